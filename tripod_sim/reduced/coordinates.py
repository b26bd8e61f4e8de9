"""Coordinates of the reduced model, from which the displacement of every node follows linearly.

    x = X + B z,   z = (c - c0, R - I of each body;  cos a - 1, sin a of each servo;  slide;  q)

c and R are centre and rotation of a rigid body (R - I row by row), a the angle of a servo, q the amplitudes of the
shapes. B is constant: all that is not linear is between z and the unknowns (c, rotation vector) of each body and q.
"""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.constraints.groups import Groups
from tripod_sim.reduced import coordinate_kernels as kernels
from tripod_sim.reduced.state import ReducedState

FloatArray = NDArray[np.float64]

BODY = 12
"""Coordinates of a rigid body: three of c - c0, nine of R - I."""


class Coordinates:
    """z and its derivatives.

    Attributes:
        boundary: Number of coordinates before q.
        size: Number of all.
        unknowns: 6 for each body, then those of q.
        tangent: dz / d unknowns of the last `update`, shape (size, unknowns).
        drive: dz / d angles of the last `update`, shape (size, s).
    """

    def __init__(self, centres: FloatArray, servos: int, shapes: int) -> None:
        """`centres`: c0 of each body [m], shape (b, 3); `servos`, `shapes`: how many there are."""
        self._centres, self.bodies, self.servos = centres, len(centres), servos
        first = BODY * self.bodies
        self.boundary = first + 2 * servos + 1
        self.size, self.unknowns = self.boundary + shapes, 6 * self.bodies + shapes
        self._angles = slice(first, first + 2 * servos)
        self.tangent, self.drive = np.zeros((self.size, self.unknowns)), np.zeros((self.size, servos))
        for b in range(self.bodies):
            self.tangent[BODY * b : BODY * b + 3, 6 * b : 6 * b + 3] = np.eye(3)
        self.tangent[self.boundary :, 6 * self.bodies :] = np.eye(shapes)
        self._rotations = np.tile(np.eye(3), (self.bodies, 1, 1))
        self._joints = np.zeros(servos + 1)

    def values(self, state: ReducedState) -> FloatArray:
        """Return z of `state`, shape (size,)."""
        z = np.empty(self.size)
        kernels.write_values(self._centres, state.centres, state.rotations, state.joints, z)
        z[self.boundary :] = state.q
        return z

    def boundary_values(self, centres: FloatArray, rotations: FloatArray, joints: FloatArray) -> FloatArray:
        """Return z without q, shape (boundary,).

        Args:
            centres: Of the bodies [m], shape (b, 3).
            rotations: Of the bodies, shape (b, 3, 3).
            joints: Angles [rad], then the slide [m], shape (s + 1,).
        """
        z = np.empty(self.boundary)
        kernels.write_values(self._centres, centres, rotations, joints, z)
        return z

    def update(self, rotations: FloatArray, joints: FloatArray) -> None:
        """Write `tangent` and `drive` for bodies at `rotations`, shape (b, 3, 3), and servos at `joints`, (s + 1,)."""
        self._rotations[:], self._joints[:] = rotations, joints
        kernels.write_tangent(rotations, joints, self.tangent, self.drive)

    def add_curvature(self, p: FloatArray, matrix: FloatArray, drive_drive: FloatArray) -> None:
        """Add p . d²z to the second derivatives by unknowns and by angles, at the last `update`.

        Of a body with P = dPhi/dR this is sym(R P^T) - tr(R P^T) I; of a servo -(cos a, sin a) . p.

        Args:
            p: dPhi/dz, shape (size,).
            matrix: By unknowns, shape (unknowns, unknowns), changed in place.
            drive_drive: By angles, shape (s, s), changed in place.
        """
        for b in range(self.bodies):
            m = self._rotations[b] @ p[BODY * b + 3 : BODY * (b + 1)].reshape(3, 3).T
            block = matrix[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6]
            block += 0.5 * (m + m.T)
            block.flat[:: block.shape[1] + 1] -= np.trace(m)
        angles = p[self._angles]
        for s in range(self.servos):
            a = self._joints[s]
            drive_drive[s, s] -= np.cos(a) * angles[2 * s] + np.sin(a) * angles[2 * s + 1]


def boundary_columns(rest: FloatArray, groups: Groups) -> FloatArray:
    """Return the displacement of nodes of bodies and frames for each coordinate but q, shape (3 n, boundary).

    Args:
        rest: Undeformed positions X [m], shape (n, 3).
        groups: Bodies and driven frames; all other rows are zero.
    """
    bodies, frames = groups.rigid, groups.driven
    first = BODY * len(bodies)
    columns = np.zeros((len(rest), 3, first + 2 * len(frames) + 1))
    for b, nodes in enumerate(bodies):
        arm = rest[nodes] - rest[nodes].mean(axis=0)
        for i in range(3):
            columns[nodes, i, BODY * b + i] = 1.0
            columns[nodes, i, BODY * b + 3 + 3 * i : BODY * b + 6 + 3 * i] = arm
    for s, frame in enumerate(frames):
        _, cosine, sine = frame.swing(rest[frame.nodes])
        columns[frame.nodes, :, first + 2 * s] = cosine
        columns[frame.nodes, :, first + 2 * s + 1] = sine
        columns[frame.nodes, :, -1] = frame.inward
    return columns.reshape(3 * len(rest), -1)
