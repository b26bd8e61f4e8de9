"""One implicit stage, the building block of all implicit schemes.

Every scheme here ends a stage with v' = (x' - z) / s and M (v' - u) / s = f(x', v'), with s, z and u from known values.
With f = -dE/dx - a M v' - b dg/dt, g = dE/dx and dg/dt = (g' - q) / s, this is the minimum of

    E(x') + 1/(2 s²) |x' - z - s u|²_M + a/(2 s) |x' - z|²_M + b/s (E(x') - q . (x' - z)),

so every stage can be made safe by going down [MartinEtAl2011]. A scheme makes z, u and q in the same way of x, v and g.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import FloatArray
from tripod_sim.forces.anchor import Anchor
from tripod_sim.forces.term import StageTerm
from tripod_sim.integrators.newton import Newton, NewtonReport
from tripod_sim.state import State


class ImplicitStage:
    """Solves stages for one system.

    Attributes:
        known: z [m], u [m/s], with stiffness damping q [N], and what terms remember (the lengths l_0 [m] of dampers),
            each in as many rows as it takes, the rest zero: written before each `solve`, shape (rows, n, 3).
    """

    def __init__(self, newton: Newton, inertia: Anchor, mass: FloatArray, mass_damping: float) -> None:
        """`mass`: of nodes [kg], shape (n,); `mass_damping`: a of the force -a M v [1/s]."""
        self.newton, self._inertia, self._mass = newton, inertia, mass
        self._mass_damping = mass_damping
        system, n = newton.system, len(mass)
        self._kept, row = list[tuple[StageTerm, slice]](), 3 if system.damping else 2
        for term in system.terms:
            if isinstance(term, StageTerm):
                self._kept.append((term, slice(3 * n * row, 3 * n * row + term.remembers)))
                row += -(-term.remembers // (3 * n))
        self.known = np.zeros((row, n, 3))

    def read(self, state: State, out: FloatArray) -> None:
        """Write x, v, with stiffness damping g, and what terms remember of `state` to `out`, as `known`."""
        system = self.newton.system
        out[0], out[1] = state.positions, state.velocities
        if system.damping:
            out[2] = system.elastic_forces(state)
        for term, part in self._kept:
            term.remember(state.positions, out.reshape(-1)[part])

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
        system, inertia, (z, u) = self.newton.system, self._inertia, self.known[:2]
        damping = system.damping
        inertia.per_mass = 1 / s**2 + self._mass_damping / s
        aim_anchor(self._mass, self._mass_damping, s, z, u, inertia.weight, inertia.point)
        for term, part in self._kept:
            term.aim(s, self.known.reshape(-1)[part])
        if damping:
            damping.factor = damping.coefficient / s
            damping.start[:], damping.elastic[:] = z, self.known[2]


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
