"""Scenes with actuators that are no servos: a finger with a cable and a force, a beam with a chamber."""

from pathlib import Path

import meshio
import numpy as np

LENGTH, WIDTH, THICK = 0.1, 0.02, 0.015
"""Of the finger and the beam [m]: from the root at x = 0 along x, from y = 0 and z = 0."""

COMMON = """
dt = 0.005
duration = 0.5
[material]
young = 300e3
poisson = 0.45
density = 1070.0
[[set]]
name = "root"
high = [0, 1, 1]
[[set]]
name = "tip"
low = [0.1, -1, -1]
[[fixed]]
set = "root"
[[marker]]
set = "tip"
"""

FINGER = f"""
name = "finger"
{COMMON}
[mesh]
source = "block"
element = "h20"
cells = [8, 2, 2]
corners = [[0, 0, 0], [0.1, 0, 0], [0.1, 0.02, 0], [0, 0.02, 0],
           [0, 0, 0.015], [0.1, 0, 0.015], [0.1, 0.02, 0.015], [0, 0.02, 0.015]]
"""

VIA = (
    '[{body="world", points=[[-0.01, 0.01, 0.003]]}, '
    "{points=[[0.0, 0.01, 0.003], [0.03, 0.01, 0.003], [0.06, 0.01, 0.003], [0.099, 0.01, 0.003]]}]"
)
"""Way of a cable along the finger below its middle."""

BY_LENGTH = f'cable=[{{name="tendon", via={VIA}, range=[0.0, 0.03]}}]'
BY_TENSION = f'cable=[{{name="tendon", via={VIA}, command="tension", range=[0.0, 20.0]}}]'
PUSH = 'force=[{name="push", set="tip", direction=[0, 0, 2.0], range=[-0.5, 0.5]}]'
AIR = 'chamber=[{name="air", range=[0.0, 30e3]}]'


def finger(folder: Path) -> str:
    """Write the finger, without actuators; return the path of its scene."""
    path = folder / "finger.toml"
    path.write_text(FINGER, encoding="utf-8")
    return str(path)


def hollow_block(path: Path, cells: tuple[int, int, int] = (10, 4, 4)) -> None:
    """Write a beam of bricks with a closed cavity above its middle."""
    size = np.array([LENGTH, WIDTH, THICK])
    i, j, k = np.meshgrid(*(np.arange(n + 1) for n in cells), indexing="ij")
    points, node = (
        np.stack([i, j, k], axis=-1).reshape(-1, 3) / cells * size,
        np.arange(i.size).reshape(i.shape),
    )
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    x, y, z = cells
    bricks = np.stack([node[a : a + x, b : b + y, c : c + z].ravel() for a, b, c in corners], axis=1)
    place = np.indices(cells).reshape(3, -1).T
    hole = ((place > 0) & (place < np.array(cells) - 1)).all(axis=1) & (place[:, 2] > 1)
    used, numbers = np.unique(bricks[~hole], return_inverse=True)
    meshio.Mesh(points[used], [("hexahedron", numbers.reshape(-1, 8))]).write(path)


def beam(folder: Path) -> str:
    """Write the hollow beam, without its chamber; return the path of its scene."""
    hollow_block(folder / "hollow.vtk")
    path = folder / "beam.toml"
    path.write_text(f'name = "beam"\n{COMMON}\n[mesh]\nsource = "hollow.vtk"\n', encoding="utf-8")
    return str(path)
