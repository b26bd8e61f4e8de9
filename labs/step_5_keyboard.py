# %% [markdown]
# # Step 5: the keyboard
#
# `tripod teleop` moves the servos by keys. Here the same rules run without ROS: keys make set-points, set-points
# move the robot.

# %%
import matplotlib.pyplot as plt
import numpy as np
from show import body, cost, timed

from tripod_graph.command import CommandLimits
from tripod_sim import SceneError, Simulation, load_scene
from tripod_teleop.drive import Drive
from tripod_teleop.keys import KEYS

WORKING = [-1.4965, -1.4965, -1.4965, 0.035]
START = ["servos.angles=[-1.4965,-1.4965,-1.4965]", "servos.slide=0.035"]


def held(key: str, begin: float, end: float) -> list[tuple[float, str]]:
    """Return what a terminal tells of a key held down: one press, then repeats 30 times a second. No release."""
    return [(t, key) for t in np.arange(begin, end, 1 / 30)]


PRESSED = sorted(held("up", 0.2, 0.4) + held("right", 0.7, 0.9))


def play(*changes: str, hold: float = 0.15) -> tuple[float, np.ndarray]:
    """Play the keys for 1.2 s; return CPU seconds, and rows of time, angles [rad], effector [m]."""
    simulation = Simulation(load_scene("tripod", [*START, *changes]))
    drive = Drive(CommandLimits(), speed=2.0, hold=hold, pose_time=1.0)
    drive.start(WORKING)
    todo, rows = list(PRESSED), []

    def run() -> None:
        for k in range(round(1.2 / simulation.scene.dt)):
            now = (k + 1) * simulation.scene.dt
            while todo and todo[0][0] <= now:
                time, key = todo.pop(0)
                drive.press(KEYS[key], time)
            simulation.step(drive.setpoint(now))
            rows.append((now, *simulation.command[:3], *simulation.effector.position))

    return timed(run)[0], np.array(rows)


_, rows = play()
_, axes = plt.subplots(1, 2, figsize=(9, 2.8))
for k in range(3):
    axes[0].plot(rows[:, 0], np.degrees(rows[:, 1 + k]), label=f"servo {k}")
    axes[1].plot(rows[:, 0], 1e3 * rows[:, 4 + k], label="xyz"[k])
for time, _ in PRESSED:
    axes[0].axvline(time, color="0.8", linewidth=0.8)
for ax, title in zip(axes, ("angles [degrees]; grey: a press", "effector [mm]"), strict=True):
    ax.set(xlabel="time [s]", title=title)
    ax.legend(fontsize=8)
plt.tight_layout()
plt.show()

# %% [markdown]
# A terminal reports no release of a key. So a press counts for 0.15 s (`hold`), and silence means stop.
#
# ## What does accuracy cost?
#
# A person sees half a millimetre. **Question: which is the longest step that is right to that, and how many times
# faster than real time is it?**

# %%
_, truth = play("dt=0.0005", "inertia.scheme=tr_bdf2", "solver.mode=newton")
truth = truth[19::20]
points = {}
for scheme in ("implicit_euler", "tr_bdf2"):
    points[scheme] = []
    for dt in (0.01, 0.005, 0.002, 0.001):
        seconds, rows = play(f"dt={dt}", f"inertia.scheme={scheme}")
        every = round(0.01 / dt)
        error = 1e3 * np.linalg.norm(rows[every - 1 :: every, 4:] - truth[:, 4:], axis=1).max()
        points[scheme].append((f"{1e3 * dt:g} ms", seconds, error))
        print(f"{scheme:15} {1e3 * dt:2g} ms: {error:.3f} mm, {1.2 / seconds:.0f} times real time")
cost(points, "largest error of the effector [mm]")
plt.show()

# %% [markdown]
# All of them are right enough for the eye. Accuracy that nobody needs is not worth its time.
#
# ## Break it
#
# Let a press count for less time than passes between two repeats.

# %%
for hold in (0.15, 0.02):
    _, rows = play(hold=hold)
    plt.plot(rows[:, 0], np.degrees(rows[:, 1]), label=f"hold = {hold} s")
plt.xlim(0.15, 0.65)
plt.gca().set(xlabel="time [s]", ylabel="servo 0 [degrees]", title="The same key, held equally long")
plt.legend()
plt.show()

# %% [markdown]
# It stutters: between two repeats the rule says stop. And type degrees where radians are asked for:

# %%
simulation = Simulation(load_scene("tripod", START))
try:
    simulation.step(np.array([-70, -85, -85, 0.035]))
except SceneError as error:
    print(error)

# %% [markdown]
# ## Repair it
#
# `hold` must be longer than the pause of the terminal; angles are radians everywhere inside.

# %%
for part in np.linspace(0, 1, 21)[1:]:
    goal = np.append(np.radians([-70, -85, -85]), 0.035)
    simulation.step(simulation.command + part * (goal - simulation.command))
body(simulation, f"effector at {1e3 * simulation.effector.position.round(4)} mm", size=0.06)
plt.show()

# %% [markdown]
# ## On your own
#
# - With a long `hold` the servo runs on after the key is up. How far, with 0.5 s?
# - With the page: `tripod up`, then `tripod teleop` in a second terminal.
