"""Embedded estimate of the error of time steps: the error itself is carried along, by the factorisation at hand.

Every stage of the implicit schemes ends with x' = z + s v' and M (v' - u) / s = f(x', v'), z and u made of known
values. The exact motion fulfils both but for the defects tau of the scheme,

    X' = Z + s V' + tau_x,   V' = U + s M^-1 F(X', V') + tau_v,

so that the error e, exact minus computed, of a body with stiffness K, damping a M + C and a residual r of the
solver follows from one solve with the matrix A of the stage, w = M / s² + a M / s,

    A e_x' = (w + C / s) y + M (e_u + tau_v) / s - r,   A = w + K + C / s,   y = e_z + tau_x,   e_v' = (e_x' - y) / s,

e_z and e_u made of the errors as z and u are made of the values. The defects are those of the Taylor series, a = (v' -
u) / s and backward differences of it for j and dj/dt,

    implicit Euler   -h² / 2 (a, j)
    BDF2             -(1 + r) / (6 a_0 r) h³ (j, dj/dt),   r = h / h_before,  a_0 = (1 + 2 r) / (1 + r)
    TR-BDF2          -(g h)³ / 12 (j, dj/dt),  then  -(1 - g)² / (6 (2 - g)) h³ (j, dj/dt)

[HairerNorsettWanner1993, chapter III.2], [BankEtAl1985]. After a start j is not known, so the part of the first step
that comes of it, a change of e_v by -h² / 2 j, waits for the second. Nodes that servos drive or that are fixed have no
error.
"""

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.groups import Kind
from tripod_sim.copied import Copied
from tripod_sim.forces.anchor import Anchor
from tripod_sim.integrators import time_error_kernels as kernels
from tripod_sim.integrators.looking_back import G
from tripod_sim.linear.solver import LinearError
from tripod_sim.system_kernels import same

TR_BDF2 = float((-3 * G**2 + 4 * G - 2) / (12 * (2 - G)))
"""Of TR-BDF2's defect, times h³ j: the sum of those of its stages."""


@dataclass(frozen=True)
class TimeErrorReport:
    """How far the body is from where exact integration in time would have it, estimated.

    Attributes:
        effector: Distance of the effector's centre [m]; NaN in a scene without one.
        largest: Largest distance of a node [m]; NaN, as the effector's, where the estimate is local.
        node: That node; -1 where the estimate is local.
        added: Largest distance of a node that the worst part of this step added [m]; NaN where steps have a fixed
            length, which does not need it.
        ball: How far the ball in a maze would be from where it is [m] were its gravity larger by the accuracy asked
            for; NaN without either. Much more than the accuracy times its way: a wall decides where it is.
        vector: What the effector's centre lacks to where it would be [m]; None where only its length is known.
    """

    effector: float
    largest: float
    node: int
    added: float
    ball: float = np.nan
    vector: tuple[float, float, float] | None = None


@dataclass(eq=False)
class ErrorState(Copied):
    """What the estimate remembers from step to step.

    Attributes:
        error: e_x [m] and e_v [m/s] in the `Coordinates` of the transport, shape (2, n, k).
        before: Of BDF2 the errors a step earlier, of TR-BDF2 the rates of the errors, shape (2, n, k).
        velocities: At the end of the last step [m/s], shape (nodes, 3).
        accelerations: At the ends of the last two steps [m/s²], the latest first, shape (2, n, k).
        length: Time between these [s].
        known: How many of the accelerations are known.
        missing: Length of a first step whose part of the error that comes of j waits for the next step [s], else 0.
        proposed: Length of the next step, where the simulator chooses it [s]; 0 before the first.
        last: Error that the last step added, in parts of the tolerance.
        order: Of the scheme proposed for the next step, where the simulator chooses that, too; 0 before the first.
        still: Whether the last step left no error, and changed neither velocities nor accelerations.
    """

    error: FloatArray
    before: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    known: int = 0
    length: float = 0.0
    missing: float = 0.0
    proposed: float = 0.0
    last: float = 1.0
    order: int = 0
    still: bool = False

    def copy_to(self, other: "ErrorState") -> None:
        """As for others, but written out: each step does it."""
        other.error[:], other.before[:] = self.error, self.before
        other.velocities[:], other.accelerations[:] = self.velocities, self.accelerations
        other.known, other.length, other.missing = self.known, self.length, self.missing
        other.proposed, other.last, other.order = self.proposed, self.last, self.order
        other.still = self.still


class Coordinates(Protocol):
    """What errors are carried in: those of nodes, or of fewer modes.

    Attributes:
        shape: Of the errors, (n, k).
        negligible: Errors below this are none.
        corrects: Whether they take account of the forces that the solver has left over.
    """

    shape: tuple[int, int]
    negligible: float
    corrects: bool

    def accelerations(self, end: FloatArray, u: FloatArray, s: float, out: FloatArray) -> None:
        """Write (end - u) / s of what moves by itself to `out`; velocities of nodes [m/s], shape (nodes, 3)."""

    def stage(
        self, first: FloatArray, c1: float, second: FloatArray, c2: float, p: FloatArray, q: FloatArray, factor: float,
        s: float, left: FloatArray, begun: FloatArray, out: FloatArray,
    ) -> None:  # fmt: skip
        """Write what a stage starts from and the errors at its end (see `time_error_kernels.load`, `finish`).

        left: Of the unknowns, the force that the solver has left over [N].
        """

    def warm_up(self, begun: FloatArray, out: FloatArray) -> None:
        """Compile what a stage runs, where nothing is factored yet; both arrays are zero and stay so."""

    def effector(self, errors: FloatArray) -> tuple[float, float, float] | None:
        """Return the error of the effector's centre [m]; None in a scene without one."""

    def furthest(self, errors: FloatArray) -> tuple[float, int]:
        """Return the largest error of a node [m], and of which."""


class Nodes:
    """The errors of nodes (see `Coordinates`), carried by the factorisation of the system."""

    negligible, corrects = 0.0, True

    def __init__(self, system: Any, inertia: Anchor, mass: FloatArray) -> None:
        """As for `ErrorTransport`."""
        self._system, self._inertia, self._mass = system, inertia, mass
        self.shape = (len(mass), 3)
        self._moving = np.isin(system.reduction.kind, (Kind.FREE, Kind.RIGID))
        self._heavy = [t for t in getattr(system, "terms", ()) if t.has_inertia]
        self._reduced, self._torques = np.zeros(system.unknowns), np.zeros(len(system.torques))
        self._force, self._move = np.zeros(self.shape), np.zeros(self.shape)
        self._effector = system.groups.rigid[0] if system.groups.rigid else None

    def accelerations(self, end: FloatArray, u: FloatArray, s: float, out: FloatArray) -> None:
        """As in `Coordinates`."""
        kernels.accelerations(end, u, s, self._moving, out)

    def stage(
        self, first: FloatArray, c1: float, second: FloatArray, c2: float, p: FloatArray, q: FloatArray, factor: float,
        s: float, left: FloatArray, begun: FloatArray, out: FloatArray,
    ) -> None:  # fmt: skip
        """As in `Coordinates`."""
        system, force, inertia = self._system, self._force, self._inertia
        kernels.load(first, c1, second, c2, p, q, factor, self._mass, inertia.weight, s, begun, force)
        for term in self._heavy:
            term.add_inertia(begun[1] / s + inertia.per_mass * begun[0], force)
        if system.damped:
            system.add_rates(begun[0], force)
        system.reduction.gradient(force, self._reduced, self._torques)
        self._reduced -= left
        try:
            solution = system.linear.solve(self._reduced)
        except LinearError:
            solution = np.full_like(self._reduced, np.nan)
        system.reduction.moves(solution, system.lever, self._move)
        kernels.finish(self._move, begun, s, out)

    def warm_up(self, begun: FloatArray, out: FloatArray) -> None:
        """As in `Coordinates`."""
        mass, zero = self._mass, out[0]
        kernels.load(out, 1.0, out, 0.0, zero, zero, 0.0, mass, mass, 1.0, begun, self._force)
        kernels.finish(self._move, begun, 1.0, out)

    def effector(self, errors: FloatArray) -> tuple[float, float, float] | None:
        """As in `Coordinates`."""
        if self._effector is None:
            return None
        x, y, z = errors[self._effector].mean(axis=0).tolist()
        return x, y, z

    def furthest(self, errors: FloatArray) -> tuple[float, int]:
        """As in `Coordinates`."""
        largest, node = kernels.furthest(errors)
        return float(largest), int(node)


class ErrorTransport:
    """Carries the errors of one system along, stage by stage, with scratch of its own.

    Attributes:
        system, inertia: As given.
        local: Whether it measures `added`, too.
        carried: Whether it carries the errors along; else it measures `added` alone, and they stay zero.
        order: Of the last step in its length.
    """

    def __init__(
        self, system: Any, inertia: Anchor, mass: FloatArray, *, local: bool, carried: bool = True
    ) -> None:
        """Prepare.

        Args:
            system: A `System`, or what of one is used here.
            inertia: The system's.
            mass: Of nodes [kg], shape (n,).
            local, carried: What is asked for.
        """
        self.system, self.inertia = system, inertia
        self.local, self.carried = local, carried
        self.order, self._s = 1, 1.0
        self._left = np.zeros((2, system.unknowns))
        self._none = np.zeros(system.unknowns)
        self.carry_in(Nodes(system, inertia, mass))

    def carry_in(self, coordinates: Coordinates) -> None:
        """Carry errors in other coordinates from the next `start` on."""
        self._coordinates, shape = coordinates, coordinates.shape
        self._begun, self._middle, self._alone = (
            np.zeros((2, *shape)),
            np.zeros((2, *shape)),
            np.zeros((2, *shape)),
        )
        self._differences = np.zeros((3, *shape))

    def start(self, velocities: FloatArray) -> ErrorState:
        """Return the state without error at the start; `velocities`: there [m/s], shape (n, 3).

        The kernels compile here.
        """
        none = np.zeros((2, *self._coordinates.shape))
        state = ErrorState(none, none.copy(), velocities.copy(), none.copy())
        trial, v = state.copy(), velocities
        self._differ(trial, v, v, v, 1.0, 1.0)
        self._carries(trial, 0, 0.0, 1.0)
        self._coordinates.warm_up(self._begun, self._alone)
        self._measure_rates(trial, 1.0)
        self._vanished, self._nothing = False, self._reported(none[0], np.nan)
        return state

    @property
    def added(self) -> FloatArray:
        """e_x of the last step if it had started without error [m], shape (n, k)."""
        return self._alone[0]

    def keep_residual(self, stage: int) -> None:
        """Remember the force that the solver has left over in `stage`, 0 or 1, as long as it is at hand."""
        if self.carried and self._coordinates.corrects:
            self._left[stage] = self.system.residual

    def rests(self, state: ErrorState, start: FloatArray, end: FloatArray, h: float) -> bool:
        """Return whether a step as of `euler` from rest without errors changes no velocity: `state` is then carried."""
        if not (state.still and state.known == 2) or self.local or not same(start, end):
            return False
        state.length = h
        return True

    def euler(
        self, state: ErrorState, start: FloatArray, end: FloatArray, h: float, *, keep_rates: bool = False
    ) -> None:
        """Carry `state` over a step of implicit Euler.

        Args:
            state: Overwritten.
            start, end: Velocities at start and end of the step [m/s], shape (n, 3).
            h: [s].
            keep_rates: Whether `before` is to hold the rates of the errors at the end, else the errors at the start.
        """
        self._differ(state, start, end, start, h, h)
        if state.known == 1:  # the first step: j is known after the second
            state.missing = h
        factor = -(h**2) / 2
        if self._carries(state, 0, factor, h):
            state.before[:] = state.error
            self._stage(state.error, 1.0, state.error, 0.0, 0, factor, h, self._left[0], state.error)
            if keep_rates:
                self._measure_rates(state, h)
        if state.known == 1:  # for the choice of the length as if the acceleration had begun at zero
            np.divide(self._differences[0], h, out=self._differences[1])
        self.order = 1
        self._measure_added(0, factor, h)

    def bdf2(
        self, state: ErrorState, start: FloatArray, end: FloatArray, u: FloatArray, h: float, ratio: float
    ) -> None:
        """Carry `state` over a step of BDF2 with its `u` [m/s], `ratio` times as long as the step before."""
        a, b, c = (1 + 2 * ratio) / (1 + ratio), 1 + ratio, ratio**2 / (1 + ratio)
        self._differ(state, start, end, u, h, h / a)
        factor = -(h**3) * (1 + ratio) / (6 * a * ratio)
        if self._carries(state, 1, factor, h):
            self._middle[:] = state.error
            self._stage(
                state.error, b / a, state.before, -c / a, 1, factor, h / a, self._left[0], state.error
            )
            state.before[:] = self._middle
        self.order = 2
        self._measure_added(1, factor, h / a)

    def tr_bdf2(self, state: ErrorState, start: FloatArray, end: FloatArray, u: FloatArray, h: float) -> None:
        """Carry `state` over a step of TR-BDF2, whose second stage has the `u` [m/s].

        The residuals of its stages have been kept, as of the other schemes.
        """
        k, p = G * h / 2, 1 / (G * (2 - G))
        self._differ(state, start, end, u, h, k)
        first, second = -((G * h) ** 3) / 12, -((1 - G) ** 2) / (6 * (2 - G)) * h**3
        if self._carries(state, 1, first + second, h):
            middle, q = self._middle, (1 - G) ** 2 * p
            self._stage(state.error, 1.0, state.before, k, 1, first, k, self._left[0], middle)
            self._stage(middle, p, state.error, -q, 1, second, k, self._left[1], state.error)
            self._measure_rates(state, k)
        self.order = 2
        self._measure_added(1, TR_BDF2 * h**3, k)

    def would_add(self, order: int, h: float) -> float:
        """Return what a step of `h` [s] in place of the last would have added, as `largest_added` [m].

        order: 1 for implicit Euler, 2 for TR-BDF2. The matrix is that of the last step.
        """
        derivative, factor = (0, -(h**2) / 2) if order == 1 else (1, TR_BDF2 * h**3)
        self._measure_added(derivative, factor, self._s)
        return self.largest_added

    def report(self, state: ErrorState, added: float) -> TimeErrorReport:
        """Return the distances of `state`; `added`: as in the report [m]."""
        if not self.carried:
            return TimeErrorReport(np.nan, np.nan, -1, added)
        if self._vanished and not self.local:
            return self._nothing
        return self._reported(state.error[0], added)

    def _reported(self, errors: FloatArray, added: float) -> TimeErrorReport:
        largest, node = self._coordinates.furthest(errors)
        vector = self._coordinates.effector(errors)
        distance = math.hypot(*vector) if vector else np.nan
        return TimeErrorReport(distance, largest, node, added, vector=vector)

    @property
    def largest_added(self) -> float:
        """Largest distance of a node in `added` [m]."""
        return self._coordinates.furthest(self.added)[0]

    def _differ(
        self, state: ErrorState, start: FloatArray, end: FloatArray, u: FloatArray, h: float, s: float
    ) -> None:
        """Find a, j and dj/dt of a step that ends with a stage of `u` and `s`, and remember what the next one needs.

        Velocities at the start that somebody has changed are a new start.
        """
        self._s = s
        if not same(start, state.velocities):
            state.known, state.missing = 0, 0.0
        self._coordinates.accelerations(end, u, s, self._differences[0])
        state.still = kernels.differences(
            h, state.accelerations, state.length, state.known, self._differences
        )
        state.velocities[:] = end
        if self.carried and state.missing and state.known:
            state.error[1] -= state.missing**2 / 2 * self._differences[1]
            state.missing = 0.0
        state.length, state.known = h, min(state.known + 1, 2)

    def _carries(self, state: ErrorState, derivative: int, factor: float, h: float) -> bool:
        """Return whether a step of `h` [s] carries errors along; where all are negligible they become none.

        Its defects are `factor` times the derivatives of the acceleration from number `derivative` on.
        """
        p, q, limit = (
            self._differences[derivative],
            self._differences[derivative + 1],
            self._coordinates.negligible,
        )
        self._vanished = kernels.vanish(state.error, state.before, p, q, factor, h, limit)
        state.still = state.still and self._vanished
        return self.carried and not self._vanished

    def _stage(
        self, first: FloatArray, c1: float, second: FloatArray, c2: float, derivative: int, factor: float, s: float,
        left: FloatArray, out: FloatArray,
    ) -> None:  # fmt: skip
        """Write the errors at the end of a stage that starts from c1 `first` + c2 `second` to `out`.

        Its defects are `factor` times the derivatives of the acceleration from number `derivative` on.
        """
        p, q = self._differences[derivative], self._differences[derivative + 1]
        self._coordinates.stage(first, c1, second, c2, p, q, factor, s, left, self._begun, out)

    def _measure_rates(self, state: ErrorState, s: float) -> None:
        """Write the rates of the errors at the end of the last stage to `before`."""
        kernels.rates(state.error, self._begun, s, state.before)

    def _measure_added(self, derivative: int, factor: float, s: float) -> None:
        """Write `added` of a step with these defects."""
        if self.local:
            self._stage(self._alone, 0.0, self._alone, 0.0, derivative, factor, s, self._none, self._alone)
