"""One evaluation of the elements a step, where that is enough.

Evaluating the elements is most of the work of a step, a linear solve a tenth of it. So a step is foreseen, evaluated
once and corrected:

    x1 = x - A^-1 g(x) - p,   m = A^-1 g(x1),   x2 = x1 - m,

p the forecast of `left_over`. x1 misses about |m|, and the step ends there if that is below `near`: a length, and for
every node; what it misses is left to the next step. A is kept from an earlier pose, and every solve with it leaves some
part q of what it was to take away, known where a solve and what it left both are: q = |p + m| / |x1 - x|. So x2 misses
about q |m|, and the step ends there if that is below `near`. The forces there are not evaluated but taken to be in
balance (`System.settle`); what that leaves out is of the order of q² and is seen by the evaluation of the next step.
Where x2 is not near enough it is evaluated and corrected in turn, as in Newton's method. The tangent is renewed in a
step where it does not halve the residual; before a step, where that is foreseen from what the last two missed, or where
further evaluations, beyond those that a new tangent needs, have cost as much as it does. What is renewed before a step
can be renewed between steps (`Newton.renew`).
"""

import numpy as np

from tripod_sim.integrators.left_over import LeftOver
from tripod_sim.integrators.newton import FloatArray, Newton, NewtonReport
from tripod_sim.state import State
from tripod_sim.system import System
from tripod_sim.system_kernels import largest


class OneSolve(Newton):
    """Newton's method that foresees, evaluates once and corrects."""

    WORTH = 5
    """Further evaluations that cost as much as a new tangent."""

    SOON, LEAST, SETTLED = 0.6, 0.03, 20
    """What a corrected step misses, over `near`, grows geometrically as the pose leaves that of the tangent. A next
    value above SOON lets the next step begin with a new tangent, which can be made ahead of time: else it would need
    that after an evaluation for nothing. LEAST stands for the value where x1 was near enough. A tangent that has served
    fewer than SETTLED steps is kept: in motions so fast another one would soon be as bad."""

    TRUSTED = 0.5
    """Largest q with which a correction is one."""

    SWING = 0.005
    """Shorter steps are solved as much better [s]: an error of the position is one of the velocity, too, of as much
    over the step, which moves a body by 1 / w of its slowest mode times that (5 ms for the Tripod at work)."""

    def __init__(self, system: System, tolerance: float, max_iterations: int, near: float) -> None:
        """As `Newton`; `near`: how far any node may be from the solution of a step [m]."""
        super().__init__(system, tolerance, max_iterations)
        self.near = self._asked = near
        self._left_over = LeftOver(system.unknowns)
        self._forecast: FloatArray | None = None  # p, until it has been judged
        self._correction: FloatArray | None = None  # m, until it is used
        self._missed = np.zeros_like(system.rest)
        self._steps = self._needed = self._spent = 0
        self._missing, self._tired, self._age = self.LEAST, False, 0

    def forget(self) -> None:
        """As `Newton.forget`."""
        super().forget()
        self._left_over.drop()
        self._needed = self._spent = 0

    def _begin(self, length: float | None) -> None:
        self._forecast, self._correction = self._left_over.forecast(length), None
        self._steps, self._tired = 0, False
        if length and not self.store:  # who keeps several lengths says for each how near
            self.near = self._asked * min(1.0, length / self.SWING)

    def _renew(self, state: State, report: NewtonReport, *, start: bool = False) -> float:
        self._left_over.drop()
        self._forecast = self._correction = None
        return super()._renew(state, report, start=start)

    def _serves(self, report: NewtonReport) -> bool:
        if not self._steps:
            self._left_over.drop()
        if report.factorisations:
            self._needed, self._spent, self._age = max(1, self._steps), 0, 0
        else:
            self._spent += max(0, self._steps - self._needed)
            self._age += 1
        return self._spent < self.WORTH and not self._tired

    def _proposed(self) -> FloatArray:
        self._steps += 1
        if self._correction is not None:
            correction, self._correction = self._correction, None
            return correction
        solution = self._solve()
        if self._forecast is not None:
            solution += self._forecast
        return solution

    def _ends(self, state: State, trial: State, size: float, before: float, report: NewtonReport) -> bool:
        """Correct a state that is then near enough, and return True; else keep the correction for the next step."""
        if not self._steps:
            return False
        system, missed = self.system, self._missed
        correction = self._correction = self._solve()
        system.reduction.moves(correction, system.lever, missed)
        far = largest(missed)
        if size < self.TRUSTED * before and far <= self.near:
            if self._forecast is not None:
                self._left_over.note(correction)
            self._missing = self.LEAST
            return True
        left = 0.0
        if self._forecast is not None:
            system.reduction.moves(self._forecast + correction, system.lever, missed)
            left = largest(missed)
            self._left_over.note(correction)
            self._forecast = None
            system.reduction.moves(correction, system.lever, missed)
        left = max(left, far)
        trusted = size < self.TRUSTED * before and left < self.TRUSTED * self._moved
        if not (trusted and left * far <= self.near * self._moved):
            return False
        missing = max(left * far / (self.near * self._moved), self.LEAST)
        self._tired = self._age >= self.SETTLED and missing**2 > self.SOON * self._missing
        self._missing = missing
        report.iterations += 1
        np.negative(correction, out=correction)
        np.negative(missed, out=missed)
        system.move(state, correction, missed, 1.0, trial)
        system.settle(trial, correction, missed)
        trial.copy_to(state)
        return True
