"""Load increments of statics: a body takes up a load that bends it far, such as its weight, a little at a time.

A thin body that a load bends far is hard for a line search: the step that the linear response proposes stretches the
body before it bends it, so the potential falls only along tiny parts of it. Here each increment takes up the share s of
the unbalanced load that moves no node further than `reach`,

    K dx = -r,   x <- x + s dx,   s = min(1, reach / max |dx|),

with the exact tangent K at each increment; what stretch it leaves belongs to the unbalanced load of the next
[Crisfield1991, chapter 1]. It ends in equilibrium once s = 1 suffices. Where an element turns inside out, the tangent
is no longer positive definite, or too many increments pass, the body is rolled back and the reach halved.
"""

import numpy as np

from tripod_sim.integrators.newton import NewtonReport
from tripod_sim.linear.solver import LinearError
from tripod_sim.state import State
from tripod_sim.system import System


class LoadSteps:
    """Brings states near to equilibrium where their load would move them far, with scratch of its own.

    Attributes:
        response: How far the unbalanced load of the last `carry` moves a node to first order, the furthest [m];
            infinite where there was none, or no stable response.
    """

    REACH = 0.1
    """Largest move of a node in an increment, in parts of the largest extent of the body: well below it the increments
    are many, well above it thin bodies fold over."""

    MOST = 100
    """Increments at the first reach; each halving allows for twice as many."""

    HALVINGS = 3

    def __init__(self, system: System, tolerance: float) -> None:
        """`tolerance`: unbalanced force [N] at which a state counts as solved."""
        self._system, self._tolerance = system, tolerance
        self._reach = self.REACH * float(np.ptp(system.rest, axis=0).max())
        self._dx = np.zeros_like(system.rest)
        self.response = np.inf
        self._start: State | None = None
        self._trial: State | None = None

    def carry(self, state: State) -> NewtonReport:
        """Move `state` to equilibrium, its driven frames where they are, if its load moves it further than the reach.

        Only `increments`, those rolled back included, and `halvings` of the report are written; and `factorisations` is
        1 where the state is left as it was and the system factored there, positive definite.

        The state is left as it was where the load moves it less, or where no reach leads to an equilibrium with a
        potential below that of the start.
        """
        report, system, self.response = NewtonReport(), self._system, np.inf
        phi = system.evaluate(state)
        if not (np.isfinite(phi) and system.unbalanced() > self._tolerance):
            return report
        if self._start is None or self._trial is None:
            self._start, self._trial = state.copy(), state.copy()
        state.copy_to(self._start)
        if not self._respond(state):
            return report
        self.response = self._furthest()
        if self.response <= self._reach:
            report.factorisations = 1
            return report
        for halving in range(self.HALVINGS + 1):
            scale = 0.5**halving
            if self._march(state, phi, self._reach * scale, int(self.MOST / scale), report):
                return report
            self._start.copy_to(state)
            report.halvings += 1
        return report

    def _march(self, state: State, phi: float, reach: float, most: int, report: NewtonReport) -> bool:
        """Take increments up to equilibrium below `phi` [J]; return whether it was reached."""
        system, trial = self._system, self._trial
        assert trial
        for _ in range(most):
            if not self._respond(state):
                return False
            report.increments += 1
            solution = self._solution
            system.move(state, solution, self._dx, min(1.0, reach / self._furthest()), trial)
            trial.copy_to(state)
            lower = system.evaluate(state)
            if not np.isfinite(lower):
                return False
            if system.unbalanced() <= self._tolerance:
                return lower <= phi
        return False

    def _respond(self, state: State) -> bool:
        """Write the linear response to the unbalanced load; return False where there is none or it is unstable."""
        system = self._system
        if system.assemble(state, project=False) >= 0 or not np.isfinite(system.evaluate(state)):
            return False
        if not system.factor():
            return False
        try:
            self._solution = -system.linear.solve(system.residual)
        except LinearError:
            return False
        system.reduction.moves(self._solution, system.lever, self._dx)
        return bool(np.isfinite(self._dx).all())

    def _furthest(self) -> float:
        return float(np.sqrt((self._dx**2).sum(axis=1).max()))
