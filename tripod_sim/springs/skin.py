"""What shows a chain, which has no surface: an octahedron about each node and ribbons along the springs."""

import zlib

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.springs.body import SpringBody

THICKNESS = 0.1
"""Of an octahedron from centre to corner, as a share of the shortest spring."""

FACES = ((0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5))
"""Of the octahedron with the corners +X, -X, +Y, -Y, +Z, -Z."""

RIBBON = 0.3
"""Width of a ribbon, as a share of the thickness."""


class ChainSkin:
    """Surface whose vertices keep their distance to a node.

    Attributes:
        nodes: Vertices about the undeformed body [m], shape (12 n, 3).
        surface: Triangles, shape (k, 3).
        topology_id: CRC-32 of the triangles.
    """

    def __init__(self, body: SpringBody) -> None:
        n = len(body.nodes)
        shortest = float(body.rest_length.min()) or float(np.ptp(body.nodes, axis=0).max()) / n
        unit = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
        corner = THICKNESS * shortest * unit
        self._offset = np.concatenate([corner, RIBBON * corner])[None]
        faces = 12 * np.arange(n)[:, None, None] + np.array(FACES)
        ribbons = [_ribbon(body.ends, 6 + first, 7 + first) for first in (0, 2, 4)]
        self.surface: IndexArray = np.concatenate([faces.reshape(-1, 3), *ribbons])
        self.topology_id = zlib.crc32(self.surface.astype("<i8").tobytes())
        self.nodes = self.vertices(body.nodes)

    def vertices(self, positions: FloatArray) -> FloatArray:
        """Return the vertices about nodes at `positions` [m], shape (12 n, 3), a new array."""
        return np.asarray((positions[:, None] + self._offset).reshape(-1, 3))


def _ribbon(ends: IndexArray, one: int, other: int) -> IndexArray:
    """Return two triangles for each spring, between the corners `one` and `other` of its ends."""
    i, j = 12 * ends.T
    a, b, c, d = i + one, i + other, j + other, j + one
    return np.stack([np.column_stack([a, b, c]), np.column_stack([a, c, d])], axis=1).reshape(-1, 3)
