"""Steps of spring bodies whose error in time is estimated, and `dt = "auto"`."""

import numpy as np

from tripod_sim.errors import StepError
from tripod_sim.integrators.substeps import StepReport
from tripod_sim.integrators.time_error import ErrorState, TimeErrorReport
from tripod_sim.integrators.time_error_kernels import furthest
from tripod_sim.springs import error_kernels as kernels
from tripod_sim.springs.body import FloatArray
from tripod_sim.springs.implicit import SCHEMES, WHY, SpringSolver
from tripod_sim.springs.implicit_kernels import SOLVED, Options
from tripod_sim.springs.system import SpringSystem
from tripod_sim.state import State
from tripod_sim.tables.method import TimeError

NUMBERS = ("known", "length", "missing", "proposed", "last")
"""Of an `ErrorState`, in the order of `error_kernels`."""


class EstimatedSprings:
    """Advances a spring body by implicit Euler, BDF2 or TR-BDF2 and estimates the error of that.

    With `steps = "auto"` a step is divided into equal parts as long as the tolerance allows, and again where that
    changes on the way.
    """

    def __init__(
        self,
        system: SpringSystem,
        scheme: str,
        options: Options,
        wanted: TimeError,
        *,
        drag: float,
        rayleigh: float,
        max_halvings: int,
    ) -> None:
        """`wanted`: the scene's table; the others as for `ImplicitSprings`."""
        self._solver = SpringSolver(system, options, drag=drag, rayleigh=rayleigh, moving=True)
        self._scheme, self._halvings, self._wanted = SCHEMES[scheme], max_halvings, wanted
        self._carried = wanted.carries
        n, m = len(system.body.nodes), len(system.body.ends)
        self._history, self._past, self._clock = np.zeros((5, n, 3)), np.zeros((3, m)), np.zeros(1)
        scratch = [*np.zeros((2, 2, n, 3)), *np.zeros((8, n, 3)), np.zeros((3, n, 3)), np.zeros((m, 6))]
        self._scratch = kernels.ErrorWork._make([*scratch, system.mass > 0])
        kept = [*np.zeros((2, n, 3)), np.zeros((5, n, 3)), np.zeros((3, m)), np.zeros(1)]
        self._kept = kernels.Motion._make(kept)
        self._kept_errors = _errors(self.start(np.zeros((n, 3))))
        self._origin: State | None = None

    def start(self, velocities: FloatArray) -> ErrorState:
        """Return the state without error at the start; `velocities`: there [m/s], shape (n, 3)."""
        none = np.zeros((2, *velocities.shape))
        return ErrorState(none, none.copy(), velocities.copy(), none.copy())

    def forget(self) -> None:
        """Drop factorisation and history."""
        self._clock[0] = self._solver.work.kept[0] = 0.0

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance by `dt` [s], in place. Raises StepError and leaves `state`."""
        solver, estimate, wanted = self._solver, state.errors, self._wanted
        assert estimate
        if self._origin is None:
            self._origin = state.copy()
        state.copy_to(self._origin)
        errors, auto = _errors(estimate), wanted.steps == "auto"
        motion = kernels.Motion(state.positions, state.velocities, self._history, self._past, self._clock)
        smallest = 0.999 * min(dt, wanted.shortest if auto else dt) * 0.5**self._halvings
        outcome, parts, rejected, failed, worst = kernels.estimated_interval(
            self._scheme, dt, auto, self._carried, wanted.tolerance, wanted.shortest, smallest, motion, errors,
            self._kept, self._kept_errors, solver.problem, solver.factor, solver.options, solver.work, self._scratch,
            solver.counts,
        )  # fmt: skip
        if outcome != SOLVED:
            self._origin.copy_to(state)
            self.forget()
            why = WHY[outcome].format(residual=float(solver.counts[3]))
            raise StepError(
                f"step {state.step + 1} at {state.time:.4g} s cannot be saved, even in parts of {2 * smallest:.2g} s: "
                f"{why}"
            )
        for name, value in zip(NUMBERS, errors.numbers.tolist(), strict=True):
            setattr(estimate, name, int(value) if name == "known" else value)
        state.time += dt
        state.step += 1
        report = solver.report(parts)
        report.rejected, report.halvings = rejected, failed
        largest, node = furthest(estimate.error[0]) if self._carried else (np.nan, -1)
        added = worst if auto else np.nan
        report.time_error = TimeErrorReport(np.nan, float(largest), int(node), float(added))
        return report


def _errors(state: ErrorState) -> kernels.Errors:
    """Return what the kernels take of `state`: its own arrays, and a copy of its numbers."""
    numbers = np.array([float(getattr(state, name)) for name in NUMBERS])
    return kernels.Errors(state.error, state.before, state.velocities, state.accelerations, numbers)
