"""One implicit stage, the building block of all implicit schemes.

Every scheme here ends a stage with v' = (x' - z) / s and M (v' - u) / s = f(x', v'), with s, z and u from known values.
With f = -dE/dx - (a M + b K) v' this is the minimum of

    E(x') + 1/(2 s²) |x' - z - s u|²_M + a/(2 s) |x' - z|²_M + b/(2 s) |x' - z|²_K,

so every stage can be made safe by going down [MartinEtAl2011].
"""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.forces.anchor import Anchor
from tripod_sim.integrators.newton import Newton, NewtonReport
from tripod_sim.state import State

FloatArray = NDArray[np.float64]


class ImplicitStage:
    """Solves stages for one system.

    Attributes:
        z: Written before each `solve` [m], shape (n, 3).
        u: Written before each `solve` [m/s], shape (n, 3).
    """

    def __init__(self, newton: Newton, inertia: Anchor, mass: FloatArray, mass_damping: float) -> None:
        """`mass`: of nodes [kg], shape (n,); `mass_damping`: a of the force -a M v [1/s]."""
        self.newton, self._inertia, self._mass = newton, inertia, mass
        self._mass_damping = mass_damping
        self.z, self.u = np.zeros((len(mass), 3)), np.zeros((len(mass), 3))

    def solve(self, state: State, joints: FloatArray, s: float) -> NewtonReport:
        """Move `state` to the end of the stage with `z` and `u`, in place, its driven frames at `joints`.

        Args:
            state: Start of Newton's iteration; holds x' and v' afterwards.
            joints: Angles [rad] and slide [m] at the end of the stage, shape (servos + 1,).
            s: [s].

        Raises:
            NewtonError: no solution; `state` is then in between.
        """
        inertia, damping = self._inertia, self.newton.system.damping
        inertial, drag = self._mass / s**2, self._mass * (self._mass_damping / s)
        np.add(inertial, drag, out=inertia.weight)
        np.divide(s * inertial, inertia.weight, out=inertial, where=inertia.weight > 0)  # ghosts have no mass
        np.multiply(self.u, inertial[:, None], out=inertia.point)
        inertia.point += self.z
        if damping:
            damping.factor = damping.coefficient / s
            damping.start[:] = self.z
        report = self.newton.solve(state, joints, keep=s)
        np.subtract(state.positions, self.z, out=state.velocities)
        state.velocities /= s
        return report
