"""Node groups that constraints tie together exactly: no springs, no multipliers, fewer unknowns.

A node is free, belongs to a rigid body (six unknowns), to a driven frame (moved by the caller; its angle is the only
coordinate that matters for torque and compliance), or is fixed; a free one may be held along some axes. What is held
may move as time says (`prescribed`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import names_of

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.constraints.prescribed import Prescribed


class Kind(IntEnum):
    """What a node is tied to."""

    FREE = 0
    RIGID = 1
    DRIVEN = 2
    FIXED = 3


class RigidMotion(NamedTuple):
    """Poses and velocities of b rigid bodies.

    Attributes:
        centres: Of mass, in world [m], shape (b, 3).
        rotations: From each body's frame to world, shape (b, 3, 3).
        velocities: Of the centres [m/s], shape (b, 3).
        spins: Angular velocities in world [rad/s], shape (b, 3).
    """

    centres: FloatArray
    rotations: FloatArray
    velocities: FloatArray
    spins: FloatArray


@dataclass(frozen=True, eq=False)
class DrivenFrame:
    """Nodes held by a servo arm, which turns about a horizontal axis and slides with the servo body.

    Attributes:
        nodes: Node indices.
        axis: Unit vector of the axis in world.
        point: A point on the axis when `slide` is 0 [m].
        inward: Direction in which a positive slide moves the axis, unit vector.
    """

    nodes: IndexArray
    axis: FloatArray
    point: FloatArray
    inward: FloatArray

    def swing(self, rest: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (c, u, w), each (n, 3): the held nodes stand at c + u cos(angle) + w sin(angle) + slide inward.

        Args:
            rest: Undeformed positions of the held nodes [m], shape (n, 3).
        """
        arm = rest - self.point
        along = np.outer(arm @ self.axis, self.axis)
        return self.point + along, arm - along, np.cross(self.axis, arm)


@dataclass(frozen=True, eq=False)
class Groups:
    """All groups of one mesh; no node may be in two.

    Attributes:
        size: Number of nodes.
        rigid: Node indices of each rigid body.
        driven: The driven frames.
        fixed: Nodes held along all axes.
        pinned: Free nodes that are held along some axes: node and axis, a row for each, shape (k, 2).
        prescribed: How some of what is held moves; None: none of it does.
        places: By number of a rigid body: where its nodes stand in it [m], shape (k, 3); of others as undeformed.
        free: Number of rigid bodies that hold no node. They come behind those of `rigid`.
        actuators: Number of actuators that are terms of the potential (`forces.actuator`).
    """

    size: int
    rigid: tuple[IndexArray, ...] = ()
    driven: tuple[DrivenFrame, ...] = ()
    fixed: IndexArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    pinned: IndexArray = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    prescribed: "Prescribed | None" = None
    places: Mapping[int, FloatArray] = field(default_factory=dict)
    free: int = 0
    actuators: int = 0

    def __post_init__(self) -> None:
        owner: dict[int, str] = {}
        named = [(f"rigid body {i}", nodes) for i, nodes in enumerate(self.rigid)]
        named += [(f"servo_{i}", frame.nodes) for i, frame in enumerate(self.driven)]
        for name, nodes in [*named, ("the fixed regions", self.fixed)]:
            if name != "the fixed regions" and len(nodes) < 3:
                raise SceneError(
                    f"{name} holds {len(nodes)} nodes of the mesh; it needs at least 3: refine the mesh or "
                    "enlarge what it holds"
                )
            if shared := [n for n in nodes.tolist() if n in owner]:
                raise SceneError(
                    f"{name} and {owner[shared[0]]} both hold nodes {names_of(np.array(shared))}; leave them out "
                    "of one of the two"
                )
            owner.update(dict.fromkeys(nodes.tolist(), name))
        if self.size and len(owner) == self.size:
            raise SceneError("every node of the mesh is held, so nothing can deform; hold fewer nodes")

    @property
    def commanded(self) -> int:
        """Number of actuators: driven frames, and terms of the potential."""
        return len(self.driven) + self.actuators

    @property
    def joints(self) -> int:
        """Length of `State.joints`: angles, other actuators, slide, and time where motions are prescribed."""
        return self.commanded + 1 + bool(self.prescribed)

    def placed(self, rest: FloatArray) -> FloatArray:
        """Return `rest`, undeformed places of nodes [m], shape (size, 3), with those of `places` in their stead."""
        if not self.places:
            return rest
        found = rest.copy()
        for body, places in self.places.items():
            found[self.rigid[body]] = places
        return found

    def still(self) -> NDArray[np.bool_]:
        """Return which nodes are fixed or prescribed along which axes, shape (size, 3)."""
        still = np.zeros((self.size, 3), dtype=bool)
        still[self.fixed] = True
        still[tuple(self.pinned.T)] = True
        return still

    def held(self) -> NDArray[np.bool_]:
        """Return which nodes are fixed, driven or prescribed along which axes, shape (size, 3)."""
        held = self.still()
        for frame in self.driven:
            held[frame.nodes] = True
        return held

    def kinds(self) -> tuple[IndexArray, IndexArray]:
        """Return the kind of each node and the number of its body or frame, both of shape (size,)."""
        kind, number = np.zeros(self.size, dtype=np.int64), np.zeros(self.size, dtype=np.int64)
        for i, nodes in enumerate(self.rigid):
            kind[nodes], number[nodes] = Kind.RIGID, i
        for i, frame in enumerate(self.driven):
            kind[frame.nodes], number[frame.nodes] = Kind.DRIVEN, i
        kind[self.fixed] = Kind.FIXED
        return kind, number
