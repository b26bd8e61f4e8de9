"""Steps as long as an asked accuracy allows, whatever advances the body: with contact, bounds of strains, a ball.

Where bodies hit each other no tangent carries errors along. What is known at the ends of any step, positions x and
velocities v, tells by how much the step errs: the positions should be the integral of the velocities, and these that of
the accelerations a, backward differences of v, and differ from that by the trapezoidal rule by

    e = x' - x - h (v + v') / 2,    e_v = v' - v - h (a + a') / 2.

For implicit Euler e is h² / 2 times the acceleration, its very defect; for schemes of second order h³ times a constant
a little above that of their defect; and h / 2 times the jump of the velocity where something hits, which is how
uncertain the hit's instant is [HairerNorsettWanner1993, chapter II.4]. What is pressed does not err along the normal:
it ends where the surface is. An error of the velocity puts a point off later, in a vibration by

    d = e_v / w,    w² = |a' - a| / (h |v|).

Errors of positions add up to the sum of |e|. Those of velocities go with vibrations of all phases, so their squares add
up, but for what came within 1 / w before, which they go along with: D² grows by |d|² + 2 d . r, r = exp(-w h) (d + r)
of the part before. What a part adds to a point's error is what it lets the sum of |e| and D grow by. It costs nothing:
no step is made twice but those that are taken back.

A ball in a maze is led by the plate, whose error it takes up for good: a wall that comes a little later sends it off
differently, and one that it barely hits or misses puts it off by many times as much. Steps err by the phase of what
swings. So two more balls go along, on plates that are ahead of their own and behind by

    A S / V,

V its fastest speed: of a vibration that is A of its phase. How far they are from the first is what the ball's place is
told to; where walls make that more than A of its way they decide where it is, and no promise holds for it.

With `accuracy` A the errors of each point may add up to A times S, as far as the furthest point of its kind has been
from where it began (kinds: nodes and corners of rigid bodies; the effector's nodes). With ds its way, a part may add
its own share and some of what the parts before have spared,

    A ds + max(SPEND (A S + floor - sum so far), LEAST (A S + floor)).

A motion without hits then gets equal errors per way, and a hit, whose error is h v / 2 however short the step, what
the way to it has spared. Where that is too much, a part goes up to the hit, whose instant is known from how bodies
move on without forces, and a short one over it. Servos that start or stop are hits, too: what is taken back twice is
taken to add as one does. The floor is A times the contact distance or FINE times the size of everything, or the
tolerance where that is larger: what is finer nobody sees. Without an accuracy a part may add the tolerance.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.effects.inertia import ORDER
from tripod_sim.effects.time_error import TimeError
from tripod_sim.errors import StepError
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.time_error import TR_BDF2, TimeErrorReport
from tripod_sim.integrators.way_kernels import (
    drop_normal,
    ratio_over_way,
    write_corners,
    write_errors,
    write_lengths,
)
from tripod_sim.state import State, WayState

if TYPE_CHECKING:
    from tripod_sim.contact.world import World
    from tripod_sim.parts import Parts

SAFETY, SHRINK, GROW = 0.9, 0.2, 2.0
"""Of the length that the errors allow; least and largest change from part to part."""

SPEND = 0.25
"""Share of what earlier parts have spared that a part may add."""

LEAST = 0.01
"""Share of the whole that a part may add where nothing is spared: what hits on and on or trembles needs no less."""

FINE = 0.005
"""Of the size of all bodies together: how far a point has been at least, as far as accuracies are concerned."""

SHARE, FINER = (1.0, 0.5, 0.7), (0.5, 0.9, 0.35)
"""Of the accuracy A that what is measured may add up to at A = 0.1, and power of A that goes with it, of springs and
rigid bodies, of a solid that touches others, and of one alone: what is measured is of leading order, and hits, which
make errors larger, take the more of a finer accuracy."""

POWER = 2
"""Power of the length with which errors over what is allowed are taken to grow."""

FAST = 4 * abs(TR_BDF2)
"""Defect of TR-BDF2 over e_v: differences as of BDF2 make that h³ / 4 times the third derivative, 9 / 8 of BDF2's."""

KEEP = 1.4
"""By which a length must have grown before it is changed: lengths that recur keep factorisations."""

BEFORE = 0.98
"""Of the way to a hit: what a part goes that is to end before it."""


class WaySteps:
    """Divides the steps of a time integrator, the ball's among them.

    Attributes:
        awake: The time integrator.
    """

    def __init__(
        self,
        parts: "Parts",
        wanted: TimeError,
        scheme: str,
        distance: float,
        *,
        solid: bool = False,
    ) -> None:
        """Divide the steps of `parts.stepper`.

        Args:
            parts: Of the simulation.
            wanted: The scene's table.
            scheme: Its time integrator.
            distance: Of contact [m], 0 without.
            solid: Whether a body is a solid.
        """
        self._order, self._fast = ORDER[scheme], FAST if scheme == "tr_bdf2" else 1.0
        self.awake, self._ball, self._wanted = parts.stepper, parts.ball, wanted
        groups, rigid = parts.system.groups, parts.rigid
        corners = [s.vertices for s in rigid.shapes] if rigid else []
        self._corners = np.concatenate([np.zeros((0, 3)), *corners])
        self._body = np.repeat(np.arange(len(corners)), [len(c) for c in corners])
        self._soft = len(parts.mesh.nodes) - len(self._corners)
        self._disc = groups.rigid[0] if groups.rigid else np.zeros(0, dtype=np.int64)
        shown = self._soft + len(self._corners)
        count = shown + len(self._disc)
        self._kinds = [slice(0, shown)] + ([slice(shown, count)] if len(self._disc) else [])
        self._free = np.ones(count, dtype=bool)
        self._free[: self._soft] = np.any(~groups.held(), axis=1)[: self._soft]
        self._before, self._after = np.zeros((2, count, 3)), np.zeros((2, count, 3))
        self._added, self._ways, self._far = np.zeros((3, count))
        self._sums = np.zeros((count, 4))
        self._errors, self._a_end = np.zeros((2, count, 3)), np.zeros((count, 3))
        self._first = self._soft + np.searchsorted(self._body, np.arange(len(corners) + 1))
        self._world: World | None = getattr(self.awake, "world", None)
        if self._world:
            self._row, self._owner = self._world.owners()
        self._remember = getattr(self.awake, "keep_history", lambda: None)
        self._recall = getattr(self.awake, "recall_history", self.awake.forget)
        newton = getattr(self.awake, "newton", None)
        self._newton = newton if isinstance(newton, Newton) and wanted.accuracy else None
        if self._newton:
            self._newton.keep_several()
        kind = 0 if not solid else 1 if self._world else 2
        share = SHARE[kind] * (wanted.accuracy / 0.1) ** FINER[kind]
        self._accuracy = min(share, 1.0) * wanted.accuracy
        self._maze = self._ball if wanted.accuracy else None
        self._shifted = self._maze.shifted() if self._maze else None
        size = float(np.linalg.norm(np.ptp(parts.mesh.nodes, axis=0)))
        self._floor = max(wanted.tolerance, self._accuracy * max(distance, FINE * size))
        self._origin: State | None = None
        self._keep: State | None = None

    def start(self, state: State) -> WayState:
        """Return what is remembered at the start, `state`; the kernels compile here."""
        self._read(state, self._before)
        x, v = self._before.copy()
        twist = np.zeros((2 if self._maze else 0, 3))
        known = WayState(x, v, np.zeros_like(x), np.zeros((len(x), 4)), np.zeros(len(x)), np.zeros(2), twist)
        self._measure(known, 1.0, 1.0, StepReport())
        self._ratio(known)
        if self._maze and state.ball:
            known.ahead, known.behind = state.ball.copy(), state.ball.copy()
        return known

    def ball_starts(self, state: State) -> None:
        """Let the other balls start with that of `state`."""
        if state.ball and state.way:
            for ball in state.way.balls:
                state.ball.copy_to(ball)

    def forget(self) -> None:
        """Drop what was kept from earlier steps."""
        self.awake.forget()

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance by `dt` [s], in place. Raises StepError and leaves `state`."""
        known = state.way
        assert known
        if self._origin is None or self._keep is None or (self._origin.ball is None) != (state.ball is None):
            self._origin, self._keep = state.copy(), state.copy()  # the ball comes after the first trial
        state.copy_to(self._keep)
        try:
            return self._divided(state, known, joints, dt)
        except StepError:
            self._keep.copy_to(state)
            self.forget()
            raise

    def _divided(self, state: State, known: WayState, joints: FloatArray, dt: float) -> StepReport:
        """Take the step in parts as long as the errors allow."""
        begin, start, total, origin = state.joints.copy(), (state.time, state.step), StepReport(), self._keep
        length, done, worst, again, shortest = known.proposed or dt, 0.0, 0.0, False, self._wanted.shortest
        assert origin
        self._read(state, self._before)
        h, flight = 2 * dt, 0.0
        while done < dt:
            if flight:
                h, pieces = flight, 2.0
            else:
                if not h <= length < KEEP * h:
                    h = length
                pieces = max(1.0, np.ceil((dt - done) / h - 1e-9))
                h = (dt - done) / pieces
            self._remember()
            try:
                report = self._part(state, begin + min(1.0, (done + h) / dt) * (joints - begin), h)
                self._read(state, self._after)
                self._measure(known, h, state.time, report)
                ratio, given = self._ratio(known)
                again_from = self._recall if report.parts == 1 else self.awake.forget
            except StepError:
                if h <= shortest:
                    raise
                ratio, given, again_from = np.inf, 0.0, self.awake.forget
            change = SAFETY * ratio ** (-1.0 / POWER) if ratio > 0 else GROW
            if not ratio <= 1.0 and h > shortest * (1 + 1e-9):
                origin.copy_to(state)
                again_from()
                total.rejected += 1
                hit = report.contact.meets if np.isfinite(ratio) and report.contact else np.inf
                change = after_hit(ratio, given) if again or np.isfinite(hit) else max(change, SHRINK)
                length = max(h * (change if np.isfinite(ratio) else 0.5), shortest)
                flight = BEFORE * hit * h if length < BEFORE * hit * h < h else 0.0
                again = True
                continue
            total = _joined(report, total)
            self._note(known, h)
            if not flight:
                length = min(max(h * min(max(change, SHRINK), 1.0 if again else GROW), shortest), dt)
            again = bool(flight)
            done, flight, worst = dt if pieces == 1 else done + h, 0.0, max(worst, float(self._added.max()))
            if done < dt:
                origin = self._saved(state)
        known.proposed = length
        state.time, state.step = start[0] + dt, start[1] + 1
        apart, ball = np.nan, state.ball
        if ball and known.balls:
            apart = max(float(np.linalg.norm(other.position - ball.position)) for other in known.balls)
        total.time_error = self._report(known, worst, apart)
        return total

    def _saved(self, state: State) -> State:
        """Return a copy of `state`, which the next overwrites."""
        assert self._origin
        state.copy_to(self._origin)
        return self._origin

    def _part(self, state: State, joints: FloatArray, h: float) -> StepReport:
        """Advance over one part, with the ball."""
        if self._ball and state.ball:
            self._ball.load(state, state.ball)
        if self._newton and state.way:
            self._newton.allow(self._accuracy * float(state.way.furthest.max()) + self._floor, h)
        report = self.awake.step(state, joints, h)
        if self._ball and state.ball:
            self._ball.follow(state, state.ball, h)
            if self._shifted and state.way:
                self._follow(state.way, state.time, h)
        return report

    def _follow(self, known: WayState, time: float, h: float) -> None:
        """Let the other balls follow a part of `h` that ended at `time` [s]."""
        assert self._shifted
        shift = self._wanted.accuracy * float(known.furthest[-1]) / max(known.fastest, 1e-12)
        for ball, ahead in zip(known.balls, (shift, -shift), strict=False):
            self._shifted(ball, ahead, known.twist, time, h)

    def _ratio(self, known: WayState) -> tuple[float, float]:
        """Return what a part has added over what it may, and which part of this its way gives, at the worst point.

        The first is NaN where a number is not finite.
        """
        if not self._accuracy:
            return float(self._added.max()) / self._wanted.tolerance, 0.0
        ratios = [
            ratio_over_way(
                self._accuracy, self._floor, SPEND, LEAST,
                self._added[k], self._ways[k], self._far[k], known.added[k], furthest,
            )
            for k, furthest in zip(self._kinds, known.furthest, strict=False)
        ]  # fmt: skip
        return max(ratios, key=lambda r: np.inf if np.isnan(r[0]) else r[0])

    def _report(self, known: WayState, worst: float, apart: float) -> TimeErrorReport:
        """Return what parts have added so far, where the steps follow an accuracy, and the most of one [m].

        apart: How far the ball is from the others at most [m].
        """
        if not self._accuracy:
            return TimeErrorReport(np.nan, np.nan, -1, worst)
        shown, node = known.added[self._kinds[0]], int(known.added[self._kinds[0]].argmax())
        disc = float(known.added[self._kinds[1]].max()) if len(self._disc) else np.nan
        return TimeErrorReport(disc, float(shown[node]), node, worst, apart)

    def _read(self, state: State, out: FloatArray) -> None:
        """Write positions [m] and velocities [m/s] of all points of interest to `out`, shape (2, n, 3)."""
        for k, values in enumerate((state.positions, state.velocities)):
            out[k, : self._soft] = values[: self._soft]
            if len(self._disc):
                out[k, self._kinds[1]] = values[self._disc]
        if r := state.rigid:
            write_corners(
                self._soft,
                self._corners,
                self._body,
                r.centres,
                r.rotations,
                r.velocities,
                r.spins,
                out[0],
                out[1],
            )

    def _measure(self, known: WayState, h: float, time: float, report: StepReport) -> None:
        """Write what a part of `h` [s], which ended `time` [s] after the start, added, and the ways that it made."""
        begins = (
            not known.length or (report.contact is not None and report.contact.restarted) or self._order == 1
        )
        write_errors(
            h, 0.0 if begins else h / known.length, self._before, self._after, known.velocities, known.accelerations,
            self._free, self._a_end, self._errors,
        )  # fmt: skip
        if not begins:
            self._errors[1] *= self._fast
        if not known.length:
            self._errors[1] = 0.0
        if self._world:
            contacts = self._world.contacts
            c = contacts.arrays
            drop_normal(
                contacts.count, c.vertex, c.weight, c.normal, c.pressure, self._row, self._owner, self._first,
                self._errors,
            )  # fmt: skip
        write_lengths(
            h, max(time, h), self._before, self._after, known.accelerations, self._a_end, self._errors, known.origin,
            self._free, known.sums, self._sums, self._added, self._ways, self._far,
        )  # fmt: skip

    def _note(self, known: WayState, h: float) -> None:
        """Let `known` follow a part of `h` [s]."""
        known.velocities[:] = self._before[1]
        known.accelerations[:] = self._a_end
        known.sums[:] = self._sums
        known.added += self._added
        known.length = h
        if self._maze:
            known.twist[:] = self._maze.twist
            known.fastest = max(known.fastest, float(np.linalg.norm(known.twist[0])))
        for k, kind in enumerate(self._kinds):
            known.furthest[k] = max(known.furthest[k], self._far[kind].max())
        self._before, self._after = self._after, self._before


def after_hit(ratio: float, given: float) -> float:
    """Return the length over that of a part in which a hit added `ratio` times what it may: x of at most a half.

    What the hit adds is as that length, and so is the share g of what it may that its way gives: x r = g x + 1 - g.
    """
    return float(min(SAFETY * (1 - given) / max(ratio - SAFETY * given, 1e-9), 0.5))


def _joined(report: StepReport, earlier: StepReport) -> StepReport:
    """Return the report of a part as that of all parts until its end, with that of the `earlier` ones."""
    if not earlier.parts:
        return replace(report, parts=1, rejected=earlier.rejected)
    contact, before = report.contact, earlier.contact
    if contact and before:
        contact.smallest_gap = min(contact.smallest_gap, before.smallest_gap)
        contact.cut = max(contact.cut, before.cut)
        contact.lowered = max(contact.lowered, before.lowered)
    return replace(report.after(earlier), parts=earlier.parts + 1, rejected=earlier.rejected)
