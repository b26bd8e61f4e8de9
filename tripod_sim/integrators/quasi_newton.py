"""Newton's method with a factorisation that serves many steps, since it takes as long as many evaluations.

- It turns with the body (see `turning`); incompatible modes are unknowns beside the nodes, with their condensations.
- The limited-memory BFGS method improves it by what the last steps of a solve found [LiuEtAl2017],
  [NocedalWright2006, section 7.2]: steps go down the potential, since A stays positive definite.
- A solve begins where the acceleration of the last step leads to, if the potential is lower there.
- It is renewed once the solves since then have taken as many steps more than the first as take its time: that is at
  most twice what would be best [KarlinEtAl1988].
"""

import math

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.newton import Newton, NewtonReport
from tripod_sim.integrators.turning import Rotations, TurningSolver
from tripod_sim.state import State
from tripod_sim.system import System

PAIRS = 12
"""Steps of a solve that are remembered."""

LEAST, MOST = 8.0, 60.0
"""Steps that take the time of a factorisation, whatever the linear solver: elements take a part of both."""

CURVED = 1e-10
"""Cosine between a step and the change of the gradient from which on it is remembered: the potential curves up."""


class QuasiNewton(Newton):
    """Moves a state to the minimum of a potential with a factorisation of an earlier time step."""

    foresees = True

    def __init__(self, system: System, tolerance: float, max_iterations: int) -> None:
        """As `Newton`."""
        super().__init__(system, tolerance, max_iterations)
        self._rotations = Rotations.of_own_mesh(system)
        self._solids = [term for term in system.elastic.terms if term.solid]
        self._modes = system.elastic.has_modes
        self._turning: TurningSolver | None = None
        self._turned: list[FloatArray] = []  # rotations of elements that their condensations know
        self._pairs: list[tuple[FloatArray, FloatArray, float]] = []
        self._begun: tuple[FloatArray, FloatArray] | None = None  # p and the gradient where it was proposed
        self._of_modes = np.zeros(0)  # their part of the step that was proposed
        self._steps = 0  # since the factorisation, or the begin of the solve
        self._first: int | None = None  # steps that the first solve with the factorisation took
        self._extra = 0  # those that later ones took beyond that

    def _turn(self, state: State) -> None:
        """Let the factorisation turn with the body in `state`."""
        system = self.system
        if self._turning is None or system.linear is not self._turning:
            system.linear = self._turning = TurningSolver(system.linear.rough(), system.unknowns)
        self._turning.turn(self._rotations.at(state))

    def _turn_modes(self, state: State) -> None:
        """Let the condensations of elements turn with these in `state`."""
        now = self._rotations.of_elements(state)
        for term, new, old in zip(self._solids, now, self._turned, strict=True):
            term.turn_modes(new @ old.transpose(0, 2, 1))
        self._turned = now
        self.system.known_no_more()

    def _renew(self, state: State, report: NewtonReport) -> float:
        self._turn(state)
        self._restart()
        self._first, self._extra = None, 0
        if self._modes:
            self._turned = self._rotations.of_elements(state)
        return super()._renew(state, report)

    def _restart(self) -> None:
        """Drop what steps have found about the tangent."""
        self._pairs.clear()
        self._begun, self._steps = None, 0

    def _begin(self, length: float | None) -> None:
        self._restart()

    def _drive(self) -> None:
        super()._drive()
        self._begun = None  # the gradient knew the driven nodes at their places to be

    def _start(self) -> None:
        """Begin where nodes are foreseen, if the potential is lower there, with the tangent turned to it."""
        foreseen, self.foreseen = self.foreseen, None
        if self._size <= self.tolerance:
            return
        at = self._state
        if foreseen is not None and not self.system.reduction.bodies:
            at = self._foresee(foreseen)
        self._turn(at)
        if self._modes:
            self._turn_modes(at)
        elif at is self._state:
            return
        if at is self._trial and (phi := self.system.evaluate(at)) < self.phi:
            self.take(phi, 1.0)
            self._steps, self._before = 0, 0.0
        else:
            self.phi = self.system.evaluate(self._state)
            self._size = self.system.unbalanced()

    def _foresee(self, places: FloatArray) -> State:
        """Return a state with all nodes that nothing holds at `places` [m], shape (n, 3), and the modes that follow."""
        state, trial, system = self._state, self._trial, self.system
        state.copy_to(trial)
        free = system.reduction.free
        trial.positions[free] = places[free]
        pinned = tuple(system.groups.pinned.T)
        trial.positions[pinned] = state.positions[pinned]
        if self._modes:
            self._dx[:] = trial.positions - state.positions
            system.elastic.offset_modes(np.zeros_like(system.elastic.mode_gradient))
            system.elastic.advance_modes(state.modes, self._dx, 1.0, trial.modes)
            self._dx[:] = 0.0
        return trial

    def holds(self) -> bool:
        """Return whether steps with the factorisation at hand are worth going on."""
        return super().holds() and self._steps < self._worth

    @property
    def _worth(self) -> float:
        """How many steps take the time of a factorisation."""
        return min(max(self.system.linear.solves_a_factor, LEAST), MOST)

    def _converges(self, size: float, before: float) -> bool:
        """Return True: what goes down is a step nearer, though forces in stiff directions may grow."""
        return True

    def _serves(self, report: NewtonReport) -> bool:
        if self._renews_always:
            return False
        if self._first is None:
            self._first = report.iterations
        self._extra += max(0, report.iterations - self._first)
        return self._extra < self._worth

    def _gradient(self) -> FloatArray:
        """Return the gradient where the system was evaluated last: of the unknowns, then of the modes."""
        residual = self.system.residual
        return (
            np.concatenate([residual, self.system.elastic.mode_gradient]) if self._modes else residual.copy()
        )

    def _proposed(self) -> FloatArray:
        gradient, count = self._gradient(), self.system.unknowns
        q, shares = gradient.copy(), []
        for s, y, curvature in reversed(self._pairs):
            shares.append((s @ q) / curvature)
            q -= shares[-1] * y
        p = self._solve(q[:count])
        if self._modes:
            p = np.concatenate([p, self.system.elastic.solve_modes(q[count:])])
        for (s, y, curvature), share in zip(self._pairs, reversed(shares), strict=True):
            p += (share - (y @ p) / curvature) * s
        self._begun, self._of_modes = (p, gradient), p[count:]
        return p[:count]

    def _aim_modes(self) -> None:
        if self._modes:
            self.system.elastic.offset_modes(self._of_modes)

    def slope(self, p: FloatArray, *, trial: bool) -> float:
        """As `Newton.slope`, with the part of the modes."""
        found = super().slope(p, trial=trial)
        return found + float(self.system.elastic.mode_gradient @ self._of_modes) if self._modes else found

    def take(self, phi: float, share: float) -> None:
        """As `Newton.take`; learn how the gradient changed along the step."""
        super().take(phi, share)
        self._steps += 1
        if self._begun:
            p, before = self._begun
            s, y = -share * p, self._gradient() - before
            curvature = float(s @ y)
            if curvature > CURVED * math.sqrt(float(s @ s) * float(y @ y)):
                self._pairs.append((s, y, curvature))
                del self._pairs[:-PAIRS]
        self._begun = None
