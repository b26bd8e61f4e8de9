"""The basis of a reduced model: how nodes move with the coordinates, and which elements stand for all."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tripod_sim.constraints.groups import Groups, Kind
from tripod_sim.reduced.coordinates import boundary_columns

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Basis:
    """What training finds; B of the module `coordinates` without what the constraints prescribe.

    Attributes:
        lift: Displacement of free nodes for each coordinate but q, shape (3 f, boundary).
        shapes: For each amplitude q, orthonormal with respect to the mass [kg^-1/2], shape (3 f, r).
        weights: How many elements each one stands for, not negative; without hyper-reduction all 1, shape (m,).
        reached: Share of the poses of training in which the full model has found an equilibrium.
    """

    lift: FloatArray
    shapes: FloatArray
    weights: FloatArray
    reached: float

    def columns(self, rest: FloatArray, groups: Groups) -> FloatArray:
        """Return B, shape (3 n, boundary + r), for nodes at `rest` [m], shape (n, 3)."""
        boundary = boundary_columns(rest, groups)
        found = np.hstack([boundary, np.zeros((len(boundary), self.shapes.shape[1]))])
        free = free_rows(groups)
        found[free, : boundary.shape[1]], found[free, boundary.shape[1] :] = self.lift, self.shapes
        return found


def free_rows(groups: Groups) -> NDArray[np.int64]:
    """Return the rows of free nodes in arrays of shape (3 n,)."""
    free = np.flatnonzero(groups.kinds()[0] == Kind.FREE)
    return (3 * free[:, None] + np.arange(3)).ravel()
