"""Implicit Euler: v' = v + dt M^-1 f(x', v'), x' = x + dt v'.

With f = -dE/dx it is the minimum of E(x') + 1/(2 dt²) |x' - (x + dt v)|²_M, so that every step can be made safe
by going down [MartinEtAl2011]. First order; it damps: a mode of angular frequency w loses a fraction of about
w² dt² / 2 of its amplitude a step.
"""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.forces.anchor import Anchor
from tripod_sim.integrators.newton import Newton, NewtonReport
from tripod_sim.integrators.substeps import StepReport, advance_in_parts
from tripod_sim.state import State

FloatArray = NDArray[np.float64]


class ImplicitEuler:
    """Advances a state by implicit Euler steps."""

    def __init__(
        self, newton: Newton, inertia: Anchor, mass: FloatArray, mass_damping: float, max_halvings: int
    ) -> None:
        """`mass`: of nodes [kg], shape (n,); `mass_damping`: a of the force -a M v [1/s]."""
        self._newton, self._inertia, self._mass = newton, inertia, mass
        self._mass_damping, self._max_halvings = mass_damping, max_halvings
        self._backup: State | None = None
        self._before = np.zeros((len(mass), 3))

    def forget(self) -> None:
        """Drop what was kept from earlier steps."""
        self._newton.forget()

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance `state` by `dt` [s] while the driven frames move to `joints`, shape (s + 1,), in place.

        Raises:
            StepError: the step could not be saved; `state` is unchanged.
        """
        if self._backup is None:
            self._backup = state.copy()
        start = state.joints.copy()

        def part(begin: float, end: float) -> NewtonReport:
            return self._part(
                state, start + end * (joints - start), dt if end - begin == 1 else dt * (end - begin)
            )

        report = advance_in_parts(state, self._backup, part, self._max_halvings)
        state.time += dt
        state.step += 1
        return report

    def _part(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        inertia, damping = self._inertia, self._newton.system.damping
        inertial, drag = self._mass / h**2, self._mass * (self._mass_damping / h)
        np.add(inertial, drag, out=inertia.weight)
        share = (h * inertial / inertia.weight)[:, None]
        np.multiply(state.velocities, share, out=inertia.point)
        inertia.point += state.positions
        if damping:
            damping.factor = damping.coefficient / h
            damping.start[:] = state.positions
        self._before[:] = state.positions
        report = self._newton.solve(state, joints, keep=h)
        np.subtract(state.positions, self._before, out=state.velocities)
        state.velocities /= h
        return report
