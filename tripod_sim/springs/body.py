"""A body of nodes with mass, tied by springs."""

import zlib
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray, freeze
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import names_of


def _none() -> IndexArray:
    return np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class SpringBody:
    """Nodes and the springs between them.

    With d = x_j - x_i, l = |d| and n = d / l, a spring of stiffness k, rest length L and damping c pulls i with

        T n,   T = k (l - L) + c dl/dt,

    and j with the opposite. A slack spring that is compressed has k (l - L) = 0; its damper c acts all the same.

    Attributes:
        nodes: Undeformed positions [m], shape (n, 3).
        ends: Node indices (i, j) of each spring, shape (m, 2).
        rest_length: L [m], shape (m,), not negative.
        stiffness: k [N/m], shape (m,), not negative.
        damping: c [N s/m], shape (m,), not negative.
        mass: Of nodes [kg], shape (n,), positive.
        fixed: Nodes that never move.
        slack: Whether springs are slack when compressed.
        triangles: Of the surface, node indices, shape (t, 3); empty for a chain.
    """

    nodes: FloatArray
    ends: IndexArray
    rest_length: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    mass: FloatArray
    fixed: IndexArray = field(default_factory=_none)
    slack: bool = False
    triangles: IndexArray = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))

    def __post_init__(self) -> None:
        freeze(self, **dict.fromkeys(("nodes", "rest_length", "stiffness", "damping", "mass"), np.float64))
        freeze(self, **dict.fromkeys(("ends", "fixed", "triangles"), np.int64))
        n = len(self.nodes)
        if (bad := np.flatnonzero(((self.ends < 0) | (self.ends >= n)).any(axis=1))).size:
            raise SceneError(f"springs {names_of(bad)} name nodes outside 0..{n - 1}")
        if (bad := np.flatnonzero(self.ends[:, 0] == self.ends[:, 1])).size:
            raise SceneError(f"springs {names_of(bad)} begin and end at the same node")
        for name in ("rest_length", "stiffness", "damping"):
            value = getattr(self, name)
            if (bad := np.flatnonzero(~((value >= 0) & (value < np.inf)))).size:
                raise SceneError(f"springs {names_of(bad)}: {name} must be finite and not negative")
        if (bad := np.flatnonzero(~((self.mass > 0) & (self.mass < np.inf)))).size:
            raise SceneError(f"nodes {names_of(bad)}: mass must be finite and positive")
        if (bad := self.fixed[(self.fixed < 0) | (self.fixed >= n)]).size:
            raise SceneError(f"fixed nodes {names_of(bad)} do not exist; the body has nodes 0..{n - 1}")
        if len(np.unique(self.fixed)) == n:
            raise SceneError("every node is fixed, so nothing can move; fix fewer nodes")

    @property
    def elements(self) -> IndexArray:
        """The springs, as `ends`."""
        return self.ends

    @property
    def count(self) -> int:
        """Number of springs."""
        return len(self.ends)

    @property
    def surface(self) -> IndexArray:
        """The surface triangles, as `triangles`."""
        return self.triangles

    @cached_property
    def free(self) -> IndexArray:
        """Nodes that are not fixed, ascending."""
        return np.setdiff1d(np.arange(len(self.nodes)), self.fixed)

    @cached_property
    def topology_id(self) -> int:
        """CRC-32 of node count, springs and triangles."""
        numbers = np.concatenate([[len(self.nodes)], self.ends.ravel(), self.triangles.ravel()])
        return zlib.crc32(numbers.astype("<i8").tobytes())
