"""What fixed regions and prescribed motions hold, and which motions of a body as a whole they leave free."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tripod_host.arrays import BoolArray, FloatArray, IndexArray
from tripod_sim.constraints.groups import DrivenFrame, Groups
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import names_of
from tripod_sim.mesh.topology import parts

if TYPE_CHECKING:
    from tripod_sim.constraints.prescribed import Prescribed

AXES = "xyz"

LOOSE = 1e-12
"""Square of how firmly a motion as a whole is held, as a share of the firmest, below which it is free."""


class Holding(NamedTuple):
    """Nodes that something holds.

    Attributes:
        name: Of what does, for messages.
        nodes: Shape (k,).
        axes: Some of `xyz`.
    """

    name: str
    nodes: IndexArray
    axes: str = AXES


def held_groups(
    shape: tuple[int, int],
    rigid: Sequence[Holding],
    driven: tuple[DrivenFrame, ...],
    fixed: Sequence[Holding],
    moved: Sequence[Holding],
    prescribed: "Prescribed | None",
) -> Groups:
    """Return all groups of the bodies.

    Args:
        shape: Of the positions of their nodes.
        rigid: The nodes of each rigid body.
        driven: The arms of servos.
        fixed, moved: What is fixed, and what moves along timelines.
        prescribed: These timelines; None without any.

    Raises:
        SceneError: two of what holds nodes hold one along the same axis, or all are held.
    """
    owner, names = np.full(shape, -1), []
    groups = [*rigid, *(Holding(f"servo_{i}", frame.nodes) for i, frame in enumerate(driven))]
    for name, held, axes in (*groups, *fixed, *moved):
        names.append(name)
        for axis in map(AXES.index, axes):
            before = owner[held, axis]
            last = len(groups) if name.startswith("fixed") else len(names)  # what is fixed twice is fixed
            both = np.flatnonzero((before >= 0) & (before < last))
            if both.size:
                raise SceneError(
                    f"{name} and {names[before[both][0]]} both hold nodes {names_of(held[both])} along {AXES[axis]}; "
                    "leave them out of one of the two"
                )
            owner[held, axis] = len(names) - 1
    if owner.size and (owner >= 0).all():
        raise SceneError(f"{', '.join(names)} hold every node, so nothing can deform; hold fewer nodes")
    own = owner >= len(groups)
    whole = np.flatnonzero(own.all(axis=1))
    single = own.copy()
    single[whole] = False
    bodies = tuple(body.nodes for body in rigid)
    return Groups(shape[0], bodies, driven, whole, np.argwhere(single), prescribed)


def free_motion(joined: Sequence[IndexArray], nodes: FloatArray, held: BoolArray) -> str:
    """Return in words how a part of a body can move as a whole; empty if no part can.

    Args:
        joined: Nodes that belong together: of elements, shape (m, k), and of each rigid body, shape (k,).
        nodes: Undeformed [m], shape (n, 3).
        held: Which nodes are held along which axes, shape (n, 3).
    """
    label = parts([np.atleast_2d(rows) for rows in joined], len(nodes))
    size = float(np.ptp(nodes, axis=0).max())
    for part in np.unique(label):
        mine = label == part
        centre = nodes[mine].mean(axis=0)
        node, axis = np.nonzero(held & mine[:, None])
        ways = np.eye(3)[axis]  # rows: what a displacement and a small rotation move there along the axis
        turns = np.cross((nodes[node] - centre) / size, ways)
        rows = np.hstack([ways, turns])
        values, vectors = np.linalg.eigh(rows.T @ rows)
        if values[0] > LOOSE * max(values[-1], 1.0):
            continue
        move, turn = vectors[:3, 0], vectors[3:, 0] / size
        where = names_of(np.flatnonzero(mine), 4)
        if np.linalg.norm(turn) * size < 1e-6:
            return f"the part with nodes {where} can move along {_text(move)}"
        about = centre + np.cross(turn, move) / (turn @ turn)
        return f"the part with nodes {where} can turn about {_text(turn)} through {_text(about, 1.0)} m"
    return ""


def _text(vector: FloatArray, size: float = 0.0) -> str:
    """Return a vector for a message, divided by its length or by `size`."""
    scaled = vector / (size or np.linalg.norm(vector))
    return f"({', '.join(f'{c:.3g}' for c in np.where(np.abs(scaled) < 1e-9, 0.0, scaled))})"
