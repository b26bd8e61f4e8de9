"""Quasi-static steps: each ends in equilibrium, reached by load increments small enough to stay on the branch."""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.integrators.newton import Newton, NewtonReport
from tripod_sim.integrators.substeps import StepReport, advance_in_parts
from tripod_sim.state import State

FloatArray = NDArray[np.float64]


class QuasiStatic:
    """Moves a state from equilibrium to equilibrium."""

    def __init__(self, newton: Newton, max_halvings: int, max_turn: float, reach: float) -> None:
        """`max_turn`: largest servo move of an increment [rad]; `reach`: of an arm [m], sets the same for the slide."""
        self._newton, self._max_halvings, self._max_turn, self._reach = newton, max_halvings, max_turn, reach
        self._backup: State | None = None

    def forget(self) -> None:
        """Nothing is kept from earlier steps."""

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Move `state` to equilibrium with the driven frames at `joints`, shape (s + 1,), in place.

        Time grows by `dt` [s].

        Raises:
            StepError: no equilibrium was found along the way; `state` is unchanged.
        """
        if self._backup is None:
            self._backup = state.copy()
        start = state.joints.copy()
        move = np.abs(joints - start)
        turn = max(float(move[:-1].max(initial=0.0)), float(move[-1]) / self._reach)
        first = 1.0 / max(1, int(np.ceil(turn / self._max_turn)))

        def part(_: float, end: float) -> NewtonReport:
            return self._newton.solve(state, start + end * (joints - start))

        report = advance_in_parts(state, self._backup, part, self._max_halvings, first)
        state.time += dt
        state.step += 1
        return report
