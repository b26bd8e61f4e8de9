"""A mesh of your own: write a file, name it in a scene, let it move.

    python examples/own_mesh.py            # writes finger.vtk and finger.toml beside you, and runs them
    tripod run finger.toml --view          # shows it

Any file of tetrahedra or hexahedra that gmsh, VTK, Abaqus or GiD write will do in place of finger.vtk: the scene names
no element, so the cells decide it (docs/file_formats.md).
"""

import sys
from pathlib import Path

import numpy as np

from tripod_study.run import run

LENGTH, WIDTH, HEIGHT = 0.080, 0.020, 0.012  # [m]
CELLS = (16, 4, 3)
YOUNG, DENSITY = 1e6, 1070.0  # [Pa], [kg/m³]

SCENE = f"""name = "finger"
description = "A silicone finger, its root held, bends under its weight"
dt = 0.005
duration = 1.5

[mesh]
source = "finger.vtk"

[material]
young = {YOUNG}
poisson = 0.3
mass = {LENGTH * WIDTH * HEIGHT * DENSITY:.5f}

[gravity]

[inertia]

[damping]
stiffness = 0.01

[[fixed]]
low = [-0.001, -1, -1]
high = [0.001, 1, 1]
"""


def write_mesh(path: Path) -> None:
    """Write a block of bricks as an ASCII file of VTK: points, then the eight corners of each brick."""
    i, j, k = np.meshgrid(*(np.arange(n + 1) for n in CELLS), indexing="ij")
    points = np.stack([i, j, k], axis=-1) / CELLS * (LENGTH, WIDTH, HEIGHT) - (0, WIDTH / 2, HEIGHT / 2)
    node = np.arange(i.size).reshape(i.shape)
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    nx, ny, nz = CELLS
    bricks = np.stack([node[a : a + nx, b : b + ny, c : c + nz].ravel() for a, b, c in corners], axis=1)
    lines = ["# vtk DataFile Version 3.0", "finger", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines += [f"POINTS {i.size} double", *(" ".join(map(str, p)) for p in points.reshape(-1, 3).tolist())]
    lines += [
        f"CELLS {len(bricks)} {9 * len(bricks)}",
        *(" ".join(map(str, (8, *b))) for b in bricks.tolist()),
    ]
    lines += [f"CELL_TYPES {len(bricks)}", *["12"] * len(bricks)]  # 12: a hexahedron
    path.write_text("\n".join(lines) + "\n")


def main() -> None:
    """Write both files, run the scene, and compare how far the tip sinks with the theory of beams."""
    write_mesh(Path("finger.vtk"))
    Path("finger.toml").write_text(SCENE)
    run("finger.toml", out=Path("finger.npz"))

    recorded = np.load("finger.npz")["positions"]  # (steps, nodes, 3)
    tip = np.isclose(recorded[0, :, 0], LENGTH, atol=1e-3)
    sag = -recorded[-1, tip, 2].mean()
    load = DENSITY * 9.81 * WIDTH * HEIGHT  # [N/m]
    beam = load * LENGTH**4 / (8 * YOUNG * WIDTH * HEIGHT**3 / 12)
    print(f"the tip sinks by {1e3 * sag:.2f} mm; a slender beam would by {1e3 * beam:.2f} mm")
    if abs(sag / beam - 1) > 0.05:
        sys.exit("that is more than 5 % apart")


if __name__ == "__main__":
    main()
