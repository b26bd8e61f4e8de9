"""The cases of `peers.py`: what every simulator is given, what is read from it, and the reference for all.

- **cantilever rest**: a soft bar, one end held, sags by its weight; deflection of the tip.
- **cantilever swing**: the same bar, straight and at rest, is let go; height of the tip every 10 ms for 0.25 s.
- **y L1**: the silicone Y, flat, its ends held, a rigid disc in its centre; sag of the disc.
- **y L2**: its ends turned down by 45 degrees about the servo axes; height of the disc.
- **cloth**: the suite's scene `cloth`; every other node of every other row, each 50 ms for 1 s.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.blocks import brick
from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim import load_scene
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.mesh.y_piece import LEVELS, y_piece
from tripod_sim.robot.arms import servo_arms
from tripod_sim.robot.disc import effector_disc
from tripod_sim.springs.body import SpringBody
from tripod_sim.springs.net import spring_net
from tripod_sim.tables.robot import Effector, Servos

LENGTH, SIDE = 0.1, 0.02
"""Of the bar [m]."""
YOUNG, POISSON, MASS = 250e3, 0.3, 0.04
"""Of the bar [Pa, -, kg]. nu is 0.3 here and not silicone's 0.45, which locks the linear tetrahedra of most peers."""
SILICONE = (250e3, 0.45, 0.032)
"""E [Pa], nu, mass [kg] of the Y-piece."""
GRAVITY = 9.81
TURN = -np.pi / 4
"""Of the servos in L2 [rad]."""

REST = 0.6
"""What simulators without statics are given to come to rest [s]."""
BAR_DRAG, Y_DRAG = 64.0, 140.0
"""Mass damping a [1/s] on the way to rest, about critical for the lowest mode."""

SWING_TIMES = np.arange(1, 26) * 0.01
CLOTH_TIMES = np.arange(1, 21) * 0.05
SAMPLE = {"cantilever swing": 0.01, "cloth": 0.05}
"""Time between two samples [s]."""

CASES = ("cantilever rest", "cantilever swing", "y L1", "y L2", "cloth")
SIMULATED = {"cantilever rest": REST, "cantilever swing": 0.25, "y L1": REST, "y L2": REST, "cloth": 1.0}
"""Simulated time of a run [s]; our statics has none."""


@dataclass(frozen=True)
class Setting:
    """How a simulator is set for one run.

    Attributes:
        name: In words, complete: what a user would have to set.
        options: What `prepare` of the simulator's module understands.
        quick: Whether `--quick` keeps it.
    """

    name: str
    options: dict[str, Any] = field(default_factory=dict)
    quick: bool = False


@dataclass(frozen=True, eq=False)
class Prepared:
    """A model that is built and warmed up.

    Attributes:
        run: Simulates from the start and returns what the case reads [m], shape (samples, points, components).
        unknowns: Coordinates that move.
        simulated: Time that a run simulates [s]; 0 for a static solution.
    """

    run: Callable[[], FloatArray]
    unknowns: int
    simulated: float


@dataclass(frozen=True, eq=False)
class Reference:
    """What is right.

    Attributes:
        values: As a run returns them [m], shape (samples, points, components).
        scale: What errors are a share of [m].
        uncertainty: Estimated error of `values` in the same measure [%].
        source: In words.
    """

    values: FloatArray
    scale: float
    uncertainty: float
    source: str

    def error(self, values: FloatArray) -> float:
        """Return the largest over the samples of the root mean square over the points, in percent of `scale`."""
        off = np.sqrt(((values - self.values) ** 2).sum(axis=2).mean(axis=1))
        return float(100 * off.max() / self.scale) if np.isfinite(off).all() else float("nan")


def bar(element: str, cells: tuple[int, int, int]) -> SolidMesh:
    """Return the mesh of the bar: axis along x from the origin, cells along x, y, z."""
    across = [np.linspace(-SIDE / 2, SIDE / 2, n + 1) for n in cells[1:]]
    return brick(element, (np.linspace(0, LENGTH, cells[0] + 1), *across))


def bar_ends(nodes: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return the nodes of the held end, and the four corners of the other, whose mean height is read."""
    corner = (np.abs(nodes[:, 1:]) > SIDE / 2 - 1e-6).all(axis=1)
    return np.flatnonzero(nodes[:, 0] < 1e-6), np.flatnonzero((nodes[:, 0] > LENGTH - 1e-6) & corner)


@dataclass(frozen=True, eq=False)
class YMesh:
    """The Y-piece for a simulator that is given nodes and tetrahedra.

    Attributes:
        mesh: Tetrahedra.
        disc: Nodes of the rigid disc.
        arms: Of each arm: its nodes, a point of its axis [m], the axis.
        free: All other nodes.
    """

    mesh: SolidMesh
    disc: IndexArray
    arms: tuple[tuple[IndexArray, FloatArray, FloatArray], ...]
    free: IndexArray

    def turned(self, angle: float) -> list[FloatArray]:
        """Return where the nodes of each arm are at a servo angle [rad], of each shape (., 3) [m]."""
        found = []
        for nodes, point, axis in self.arms:
            r = self.mesh.nodes[nodes] - point
            along = np.outer(r @ axis, axis)
            found.append(point + along + np.cos(angle) * (r - along) + np.sin(angle) * np.cross(axis, r))
        return found


def y_mesh(level: int) -> YMesh:
    """Return the Y-piece of linear tetrahedra at a mesh level of the suite's generator."""
    mesh = convert(y_piece(LEVELS[level]), "t4")
    disc = effector_disc(mesh.nodes, Effector())
    arms = tuple((f.nodes, np.array(f.point), np.array(f.axis)) for f in servo_arms(mesh.nodes, Servos()))
    taken = np.concatenate([disc, *(nodes for nodes, _, _ in arms)])
    return YMesh(mesh, disc, arms, np.setdiff1d(np.arange(len(mesh.nodes)), taken))


def cloth() -> SpringBody:
    """Return the body of the suite's scene `cloth`."""
    scene = load_scene("cloth")
    assert scene.springs
    return spring_net(scene.springs)


def cloth_read(positions: FloatArray) -> FloatArray:
    """Return the positions that are compared, of those of all nodes, shape (n, 3) [m]: a copy."""
    n = round(len(positions) ** 0.5)
    return np.array(positions, dtype=float).reshape(n, n, 3)[::2, ::2].reshape(-1, 3)


def lame(young: float, poisson: float) -> tuple[float, float]:
    """Return lambda and mu [Pa]."""
    return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))


def height(values: float | FloatArray) -> FloatArray:
    """Return heights as a case's values, shape (samples, 1, 1)."""
    return np.reshape(np.atleast_1d(np.asarray(values, dtype=float)), (-1, 1, 1))
