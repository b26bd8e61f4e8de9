# %% [markdown]
# # Step 1: the free piece
#
# A piece of silicone has a mesh, a material, gravity and inertia. Nothing holds it, so it falls.
#
# - **Objectives**: explain what a mesh is; predict the error of implicit Euler by hand; read a mesh error message.
# - **Prerequisites**: [lab A](a_pendulum.ipynb).
# - **Time**: 20 minutes.
#
# ## Equations
#
# The mesh has nodes with positions x and masses M. Its elements resist deformation with elastic forces:
#
#     M dv/dt = f(x) + M g,   dx/dt = v,   f(x) = -dU/dx   with the strain energy U(x)
#
# In free fall U stays zero. Implicit Euler adds g dt to the velocity and then moves by the new velocity. After n steps
# the piece has fallen by
#
#     g dt² (1 + 2 + ... + n) = g dt² n (n + 1) / 2 = g t² / 2 + g t dt / 2   with t = n dt

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
from show import bodies, body, cost, timed

from tripod_sim import SceneError, Simulation, load_scene

for axes, level in zip(bodies(3), (1, 2, 4), strict=True):
    simulation = Simulation(load_scene("silicone_free", [f"mesh.level={level}"]))
    body(simulation, f"level {level}: {len(simulation.mesh.elements)} elements", axes=axes, size=0.06)
plt.show()

# %% [markdown]
# The simulator moves the nodes. `mesh.level` sets how many there are. The piece is drawn where it starts, so its
# displacement is zero. Let it fall:

# %%
simulation = Simulation(load_scene("silicone_free"))
rows = []
for _ in range(40):
    simulation.step()
    rows.append((simulation.state.time, 1e3 * simulation.positions[:, 2].mean()))
t, z = np.array(rows).T
plt.figure(figsize=(5, 3))
plt.plot(t, z, "o", markersize=3, label="simulated")
plt.plot(t, -1e3 * 9.81 / 2 * t**2, label="-g t² / 2 (exact)")
plt.gca().set(xlabel="time [s]", ylabel="height [mm]")
plt.legend()
plt.show()
print(f"strain energy: {simulation.energies().strain:.1e} J: it falls undeformed")

# %% [markdown]
# The points lie a little below the line. This is the error of the time steps: g t dt / 2, as computed above.
#
# ## What does accuracy cost?
#
# **Question: for an error below 1 mm after 0.2 s, what is cheaper: a shorter step or another scheme?** Guess, then run.


# %%
def fall(scheme: str, dt: float) -> tuple[float, float]:
    """Return CPU seconds and the error of the height after 0.2 s [mm]."""
    simulation = Simulation(load_scene("silicone_free", [f"dt={dt}", f"inertia.scheme={scheme}"]))
    start = simulation.positions[:, 2].mean()
    seconds, _ = timed(lambda: [simulation.step() for _ in range(round(0.2 / dt))])
    return seconds, 1e3 * abs(simulation.positions[:, 2].mean() - start + 9.81 / 2 * 0.2**2)


points, cheapest = {}, (np.inf, "nothing")
for scheme in ("implicit_euler", "bdf2", "tr_bdf2"):
    points[scheme] = []
    for dt in (0.01, 0.005, 0.002, 0.0005):
        seconds, error = fall(scheme, dt)
        points[scheme].append((f"{1e3 * dt:g} ms", seconds, error))
        if error < 1:
            cheapest = min(cheapest, (seconds, f"{scheme}, dt = {1e3 * dt:g} ms"))
cost(points, "error after 0.2 s [mm]")
plt.show()
print(f"below 1 mm in the least time: {cheapest[1]}")

# %% [markdown]
# ## Break it
#
# Read your own mesh: two bricks in a VTK file, in millimetres. In the second brick two nodes are swapped.

# %%
FILE = """# vtk DataFile Version 3.0
two bricks
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 12 double
0 0 0  10 0 0  20 0 0  0 10 0  10 10 0  20 10 0
0 0 10 10 0 10 20 0 10 0 10 10 10 10 10 20 10 10
CELLS 2 18
8 0 1 4 3 6 7 10 9
8 1 5 2 4 7 8 11 10
CELL_TYPES 2
12 12
"""


def bricks(text: str) -> Simulation:
    """Return the simulation of a mesh file with this text."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "bricks.vtk"
        path.write_text(text)
        return Simulation(load_scene("silicone_free", [f"mesh.source={path}", "mesh.scale=0.001"]))


try:
    bricks(FILE)
except SceneError as error:
    print(str(error).partition(": ")[2])

# %% [markdown]
# Elements are counted from 0, so the second brick is wrong. An inverted element has a negative volume, and all its
# forces would be wrong.
#
# ## Repair it

# %%
simulation = bricks(FILE.replace("8 1 5 2 4", "8 1 2 5 4"))
body(simulation, "two bricks")
plt.show()
print(f"{len(simulation.mesh.elements)} elements, {1e3 * np.ptp(simulation.mesh.nodes, axis=0)} mm")

# %% [markdown]
# ## Questions
#
# 1. How long does the piece take to fall 196 mm on the Moon (`gravity.acceleration=[0,0,-1.62]`)? On Earth it takes 0.2
#    s.
# 2. You forget `mesh.scale`. How large are the bricks, and does a message tell you?
# 3. Which step does implicit Euler need for an error of 1 mm after 0.2 s?
#
# <details><summary>Solutions</summary>
#
# <p>1. t = √(2 h / g), so √(9.81 / 1.62) = 2.46 times as long: 0.49 s.</p>
#
# <p>2. They are 20 m long, and no message tells you: a body of 20 m is a valid body. Print
# <code>simulation.mesh.nodes</code> after reading a file.</p>
#
# <p>3. g t dt / 2 = 1 mm gives dt = 2 · 0.001 / (9.81 · 0.2) = 1.0 ms.</p>
#
# </details>
#
# In a terminal: `tripod run silicone_free --view`.
