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

    def _begin(self, length: float | None) -> None:
        """Begin with one step."""
        self._is_one, self._done = True, False

    def _renew(self, state: State, report: NewtonReport) -> float:
        """As `Newton`, of which all further steps are."""
        self._is_one = False
        return super()._renew(state, report)

    def _converges(self, size: float, before: float) -> bool:
        """Return True for the first step, which need not."""
        return self._is_one or super()._converges(size, before)

    def take(self, phi: float, share: float) -> None:
        """Take the step, which is enough if it is the first."""
        super().take(phi, share)
        self._done = self._is_one

    def _ends(self) -> bool:
        """Return whether the one step has been made."""
        return self._done or super()._ends()
