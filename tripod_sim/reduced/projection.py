"""From rows to unknowns: what `constraints.reduction` does for a mesh, with dense columns.

With g = dPhi/drows, p = B^T g, T = dz / d unknowns and Z = dz / d angles,

    dPhi / d unknowns = T^T p,   torques = Z^T p,   Hessian = T^T (sum_e B_e^T K_e B_e) T + p . d²z.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tripod_sim.linear.dense import Dense
from tripod_sim.reduced.coordinates import Coordinates
from tripod_sim.reduced.product_kernels import multiply
from tripod_sim.reduced.rows import Rows

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


class Projection:
    """Maps between rows and unknowns: 6 for each body, then the amplitudes q.

    Attributes:
        unknowns: Their number n.
        linear: Solves with the Hessian that `hessian` wrote.
        drive: Mixed derivatives with respect to unknowns and angles, shape (n, s).
        drive_drive: Second derivatives with respect to angles, shape (s, s).
    """

    free_count = 0
    """Free nodes before the bodies: none."""

    def __init__(self, coordinates: Coordinates, rows: Rows, elements: IndexArray) -> None:
        """`elements`: rows of the nodes of each element, shape (m, a)."""
        self._coordinates, self._columns = coordinates, rows.columns
        self._transposed = np.ascontiguousarray(rows.columns.T)
        size = rows.columns.shape[1]
        local = rows.columns.reshape(-1, 3, size)
        self._of_elements = np.ascontiguousarray(local[elements].reshape(len(elements), -1, size))
        self._products = np.empty_like(self._of_elements)
        bed = local[rows.bedded].reshape(-1, size)
        self._bedding = bed.T @ bed
        self.unknowns = coordinates.unknowns
        self.linear = Dense(self.unknowns)
        servos = coordinates.servos
        self.drive, self.drive_drive = np.zeros((self.unknowns, servos)), np.zeros((servos, servos))
        self._p, self._sum = np.zeros(size), np.zeros((size, size))

    def gradient(
        self, g: FloatArray, lever: FloatArray, axes: FloatArray, out: FloatArray, torque: FloatArray
    ) -> None:
        """Write T^T B^T g to `out`, shape (unknowns,), and Z^T B^T g to `torque`, shape (s,), at the last `update`.

        `lever` and `axes` belong to meshes and are not looked at; so below.
        """
        multiply(self._transposed, g.reshape(-1), self._p)
        np.dot(self._p, self._coordinates.tangent, out=out)
        np.dot(self._p, self._coordinates.drive, out=torque)

    def hessian(
        self,
        parts: Sequence[tuple[int, FloatArray, float]],
        mass: FloatArray,
        g: FloatArray,
        lever: FloatArray,
        axes: FloatArray,
    ) -> None:
        """Write the Hessian into `linear.matrix`, `drive` and `drive_drive`.

        Args:
            parts: What is added up: 0 with element matrices [N/m], shape (m, 3 a, 3 a), or 1 for the bedding, and the
                factor of each.
            mass: Isotropic term of each row [N/m], shape (rows,).
            g: Gradient by rows [N] of the whole potential, for the second-order terms.
            lever, axes: As in `gradient`.
        """
        total, size = self._sum, len(self._sum)
        total[:] = 0.0
        for block, matrices, factor in parts:
            if block == 0:
                np.matmul(matrices, self._of_elements, out=self._products)
                product = self._of_elements.reshape(-1, size).T @ self._products.reshape(-1, size)
                total += factor * product
            else:
                total += factor * self._bedding
        heavy = np.flatnonzero(mass)
        if heavy.size:
            columns = self._columns.reshape(-1, 3, size)[heavy]
            weighted = columns * mass[heavy, None, None]
            total += columns.reshape(-1, size).T @ weighted.reshape(-1, size)
        total += total.T.copy()
        total *= 0.5
        multiply(self._transposed, g.reshape(-1), self._p)
        tangent, drive, matrix = self._coordinates.tangent, self._coordinates.drive, self.linear.matrix
        along = total @ tangent
        matrix[:] = tangent.T @ along
        self.drive[:] = along.T @ drive
        self.drive_drive[:] = drive.T @ total @ drive
        self._coordinates.add_curvature(self._p, matrix, self.drive_drive)
        matrix += matrix.T.copy()
        matrix *= 0.5

    def moves(self, solution: FloatArray, lever: FloatArray, out: FloatArray) -> None:
        """Write the first-order move of all rows for a step of the unknowns to `out`, shape (rows, 3)."""
        multiply(self._columns, self._coordinates.tangent @ solution, out.reshape(-1))

    def unknown_name(self, index: int) -> str:
        """Return in words what an unknown is."""
        body = index // 6
        bodies = self._coordinates.bodies
        return f"rigid body {body}" if body < bodies else f"shape {index - 6 * bodies}"
