"""Scenes with actuators that are no servos: a finger with a cable and a force, a beam with a chamber."""

from pathlib import Path

import meshio
import numpy as np

from tools.robot_meshes import lattice
from tripod_sim.scene.file import load_scene, scene_to_toml

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
JAW = PUSH.replace("push", "jaw").replace("-0.5, 0.5]", '-0.02, 0.02], command="displacement"')
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


DOME = """
name = "dome"
dt = 0.02
duration = 0.4
[mesh]
source = "dome.vtk"
[material]
young = 300e3
density = 1070.0
[[set]]
name = "base"
high = [1, 1, 0.004]
[[fixed]]
set = "base"
[[chamber]]
name = "air"
range = [-10e3, 10e3]
[motion]
actuate = ["air = 0: 0; 0.4: -200Pa"]
"""


def dome(folder: Path, cells: int = 8) -> str:
    """Write a box of 100 x 100 mm whose thin roof arches by 12 mm over its chamber; return the path of its scene."""
    x = np.linspace(-0.05, 0.05, cells + 1)
    i, j, k = np.meshgrid(x, x, np.arange(4), indexing="ij")
    arch = 0.012 * np.cos(np.pi * i / 0.1) * np.cos(np.pi * j / 0.1)
    points = np.stack([i, j, np.take([0.0, 0.004, 0.03, 0.032], k) + np.where(k > 1, arch, 0.0)], axis=-1)
    filled = np.ones((cells, cells, 3), bool)
    filled[1:-1, 1:-1, 1] = False
    places, bricks = lattice(points, filled)
    used, numbers = np.unique(bricks, return_inverse=True)
    meshio.Mesh(places[used], [("hexahedron", numbers.reshape(-1, 8))]).write(folder / "dome.vtk")
    path = folder / "dome.toml"
    path.write_text(DOME, encoding="utf-8")
    return str(path)


def mixed(folder: Path) -> str:
    """Write the beam that a servo turns at its root, with a cable, a chamber and a force; return the path."""
    words = [
        "fixed=off", "dt=0.02", "inertia={}", "damping.stiffness=0.01", 'effector={set="tip"}',
        'servo=[{set="root", hub=[0, 0.01, 0.0075], axis=[0, 1, 0]}]',
        "servos={count=1, axis_depth=0.02, angle_min=-0.5, angle_max=0.5}",
        BY_LENGTH, AIR, PUSH,
    ]  # fmt: skip
    path = folder / "mixed.toml"
    path.write_text(scene_to_toml(load_scene(beam(folder), words)), encoding="utf-8")
    return str(path)
