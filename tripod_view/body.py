"""The deforming body: a triangle mesh, and node positions that fit it or are refused with the reason."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from tripod_graph import names
from tripod_host.arrays import FloatArray

CornerArray = NDArray[np.uint32]


FARTHEST = 1e9
"""Largest coordinate that is drawn [m]: beyond, a camera cannot be told from what it looks at."""


PATIENCE = 10
"""Positions in a row of another mesh that are passed over without a word: the new mesh is on its way, or was faster."""


class BodyError(ValueError):
    """A mesh or a set of node positions that cannot be drawn; the message says why."""


class MisfitError(BodyError):
    """Positions of another mesh."""


@dataclass(frozen=True)
class Surface:
    """The surface of the body.

    Attributes:
        nodes: Undeformed node positions [m], shape (n, 3), none beyond `FARTHEST`.
        triangles: Node indices, shape (m, 3), each below n.
    """

    nodes: FloatArray
    triangles: CornerArray

    def __post_init__(self) -> None:
        if self.nodes.ndim != 2 or self.nodes.shape[1] != 3 or len(self.nodes) == 0:
            raise BodyError(f"mesh nodes have shape {self.nodes.shape}; (n, 3) with n at least 1 is needed")
        if self.triangles.ndim != 2 or self.triangles.shape[1] != 3 or len(self.triangles) == 0:
            raise BodyError(
                f"mesh triangles have shape {self.triangles.shape}; (m, 3), m at least 1, is needed"
            )
        _check(self.nodes, "mesh node")
        worst = int(self.triangles.max())
        if worst >= len(self.nodes):
            raise BodyError(f"mesh triangle names node {worst}; the mesh has {len(self.nodes)}")

    @property
    def connectivity(self) -> int:
        """Checksum of the triangles: equal for the same nodes in the same order."""
        return crc32(self.triangles.tobytes())


class Body:
    """Fits node positions to the newest mesh.

    The mesh message carries no topology id, so the first positions that fit a mesh tell the id of its
    connectivity; an id belongs to one connectivity for ever. Positions left over from an older mesh are
    therefore refused even if their count fits.

    Attributes:
        surface: The newest mesh, None before the first.
        skipped: Positions and fields refused since start, but for a few about a change of the mesh.
        topic, reason: Where the newest of them came from, and why it was refused.
    """

    def __init__(self) -> None:
        self.surface: Surface | None = None
        self.skipped = 0
        self.topic, self.reason = names.BODY_STATE, ""
        self._id_of: dict[int, int] = {}
        self._connectivity = 0
        self._misfits = Counter[str]()

    def rebuild(self, surface: Surface) -> bool:
        """Take a mesh; return whether it differs from the one before."""
        old = self.surface
        if (
            old is not None
            and np.array_equal(old.triangles, surface.triangles)
            and np.array_equal(old.nodes, surface.nodes)
        ):
            return False
        self.surface, self._connectivity = surface, surface.connectivity
        return True

    def fit(self, topology_id: int, positions: FloatArray) -> FloatArray | None:
        """Return flat `positions` [m] as shape (n, 3), None (counted) if they do not fit."""
        return self._taken(names.BODY_STATE, lambda: self._fitted(topology_id, positions))

    def fit_field(self, topology_id: int, values: FloatArray) -> FloatArray | None:
        """Return a field, shape (n,), with NaN where it is not finite; None (counted) if it does not fit."""
        return self._taken(names.FIELD, lambda: self._fitted_field(topology_id, values))

    def _taken(self, topic: str, read: Callable[[], FloatArray]) -> FloatArray | None:
        try:
            fitted = read()
        except BodyError as error:
            self._misfits[topic] = self._misfits[topic] + 1 if isinstance(error, MisfitError) else 0
            if not 0 < self._misfits[topic] <= PATIENCE:
                self.skipped += 1
                self.topic, self.reason = topic, str(error)
            return None
        self._misfits[topic] = 0
        return fitted

    def _fitted(self, topology_id: int, positions: FloatArray) -> FloatArray:
        n = self._count(positions.size, 3, "coordinates")
        known = self._id_of.get(self._connectivity)
        if known is None and topology_id in self._id_of.values():
            raise MisfitError(f"topology id {topology_id} belongs to an older mesh")
        if known is not None and topology_id != known:
            raise MisfitError(f"topology id {topology_id}, the mesh has {known}")
        shaped = positions.reshape(n, 3)
        _check(shaped, "node")
        self._id_of[self._connectivity] = topology_id
        return shaped

    def _fitted_field(self, topology_id: int, values: FloatArray) -> FloatArray:
        self._count(values.size, 1, "values")
        if topology_id != (known := self._id_of.get(self._connectivity)):
            raise MisfitError(
                f"topology id {topology_id}, the mesh has {'none yet' if known is None else known}"
            )
        return np.where(np.isfinite(values), values, np.nan)

    def _count(self, size: int, each: int, what: str) -> int:
        """Return how many nodes the mesh has. Raises MisfitError unless `size` is `each` times that."""
        if self.surface is None:
            raise MisfitError("no mesh yet")
        n = len(self.surface.nodes)
        if size != each * n:
            raise MisfitError(f"{size} {what} for a mesh of {n} nodes")
        return n


def _check(nodes: FloatArray, what: str) -> None:
    """Raise BodyError where a node cannot be drawn."""
    if not nodes.size or np.abs(nodes).max() <= FARTHEST:
        return
    bad = np.flatnonzero(~(np.abs(nodes) <= FARTHEST).all(axis=1))  # NaN fails
    if bad.size:
        place = nodes[bad[0]]
        far = f"beyond {FARTHEST:g} m" if np.isfinite(place).all() else "not finite"
        raise BodyError(f"{what} {bad[0]} is {far}")
