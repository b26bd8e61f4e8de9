# %% [markdown]
# # Step 1: the free piece
#
# A piece of silicone has a mesh, a material, gravity and inertia. Nothing holds it, so it falls.

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
# A mesh is nodes and elements; the simulator moves the nodes. `mesh.level` says how many there are. Let it fall:

# %%
simulation = Simulation(load_scene("silicone_free"))
rows = []
for _ in range(40):
    simulation.step()
    rows.append((simulation.state.time, 1e3 * simulation.positions[:, 2].mean()))
t, z = np.array(rows).T
plt.figure(figsize=(5, 3))
plt.plot(t, z, "o", markersize=3, label="simulated")
plt.plot(t, -1e3 * 9.81 / 2 * t**2, label="-g t² / 2")
plt.gca().set(xlabel="time [s]", ylabel="height [mm]")
plt.legend()
plt.show()
print(f"strain energy: {simulation.energies().strain:.1e} J: it falls undeformed")

# %% [markdown]
# The points are a little below the line. That is the error of the time steps: implicit Euler runs ahead by g t dt /
# 2.
#
# ## What does accuracy cost?
#
# **Question: to be within 1 mm after 0.2 s, what is cheaper: a shorter step or another scheme?** Guess, then run.


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
print(f"within 1 mm in the least time: {cheapest[1]}")

# %% [markdown]
# ## Break it
#
# Bring your own mesh: two bricks in a VTK file, in millimetres. In the second one two corners are swapped.

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
# Elements are counted from 0, so it is the second. An element that is turned inside out has a negative volume, and
# no force would be right.
#
# ## Repair it

# %%
simulation = bricks(FILE.replace("8 1 5 2 4", "8 1 2 5 4"))
body(simulation, "two bricks")
plt.show()
print(f"{len(simulation.mesh.elements)} elements, {1e3 * np.ptp(simulation.mesh.nodes, axis=0)} mm")

# %% [markdown]
# ## On your own
#
# - On the moon: `gravity.acceleration=[0,0,-1.62]`.
# - Leave `mesh.scale` away. Who notices that the bricks are 20 m long? (Nobody: look at your units.)
# - `tripod run silicone_free --view`
