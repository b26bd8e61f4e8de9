# %% [markdown]
# # Step 2: an elastic material
#
# How stiff is silicone, and how stiff does a mesh make it? The piece is held at one end and hangs at rest.
#
# - **Objectives**: compare material laws; recognise locking; choose an element.
# - **Prerequisites**: [step 1](step_1_free_piece.ipynb); stress, strain, Young's modulus.
# - **Time**: 20 minutes.
#
# ## Equations
#
# At rest the elastic forces balance the weight: f(x) + M g = 0, with the strain energy U as the integral of a density W
# over the body. The neo-Hookean law, for rubber, with the deformation gradient F = dx/dX and J = det F, is
#
#     W = mu/2 (J^(-2/3) |F|² - 3) + K/2 (J - 1)²
#     mu = E / (2 (1 + nu)),   K = E / (3 (1 - 2 nu))
#
# E is Young's modulus (here 250 kPa), nu is Poisson's ratio. For nu = 0.5 the bulk modulus K is infinite: the volume
# cannot change.

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
# Four laws relate stress and strain. They agree for small strains. Here the strip rotates far but stretches little:

# %%
for law in ("neo_hooke", "stable_neo_hooke", "corotational", "st_venant_kirchhoff"):
    print(f"{law:20} lowest point at {1e3 * hang(f'material.law={law}').positions[:, 2].min():7.2f} mm")

# %% [markdown]
# ## What does accuracy cost?
#
# A mesh makes the piece stiffer or softer than the silicone is. Elements differ: `t4` are linear tetrahedra, `h8_modes`
# are bricks that can bend, `h20` are quadratic bricks. `mesh.level` is the number of a prepared mesh of the piece.
# Levels 1 to 4 have one layer of elements through the thickness, and more and more elements along and across the
# strips. Levels 5 and 6 have two layers, level 7 has three. The errors refer to `h20` on level 4. **Question: how large
# is the error of linear tetrahedra in percent, and can a finer mesh of them repair it?**


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
# One layer of linear tetrahedra cannot bend. This is called locking. More layers help slowly. Another element helps at
# once, in less time than the finest tetrahedra take.
#
# With `h8_modes` the error grows on finer meshes. Two errors cancel on level 1: short of elements along the strip a
# mesh is too stiff, and one layer is a little too soft. The second remains on level 4. Besides, the reference itself is
# about 0.2 % too stiff: with all its edges halved (`mesh.refine=1`) it sags by 75.18 mm in place of 75.01 mm. So
# differences of 0.2 % say nothing here.
#
# ## Break it
#
# Silicone hardly changes its volume: Poisson's ratio is close to 0.5. Try 0.5 itself.

# %%
try:
    hang("material.poisson=0.5")
except SceneError as error:
    print(error)

# %% [markdown]
# At 0.5 the stiffness against a change of volume is infinite. Take 0.499, with tetrahedra and with bricks:

# %%
for axes, element in zip(bodies(2), ("t4", "h8_modes"), strict=True):
    simulation = hang("material.poisson=0.499", f"mesh.element={element}", "mesh.level=3")
    down = -1e3 * simulation.positions[:, 2].min()
    body(simulation, f"{element}: sags by {down:.0f} mm", axes=axes, size=0.06)
plt.show()

# %% [markdown]
# The left result is wrong, and no message says so. Each tetrahedron keeps its own volume, so none can bend.
#
# ## Repair it
#
# Choose an element that can bend at constant volume: bricks with extra modes, with a mean volume, or quadratic ones.

# %%
for element in ("t4", "h8_modes", "h8_mean", "h20"):
    low, high = (
        -1e3 * hang(f"material.poisson={nu}", f"mesh.element={element}", "mesh.level=2").positions[:, 2].min()
        for nu in (0.45, 0.499)
    )
    print(f"{element:9} sags by {low:6.2f} mm with 0.45, {high:6.2f} mm with 0.499")

# %% [markdown]
# ## Questions
#
# 1. Which Young's modulus halves the sag of 75 mm? Guess, then try values for `material.young`.
# 2. Write `material.yung=1e6`. What does the program answer?
# 3. Why do the four laws give almost the same shape here?
#
# <details><summary>Solutions</summary>
#
# <p>1. About 1.8 MPa, seven times as stiff: 1.5 MPa gives 43 mm, 2 MPa gives 35 mm. The soft strip hangs almost
# straight down, so at first more stiffness changes little.</p>
#
# <p>2. It names the unknown field, lists the fields of the table, and asks whether you mean <code>young</code>.</p>
#
# <p>3. The strip is thin. It bends with large rotations but small strains, and all four laws agree for small strains
# and are exact for rotations.</p>
#
# </details>
#
# In a terminal: `tripod run silicone --view`; `tripod study silicone --quick` measures more settings on your machine.
