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

from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.integrator import StepperIntegrator
from tripod_sim.integrators.newton import NewtonReport
from tripod_sim.integrators.path_error_kernels import (
    drop_normal,
    ratio_over_path,
    write_corners,
    write_errors,
    write_lengths,
)
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.scheme import Scheme
from tripod_sim.integrators.step_control import StepControl, Substep, Work
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.integrators.time_error import TimeErrorReport
from tripod_sim.state import State, WayState
from tripod_sim.tables.method import TimeError

if TYPE_CHECKING:
    from tripod_sim.contact.contact_solver import ContactSolver
    from tripod_sim.integrators.report import ContactReport
    from tripod_sim.steps.parts import Parts

SAFETY, SHRINK, GROW = 0.9, 0.2, 2.0
"""Of the length that the errors allow; least and largest change from part to part."""

SPEND = 0.25
"""Share of what earlier parts have spared that a part may add."""

LEAST = 0.01
"""Share of the whole that a part may add where nothing is spared: what hits on and on or trembles needs no less."""

UNSOLVED = 0.1
"""Share of the whole that what the solver leaves of a part is held against: it may move all parts the same way."""

FINE = 0.005
"""Of the size of all bodies together: how far a point has been at least, as far as accuracies are concerned."""

RIGID, SOLID_TOUCHING, SOLID_ALONE, NET_TOUCHING = (1.0, 0.5), (0.5, 0.9), (0.7, 0.35), (0.2, 0.1)
"""Of the accuracy A that what is measured may add up to at A = 0.1, and power of A / 0.1 that goes with it, of springs
alone and rigid bodies, of solids and of springs that touch others: what is measured is of leading order, hits, which
make errors larger, take the more of a finer accuracy, and a net that folds on an obstacle makes them several times as
large."""

POWER = 2
"""Power of the length with which errors over what is allowed are taken to grow."""

MOST_HALVINGS = 6
"""How often a substep of the shortest length that errors ask for is halved where it cannot be solved."""

KEEP = 1.4
"""By which a length must have grown before it is changed: lengths that recur keep factorisations."""

SWUNG = 4.0
"""Longest way over distance for which an accuracy is promised: two periods of what is let go."""

BEFORE = 0.98
"""Of the way to a hit: what a part goes that is to end before it."""


class PathErrorControl(StepControl):
    """Keeps errors below a share of the path: of whatever advances the bodies, and of the ball with them.

    Attributes:
        integrator: Advances over a substep.
        swung: Longest way of a point so far, over how far one of its kind has been from its origin.
    """

    rejects = True

    def __init__(
        self,
        parts: "Parts",
        wanted: TimeError,
        scheme: Scheme,
        distance: float,
        *,
        solid: bool = False,
        net: bool = False,
    ) -> None:
        """Control the substeps of what `parts.stepper` integrates with.

        Args:
            parts: Of the simulation.
            wanted: The scene's table.
            scheme: Its time integrator.
            distance: Of contact [m], 0 without.
            solid: Whether a body is a solid.
            net: Whether a body is of springs.
        """
        self.swung = 0.0
        self._order, self._fast = scheme.order, scheme.over_difference
        inner = parts.stepper
        self.integrator = inner.integrator if isinstance(inner, Substeps) else StepperIntegrator(inner)
        self._ball, self._wanted = parts.ball, wanted
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
        self._world: ContactSolver | None = getattr(self.integrator, "world", None)  # only contact has one
        if self._world:
            self._row, self._owner = self._world.owners()
        self._newton = self.integrator.newton if wanted.accuracy else None
        if self._newton:
            self._newton.keep_several()
        kinds = [RIGID, *([SOLID_TOUCHING if self._world else SOLID_ALONE] if solid else [])]
        if net and self._world:
            kinds.append(NET_TOUCHING)
        share = min(most * (wanted.accuracy / 0.1) ** power for most, power in kinds)
        self._accuracy = min(share, 1.0) * wanted.accuracy
        self._maze = self._ball if wanted.accuracy else None
        self._shifted = self._maze.shifted() if self._maze else None
        self._least = wanted.shortest * 0.5**MOST_HALVINGS
        size = float(np.linalg.norm(np.ptp(parts.mesh.nodes, axis=0)))
        self._floor = max(wanted.tolerance, self._accuracy * max(distance, FINE * size))

    def start(self, state: State) -> WayState:
        """Return what is remembered at the start, `state`; the kernels compile here."""
        self._read(state, self._before)
        x, v = self._before.copy()
        twist = np.zeros((2 if self._maze else 0, 3))
        known = WayState(
            x,
            v,
            np.zeros_like(x),
            np.zeros((len(x), 4)),
            np.zeros(len(x)),
            np.zeros(2),
            np.zeros(len(x)),
            twist,
        )
        self._measure(known, 1.0, 1.0, None)
        self._ratio(known)
        if self._maze and state.ball:
            known.ahead, known.behind = state.ball.copy(), state.ball.copy()
        return known

    def ball_starts(self, state: State) -> None:
        """Let the other balls start with that of `state`."""
        if state.ball and state.way:
            for ball in state.way.balls:
                state.ball.copy_to(ball)

    def begin(self, state: State, move: FloatArray, dt: float) -> None:
        """Begin with the length proposed at the end of the last step."""
        known = state.way
        assert known
        self._dt, self._done, self._worst = dt, 0.0, 0.0
        self._length, self._h, self._flight, self._again = known.proposed or dt, 2 * dt, 0.0, False
        self._read(state, self._before)

    def propose(self) -> Substep | None:
        """Return the next substep: one up to a hit, or the next of equal ones to the end of the step."""
        dt, done = self._dt, self._done
        if done >= dt:
            return None
        if self._flight:
            self._h, self._pieces = self._flight, 2.0
        else:
            if not self._h <= self._length < KEEP * self._h:
                self._h = self._length
            self._pieces = max(1.0, np.ceil((dt - done) / self._h - 1e-9))
            self._h = (dt - done) / self._pieces
        end = 1.0 if self._pieces == 1 else min(1.0, (done + self._h) / dt)
        return Substep(end, self._h, self._h / dt, self._is_shortest())

    def _is_shortest(self) -> bool:
        """Return whether the proposed substep is not halved if it fails; equal parts of a step are rounded."""
        return self._h <= self._least * (1 + 1e-9)

    def prepare(self, state: State) -> None:
        """Apply the load of the ball, and set how exactly the substep is solved."""
        if self._ball and state.ball:
            self._ball.load(state, state.ball)
        if self._newton and state.way:
            whole = self._accuracy * float(state.way.furthest.max()) + self._floor
            self._newton.allow(UNSOLVED * whole, self._h)

    def shorten(self, spent: int) -> bool:
        """Halve the substep, unless it is far shorter than errors ask for."""
        if self._is_shortest():
            return False
        self._length, self._flight, self._again = max(0.5 * self._h, self._least), 0.0, True
        return True

    def accepts(self, state: State, work: Work) -> bool:
        """Let the ball follow; accept a substep that added little enough, or is the shortest."""
        known, h, shortest = state.way, self._h, self._wanted.shortest
        assert known and isinstance(work, StepReport | NewtonReport)
        if self._ball and state.ball:
            self._ball.follow(state, state.ball, h)
            if self._shifted:
                self._follow(known, state.time, h)
        contact = getattr(work, "contact", None)
        self._read(state, self._after)
        self._measure(known, h, state.time, contact)
        ratio, given = self._ratio(known)
        change = SAFETY * ratio ** (-1.0 / POWER) if ratio > 0 else GROW
        if not ratio <= 1.0 and h > shortest * (1 + 1e-9):
            hit = contact.meets if np.isfinite(ratio) and contact else np.inf
            change = after_hit(ratio, given) if self._again or np.isfinite(hit) else max(change, SHRINK)
            length = max(h * (change if np.isfinite(ratio) else 0.5), shortest)
            self._flight = BEFORE * hit * h if length < BEFORE * hit * h < h else 0.0
            self._length, self._again = length, True
            return False
        self._note(known, h)
        if not self._flight:
            self._length = min(
                max(h * min(max(change, SHRINK), 1.0 if self._again else GROW), shortest), self._dt
            )
        self._again = bool(self._flight)
        self._done, self._flight = self._dt if self._pieces == 1 else self._done + h, 0.0
        self._worst = max(self._worst, float(self._added.max()))
        return True

    def finish(self, state: State, report: StepReport) -> None:
        """Propose the length of the next substep, and report the error."""
        known = state.way
        assert known
        known.proposed = self._length
        apart, ball = np.nan, state.ball
        if ball and known.balls:
            apart = max(float(np.linalg.norm(other.position - ball.position)) for other in known.balls)
        report.time_error = self._report(known, self._worst, apart)
        if self._accuracy:
            least = self._floor / self._accuracy
            pairs = zip(self._kinds, known.furthest, strict=False)
            self.swung = max(float(known.ways[kind].max()) / max(far, least) for kind, far in pairs)

    def swing_note(self, _positions: FloatArray) -> str:
        """Return the note on a motion that goes to and fro for so long that its accuracy is not promised, or none."""
        if self._maze or self.swung <= SWUNG:
            return ""
        return (
            f"time_error.accuracy = {self._wanted.accuracy:g} is not promised any longer: a point has gone "
            f"{SWUNG:g} times as far as it gets from its start, and in a long swing errors add up to more than the "
            "estimate. Check with a fixed dt, inertia.scheme = 'tr_bdf2', and half of that dt"
        )

    def _follow(self, known: WayState, time: float, h: float) -> None:
        """Let the other balls follow a substep of `h` that ended at `time` [s]."""
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
            ratio_over_path(
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
        if len(self._corners):
            write_corners(self._soft, self._corners, self._body, *state.rigid, out[0], out[1])

    def _measure(self, known: WayState, h: float, time: float, contact: "ContactReport | None") -> None:
        """Write what a part of `h` [s], which ended `time` [s] after the start, added, and the ways that it made."""
        begins = not known.length or (contact is not None and contact.restarted) or self._order == 1
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
        known.ways += self._ways
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
