# %% [markdown]
# # Step 6: contact with a ball
#
# A light ball falls on the silicone, comes to rest in the hole of the disc, and is thrown.
#
# - **Objectives**: explain contact conditions; test whether a result depends on the step.
# - **Prerequisites**: [step 4](step_4_assembly.ipynb), [lab B](b_cloth.ipynb).
# - **Time**: 20 minutes.
#
# ## Equations
#
# The ball at position b with velocity u touches the silicone at gap g = 0. The normal force λ and the friction force t
# obey
#
#     m du/dt = m g + λ n + t,   g >= 0,   λ >= 0,   λ g = 0,   |t| <= friction · λ
#
# The same force acts on the silicone, in the opposite direction. Ball and silicone are solved together in each step.

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
# The strips move down in 0.4 s, wait, and jump up in 20 ms. All three servos turn alike.

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
# The ball flies, falls back into the hole, bounces and comes to rest.
#
# ## What does accuracy cost?
#
# The resting place of the ball is easy to compute. The height of its flight is not: the jump takes 20 ms, and the waves
# in the silicone are faster still. **Question: by how much does the height change when you halve the step? When would
# you believe it?**


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
# Implicit Euler with 10 ms loses more than two thirds of the height: it damps the jump. The heights of TR-BDF2 are
# closer together but still change. A result that changes with the step is not yet an answer.
#
# ## Break it
#
# Start with the ball inside the silicone. Then remove inertia:

# %%
for changes in (["ball.position=[0,0,0]"], ["inertia=off", "damping=off"]):
    try:
        Simulation(load_scene("tripod_ball", changes))
    except SceneError as error:
        print(error)

# %% [markdown]
# In the first scene a program would have to invent a force to push the ball out. The second has no unique equilibrium:
# the ball may rest anywhere.
#
# ## Repair it
#
# Lift the ball. It may be heavy: the simultaneous solution of ball and silicone is stable for any ratio of masses.

# %%
times = {}
for name, words in {
    "light ball": ["ball.position=[0,0,0.02]"],
    "20 times as heavy": ["ball.position=[0,0,0.02]", "ball.mass=0.01"],
}.items():
    simulation = Simulation(load_scene("tripod_ball", words))
    times[name], _ = timed(lambda s=simulation: [s.step() for _ in range(60)])
    print(
        f"{name:18} effector at {1e3 * simulation.effector.position[2]:6.2f} mm, {1e3 * times[name] / 60:.1f} ms a step"
    )

# %% [markdown]
# ## Questions
#
# 1. Use a finer mesh, `mesh.level=2`. How much does the height of the throw change, compared with a smaller step?
# 2. The jump takes 60 ms in place of 20 ms. How high does the ball fly?
# 3. Which error do you reduce first, of the mesh or of the step?
#
# <details><summary>Solutions</summary>
#
# <p>1. By a few percent. With implicit Euler, a step of 2 ms in place of 5 ms nearly doubles the height.</p>
#
# <p>2. Far lower. The speed of the disc at the end of the jump decides, and a slower jump gives the ball less of
# it.</p>
#
# <p>3. Of the step, or better the scheme: use TR-BDF2.</p>
#
# </details>
#
# In a terminal: `tripod run tripod_ball --view`.
