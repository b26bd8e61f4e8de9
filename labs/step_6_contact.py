# %% [markdown]
# # Step 6: contact with a ball
#
# A light ball falls on the silicone, lies in the hole of the disc, and is thrown.

# %%
import matplotlib.pyplot as plt
import numpy as np
from show import bodies, body, cost, timed

from tripod_sim import SceneError, Simulation, load_scene

simulation = Simulation(load_scene("tripod_ball"))
for axes, steps in zip(bodies(3), (0, 12, 60), strict=True):
    for _ in range(steps):
        simulation.step()
    body(simulation, f"{simulation.state.time:.2f} s", axes=axes, size=0.06)
plt.show()

# %% [markdown]
# ## The throw
#
# The strips go down in 0.4 s, wait, and jump up in 20 ms. All three servos turn alike.

# %%
TIMES, ANGLES = [0.0, 0.4, 0.8, 1.2, 1.22], [0.0, 0.0, -1.4, -1.4, -0.5]


def throw(*changes: str) -> tuple[float, np.ndarray]:
    """Return CPU seconds, and rows of time [s], height of ball and effector [mm]."""
    simulation = Simulation(load_scene("tripod_ball", ["mesh.level=1", *changes]))
    rows = []

    def run() -> None:
        while simulation.state.time < 1.8:
            angle = np.interp(simulation.state.time + simulation.scene.dt, TIMES, ANGLES)
            simulation.step(np.array([angle, angle, angle, 0.0]))
            rows.append(
                (
                    simulation.state.time,
                    1e3 * simulation.ball.position[2],
                    1e3 * simulation.effector.position[2],
                )
            )

    return timed(run)[0], np.array(rows)


_, rows = throw()
plt.figure(figsize=(6, 3))
plt.plot(rows[:, 0], rows[:, 1], label="ball")
plt.plot(rows[:, 0], rows[:, 2], label="effector")
plt.gca().set(xlabel="time [s]", ylabel="height [mm]", ylim=(-40, 70))
plt.legend()
plt.show()

# %% [markdown]
# It flies, falls back into the hole, bounces and lies.
#
# ## What does accuracy cost?
#
# Where the ball lies is easy. How high it flies is not: the jump takes 20 ms, and the fastest wave in the silicone
# is shorter still. **Question: by how much does the height change when you halve the step? When would you believe
# it?**


# %%
def fall(dt: float, scheme: str) -> tuple[str, float, float]:
    """Return a label, CPU seconds and the height of the throw [mm]."""
    seconds, rows = throw(f"dt={dt}", f"inertia.scheme={scheme}")
    return f"{1e3 * dt:g} ms", seconds, rows[rows[:, 0] > 1.2, 1].max()


points = {
    "implicit_euler": [fall(dt, "implicit_euler") for dt in (0.01, 0.005, 0.002, 0.001)],
    "tr_bdf2": [fall(dt, "tr_bdf2") for dt in (0.005, 0.002, 0.001)],
}
cost(points, "height of the throw [mm]")
plt.show()
for scheme, series in points.items():
    print(f"{scheme:15} " + ", ".join(f"{label}: {height:.0f} mm" for label, _, height in series))

# %% [markdown]
# Implicit Euler at 10 ms swallows more than two thirds of the throw: it damps the jerk. The heights of TR-BDF2 lie
# closer together, but its last digits still move, since the ball leaves at an instant. A number that changes with
# the step is not yet an answer.
#
# ## Break it
#
# Let the ball begin inside the piece, and let nothing have inertia:

# %%
for changes in (["ball.position=[0,0,0]"], ["inertia=off", "damping=off"]):
    try:
        Simulation(load_scene("tripod_ball", changes))
    except SceneError as error:
        print(error)

# %% [markdown]
# The first would push the ball out with a force of its own making. The second is refused since a ball that happens to
# lie on something has no place of its own at rest.
#
# ## Repair it
#
# Lift the ball. It may be heavy: ball and silicone are solved together in each step, so none feels the other late.

# %%
times = {}
for name, words in {
    "light ball": ["ball.position=[0,0,0.02]"],
    "20 times as heavy": ["ball.position=[0,0,0.02]", "ball.mass=0.01"],
}.items():
    simulation = Simulation(load_scene("tripod_ball", words))
    times[name], _ = timed(lambda s=simulation: [s.step() for _ in range(60)])
    print(
        f"{name:20} effector at {1e3 * simulation.effector.position[2]:6.2f} mm, {1e3 * times[name] / 60:.1f} ms a step"
    )

# %% [markdown]
# ## On your own
#
# - How high does it fly from `mesh.level=2`? From another speed of the jump?
# - `tripod run tripod_ball --view`
