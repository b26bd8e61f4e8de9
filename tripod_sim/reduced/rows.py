"""Rows: what a reduced model keeps of the body, in place of all nodes.

A row is a point whose position follows linearly from the coordinates z. The first rows are the nodes of the elements
that are evaluated. Those after them have no place in the body: they carry what is quadratic in z in as few rows as
there are coordinates,

    z^T B^T M B z = m |y|²   (inertia; m the mass of the whole body),   z^T B^T K B z = |k|²   (bedding of clamps),

so that every term of the potential is a term of rows.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of one model.

    Attributes:
        rest: Positions at z = 0 [m]; zero where a row is no node, shape (k, 3).
        columns: d positions / dz, shape (3 k, size).
        inert: Rows that carry the inertia.
        bedded: Rows that carry the bedding; none without it.
        mass: Of the whole body, and of each inert row [kg].
        back: dz of moves of the inert rows, shape (size, 3 inert rows).
    """

    rest: FloatArray
    columns: FloatArray
    inert: slice
    bedded: slice
    mass: float
    back: FloatArray

    @property
    def masses(self) -> FloatArray:
        """Of rows [kg], shape (k,)."""
        found = np.zeros(len(self.rest))
        found[self.inert] = self.mass
        return found


def make_rows(
    rest: FloatArray, columns: FloatArray, nodes: IndexArray, mass: FloatArray, bedding: FloatArray | None
) -> Rows:
    """Return the rows of a model.

    Args:
        rest: Undeformed positions of all nodes [m], shape (n, 3).
        columns: B, shape (3 n, size).
        nodes: Those that have rows, shape (p,).
        mass: Of all nodes [kg], shape (n,).
        bedding: B^T K B of the clamps' bedding, shape (size, size); None without it.
    """
    total = float(mass.sum())
    inertia, back = root(columns.T @ (np.repeat(mass, 3)[:, None] * columns) / total)
    parts = [columns.reshape(len(rest), 3, -1)[nodes].reshape(3 * len(nodes), -1), inertia]
    if bedding is not None:
        parts.append(root(bedding)[0])
    ends = np.cumsum([0, *(len(p) // 3 for p in parts)]).tolist()
    all_rest = np.zeros((ends[-1], 3))
    all_rest[: len(nodes)] = rest[nodes]
    return Rows(
        all_rest, np.ascontiguousarray(np.concatenate(parts)), slice(ends[1], ends[2]), slice(ends[2], ends[-1]),
        total, back,
    )  # fmt: skip


def root(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return Y and C with Y^T Y = A and Y C = I on the rows of Y that are not zero.

    Args:
        matrix: A, symmetric and at least semi-definite, shape (n, n).

    Returns:
        Shapes (k, n) and (n, k), k a multiple of 3 from the rank on.
    """
    scale = np.sqrt(np.diag(matrix))
    scale[scale == 0.0] = 1.0
    values, vectors = np.linalg.eigh(matrix / scale / scale[:, None])
    kept = values > 1e-13 * values[-1]
    size, values, vectors = int(kept.sum()), values[kept], vectors[:, kept]
    padded = 3 * -(-size // 3)
    found, back = np.zeros((padded, len(matrix))), np.zeros((len(matrix), padded))
    found[:size] = (vectors * np.sqrt(values)).T * scale
    back[:, :size] = vectors / np.sqrt(values) / scale[:, None]
    return found, back
