"""One step of Newton's method for each stage, with the tangent at its start: for bodies whose tangent changes fast."""

from tripod_sim.integrators.newton import Newton, NewtonReport
from tripod_sim.state import State


class OneNewtonStep(Newton):
    """Makes one step of Newton's method where its full length goes down the potential; else solves as `Newton`.

    A factorisation is never kept: by that of an earlier pose one step leads springs astray.
    """

    def _serves(self, report: NewtonReport) -> bool:
        """Return that the next solve renews the factorisation."""
        return False

    def _descend(
        self, state: State, trial: State, phi: float, size: float, report: NewtonReport, before: float
    ) -> None:  # fmt: skip
        """Make one step from an evaluated `state`; go on as `Newton` where that does not go down."""
        if size > self.tolerance:
            if self._step(state, trial, report) <= phi + self._slack(phi):
                trial.copy_to(state)
                report.residual = self.system.unbalanced()
                return
            self.system.evaluate(state)
        super()._descend(state, trial, phi, size, report, before)
