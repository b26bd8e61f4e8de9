"""An effector that is only observed: a point of a body, or the mean position of a set of nodes."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.reduction import Reduction
from tripod_sim.mesh.embedding import Embedding


class ObservedPoint:
    """The point p = sum of w_a x_a over nodes a. It adds nothing to the potential."""

    def __init__(self, embedding: Embedding) -> None:
        """`embedding`: of points of bodies; their mean is observed."""
        self._nodes = embedding.nodes.ravel()
        self._weights = embedding.weights.ravel() / len(embedding.nodes)

    def position(self, x: FloatArray) -> FloatArray:
        """Return p [m], shape (3,), with nodes at `x` [m], shape (n, 3)."""
        return np.asarray(self._weights @ x[self._nodes])

    def forces(self, reduction: Reduction, count: int) -> tuple[FloatArray, FloatArray]:
        """Return unit forces on p along x, y and z as gradients: dp/du of the unknowns and dp/dq of driven frames.

        Args:
            reduction: Of a system whose levers are those of the present positions.
            count: Number of nodes.

        Returns:
            Shapes (unknowns, 3) and (driven frames, 3).
        """
        unknowns, driven = np.zeros((reduction.unknowns, 3)), np.zeros((reduction.driven, 3))
        for axis in range(3):
            g, out, torque = np.zeros((count, 3)), np.zeros(reduction.unknowns), np.zeros(reduction.driven)
            np.add.at(g[:, axis], self._nodes, self._weights)
            reduction.gradient(g, out, torque)
            unknowns[:, axis], driven[:, axis] = out, torque
        return unknowns, driven
