# %% [markdown]
# # Step 5: the keyboard
#
# `tripod teleop` moves the servos by keys. Here the same rules run without ROS: keys change the commanded angles, and
# the robot follows.
#
# - **Objectives**: explain how key presses become motion; decide which accuracy an operator needs.
# - **Prerequisites**: [step 4](step_4_assembly.ipynb).
# - **Time**: 20 minutes.
#
# ## Equations
#
# A terminal reports key presses and repeats, but no release. A press at time t_k therefore counts for a hold time h.
# While it counts, the commanded angle q moves at the speed w:
#
#     dq/dt = ± w   while t - t_k < h,   else 0

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
    """Return times [s] and names of presses of a key that is held down: 30 repeats a second, no release."""
    return [(t, key) for t in np.arange(begin, end, 1 / 30)]


PRESSED = sorted(held("up", 0.2, 0.4) + held("right", 0.7, 0.9))


def play(*changes: str, hold: float = 0.15) -> tuple[float, np.ndarray]:
    """Play the keys for 1.2 s; return the CPU time [s] and rows of time [s], angles [rad], effector [m]."""
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
_, axes = plt.subplots(1, 2, figsize=(10, 3.4))
for k in range(3):
    axes[0].plot(rows[:, 0], np.degrees(rows[:, 1 + k]), label=f"servo {k}")
    axes[1].plot(rows[:, 0], 1e3 * rows[:, 4 + k], label="xyz"[k])
for time, _ in PRESSED:
    axes[0].axvline(time, color="0.8", linewidth=0.8)
for ax, title in zip(axes, ("angle [degrees]; grey: key presses", "effector [mm]"), strict=True):
    ax.set(xlabel="time [s]", title=title)
    ax.legend(fontsize=8)
plt.tight_layout()
plt.show()

# %% [markdown]
# The grey lines are the presses that the terminal reports. Each counts for 0.15 s (`hold`). After that the servo stops.
#
# ## What does accuracy cost?
#
# An operator sees half a millimetre. **Question: which is the longest step with an error below that, and how many times
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
# All of them are accurate enough for the eye. Take the fastest.
#
# ## Break it
#
# Let a press count for less time than passes between two repeats.

# %%
for hold in (0.15, 0.02):
    _, rows = play(hold=hold)
    plt.plot(rows[:, 0], np.degrees(rows[:, 1]), label=f"hold = {hold} s")
plt.xlim(0.15, 0.65)
plt.gca().set(xlabel="time [s]", ylabel="servo 0 [degrees]", title="The same key, held for the same time")
plt.legend()
plt.show()

# %% [markdown]
# The motion stutters: between two repeats the rule stops the servo. Now give degrees where radians are needed:

# %%
simulation = Simulation(load_scene("tripod", START))
try:
    simulation.step(np.array([-70, -85, -85, 0.035]))
except SceneError as error:
    print(error)

# %% [markdown]
# ## Repair it
#
# Make `hold` longer than the time between two repeats. Convert degrees to radians: the library uses radians everywhere.

# %%
for part in np.linspace(0, 1, 21)[1:]:
    goal = np.append(np.radians([-70, -85, -85]), 0.035)
    simulation.step(simulation.command + part * (goal - simulation.command))
body(simulation, f"effector at {(1e3 * simulation.effector.position).round(1)} mm", size=0.06)
plt.show()

# %% [markdown]
# ## Questions
#
# 1. With `hold` = 0.5 s the servo continues after the key is up. By which angle more than with 0.15 s?
# 2. Why is a long `hold` dangerous on a real robot, and a short one useless?
#
# <details><summary>Solutions</summary>
#
# <p>1. By w (0.5 s - 0.15 s) = 2 rad/s · 0.35 s = 0.7 rad = 40 degrees.</p>
#
# <p>2. With a long one the robot moves on although the operator wants it to stop. With one below the time between two
# repeats, 33 ms here, it stutters.</p>
#
# </details>
#
# In a terminal: `tripod up` starts the page, `tripod teleop` in a second terminal moves the robot.
