"""Newton's method on the potential of one step of a system (see `minimise`).

The Hessian is made positive definite: first as it is; if it is not, with each point's tangent projected; then without
the second-order terms of rotations of rigid bodies, which are large where a command pulls hard at one that has not
moved yet; at last with a shift. A factorisation is kept while it still halves the residual (chord steps), also from one
solve to the next. Where the error of the time steps is known, so is what an exact solution is worth (`Newton.near`).
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.errors import UnsolvedError
from tripod_sim.integrators.minimise import Descent, minimise
from tripod_sim.linear.solver import LinearError
from tripod_sim.state import State
from tripod_sim.system import System
from tripod_sim.system_kernels import dot, largest, write_moves

if TYPE_CHECKING:  # what is absent is not imported
    from tripod_sim.forces.strain_bound import StrainBound
    from tripod_sim.integrators.factor_store import FactorStore


UNSOLVED, SWING = 0.005, 0.01
"""By what part of the error that a step may add its end may miss the solution of its equations, where the step takes
SWING [s] or longer. That is a velocity, too, of as much over h, which moves a body by 1 / w of its slowest mode times
that (5 ms for the Tripod at work): shorter steps are solved as much better."""


ROUNDING = 1e-13
"""A step that moves nodes by less than this share of the body's size is one of rounding."""


class NewtonError(UnsolvedError):
    """No solution was found; the message says why and where."""


@dataclass
class NewtonReport:
    """What a solve took.

    Attributes:
        iterations: Linear solves.
        factorisations: Hessians assembled and factored.
        residual: Unbalanced force at the end [N].
        increments: Of the load in statics, before Newton's method (see `load_steps`); 0 where none was needed.
        halvings: Times these were rolled back and halved.
        linear_iterations: Of conjugate gradients, where they tell.
        unstable: In statics: whether it ended where the tangent is indefinite.
        snapped: In statics: whether the load moved the body to another branch of equilibria (snap-through).
        parts: One: the state was advanced by a whole substep.
    """

    iterations: int = 0
    factorisations: int = 0
    residual: float = np.inf
    increments: int = 0
    halvings: int = 0
    linear_iterations: int = 0
    unstable: bool = False
    snapped: bool = False
    parts: int = 1


class Newton(Descent):
    """Moves a state to the minimum of its system's potential, with scratch of its own.

    Attributes:
        store: Keeps factorisations of several time steps; None keeps the last one only.
        near: A solve also ends where no coordinate of a node is further than this from its solution [m], estimated by
            |dx| q / (1 - q) with q what the last step dx left of the unbalanced force [HairerWanner1996, section IV.8].
            0 goes on to the tolerance.
        bound: Inequality that solves keep within; None without one.
        indefinite: Whether the tangent factored last had to be changed to be positive definite.
        serves: Whether the factorisation of the last solve is kept for the next.
        foresees: Whether a solve may begin where nodes are foreseen, `foreseen` [m], shape (n, 3); None: not known.
        spent: Linear solves so far, those of solves that failed among them.
        phi: See `Descent`; the point and the trial point are states.
    """

    _state: State
    _trial: State
    _report: NewtonReport
    _is_at_trial: bool
    """Whether the system was evaluated last at the trial state, else at the point."""
    _size: float
    _before: float
    """Residual at the point, and a step earlier, 0 if there was none [N]."""

    foresees = False
    foreseen: FloatArray | None = None

    FEW = 3
    """A factorisation that needed at most so many linear solves is kept for the next solve: one more chord step costs a
    fifth of a new factorisation."""

    def __init__(self, system: System, tolerance: float, max_iterations: int) -> None:
        """Solve for states of `system`.

        Args:
            system: The potential.
            tolerance: Unbalanced force [N] at which a state counts as solved.
            max_iterations: Linear solves before a solve is given up.
        """
        self.system, self.tolerance, self.max_iterations = system, tolerance, max_iterations
        self.bound: StrainBound | None = None
        self._dx, self._step = np.zeros_like(system.rest), np.zeros(system.unknowns)
        self._scratch: State | None = None
        self.serves = False
        self._kept: float | None = None
        self._ahead: float | None = None
        self.store: FactorStore | None = None
        self.near, self._moved = 0.0, 0.0
        self.spent = self._linear_spent = 0
        self.indefinite = False

    def forget(self) -> None:
        """Drop the factorisation kept from earlier solves, so that the next one depends on its state alone."""
        self._kept = self._ahead = None
        if self.store:
            self.store.forget()
        self.system.forget()

    def keep_several(self) -> None:
        """Keep factorisations of several time steps from now on."""
        from tripod_sim.integrators.factor_store import FactorStore  # noqa: PLC0415 - steps of changing length

        self.store = FactorStore(self.system)

    def allow(self, error: float, length: float) -> None:
        """End solves of steps of `length` [s] where an `error` [m] that these may add makes an exact one worth nothing.

        Needs `keep_several`.
        """
        self.near = UNSOLVED * error * min(1.0, length / SWING)

    def renews(self, keep: float) -> bool:
        """Return whether the next solve, of the time step `keep` [s], would begin with a factorisation."""
        return not self.store and keep not in (self._kept, self._ahead)

    def renew(self, state: State, keep: float) -> None:
        """Factor now as a solve from `state` would begin, of the time step `keep` [s] that the system is aimed at."""
        self._kept = None
        if self.factor_at(state):
            self._ahead = keep

    def factor_at(self, state: State) -> bool:
        """Factor at `state`, and keep that for no solve; return whether it could be: the next solve says why not."""
        try:
            self._renew(state, NewtonReport())
        except NewtonError:
            return False
        return True

    def solve(
        self, state: State, joints: FloatArray, *, keep: float | None = None, factored: bool = False
    ) -> NewtonReport:
        """Move `state` to equilibrium with its driven frames at `joints`, in place.

        The first step carries the driven nodes along with the linearised response of all others, so that the
        clamped elements do not take the whole move.

        Args:
            state: Where the body is.
            joints: Angles [rad] and slide [m] to reach, shape (s + 1,).
            keep: The time step [s] that the Hessian belongs to: the factorisation of an earlier solve with the
                same one serves again while it needs few iterations. None renews it.
            factored: Whether the system has just been factored at `state`, positive definite as it is.

        Raises:
            NewtonError: an element turned inside out, or no convergence; `state` is then in between.
        """
        if self._scratch is None:
            self._scratch = trial = state.copy()
            trial.errors = trial.way = trial.ball = trial.servos = None  # no part of a trial
        trial, report, linear_spent = self._scratch, NewtonReport(), self._linear_spent
        self._state, self._trial, self._report, self._is_at_trial = state, trial, report, False
        self.system.command(joints)
        state.copy_to(trial)
        self._dx[:] = 0.0
        kept = self.store.use(keep) if self.store and keep else keep is not None and keep == self._kept
        ahead = not kept and keep is not None and keep == self._ahead and self.system.knows(state)
        self._kept = self._ahead = None
        at_hand = kept or ahead or factored
        self.phi = self.system.evaluate(state) if at_hand else self._renew(state, report)
        if not math.isfinite(self.phi):
            raise NewtonError(f"{self._culprit(state)} at the start of the step")
        report.factorisations += ahead or factored
        self.indefinite &= not factored
        driven = self.system.moves_frames(state.joints, joints)
        if driven:
            self.system.drive(trial, joints)
            self._add_drive(state, trial)
        self._size, self._before = self.system.unbalanced(), 0.0
        self._begin(keep)
        if driven:
            self._drive()
        self._start()
        try:
            minimise(self)
        except NewtonError as error:
            error.remedy = self.system.runaway() or error.remedy
            raise
        state.joints[:] = joints
        report.residual = self._size
        report.linear_iterations = self._linear_spent - linear_spent
        self.serves = self._serves(report)
        if self.serves:
            self._kept = keep
            if self.store and keep:
                self.store.keep(keep)
        return report

    def _begin(self, length: float | None) -> None:
        """Begin to solve a step of `length` [s]."""

    def _start(self) -> None:
        """Choose where to begin, driven nodes being where they are to be."""

    @property
    def _renews_always(self) -> bool:
        """Whether a kept Hessian is worth nothing: it soon is out of date, and solving with it costs as much."""
        return not self.system.elastic.lasting and self.system.linear.iterates

    def _serves(self, report: NewtonReport) -> bool:
        """Return whether the factorisation at hand is good enough for the next solve."""
        return not self._renews_always and report.iterations <= self.FEW

    def _add_drive(self, state: State, trial: State) -> None:
        """Add to the residual at `state` what the move of the driven nodes to `trial` makes of it, to first order."""
        write_moves(self.system.driven, state.positions, trial.positions, self._dx)
        self.system.add_driven(self._dx)

    def _drive(self) -> None:
        """Make the step that moves the driven nodes."""
        phi = self.walk(self.propose(), 1.0)
        if not math.isfinite(phi):
            raise NewtonError(f"{self._culprit(self._trial)} while the servos moved it")
        self.take(phi, 1.0)
        self._dx[:] = 0.0

    def ends(self) -> bool:
        """Return whether the residual is below the tolerance, or the point is near."""
        if self._size <= self.tolerance or self._ends():  # NaN is unsolved
            return True
        if self._report.iterations >= self.max_iterations:
            raise NewtonError(
                f"unbalanced force {self._size:.3g} N above {self.tolerance:g} N after {self._report.iterations} "
                f"iterations, largest at {self._largest()}",
                self._rounding()
                or f"solver.max_iterations is {self.max_iterations}; a smaller dt or a slower motion may help",
            )
        return False

    def holds(self) -> bool:
        """Return whether the factorisation at hand is worth a chord step."""
        return not (self._renews_always and self._report.iterations)

    def factor(self) -> None:
        """Assemble and factor, positive definite; leave gradient and residual of the point."""
        self.phi = self._renew(self._state, self._report)
        self._size, self._is_at_trial = self.system.unbalanced(), False

    def propose(self) -> FloatArray:
        """Return the step to make."""
        self._report.iterations += 1
        self.spent += 1
        return self._proposed()

    def walk(self, p: FloatArray, share: float) -> float:
        """Write the trial state, and gradient and residual there."""
        system = self.system
        if self._is_at_trial:
            system.evaluate(self._state)
        self._aim_modes()
        np.negative(p, out=self._step)
        system.reduction.moves(self._step, system.lever, self._dx)
        if self.near:
            self._moved = largest(self._dx)
        system.move(self._state, self._step, self._dx, share, self._trial)
        self._is_at_trial = True
        return system.evaluate(self._trial)

    def _aim_modes(self) -> None:
        """Let the modes take their part in the step that was proposed; the evaluation at the point has seen to it."""

    def slope(self, p: FloatArray, *, trial: bool) -> float:
        """Return residual . p, of the state that was evaluated last."""
        return dot(self.system.residual, p)

    def left(self) -> float:
        """Return the residual of the trial state over that of the point."""
        return self.system.unbalanced() / self._size

    def converges(self) -> bool:
        """Return whether chord steps are worth going on."""
        return self._converges(self.system.unbalanced(), self._size)

    def slack(self) -> float:
        """Rounding of the potential [J]."""
        return 1e-12 * max(abs(self.phi), 1e-6)

    def take(self, phi: float, share: float) -> None:
        """Let the trial state be the point."""
        self._trial.copy_to(self._state)
        self.phi, self._before, self._size = phi, self._size, self.system.unbalanced()
        self._is_at_trial = False

    def rests(self, *, fresh: bool) -> bool:
        """Return whether rounding of positions alone is left of the residual."""
        if fresh:
            rounding = self._rounding()
            where = "" if rounding else f"; {self._culprit(self._trial)}"
            raise NewtonError(
                f"the energy falls along no direction, at an unbalanced force of {self._size:.3g} N{where}",
                rounding,
            )
        rests = self._size <= self.tolerance + self.system.rounding(self._state)  # no step leaves less
        if rests:
            self.system.evaluate(self._state)
        return rests

    def _ends(self) -> bool:
        """Return whether the solution is within `near`, a step having changed `_before` [N] to `_size` [N]."""
        size, before = self._size, self._before
        return self.near > 0 and size < 0.5 * before and self._moved * size <= self.near * (before - size)

    def _converges(self, size: float, before: float) -> bool:
        """Return whether steps with a kept factorisation, the last from `before` to `size` [N], are worth going on."""
        return size < 0.5 * before

    def _renew(self, state: State, report: NewtonReport) -> float:
        """Assemble and factor at `state`, positive definite; leave gradient and residual of `state`; return Phi."""
        system = self.system
        phi = np.inf
        report.factorisations += 1
        for project in (False, True):
            if system.assemble(state, project=project) >= 0:
                continue
            phi = system.evaluate(state)
            if math.isfinite(phi) and system.factor():
                self.indefinite = project
                return phi
        self.indefinite = True
        if not math.isfinite(phi):
            raise NewtonError(f"{self._culprit(state)} at the start of the step")
        if system.reduction.bodies and system.factor(curved=False):
            return phi
        shift = 1e-8 * system.elastic.largest_stiffness()
        for _ in range(4):
            if system.factor(shift):
                return phi
            shift *= 100
        raise NewtonError("the stiffness matrix is singular: is a part of the body held by nothing?")

    def _proposed(self) -> FloatArray:
        """Return the step to make, with its sign turned, shape (unknowns,): an array of the caller's own."""
        return self._solve(self.system.residual)

    def _solve(self, b: FloatArray) -> FloatArray:
        """Return A^-1 b, or raise NewtonError where the linear solver gives up."""
        linear = self.system.linear
        try:
            solution = linear.solve(b)
            self._linear_spent += linear.iterations
            return solution
        except LinearError as error:
            raise NewtonError(str(error)) from error

    def _rounding(self) -> str:
        """Return in words whether the last step was one of rounding, so that no solve leaves less; empty if not."""
        size = float(np.ptp(self.system.rest, axis=0).max())
        if not largest(self._dx) <= ROUNDING * size:
            return ""
        return f"rounding errors are as large; set solver.tolerance above {self.tolerance:g} N"

    def _culprit(self, state: State) -> str:
        return self.system.elastic.culprit(state.positions, state.modes)

    def _largest(self) -> str:
        return self.system.reduction.unknown_name(int(np.argmax(np.abs(self.system.residual))))
