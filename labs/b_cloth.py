# %% [markdown]
# # The cloth
#
# A cloth of springs: first it hangs, then it falls on a ball. You see what keeps bodies out of each other, and what
# that costs.

# %%
import matplotlib.pyplot as plt
import numpy as np
from show import bodies, body, cost, sphere, timed

from tripod_sim import SceneError, Simulation, load_scene

simulation = Simulation(load_scene("cloth", ["springs.nodes=15"]))
for axes in bodies(3):
    body(simulation, f"{simulation.state.time:.1f} s", axes=axes, size=0.7)
    simulation.advance(60)
plt.show()

# %% [markdown]
# ## A ball in the way
#
# Three more tables in the scene: `[contact]`, `[[obstacles]]`, `[damping]`. Surfaces are held 2 mm apart, and
# nothing passes, however fast it is: the program looks at the whole way of each step.

# %%
BALL = 0.2  # radius of the ball [m]
OVER = ["springs.source=grid", "springs.nodes=12", "springs.size=0.5", "springs.position=[0.01,0.005,0.21]"]

simulation = Simulation(load_scene("drape", OVER))
for axes, steps in zip(bodies(3), (10, 20, 40), strict=True):
    for _ in range(steps):
        report = simulation.step()
    body(
        simulation,
        f"{simulation.state.time:.1f} s, {report.contact.pressed} contacts press",
        axes=axes,
        size=0.3,
    )
    sphere(axes, (0, 0, 0), 0.99 * BALL)
plt.show()

# %% [markdown]
# ## What does accuracy cost?
#
# Contact forces come from multipliers (`lagrange`, which hold the distance) or from springs (`penalty`, which let
# it shrink). **Question: what is wrong most here, the time step or the distance that is held?** Where the cloth is
# after 0.3 s is compared with 0.25 mm and 2 ms.


# %%
def drape(dt: float, distance: float, response: str = "lagrange") -> tuple[float, np.ndarray]:
    """Return CPU seconds and where the nodes are after 0.3 s."""
    words = [f"dt={dt}", f"contact.response={response}", f"contact.contact_distance={distance}"]
    simulation = Simulation(load_scene("drape", [*OVER, *words]))

    def run() -> np.ndarray:
        for _ in range(round(0.3 / dt)):
            simulation.step()
        return simulation.positions

    return timed(run)


_, truth = drape(0.002, 0.00025)
points = {}
for name, response, distance in (
    ("springs, 2 mm", "penalty", 0.002),
    ("multipliers, 2 mm", "lagrange", 0.002),
    ("multipliers, 0.5 mm", "lagrange", 0.0005),
):
    points[name] = []
    for dt in (0.02, 0.01, 0.005):
        seconds, x = drape(dt, distance, response)
        error = 1e3 * np.sqrt(((x - truth) ** 2).sum(axis=1).mean())
        points[name].append((f"{1e3 * dt:g} ms", seconds, error))
        print(f"{name:20} {1e3 * dt:2g} ms {seconds:6.2f} s {error:6.2f} mm")
cost(points, "mean error after 0.3 s [mm]")
plt.show()

# %% [markdown]
# Shorter steps help at once; the smaller distance pays only beside short steps. Find what is wrong most before you
# pay.
#
# ## Break it
#
# Let the cloth begin where the ball is.

# %%
inside = "springs.position=[0.01,0.005,0.15]"
try:
    Simulation(load_scene("drape", [*OVER, inside]))
except SceneError as error:
    print(error)

# %% [markdown]
# A program that went on here would throw the cloth away with a force of its own making. This one refuses, and says
# what to do.
#
# ## Repair it

# %%
simulation = Simulation(load_scene("drape", [*OVER, inside, "contact.start=lift"]))
axes = body(simulation, "lifted until nothing passes through anything", size=0.3)
sphere(axes, (0, 0, 0), 0.99 * BALL)
plt.show()
nearest = np.linalg.norm(simulation.positions, axis=1).min()
print(f"the nearest node is {1e3 * (nearest - BALL):.1f} mm above the ball")

# %% [markdown]
# ## On your own
#
# - Edges in place of a ball: `obstacles.0.source=cube.obj`.
# - `contact.friction=0`: how long does the cloth stay?
# - `tripod run drape --view` shows the cloth until it rests.
