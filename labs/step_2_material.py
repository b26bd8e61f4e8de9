# %% [markdown]
# # Step 2: an elastic material
#
# How stiff is silicone, and how stiff does a mesh make it? The piece is held at one end and hangs at rest.

# %%
import matplotlib.pyplot as plt
from show import bodies, body, cost, timed

from tripod_sim import SceneError, Simulation, load_scene

STATIC = ["inertia=off", "damping=off"]  # without inertia each step is a state of rest


def hang(*changes: str) -> Simulation:
    """Return the piece at rest."""
    simulation = Simulation(load_scene("silicone", [*STATIC, *changes]))
    simulation.step()
    return simulation


for axes, young in zip(bodies(3), (100e3, 250e3, 1e6), strict=True):
    body(hang(f"material.young={young}"), f"E = {young / 1e3:g} kPa", axes=axes, size=0.06)
plt.show()

# %% [markdown]
# Four laws say how stress follows from strain. For small strains they agree. Here the strip bends far, but
# stretches little:

# %%
for law in ("neo_hooke", "stable_neo_hooke", "corotational", "st_venant_kirchhoff"):
    print(f"{law:20} lowest point {1e3 * hang(f'material.law={law}').positions[:, 2].min():7.2f} mm")

# %% [markdown]
# ## What does accuracy cost?
#
# A mesh is stiffer or softer than the silicone. Elements differ: `t4` are linear tetrahedra, `h8_modes` bricks that
# can bend, `h20` quadratic bricks. **Question: how many percent are linear tetrahedra off, and can a finer mesh of
# them repair it?**


# %%
def sag(element: str, level: int) -> tuple[float, float]:
    """Return CPU seconds and how far the piece sags [mm]."""
    simulation = Simulation(
        load_scene("silicone", [*STATIC, f"mesh.element={element}", f"mesh.level={level}"])
    )
    seconds, _ = timed(simulation.step)
    return seconds, -1e3 * simulation.positions[:, 2].min()


_, truth = sag("h20", 4)
points = {}
for element, levels in {"t4": (1, 2, 5, 6, 7), "h8_modes": (1, 2, 3, 4), "h20": (1, 2)}.items():
    points[element] = []
    for level in levels:
        seconds, found = sag(element, level)
        points[element].append((f"level {level}", seconds, 100 * abs(found / truth - 1)))
        print(f"{element:9} level {level}: {found:6.2f} mm, {100 * (found / truth - 1):+6.1f} %")
cost(points, "error of the sag [%]")
plt.show()

# %% [markdown]
# One layer of linear tetrahedra cannot bend: it locks. More of them help slowly. Another element helps at once, in
# less time than the finest tetrahedra take.
#
# ## Break it
#
# Silicone hardly changes its volume: Poisson's ratio is near 0.5. Ask for 0.5 itself.

# %%
try:
    hang("material.poisson=0.5")
except SceneError as error:
    print(error)

# %% [markdown]
# At 0.5 the stiffness against a change of volume is infinite. So take 0.499, and tetrahedra:

# %%
for axes, element in zip(bodies(2), ("t4", "h8_modes"), strict=True):
    simulation = hang("material.poisson=0.499", f"mesh.element={element}", "mesh.level=3")
    down = -1e3 * simulation.positions[:, 2].min()
    body(simulation, f"{element}: sags by {down:.0f} mm", axes=axes, size=0.06)
plt.show()

# %% [markdown]
# Nothing was refused on the left, and everything is wrong: every tetrahedron wants to keep its own volume, so none
# can bend.
#
# ## Repair it
#
# Take an element that can do it. Bricks with extra modes, with a mean volume, or quadratic ones all do.

# %%
for element in ("t4", "h8_modes", "h8_mean", "h20"):
    low, high = (
        -1e3 * hang(f"material.poisson={nu}", f"mesh.element={element}", "mesh.level=2").positions[:, 2].min()
        for nu in (0.45, 0.499)
    )
    print(f"{element:9} sags by {low:6.2f} mm with 0.45, {high:6.2f} mm with 0.499")

# %% [markdown]
# ## On your own
#
# - Which `material.young` halves the sag? (More than twice 250 kPa: the strip hangs almost straight down.)
# - Write `material.yung=1e6`. What does the program say?
# - `tripod study silicone --quick` measures more settings on your machine.
