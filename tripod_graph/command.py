"""What simulator and driver do with a joint trajectory: check it, follow it, hold and park when it ends.

Pure: the caller gives the time. One rule for both, so that the simulated robot does what the real one does.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tripod_graph.joint import Joint
from tripod_graph.names import SLIDE, count_servos, servo_names
from tripod_host.arrays import FloatArray

LONGEST_TRAJECTORY = 600.0
"""Latest time of a point from now [s]: while a trajectory lasts its source may be silent, so it must not be endless."""

LATE = 0.5
"""A trajectory that should have begun longer ago than this [s] is refused."""


class CommandError(ValueError):
    """A command that is refused; the message names the joint, the value and what is allowed."""


class JointNameError(CommandError):
    """A command that names other joints than those that there are, or not all."""


class LateError(CommandError):
    """A command that should have begun too long ago."""


class Activity(IntEnum):
    """What the follower is doing."""

    ACTIVE = 0
    HOLDING = 1
    PARKED = 2


@dataclass(frozen=True)
class CommandLimits:
    """Bounds of what may be commanded.

    Attributes:
        angle_min: Smallest servo angle [rad].
        angle_max: Largest servo angle [rad].
        angle_speed: Slew rate of a servo [rad/s].
        slide_max: Largest inward slide [m]; the smallest is 0.
        slide_speed: Slew rate of the slide [m/s].
        timeout: Silence after which the joints hold [s].
        park_after: Time of holding after which they move to `park` [s].
        park: Park position: the angle of each servo [rad] and the slide [m]; empty: all 0. Kept with the park values of
            `others` before the slide.
        servos: Smallest and largest angle [rad] and slew rate [rad/s] of each servo, where they are narrower; none, or
            all.
        count: Number of servos.
        others: Joints that are no servos, between these and the slide in all arrays.
    """

    angle_min: float = -2.1
    angle_max: float = 0.6
    angle_speed: float = 4.0
    slide_max: float = 0.04
    slide_speed: float = 0.1
    timeout: float = 0.5
    park_after: float = 5.0
    park: tuple[float, ...] = ()
    servos: tuple[tuple[float, float, float], ...] = ()
    count: int = 3
    others: tuple[Joint, ...] = ()

    def __post_init__(self) -> None:
        park = self.park or (0.0,) * (self.count + 1)
        if self.others and len(park) == self.count + 1:
            park = (*park[:-1], *(joint.park for joint in self.others), park[-1])
        object.__setattr__(self, "park", park)
        for name in (
            "angle_min",
            "angle_max",
            "angle_speed",
            "slide_max",
            "slide_speed",
            "timeout",
            "park_after",
        ):
            if not np.isfinite(getattr(self, name)):
                raise CommandError(f"{name} is {getattr(self, name)}; it must be finite")
        if not self.angle_min < self.angle_max:
            raise CommandError(f"angle_min {self.angle_min} rad must be below angle_max {self.angle_max} rad")
        for name in ("angle_speed", "slide_speed", "timeout"):
            if not getattr(self, name) > 0:
                raise CommandError(f"{name} is {getattr(self, name)}; it must be positive")
        for name in ("slide_max", "park_after"):
            if not getattr(self, name) >= 0:
                raise CommandError(f"{name} is {getattr(self, name)}; it must not be negative")
        self.check(np.array(self.park, float), "park position")

    @cached_property
    def table(self) -> tuple[Joint, ...]:
        """All joints in the order of the arrays: the servos, the others, the slide."""
        own = ((self.angle_min, self.angle_max, self.angle_speed),) * self.count
        servos = (
            Joint(name, "rad", *all_servos).within(*one)
            for name, all_servos, one in zip(servo_names(self.count), own, self.servos or own, strict=True)
        )
        return (*servos, *self.others, Joint(SLIDE, "m", 0.0, self.slide_max, self.slide_speed))

    @property
    def size(self) -> int:
        """Number of joints without the slide."""
        return self.count + len(self.others)

    @cached_property
    def lower(self) -> FloatArray:
        """Smallest joint values [rad, m, N, Pa], shape (size + 1,)."""
        return _fixed(*(joint.low for joint in self.table))

    @cached_property
    def upper(self) -> FloatArray:
        """Largest joint values, shape (size + 1,)."""
        return _fixed(*(joint.high for joint in self.table))

    @cached_property
    def speed(self) -> FloatArray:
        """Slew rates, shape (size + 1,) [rad/s, m/s, N/s, Pa/s]."""
        return _fixed(*(joint.speed for joint in self.table))

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints: the servos, the others, the slide."""
        return tuple(joint.name for joint in self.table)

    @cached_property
    def has_efforts(self) -> bool:
        """Whether a joint takes a force, a tension or a pressure."""
        return any(joint.is_effort for joint in self.others)

    @property
    def required(self) -> tuple[str, ...]:
        """Names of the joints that a command must name: all but the slide."""
        return self.joints[:-1]

    @property
    def known(self) -> tuple[str, ...]:
        """Names of the joints that a command may name: a robot without servos has no slide."""
        return self.joints if self.count else self.required

    def of(self, count: int, others: tuple[Joint, ...] = ()) -> "CommandLimits":
        """Return the same for `count` servos and other joints.

        Raises CommandError where the park position is of another number.
        """
        if count == self.count and others == self.others:
            return self
        park = (*self.park[: self.count], self.park[-1])
        kept = count == self.count
        return replace(
            self, count=count, others=others, servos=self.servos if kept else (),
            park=park if kept or any(park) else (),
        )  # fmt: skip

    def within(
        self,
        lower: Sequence[float],
        upper: Sequence[float],
        speed: Sequence[float],
        names: Sequence[str] | None = None,
    ) -> "CommandLimits":
        """Return what these limits share with ranges and slew rates of joints, shape (n,) each.

        The park position moves to the nearest within.

        Args:
            lower, upper: Smallest and largest values [rad, m, N, Pa].
            speed: Slew rates.
            names: Of the joints: all servos, and any of the others; None: the servos.

        Raises:
            CommandError: a joint has nothing left, or these are other joints.
        """
        servos = servo_names(self.count)
        names = servos if names is None or not len(names) else tuple(names)
        if (given := {len(lower), len(upper), len(speed)}) != {len(names)} or names[: self.count] != servos:
            count = (given - {self.count} or {count_servos(names)}).pop()
            raise CommandError(f"a range of {count} servos is given; the robot has {self.count}")
        told = {n: row for n, *row in zip(names, lower, upper, speed, strict=True)}
        shared = []
        for joint in self.table[:-1]:
            low, high, rate = told.get(joint.name, (joint.low, joint.high, joint.speed))
            both = joint.within(low, high, rate)
            if not (max(low, joint.low) < min(high, joint.high) and rate > 0):  # NaN fails
                raise CommandError(
                    f"{joint.name} has the range {low:g} to {high:g} {joint.unit} at {rate:g} {joint.unit}/s, which "
                    f"does not overlap with the own limits {joint.low:g} to {joint.high:g} {joint.unit}"
                )
            shared.append(both)
        values = [min(max(v, j.low), j.high) for v, j in zip(self.park, shared, strict=False)]
        ranges = tuple((j.low, j.high, j.speed) for j in shared[: self.count])
        return replace(self, servos=ranges, others=tuple(shared[self.count :]), park=(*values, self.park[-1]))

    def inside(self, joints: FloatArray) -> NDArray[np.bool_]:
        """Return which of `joints`, shape (..., size + 1), are finite and within the limits."""
        tolerance = 1e-9 * np.array([1.0 if j.unit in ("rad", "m") else j.span for j in self.table])
        return (joints >= self.lower - tolerance) & (joints <= self.upper + tolerance)  # NaN fails both

    def check(self, joints: FloatArray, what: str) -> None:
        """Raise CommandError unless `joints`, shape (size + 1,), is finite and within the limits."""
        if joints.shape != (self.size + 1,):
            names = ", ".join(self.joints)
            raise CommandError(f"{what} has {joints.size} values; it needs {self.size + 1}: {names}")
        inside = self.inside(joints)
        if inside.all():
            return
        i = int(np.argmin(inside))
        name, unit = self.joints[i], self.table[i].unit
        allowed = f"{self.lower[i]:g} to {self.upper[i]:g} {unit}"
        raise CommandError(f"{what}: {name} is {joints[i]:g} {unit}; allowed: {allowed}")


def _fixed(*values: float) -> FloatArray:
    array = np.array(values)
    array.flags.writeable = False
    return array


class CommandFollower:
    """Turns joint trajectories into set-points that never exceed limits and slew rates.

    A trajectory starts where the joints are when it arrives and is interpolated linearly, or, where its points have
    velocities, by cubics, from the velocity that is asked for when it arrives. One that begins later is waited for
    where the joints are. After its last point the joints hold; `timeout` after it they count as silent, and after
    `park_after` more they move to the park position, all joints in proportion so that they arrive together.
    `stop` makes them silent at once. The follower begins parked at `start`.

    Attributes:
        limits: Bounds of what may be commanded.
        joints: The set-point: angles [rad], other joints [m, N, Pa] and the slide [m], shape (limits.size + 1,), as all
            that follows.
        goal: What `joints` approaches at its limited speed.
        activity: What the follower is doing.
        trajectory: Stands for the trajectory that was taken last, also after its end; None: it was interrupted.
        rejected: Number of trajectories refused.
        last_rejection: Why the newest of them was refused.
    """

    def __init__(
        self, limits: CommandLimits, start: Sequence[float] | None = None, *, longest_step: float = 0.1
    ) -> None:
        """Begin at rest.

        Args:
            limits: Bounds of what may be commanded.
            start: Joint values now [rad, m]; None means the park position.
            longest_step: A caller that comes later than this after its last call has stalled [s]: the joints
                then move no further than in this time, instead of catching up in one jump.
        """
        self.limits = limits
        self.joints: FloatArray = np.array(limits.park if start is None else start, float)
        limits.check(self.joints, "start position")
        self.goal: FloatArray = self.joints.copy()
        self.trajectory: object = None
        self.rejected = 0
        self.last_rejection = ""
        self._longest_step = longest_step
        self._times = np.zeros(1)
        self._points = self.joints[None].copy()
        self._slopes: FloatArray | None = None
        self._silent_at = float("-inf")
        self._held_since: float | None = float("-inf") if start is None else None
        self._now: float | None = None
        self.activity = Activity.PARKED if start is None else Activity.HOLDING

    def accept(
        self,
        names: Sequence[str],
        times: Sequence[float],
        positions: Sequence[Sequence[float]],
        now: float,
        *,
        velocities: Sequence[Sequence[float]] = (),
        efforts: Sequence[Sequence[float]] = (),
        age: float = 0.0,
        place: FloatArray | None = None,
    ) -> None:
        """Follow a trajectory.

        Args:
            names: Joint names; all but the slide, in any order, and optionally the slide.
            times: Seconds from the start of each point, not falling, not negative.
            positions: Joint values of each point [rad, m], in the order of `names`; 0 or NaN for a joint that takes an
                effort. May be empty where all do.
            now: The caller's steady time [s].
            velocities: Of each point [rad/s, m/s]; none, or those of all points.
            efforts: Of each point [N, Pa], in the order of `names`; 0 or NaN for a joint that takes a position. May be
                empty where all do.
            age: How long ago it begins [s], at most `LATE`; negative: it begins later.
            place: Where the joints are, within the limits, shape (limits.size + 1,); None: at the set-point, which may
                be beyond what is let through to them.

        Raises:
            CommandError: the trajectory is refused; the motion goes on as before and `rejected` counts it.
        """
        points, slopes = self.check(names, times, positions, velocities=velocities, efforts=efforts, age=age)
        if place is not None:
            self.joints = place.copy()
        start = (now, now - age) if age < 0 else (now - age,)
        here = np.tile(self.joints, (len(start), 1))
        if slopes is not None:
            begin = np.zeros_like(here)
            begin[0] = self._slope(now) if age >= 0 else 0.0
            slopes = np.vstack([begin, slopes])
        self._times = np.concatenate([start, now - age + np.asarray(times, float)])
        self._points, self._slopes = np.vstack([here, points]), slopes
        self._silent_at = self._times[-1] + self.limits.timeout
        self._held_since = None
        self.activity, self.trajectory = Activity.ACTIVE, object()

    def check(
        self,
        names: Sequence[str],
        times: Sequence[float],
        positions: Sequence[Sequence[float]],
        *,
        velocities: Sequence[Sequence[float]] = (),
        efforts: Sequence[Sequence[float]] = (),
        age: float = 0.0,
    ) -> tuple[FloatArray, FloatArray | None]:
        """Return points and velocities of a trajectory, shape (n, size + 1), without following it; None: it has none.

        Raises:
            CommandError: the trajectory is refused; `rejected` counts it.
        """
        try:
            if not age <= LATE:  # the negation also catches NaN
                raise LateError(
                    f"the trajectory should have started {age:.3f} s ago; allowed: {LATE:g} s; check that the "
                    "clocks of both computers agree"
                )
            points = self._checked(names, times, positions, efforts, min(age, 0.0))
            return points, self._checked_velocities(names, velocities, len(points)) if len(
                velocities
            ) else None
        except CommandError as error:
            self.rejected += 1
            self.last_rejection = str(error)
            raise

    def stop(self, now: float) -> None:
        """Hold the present position at once, also on the way to the park position, and count as silent."""
        self._times, self._points, self._slopes = np.array([now]), self.joints[None].copy(), None
        self._silent_at = self._held_since = now
        self.activity, self.trajectory = Activity.HOLDING, None

    def rest(self, now: float) -> None:
        """Hold as `stop` does; what is parked, or on its way there, stays so."""
        if self.activity is not Activity.PARKED:
            self.stop(now)

    def setpoint(self, now: float) -> FloatArray:
        """Return the joint values at `now` [s], shape (size + 1,).

        Call it at a regular rate: the joints move by at most their speed times the time since the last call.
        """
        last = now if self._now is None else self._now
        dt = min(max(0.0, now - last), self._longest_step)
        self._now = max(now, last)
        if not self.is_silent(now):
            self.activity = Activity.ACTIVE
            self.goal = self._interpolated(now)
            self._approach(dt, together=False)
            return self.joints.copy()
        if self._held_since is None:
            self._held_since = now
        if now - self._held_since < self.limits.park_after:
            self.activity = Activity.HOLDING
            self.goal = self.joints.copy()
            return self.joints.copy()
        self.activity = Activity.PARKED
        self.goal = np.array(self.limits.park)
        self._approach(dt, together=True)
        return self.joints.copy()

    def is_silent(self, now: float) -> bool:
        """Return whether the time for the next command is over at `now` [s], whether or not `setpoint` was asked."""
        return now >= self._silent_at

    @property
    def end(self) -> FloatArray:
        """Where the trajectory that is followed ends, or the joints hold, or go to park."""
        parked = self.activity is Activity.PARKED
        return np.array(self.limits.park) if parked else self._points[-1].copy()

    def _interpolated(self, now: float) -> FloatArray:
        i = int(np.searchsorted(self._times, now, side="right"))
        if i == 0 or i == len(self._times):
            return self._points[min(i, len(self._times) - 1)].copy()
        t0, t1 = self._times[i - 1], self._times[i]
        w = (now - t0) / (t1 - t0)
        p0, p1 = self._points[i - 1], self._points[i]
        if self._slopes is None:
            return (1 - w) * p0 + w * p1
        v0, v1 = (t1 - t0) * self._slopes[i - 1], (t1 - t0) * self._slopes[i]
        cubic = p0 + w * (v0 + w * (3 * (p1 - p0) - 2 * v0 - v1 + w * (2 * (p0 - p1) + v0 + v1)))
        return np.clip(cubic, self.limits.lower, self.limits.upper)  # between points it may bulge out

    def _slope(self, now: float, step: float = 1e-4) -> FloatArray:
        """Return the velocity that is asked for at `now` [s] within the slew rates."""
        if self.is_silent(now):
            return np.zeros_like(self.joints)
        slope = (self._interpolated(now) - self._interpolated(now - step)) / step
        return np.clip(slope, -self.limits.speed, self.limits.speed)

    def _approach(self, dt: float, *, together: bool) -> None:
        step = self.goal - self.joints
        ratio = np.abs(step) / np.maximum(self.limits.speed * dt, 1e-300)
        scale = np.maximum(1.0, ratio.max() if together else ratio)
        self.joints = np.clip(self.joints + step / scale, self.limits.lower, self.limits.upper)

    def _checked(
        self,
        names: Sequence[str],
        times: Sequence[float],
        positions: Sequence[Sequence[float]],
        efforts: Sequence[Sequence[float]],
        begin: float,
    ) -> FloatArray:
        known, required = self.limits.known, self.limits.required
        if unknown := [n for n in names if n not in known]:
            raise JointNameError(f"unknown joint {unknown[0]!r:.60}; joints: {', '.join(known)}")
        if twice := [n for n in known if list(names).count(n) > 1]:
            raise JointNameError(f"joint {twice[0]!r} is named twice; a command names each joint once")
        if missing := [n for n in required if n not in names]:
            raise JointNameError(
                f"joint {missing[0]!r} is missing; a command names all of {', '.join(required)}"
            )
        if len(times) == 0 or len(times) != len(positions):
            raise CommandError(
                f"{len(positions)} points with {len(times)} times; at least one of each is needed"
            )
        t = np.asarray(times, float)
        before = np.concatenate([[0.0], t[:-1]])
        longest = LONGEST_TRAJECTORY + begin
        if longest < 0:
            raise CommandError(
                f"the trajectory starts in {-begin:g} s; allowed: at most {LONGEST_TRAJECTORY:g} s"
            )
        if not (ok := (t >= before) & (t <= longest)).all():
            i = int(np.argmin(ok))
            raise CommandError(f"time of point {i} is {t[i]:g} s; allowed: {before[i]:g} to {longest:g} s")
        points = np.tile(self.joints, (len(t), 1))
        order = [known.index(n) for n in names]
        for i, row in enumerate(positions):
            points[i, order] = self._values(names, row, efforts[i] if i < len(efforts) else (), i)
        inside = self.limits.inside(points).all(axis=1)
        if not inside.all():
            i = int(np.argmin(inside))
            self.limits.check(points[i], f"point {i}")
        return points

    def _values(
        self, names: Sequence[str], positions: Sequence[float], efforts: Sequence[float], point: int
    ) -> Sequence[float]:
        """Return the value of each of `names` out of positions and efforts of a point."""
        table = {joint.name: joint for joint in self.limits.table}
        if not len(efforts) and not self.limits.has_efforts:
            if len(positions) != len(names):
                raise CommandError(f"point {point} has {len(positions)} positions for {len(names)} joints")
            return positions
        values = []
        for i, joint in enumerate(table[name] for name in names):
            words = ("effort", "position") if joint.is_effort else ("position", "effort")
            own, other = (efforts, positions) if joint.is_effort else (positions, efforts)
            for what, row in zip(words, (own, other), strict=True):
                if len(row) != len(names) and (what == words[0] or len(row)):
                    plural = what if what == "effort" else "positions"
                    raise CommandError(
                        f"point {point} has {len(row)} {plural} for {len(names)} joints; {joint.name} takes "
                        f"a {joint.quantity} [{joint.unit}] as {words[0]}"
                    )
            if len(other) and not (other[i] == 0 or np.isnan(other[i])):
                raise CommandError(
                    f"point {point}: {joint.name} has the {words[1]} {other[i]:g}, but takes a {joint.quantity} "
                    f"[{joint.unit}] as {words[0]}: set its {words[1]} to 0 or NaN"
                )
            values.append(own[i])
        return values

    def _checked_velocities(
        self, names: Sequence[str], velocities: Sequence[Sequence[float]], count: int
    ) -> FloatArray:
        known = self.limits.joints
        order = [known.index(n) for n in names]
        slopes = np.zeros((count, len(known)))
        if self.limits.has_efforts:
            name = next(joint.name for joint in self.limits.table if joint.is_effort)
            raise CommandError(
                f"the points of the trajectory have velocities, which {name} cannot have, since it takes an "
                "effort: leave them out"
            )
        if len(velocities) != count:
            raise CommandError(
                f"{len(velocities)} points of {count} have velocities; all must have them, or none"
            )
        for i, row in enumerate(velocities):
            if len(row) != len(names):
                raise CommandError(f"point {i} has {len(row)} velocities for {len(names)} joints")
            slopes[i, order] = row
        if not (ok := np.abs(slopes) <= self.limits.speed + 1e-9).all():  # NaN fails
            i, k = divmod(int(np.argmin(ok)), len(known))
            unit = f"{self.limits.table[k].unit}/s"
            most = f"{self.limits.speed[k]:g} {unit}"
            raise CommandError(
                f"point {i}: velocity of {known[k]} is {slopes[i, k]:g} {unit}; allowed: up to {most}"
            )
        return slopes
