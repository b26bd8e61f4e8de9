"""A clamped bar as a user's own mesh, and what beam theory says of it."""

import math
from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np

from benchmarks.blocks import brick
from tripod_sim import Simulation, load_scene

LENGTH, HEIGHT = 0.1, 0.01
"""Of the bar along x, of square section [m]."""

YOUNG, POISSON, MASS, GRAVITY = 1e7, 0.0, 0.01, 9.81
"""Of the bar [Pa, -, kg], and its weight's acceleration [m/s²]: it sags by 1.5 % of its length. With nu = 0 its clamp
holds no widening."""

TEMPLATE = """
name = "bar"
dt = 0.001
duration = 0.1

[mesh]
source = "{source}"
element = "{element}"

[material]
law = "neo_hooke"
young = {young}
poisson = {poisson}
mass = {mass}

[gravity]

[inertia]
scheme = "tr_bdf2"

[solver]
tolerance = 1e-9

[[fixed]]
low = [-1e-6, -1, -1]
high = [1e-6, 1, 1]
"""


@dataclass(frozen=True)
class Beam:
    """What Timoshenko's beam does: sag of the tip under the weight [m], period of the first mode [s]."""

    sag: float
    period: float


def beam() -> Beam:
    """Return the theory of the bar: q L⁴ / 8 E I + q L² / 2 k G A, and Euler's first mode with the same correction."""
    area, inertia, shear = HEIGHT**2, HEIGHT**4 / 12, YOUNG / (2 + 2 * POISSON)
    q = MASS * GRAVITY / LENGTH
    bending, sliding = q * LENGTH**4 / (8 * YOUNG * inertia), q * LENGTH**2 / (2 * 5 / 6 * shear * area)
    omega = 1.8751040687**2 * math.sqrt(YOUNG * inertia * LENGTH / MASS) / LENGTH**2
    return Beam(bending + sliding, 2 * math.pi / omega * math.sqrt(1 + sliding / bending))


def bar_scene(
    folder: Path, counts: tuple[int, int, int], element: str, *, tilt: float = 0.0, young: float = YOUNG
) -> Path:
    """Write a scene of the bar and its mesh of hexahedra; return the scene's file.

    Args:
        folder: For both files.
        counts: Cells along x, y and z.
        element: Name of the element.
        tilt: By which inner faces across x lean over, one to the right, the next to the left [rad].
        young: E [Pa].
    """
    across = [np.linspace(-HEIGHT / 2, HEIGHT / 2, n + 1) for n in counts[1:]]
    mesh = brick("h8", [np.linspace(0, LENGTH, counts[0] + 1), *across])
    x = np.array(mesh.nodes)
    column = np.rint(x[:, 0] / LENGTH * counts[0]).astype(int)
    inner = (column > 0) & (column < counts[0])
    x[:, 0] += inner * np.where(column % 2, 1, -1) * x[:, 2] * math.tan(tilt)
    source = folder / f"bar_{'_'.join(map(str, counts))}_{tilt:.3f}.vtu"
    meshio.write(source, meshio.Mesh(x, [("hexahedron", mesh.elements)]))
    scene = folder / f"{source.stem}_{element}.toml"
    scene.write_text(TEMPLATE.format(source=source, element=element, young=young, poisson=POISSON, mass=MASS))
    return scene


def sag(scene: Path) -> float:
    """Return by how much the tip of a bar hangs at rest [m]."""
    simulation = Simulation(load_scene(scene, ["inertia=off"]))
    tip = simulation.positions[:, 0] > LENGTH * (1 - 1e-9)
    simulation.step()
    return -float(simulation.positions[tip, 2].mean())
