"""Embedded estimate of the error of time steps: the error itself is carried along, by the factorisation at hand.

Every stage of the implicit schemes ends with x' = z + s v' and M (v' - u) / s_f = f(x', v'), z and u made of known
values (see `scheme`). The exact motion fulfils both but for the defects tau of the stage,

    X' = Z + s V' + tau_x,   V' = U + s_f M^-1 F(X', V') + tau_v,

so that the error e, exact minus computed, of a body with stiffness K, damping a M + C and a residual r of the
solver follows from one solve with the matrix A of the stage, w = M / (s s_f) + a M / s,

    A e_x' = (w + C / s) y + M (e_u + tau_v) / s_f - r,   A = w + K + C / s,   y = e_z + tau_x,   e_v' = (e_x' - y) / s,

e_z and e_u made of the errors as z and u are made of the values. The defects, which the stages have, are those of the
Taylor series: multiples of a = (v' - u) / s_f, or of backward differences of it, j and dj/dt. After a start j is not
known, so the part of the first step that comes of it, a change of e_v by -h² / 2 j, waits for the second. Nodes that
servos drive or that are fixed have no error.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.groups import Kind
from tripod_sim.forces.anchor import Anchor
from tripod_sim.integrators import time_error_kernels as kernels
from tripod_sim.integrators.history import write_history, write_known
from tripod_sim.integrators.refined_solver import RefinedSolver
from tripod_sim.integrators.scheme import Curve, Defect, ImplicitScheme, Stage, euler_stage, total_defect
from tripod_sim.linear.solver import LinearError
from tripod_sim.state import ErrorState
from tripod_sim.system_kernels import same


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


NO_CURVE = Curve()


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
        self, begun: FloatArray, p: FloatArray, q: FloatArray, defect: Defect, stage: Stage, left: FloatArray,
        out: FloatArray,
    ) -> None:  # fmt: skip
        """Write the errors at the end of a stage (see `time_error_kernels.load`, `finish`).

        begun: e_z and e_u; the defects, its factors times `p` and `q`, are added to them.
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
        self._heavy = [t for t in system.terms if t.has_inertia]
        self._reduced, self._torques = np.zeros(system.unknowns), np.zeros(len(system.torques))
        self._force, self._move = np.zeros(self.shape), np.zeros(self.shape)
        self._effector = system.groups.rigid[0] if system.groups.rigid else None
        own = not (system.elastic.lasting or system.groups.rigid)
        self._linear = RefinedSolver(system) if own else None

    def accelerations(self, end: FloatArray, u: FloatArray, s: float, out: FloatArray) -> None:
        """As in `Coordinates`."""
        kernels.accelerations(end, u, s, self._moving, out)

    def stage(
        self, begun: FloatArray, p: FloatArray, q: FloatArray, defect: Defect, stage: Stage, left: FloatArray,
        out: FloatArray,
    ) -> None:  # fmt: skip
        """As in `Coordinates`."""
        system, force, inertia, s = self._system, self._force, self._inertia, stage.s
        kernels.load(p, q, defect.x, defect.v, self._mass, inertia.weight, stage.s_force, begun, force)
        for term in self._heavy:
            term.add_inertia(begun[1] / stage.s_force + inertia.per_mass * begun[0], force)
        if system.damped:
            system.add_rates(begun[0], force)
        system.reduction.gradient(force, self._reduced, self._torques)
        self._reduced -= left
        try:
            solution = (
                self._linear.solve(self._reduced) if self._linear else system.linear.solve(self._reduced)
            )
        except LinearError:
            solution = np.full_like(self._reduced, np.nan)
        system.reduction.moves(solution, system.lever, self._move)
        kernels.finish(self._move, begun, s, out)

    def warm_up(self, begun: FloatArray, out: FloatArray) -> None:
        """As in `Coordinates`."""
        mass, zero = self._mass, out[0]
        kernels.load(zero, zero, 0.0, 0.0, mass, mass, 1.0, begun, self._force)
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
        self.order, self._last = 1, euler_stage(1.0)
        self._left: list[FloatArray] = []
        self._none = np.zeros(system.unknowns)
        self.carry_in(Nodes(system, inertia, mass))

    def carry_in(self, coordinates: Coordinates) -> None:
        """Carry errors in other coordinates from the next `start` on."""
        self._coordinates, shape = coordinates, coordinates.shape
        self._begun, self._ended, self._alone = (
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
        past = np.zeros((3, *none.shape))
        state = ErrorState(none, past, velocities.copy(), none.copy())
        trial, v = state.copy(), velocities
        self._differ(trial, v, v, v, 1.0, self._last)
        self._carries(trial, Defect(0, 0.0, 0.0), 1.0)
        self._coordinates.warm_up(self._begun, self._alone)
        self._know(trial, self._last)
        self._note(trial, self._begun, self._last)
        self._vanished, self._nothing = False, self._reported(none[0], np.nan)
        return state

    @property
    def added(self) -> FloatArray:
        """e_x of the last step if it had started without error [m], shape (n, k)."""
        return self._alone[0]

    def keep_residual(self, stage: int) -> None:
        """Keep the residual force of stage number `stage` while it is available."""
        if self.carried and self._coordinates.corrects:
            if stage == len(self._left):
                self._left.append(np.zeros_like(self._none))
            self._left[stage][:] = self.system.residual

    def rests(self, state: ErrorState, start: FloatArray, end: FloatArray, h: float) -> bool:
        """Return whether a step from rest without errors changes no velocity: `state` is then carried over it."""
        if not (state.still and state.known == 2) or self.local or not same(start, end):
            return False
        state.length = h
        return True

    def carry(
        self,
        state: ErrorState,
        stages: Sequence[Stage],
        start: FloatArray,
        end: FloatArray,
        u: FloatArray,
        h: float,
    ) -> None:
        """Carry `state` over a step whose residuals have been kept.

        Args:
            state: Overwritten.
            stages: Of the step.
            start, end: Velocities at start and end of the step [m/s], shape (n, 3).
            u: Of the last stage [m/s], shape (n, 3).
            h: Length of the step [s].
        """
        last, total = stages[-1], total_defect(stages)
        if self.rests(state, start, end, h):
            return
        self._differ(state, start, end, u, h, last)
        if last.begins and state.known == 1:  # the first step: j is known after the second
            state.missing = h
        if self._carries(state, total, h):
            for k, stage in enumerate(stages):
                assert stage.defect
                self._know(state, stage)
                left = self._left[k] if self._coordinates.corrects else self._none
                self._stage(stage, stage.defect, left, self._ended)
                self._note(state, self._ended, stage)
        if (
            last.begins and state.known == 1
        ):  # for the choice of the length as if the acceleration had begun at zero
            np.divide(self._differences[0], h, out=self._differences[1])
        self.order = total.derivative + 1
        self._measure_added(total, last)

    def would_add(self, scheme: ImplicitScheme, h: float) -> float:
        """Return what a step of `h` [s] of a scheme in place of the last would have added, as `largest_added` [m].

        The matrix is that of the last step.
        """
        self._measure_added(scheme.defect(h), self._last)
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
        self, state: ErrorState, start: FloatArray, end: FloatArray, u: FloatArray, h: float, last: Stage
    ) -> None:
        """Find a, j and dj/dt of a step that ends with the stage `last` of `u`, and remember what the next one needs.

        Velocities at the start that somebody has changed are a new start.
        """
        self._last = last
        if not same(start, state.velocities):
            state.known, state.missing, state.behind = 0, 0.0, 0.0
        behind = 0.0
        if last.curves and not last.begins:  # where A trembles in fast modes the mean of the step does less
            self._coordinates.accelerations(end, start, h, self._differences[0])
            behind = 0.5 * h
        else:
            self._coordinates.accelerations(end, u, last.s_force, self._differences[0])
        between, state.behind = state.behind + h - behind, behind
        state.still = kernels.differences(
            between, state.accelerations, state.length, state.known, self._differences
        )
        state.velocities[:] = end
        if self.carried and state.missing and state.known:
            late = state.missing**2 / 2 * self._differences[1]
            state.error[1] -= late
            state.before[0, 1] -= late
            state.before[2, 1] += last.lag * state.missing * self._differences[1]
            state.missing = 0.0
        state.length, state.known = between, min(state.known + 1, 2)

    def _carries(self, state: ErrorState, defect: Defect, h: float) -> bool:
        """Return whether a step of `h` [s] carries errors along; where all are negligible they become none."""
        p, q, limit = *self._derivatives(defect), self._coordinates.negligible
        self._vanished = kernels.vanish(state.error, state.before, p, q, defect.x, defect.v, h, limit)
        state.still = state.still and self._vanished
        return self.carried and not self._vanished

    def _derivatives(self, defect: Defect) -> tuple[FloatArray, FloatArray]:
        """Return what the factors of a defect multiply."""
        return self._differences[defect.derivative], self._differences[defect.derivative + 1]

    def _know(self, state: ErrorState, stage: Stage) -> None:
        """Write e_z and e_u of a stage to `_begun`."""
        change, rate, curve = state.before
        for k, weights in enumerate((stage.position, stage.velocity)):
            write_known(state.error[k], change[k], rate[k], curve[k], weights, self._begun[k])

    def _note(self, state: ErrorState, after: FloatArray, stage: Stage) -> None:
        """Let `state` be `after` the stage that started from `_begun`, and remember it."""
        change, rate, curve = state.before
        for k, s in enumerate((stage.s, stage.s_force)):
            by = stage.curves[k] if stage.curves else NO_CURVE
            write_history(state.error[k], self._begun[k], after[k], s, by, change[k], rate[k], curve[k])
        if stage.curves and stage.defect:
            curve[1] += stage.defect.curve * self._derivatives(stage.defect)[1]
            curve[0] = curve[1]
        state.error[:] = after

    def _stage(self, stage: Stage, defect: Defect, left: FloatArray, out: FloatArray) -> None:
        """Write the errors at the end of a stage that starts from `_begun` to `out`."""
        p, q = self._derivatives(defect)
        self._coordinates.stage(self._begun, p, q, defect, stage, left, out)

    def _measure_added(self, defect: Defect, stage: Stage) -> None:
        """Write `added` of a step with these defects, as of one stage."""
        if self.local:
            self._begun[:] = 0.0
            self._stage(stage, defect, self._none, self._alone)
