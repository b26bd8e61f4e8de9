"""One implicit stage, the building block of all implicit schemes.

Every scheme here ends a stage with v' = (x' - z) / s and M (v' - u) / s = f(x', v'), with s, z and u from known values.
With f = -dE/dx - a M v' - dD/dx this is the minimum of

    E(x') + D(x') + 1/(2 s²) |x' - z - s u|²_M + a/(2 s) |x' - z|²_M,

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

    def read(self, state: State, out: FloatArray) -> None:
        """Write x, v and e of `state` to `out`, as `known`."""
        out[0], out[1] = state.positions, state.velocities
        self.newton.system.remember(state, out.reshape(-1)[self._strains])

    def solve(self, state: State, joints: FloatArray, s: float) -> NewtonReport:
        """Move `state` to the end of the stage with what is `known`, in place, its driven frames at `joints`.

        Args:
            state: Start of Newton's iteration; holds x' and v' afterwards.
            joints: Angles [rad] and slide [m] at the end of the stage, shape (servos + 1,).
            s: [s].

        Raises:
            NewtonError: no solution; `state` is then in between.
        """
        self.aim(s)
        report = self.newton.solve(state, joints, keep=s)
        np.subtract(state.positions, self.known[0], out=state.velocities)
        state.velocities /= s
        return report

    def renew(self, state: State, s: float) -> None:
        """Factor now as the stage of `s` [s] from `state` with what is `known` would begin."""
        self.aim(s)
        self.newton.renew(state, s)

    def aim(self, s: float) -> None:
        """Make the system's potential that of a stage of `s` [s] with what is `known`."""
        inertia, (z, u) = self._inertia, self.known[:2]
        inertia.per_mass = 1 / s**2 + self._mass_damping / s
        aim_anchor(self._mass, self._mass_damping, s, z, u, inertia.weight, inertia.point)
        self.newton.system.aim(s, self.known.reshape(-1)[self._strains])


@njit(cache=True, error_model="numpy")
def aim_anchor(
    mass: FloatArray,
    drag: float,
    s: float,
    z: FloatArray,
    u: FloatArray,
    weight: FloatArray,
    point: FloatArray,
) -> None:
    """Write weight m / s² + a m / s and point z + s u (m / s²) / weight; nodes without mass, ghosts, stay at z."""
    for n in range(mass.shape[0]):
        inertial = mass[n] / s**2
        weight[n] = inertial + mass[n] * (drag / s)
        part = s * inertial / weight[n] if weight[n] > 0 else 0.0
        for i in range(3):
            point[n, i] = z[n, i] + part * u[n, i]
