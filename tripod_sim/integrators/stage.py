"""One implicit stage, the building block of all implicit schemes.

Every scheme ends a stage with v' = (x' - z) / s and M (v' - u) / s_f = f(x', v'), with s, s_f, z and u from known
values (see `scheme`). With f = -dE/dx - a M v' - dD/dx this is the minimum of

    E(x') + D(x') + 1/(2 s s_f) |x' - z - s u|²_M + a/(2 s) |x' - z|²_M,

    D(x') = b/(2 s) sum of V (e(x') - e_q) : C_0 : (e(x') - e_q),

so every stage can be made safe by going down [MartinEtAl2011]. Here e is the measure of strain of solids (Green's, with
the tangent C_0 of their law undeformed) and of springs (their length, with stiffness and dampers), which rigid motions
leave as it is: so dampers take nothing from these. A scheme makes z, u and e_q in the same way of x, v and e.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import FloatArray
from tripod_sim.forces.anchor import Anchor
from tripod_sim.integrators.newton import Newton, NewtonReport
from tripod_sim.integrators.scheme import Stage
from tripod_sim.state import State


class ImplicitStage:
    """Solves stages for one system.

    Attributes:
        known: z [m], u [m/s], and e_q in as many rows as it takes, the rest zero: written before each `solve`, shape
            (rows, n, 3).
    """

    def __init__(self, newton: Newton, inertia: Anchor, mass: FloatArray, mass_damping: float) -> None:
        """`mass`: of nodes [kg], shape (n,); `mass_damping`: a of the force -a M v [1/s]."""
        self.newton, self._inertia, self._mass = newton, inertia, mass
        self._mass_damping = mass_damping
        n, remembers = len(mass), newton.system.remembers
        self.known = np.zeros((2 - (-remembers // (3 * n)), n, 3))
        self._strains = slice(6 * n, 6 * n + remembers)
        self._acceleration: FloatArray | None = None  # at the end of the last stage [m/s²]

    def forget(self) -> None:
        """Drop what was kept from earlier stages, so that the next one depends on its state alone."""
        self.newton.forget()
        self._acceleration = None

    def read(self, state: State, out: FloatArray) -> None:
        """Write x, v and e of `state` to `out`, as `known`."""
        out[0], out[1] = state.positions, state.velocities
        self.newton.system.remember(state, out.reshape(-1)[self._strains])

    def solve(self, state: State, joints: FloatArray, stage: Stage) -> NewtonReport:
        """Move `state` to the end of a stage with what is `known`, in place, its driven frames at `joints`.

        Args:
            state: Start of Newton's iteration; holds x' and v' afterwards.
            joints: Angles [rad] and slide [m] at the end of the stage, shape (servos + 1,).
            stage: Which.

        Raises:
            NewtonError: no solution; `state` is then in between.
        """
        self.aim(stage)
        z, u = self.known[:2]
        force = stage.square / stage.s
        last = self._acceleration
        self.newton.foreseen = None if last is None else z + stage.s * (u + force * last)
        report = self.newton.solve(state, joints, keep=stage.key)
        np.subtract(state.positions, z, out=state.velocities)
        state.velocities /= stage.s
        if self.newton.foresees:
            self._acceleration = (state.velocities - u) / force
        return report

    def renew(self, state: State, stage: Stage) -> None:
        """Factor now as the stage from `state` with what is `known` would begin."""
        self.aim(stage)
        self.newton.renew(state, stage.key)

    def aim(self, stage: Stage) -> None:
        """Make the system's potential that of a stage with what is `known`."""
        inertia, (z, u), s, square = self._inertia, self.known[:2], stage.s, stage.square
        inertia.per_mass = 1 / square + self._mass_damping / s
        aim_anchor(self._mass, self._mass_damping, s, square, z, u, inertia.weight, inertia.point)
        self.newton.system.aim(s, self.known.reshape(-1)[self._strains])


@njit(cache=True, error_model="numpy")
def aim_anchor(
    mass: FloatArray,
    drag: float,
    s: float,
    square: float,
    z: FloatArray,
    u: FloatArray,
    weight: FloatArray,
    point: FloatArray,
) -> None:
    """Write weight m / q + a m / s and point z + s u (m / q) / weight, q = `square`; nodes without mass stay at z."""
    for n in range(mass.shape[0]):
        inertial = mass[n] / square
        weight[n] = inertial + mass[n] * (drag / s)
        part = s * inertial / weight[n] if weight[n] > 0 else 0.0
        for i in range(3):
            point[n, i] = z[n, i] + part * u[n, i]
