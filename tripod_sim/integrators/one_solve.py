"""One evaluation of the elements a step, where that is enough.

Evaluating the elements is most of the work of a step, a linear solve a tenth of it. So a step is foreseen, evaluated
once and corrected:

    x1 = x - A^-1 g(x) - p,   m = A^-1 g(x1),   x2 = x1 - m,

p the forecast of `chord_predictor`. x1 misses about |m|, and the step ends there if that is below `near`: a length, and
for every node; what it misses is left to the next step. A is kept from an earlier pose, and every solve with it leaves
some part q of what it was to take away, known where a solve and what it left both are: q = |p + m| / |x1 - x|. So x2
misses about q |m|, and the step ends there if that is below `near`. The forces there are not evaluated but taken to be
in balance (`System.settle`); what that leaves out is of the order of q² and is seen by the evaluation of the next step.
Where x2 is not near enough it is evaluated and corrected in turn, as in Newton's method. The tangent is renewed in a
step where it halves neither the residual nor, where that is small, the correction (the natural monotonicity test for a
kept tangent, by Deuflhard, Newton Methods for Nonlinear Problems, 2004, section 2.1: in stiff directions the residual
may grow while the body comes nearer); before a step, where it is old and the last step ended with a correction. What is
renewed before a step can be renewed between steps (`Newton.renew`).
"""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.chord_predictor import ChordPredictor
from tripod_sim.integrators.newton import Newton, NewtonReport
from tripod_sim.state import State
from tripod_sim.system import System
from tripod_sim.system_kernels import largest


class OneSolve(Newton):
    """Newton's method that foresees, evaluates once and corrects."""

    OLD = 7
    """Steps that a tangent has served after which a step that has to be corrected is its last: as many evaluations cost
    what a new one does, and where it serves fewer, in fast motion, another one would soon be as bad."""

    TRUSTED = 0.5
    """Largest q with which a correction is one, and largest ratio of a correction to the step before it."""

    SMALL = 60
    """Steps up to this multiple of `near` are judged by corrections where residuals do not fall. A larger one may leave
    much in directions in which the kept tangent is too stiff, and corrections by it do not show that."""

    SWING = 0.005
    """Shorter steps are solved as much better [s]: an error of the position is one of the velocity, too, of as much
    over the step, which moves a body by 1 / w of its slowest mode times that (5 ms for the Tripod at work)."""

    def __init__(self, system: System, tolerance: float, max_iterations: int, near: float) -> None:
        """As `Newton`; `near`: how far any node may be from the solution of a step [m]."""
        super().__init__(system, tolerance, max_iterations)
        self.near = self._asked = near
        self._predictor = ChordPredictor(system.unknowns)
        self._forecast: FloatArray | None = None  # p, until it has been judged
        self._correction: FloatArray | None = None  # m, until it is used
        self._missed, self._far = np.zeros_like(system.rest), 0.0  # what m moves, and the largest of it [m]
        self._steps = self._age = 0

    def forget(self) -> None:
        """As `Newton.forget`."""
        super().forget()
        self._predictor.drop()

    def _begin(self, length: float | None) -> None:
        self._forecast, self._correction = self._predictor.forecast(length), None
        self._steps = 0
        if length and not self.store:  # who keeps several lengths says for each how near
            self.near = self._asked * min(1.0, length / self.SWING)

    def _renew(self, state: State, report: NewtonReport) -> float:
        self._predictor.drop()
        self._forecast = self._correction = None
        return super()._renew(state, report)

    def _serves(self, report: NewtonReport) -> bool:
        if not self._steps:
            self._predictor.drop()
        self._age = 0 if report.factorisations else self._age + 1
        return report.iterations <= 1 or self._age < self.OLD

    def _converges(self, size: float, before: float) -> bool:
        if size < self.TRUSTED * before:
            return True
        if not self._is_small():
            return False
        self._correct()
        foreseen = (
            self._steps == 1 and self._forecast is not None
        )  # then the forecast may be wrong, not the tangent
        return self._far < (1.0 if foreseen else self.TRUSTED) * self._moved

    def _is_small(self) -> bool:
        return self._moved <= self.SMALL * self.near

    def _correct(self) -> FloatArray:
        """Return the correction m of the state that was evaluated last, kept with how far it moves nodes [m]."""
        correction = self._correction = self._solve(self.system.residual)
        self.system.reduction.moves(correction, self.system.lever, self._missed)
        self._far = largest(self._missed)
        return correction

    def _proposed(self) -> FloatArray:
        self._steps += 1
        if self._correction is not None:
            correction, self._correction = self._correction, None
            return correction
        solution = self._solve(self.system.residual)
        if self._forecast is not None:
            solution += self._forecast
        return solution

    def _ends(self) -> bool:
        """Correct a state that is then near enough, and return True; else keep the correction for the next step."""
        if not self._steps:
            return False
        system, missed, size, before = self.system, self._missed, self._size, self._before
        correction = self._correct() if self._correction is None else self._correction
        far = self._far
        trusted = size < self.TRUSTED * before or (self._is_small() and far < self.TRUSTED * self._moved)
        if trusted and far <= self.near:
            if self._forecast is not None:
                self._predictor.note(correction)
            return True
        left = 0.0
        if self._forecast is not None:
            system.reduction.moves(self._forecast + correction, system.lever, missed)
            left = largest(missed)
            self._predictor.note(correction)
            self._forecast = None
            system.reduction.moves(correction, system.lever, missed)
        left = max(left, far)
        if not (trusted and left < self.TRUSTED * self._moved and left * far <= self.near * self._moved):
            return False
        self._report.iterations += 1
        np.negative(correction, out=correction)
        np.negative(missed, out=missed)
        system.move(self._state, correction, missed, 1.0, self._trial)
        system.settle(self._trial, correction, missed)
        self._trial.copy_to(self._state)
        return True
