"""The error of time steps by steps of half the length: for all that has no estimate of its own.

Where bodies touch, springs meet their bound or a scheme solves nothing, no tangent carries errors along. There a second
simulation of the scene, the twin, takes two steps where the first takes one. With p the order of the scheme, 1 where
velocities jump, and x_h, x_h/2 the two positions, the exact one less x_h is [HairerNorsettWanner1993, chapter II.4]

    (x_h/2 - x_h) / (1 - 2^-p).

With `steps = "fixed"` the twin goes along from the start on, so that this is the whole error. With `steps = "auto"`, of
explicit schemes (`way_steps` has the others), it begins each part where the body is and takes it in one step; the body
takes it in two and adds |x_h/2 - x_h| / (2^p - 1). A part that is taken back, and the twin's step, remember nothing of
those before.
"""

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.effects.time_error import TimeError
from tripod_sim.errors import StepError
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.time_error import TimeErrorReport
from tripod_sim.integrators.time_error_kernels import furthest
from tripod_sim.state import State, TwinState

if TYPE_CHECKING:
    from tripod_sim.parts import Parts

SAFETY, SHRINK, GROW = 0.9, 0.2, 2.0
"""Of the length that the tolerance allows; least and largest change from part to part."""


class Doubling:
    """A time integrator whose error is estimated by a twin with steps of half the length.

    Attributes:
        awake: The time integrator itself.
    """

    def __init__(self, parts: "Parts", twin: "Parts", order: int, wanted: TimeError) -> None:
        """`twin`: of the same scene; `order`: p; `wanted`: the scene's table."""
        self.awake, self._twin = parts.stepper, twin.stepper
        self._order, self._wanted, self._auto = order, wanted, wanted.steps == "auto"
        self._rigid, self._nodes = (
            parts.rigid,
            len(parts.mesh.nodes) - (parts.rigid.count if parts.rigid else 0),
        )
        self._effector = bool(parts.system.groups.rigid)
        if parts.ball and twin.ball:
            twin.ball.loads.share(parts.ball.loads)
        halved = self.awake if self._auto else self._twin
        steppers: list[Any] = [halved, getattr(halved, "inner", None)]
        for stepper in steppers:
            if hasattr(
                stepper, "finer"
            ):  # an explicit scheme divides half of a step into as many parts as a whole one
                stepper.finer = 2
        self._keep: State | None = None

    def start(self, state: State) -> TwinState:
        """Return what is remembered at the start."""
        return TwinState(_bare(state), _bare(state))

    def forget(self) -> None:
        """Drop what was kept from earlier steps."""
        self.awake.forget()
        self._twin.forget()

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance by `dt` [s], in place. Raises StepError and leaves `state`."""
        remembered = state.twin
        assert remembered
        if self._keep is None:
            self._keep = state.copy()
        state.copy_to(self._keep)
        try:
            return (self._chosen if self._auto else self._whole)(state, remembered, joints, dt)
        except StepError:
            self._keep.copy_to(state)
            self.forget()
            raise

    def _whole(self, state: State, errors: TwinState, joints: FloatArray, dt: float) -> StepReport:
        """Take the step, and the twin's."""
        if not (errors.known and _same(state, errors.last)):
            state.copy_to(errors.twin)
            self._twin.forget()
        report = self.awake.step(state, joints, dt)
        middle = 0.5 * (errors.twin.joints + joints)
        self._twin.step(errors.twin, middle, 0.5 * dt)
        self._twin.step(errors.twin, joints, 0.5 * dt)
        state.copy_to(errors.last)
        errors.known = 1
        share = 1.0 / (1.0 - 2.0**-self._order)
        largest, node = furthest(self._shown(errors.twin) - self._shown(state))
        of_effector = np.nan
        if self._effector:
            of_effector = share * float(np.linalg.norm(errors.twin.centres[0] - state.centres[0]))
        report.time_error = TimeErrorReport(of_effector, share * float(largest), int(node), np.nan)
        return report

    def _chosen(self, state: State, errors: TwinState, joints: FloatArray, dt: float) -> StepReport:
        """Take the step in parts as long as the tolerance allows."""
        begin, total, start = state.joints.copy(), StepReport(), (state.time, state.step)
        length, done, worst, again = errors.proposed or dt, 0.0, 0.0, False
        origin, coarse, order = errors.last, errors.twin, self._order
        while done < dt:
            pieces = np.ceil((dt - done) / length - 1e-9)
            h = (dt - done) / pieces
            state.copy_to(origin)
            state.copy_to(coarse)
            goals = [begin + min(1.0, (done + part * h) / dt) * (joints - begin) for part in (0.5, 1.0)]
            self._twin.forget()
            try:
                self._twin.step(coarse, goals[1], h)
                reports = [self.awake.step(state, goal, 0.5 * h) for goal in goals]
                added = float(furthest(self._shown(state) - self._shown(coarse))[0]) / (2.0**order - 1.0)
            except StepError:
                if h <= self._wanted.shortest:
                    raise
                added, reports = np.inf, []
            ratio = added / self._wanted.tolerance
            if not ratio <= 1.0 and h > self._wanted.shortest * (1 + 1e-9):
                origin.copy_to(state)
                self.awake.forget()
                total.rejected += 1
                change = SAFETY * ratio ** (-1.0 / (order + 1)) if np.isfinite(ratio) else 0.5
                length, again = max(h * max(change, SHRINK), self._wanted.shortest), True
                continue
            for report in reports:
                whole, total = total, report.after(total)
                total.parts, total.rejected = whole.parts, whole.rejected
            total.parts += 1
            change = SAFETY * ratio ** (-1.0 / (order + 1)) if ratio > 0 else GROW
            length = min(max(h * min(max(change, SHRINK), 1.0 if again else GROW), self._wanted.shortest), dt)
            done, again, worst = dt if pieces == 1 else done + h, False, max(worst, added)
        errors.proposed = length
        state.time, state.step = start[0] + dt, start[1] + 1
        total.time_error = TimeErrorReport(np.nan, np.nan, -1, worst)
        return total

    def _shown(self, state: State) -> FloatArray:
        """Return the positions of all nodes and vertices [m], as the simulation shows them."""
        soft = state.positions[: self._nodes]
        return (
            np.concatenate([soft, self._rigid.vertices(state.rigid)]) if self._rigid and state.rigid else soft
        )


def _bare(state: State) -> State:
    """Return a copy without what only the body's own state has."""
    copy = state.copy()
    copy.twin = copy.servos = copy.ball = None
    return copy


def _same(one: State, other: State) -> bool:
    """Return whether two states have the same positions, velocities and joints."""
    pairs = [(one.positions, other.positions), (one.velocities, other.velocities), (one.joints, other.joints)]
    if one.rigid and other.rigid:
        pairs += [(getattr(one.rigid, f.name), getattr(other.rigid, f.name)) for f in fields(one.rigid)]
    return all(np.array_equal(a, b) for a, b in pairs)
