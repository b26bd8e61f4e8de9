"""The error of the time steps carried in the modes in which that of the mesh swings, which costs no linear solve."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array, FloatArray
from tripod_sim.forces.anchor import Anchor
from tripod_sim.integrators.scheme import Defect, Stage
from tripod_sim.integrators.time_error_kernels import finish, load
from tripod_sim.mesh_error.modes import Modes
from tripod_sim.system import System


class ModalIntegration:
    """The errors in modes phi_i of the start, e = sum of phi_i z_i (see `integrators.time_error.Coordinates`).

    There m is 1, and A of a stage is diagonal, w + w_i² + d_i / s, d_i the damping of each mode (see `modal_error`).
    The residuals of the solver are not carried: each step corrects that of the step before.
    """

    corrects = False

    def __init__(self, modes: Modes, system: System, inertia: Anchor, damping: FloatArray) -> None:
        """`system`, `inertia`: as for `ErrorTransport`, of the body alone; `damping`: d_i [1/s]."""
        self._modes, self._inertia, self._damping = modes, inertia, damping
        self.shape, self.negligible = (len(modes.squares), 1), modes.negligible
        self._effector = modes.shapes[:, system.groups.rigid[0]].mean(axis=1).T

    def accelerations(self, end: FloatArray, u: FloatArray, s: float, out: FloatArray) -> None:
        """As in `Coordinates`."""
        np.divide(self._modes.momenta(end, u), s, out=out[:, 0])

    def stage(
        self, begun: FloatArray, p: FloatArray, q: FloatArray, defect: Defect, stage: Stage, left: FloatArray,
        out: FloatArray,
    ) -> None:  # fmt: skip
        """As in `Coordinates`."""
        weight = self._inertia.per_mass
        damped, lengths = self._damping / stage.s, (stage.s, stage.s_force)
        solve(p, q, defect.x, defect.v, self._modes.squares, weight, lengths, damped, begun, out)

    def warm_up(self, begun: FloatArray, out: FloatArray) -> None:
        """As in `Coordinates`."""
        zero = out[0].copy()
        solve(zero, zero, 0.0, 0.0, self._modes.squares, 1.0, (1.0, 1.0), self._damping, begun, out)

    def effector(self, errors: FloatArray) -> tuple[float, float, float] | None:
        """As in `Coordinates`."""
        x, y, z = (self._effector @ errors[:, 0]).tolist()
        return x, y, z

    def furthest(self, errors: FloatArray) -> tuple[float, int]:
        """As in `Coordinates`."""
        return self._modes.furthest(errors[:, 0])


@njit(cache=True, error_model="numpy")
def solve(
    p: Array,
    q: Array,
    x: float,
    v: float,
    squares: Array,
    weight: float,
    lengths: tuple[float, float],
    damped: Array,
    begun: Array,
    out: Array,
) -> None:
    """Add the defects to what a stage starts from, and write the errors at its end (see `load` and `finish`).

    squares: w_i² [1/s²], shape (modes,); weight: w [1/s²]; lengths: s and s_f [s]; damped: d_i / s [1/s²].
    """
    count = squares.shape[0]
    load(p, q, x, v, np.ones(count), np.full(count, weight), lengths[1], begun, out[0])
    for n in range(count):
        out[0, n, 0] = (out[0, n, 0] + damped[n] * begun[0, n, 0]) / (weight + squares[n] + damped[n])
    finish(out[0], begun, lengths[0], out)
