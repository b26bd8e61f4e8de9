"""What may reach the robot, and when: a state machine without port, clock or thread; the caller gives the time."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from enum import IntEnum
from typing import Final

import numpy as np

from tripod_driver.place import Place
from tripod_graph.command import Activity, CommandError, CommandFollower, CommandLimits
from tripod_graph.goal import GOAL_SHARE, Motion, motion_of
from tripod_graph.joint import Joint
from tripod_graph.mode import Decision, Mode, ModeTracker
from tripod_graph.range import cut
from tripod_host.arrays import FloatArray

PULSE_PERIOD: Final = 0.02
"""From pulse to pulse of a servo [s]: no two packets differ by more than the slew rate allows in this time."""

CREEP: Final = np.radians(20.0)
"""Speed of the first motion where nobody knows from where [rad/s]: slow enough to reach for the switch."""

CREEPING: Final = "the positions of the servos are unknown: the first motion is slow, 20 degrees a second"


class State(IntEnum):
    """Values of tripod_msgs/RobotStatus.state."""

    DISCONNECTED = 0
    CONNECTING = 1
    READY = 2
    ACTIVE = 3
    HOLDING = 4
    PARKED = 5
    FAULT = 6


MOVING = {
    Activity.ACTIVE: State.ACTIVE,
    Activity.HOLDING: State.HOLDING,
    Activity.PARKED: State.PARKED,
}


class Safety:
    """Decides at each moment which joint values may be sent, if any: angles, lengths of cables, pressures.

    `setpoint` gives values only between `activate` and `deactivate`, only while the board is ready, and only after a
    command, or to hold what the board holds on this driver's behalf. The first are those of the place where the servos
    stand, see `ready`; from there on they move no faster than the slew rate, into the safe range of each servo and
    within it, whatever happens in between. Where nobody knows the place, the motion to the first commanded pose creeps.
    Trajectories are followed only from the source in charge (`ModeTracker`), and not after `halt` until another
    decision is in force; others are checked and ignored. Whatever interrupts the motion (STOP, `halt`, another mode,
    a lost operator, a lost or reset board, `deactivate`) makes the joints hold; the next command ramps from there.
    Silence makes them hold, then park. A fault ends all motion until `clear`. Where the board itself has to find a
    place (`unplaced`), nothing moves but what `home` starts, and that as long as a decision is in force.

    Attributes:
        authority: Who is in charge.
        range: What is sent: commands beyond are followed to the nearest within.
        moment: Gives the time by which trajectories pass [s] for a steady time [s]; see `MotionClock`.
        rejected: Messages refused.
        last_rejection: Why the newest of them was refused.
    """

    def __init__(
        self,
        limits: CommandLimits,
        lower: Sequence[float],
        upper: Sequence[float],
        *,
        start: Sequence[float] | None = None,
    ) -> None:
        """Begin disconnected and inactive.

        Args:
            limits: Bounds of what may be commanded.
            lower: Smallest values that may be sent [rad, m, Pa], shape (n,).
            upper: Largest values that may be sent [rad, m, Pa], shape (n,).
            start: Where the servos are guessed to be before a place is known [rad], shape (s,); None means the park
                position.

        Raises:
            CommandError: a joint has no value that may both be commanded and sent.
        """
        self._lower, self._upper = np.array(lower, float), np.array(upper, float)
        for i, joint in enumerate(limits.table[:-1]):
            if not max(self._lower[i], joint.low) < min(self._upper[i], joint.high):
                safe = f"{self._lower[i]:g} to {self._upper[i]:g} {joint.unit}"
                asked = f"angle_min {joint.low:g} to angle_max {joint.high:g} rad"
                remedy = "calibrate, or change angle_min and angle_max"
                if joint.unit != "rad":
                    asked, remedy = f"its range {joint.low:g} to {joint.high:g} {joint.unit}", "calibrate"
                raise CommandError(
                    f"{joint.name} has the safe range {safe}, which does not overlap with {asked}: {remedy}"
                )
        self.range = self._range(limits)
        self.rejected, self.last_rejection = 0, ""
        self.moment: Callable[[float], float] = lambda now: now
        self._limits = limits
        joints = None if start is None else [*start, *limits.park[limits.count :]]
        self._follower = CommandFollower(limits, joints, longest_step=PULSE_PERIOD)
        self.authority = ModeTracker()
        self._board = State.DISCONNECTED
        self._trouble = "the port was not opened yet"
        self._notice = self._unplaced = ""
        self._active = self._halted = self._homing = False
        self._asked = False
        self._creeping = False
        self._ignored = 0
        self._now = float("-inf")
        self._output = self._follower.joints[:-1].copy()
        self._held = self._upper.copy()
        self._moved_at: float | None = None
        servos = np.arange(limits.size) < limits.count
        self._creep = np.where(servos, CREEP, np.inf)
        self._near = np.where(servos, np.radians(0.5), GOAL_SHARE * (limits.upper - limits.lower)[:-1])

    def _range(self, limits: CommandLimits) -> CommandLimits:
        return limits.within(
            self._lower.tolist(), self._upper.tolist(), limits.speed[:-1].tolist(), limits.required
        )

    def adopt(self, limits: CommandLimits) -> None:
        """Keep to other slew rates and times from now on; their angles are those of before."""
        parking = self._follower.limits is not self._limits
        self.range = self._range(limits)
        self._limits = limits
        self._follower.limits = replace(limits, park_after=0.0) if parking else limits

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The joints, without the slide."""
        return self._limits.table[:-1]

    @property
    def state(self) -> State:
        """What it is doing."""
        if self._board is not State.READY or not self._active or self._unplaced:
            return self._board
        return MOVING[self._follower.activity]

    @property
    def message(self) -> str:
        """What is wrong and what to do about it; empty when all is well."""
        if self._board is not State.READY:
            return self._trouble
        if self._unplaced and not self._halted:
            return self._unplaced
        if self._creeping or self._notice:
            return CREEPING if self._creeping else self._notice
        if self._halted or (self._ignored and not self._active):
            return self._deafness
        return next(self.authority.notices(self._now), "") or cut(self._follower.joints, self.range)

    @property
    def _deafness(self) -> str:
        """Why no command is obeyed, whoever sends it; empty if those of who is in charge are."""
        if self._board is not State.READY:
            return self._trouble
        if self._halted:
            return "stopped by a service call; change the control mode to move again"
        return self._unplaced if self._active else "the driver is not active: commands are ignored"

    def motion(self, now: float) -> Motion:
        """Return what it does at `now` [s], for who waits for the end of a trajectory."""
        why = self._deafness or self._notice or self.authority.in_force
        found = motion_of(self._follower, self.place, self.moment(now), why)
        return found if self.listens else replace(found, trajectory=None)

    @property
    def commanded(self) -> tuple[float, ...]:
        """Values asked for, within limits [rad, m, Pa], shape (n,)."""
        return tuple(float(value) for value in self._follower.goal[:-1])

    @property
    def place(self) -> tuple[float, ...]:
        """Where the joints are, or are guessed to be [rad, m, Pa], shape (n,)."""
        return tuple(float(value) for value in self._output)

    @property
    def place_known(self) -> bool:
        """Whether the joints surely are at `place`."""
        return self._board is State.READY and not self._creeping and not self._unplaced

    @property
    def can_move(self) -> bool:
        """Whether packets may leave now: it is active, the board ready, and something asked for."""
        return self.listens and self._asked

    @property
    def longest_step(self) -> FloatArray:
        """Longest way from one packet to the next [rad, m, Pa], shape (n,)."""
        return self._limits.speed[:-1] * PULSE_PERIOD

    @property
    def is_active(self) -> bool:
        """Whether motion is allowed, be the board ready or not."""
        return self._active

    @property
    def listens(self) -> bool:
        """Whether commands may move the robot: it is active, the board ready, and each place known or guessed."""
        return self._active and self._board is State.READY and not self._unplaced

    @property
    def at_rest(self) -> bool:
        """Whether what may be sent is where it should be."""
        goal = np.clip(self._follower.goal[:-1], self._lower, self._held)
        return bool(np.abs(self._output - goal).max() <= 1e-9)

    # the board ------------------------------------------------------------------------------------------------

    def disconnected(self, now: float, why: str) -> None:
        """There is no board, because of `why`; a fault stays a fault."""
        self._leave(State.DISCONNECTED, now, why)

    def connecting(self, now: float, why: str) -> None:
        """The board is there but does not answer yet."""
        self._leave(State.CONNECTING, now, why)

    def fault(self, now: float, why: str) -> None:
        """The board must not be driven, because of `why`, until `clear`."""
        self._leave(State.FAULT, now, why)

    def ready(self, now: float, place: Place) -> None:
        """The board answers; from `place` the next ramp begins, even if that is outside of the limits."""
        if self._board in (State.READY, State.FAULT):
            return
        self._board, self._trouble = State.READY, ""
        self._asked = self._active and place.kept
        self._creeping = not place.known
        joints = self._stand(place.angles)
        parked = bool((np.abs(joints - self._limits.park)[:-1] <= self._near).all())
        if not (parked and self._follower.activity is Activity.PARKED):
            self._follower = CommandFollower(self._limits, joints.tolist(), longest_step=PULSE_PERIOD)
            self._follower.stop(self.moment(now))

    def moved(self, values: Sequence[float]) -> None:
        """Somebody else has moved the joints to `values` [rad, m, Pa], shape (n,): what is sent goes on from there."""
        self._follower.joints = self._stand(values)

    def _stand(self, values: Sequence[float]) -> FloatArray:
        """Take the place of the joints, shape (n,); return the nearest within limits, shape (n + 1,)."""
        self._output, self._moved_at = np.array(values, float), None
        joints = self._follower.joints.copy()
        joints[:-1] = self._within(values)
        return joints

    def _within(self, values: Sequence[float] | FloatArray) -> FloatArray:
        """Return the nearest that may be commanded, shape (n,)."""
        return np.clip(values, self._limits.lower[:-1], self._limits.upper[:-1])

    def unplaced(self, why: str) -> None:
        """The board does not know a place, because of `why`; empty: it does."""
        self._homing = self._homing and bool(why)
        self._asked = self._asked and not why
        self._unplaced = why

    def hold_back(self, most: Mapping[int, float]) -> None:
        """Send no more than `most` [m, Pa] to these joints, by their number, as long as it is said."""
        self._held = self._upper.copy()
        for i, value in most.items():
            self._held[i] = max(min(value, self._upper[i]), self._lower[i])

    def clear(self) -> None:
        """Forget a fault: somebody has looked."""
        if self._board is State.FAULT:
            self._board, self._trouble = State.DISCONNECTED, "the port was not opened yet"

    def interrupt(self, now: float, why: str) -> None:
        """Hold because of `why`, if there is a motion; the next command goes on from there."""
        self._homing = False
        if self._active and self._follower.activity is Activity.ACTIVE:
            self._notice = why
        self._follower.rest(self.moment(now))

    def forget(self, why: str) -> None:
        """Say `why` no more: what interrupted the motion is over."""
        if self._notice == why:
            self._notice = ""

    # the operator ---------------------------------------------------------------------------------------------

    def activate(self, now: float) -> None:
        """Allow motion; nothing is sent before a command, except to go on holding what the board holds."""
        self._active = True
        self._ignored = 0
        self._follower.rest(self.moment(now))

    def deactivate(self) -> None:
        """Give no more values."""
        self._active = self._asked = self._homing = False
        self._ignored = 0

    def trajectory(
        self,
        names: Sequence[str],
        times: Sequence[float],
        positions: Sequence[Sequence[float]],
        now: float,
        *,
        source: str,
        velocities: Sequence[Sequence[float]] = (),
        efforts: Sequence[Sequence[float]] = (),
        age: float = 0.0,
    ) -> str:
        """Follow a trajectory of `source` if that is allowed; return why it is not, else nothing.

        See `CommandFollower.accept`.

        Raises:
            CommandError: it is refused, whether motion is allowed or not.
        """
        self.look(now)
        if why := self.authority.admits(source, now) or self._deafness:
            self._follower.check(names, times, positions, velocities=velocities, efforts=efforts, age=age)
            self._ignored += 1
        else:
            place = self._follower.joints.copy()
            place[:-1] = self._within(self.place)
            moment = self.moment(now)
            self._follower.accept(
                names, times, positions, moment, velocities=velocities, efforts=efforts, age=age, place=place
            )
            self._notice, self._asked = "", True
        return why

    def control_mode(self, decision: Decision, wall: float, now: float) -> None:
        """Take what an operator says; see `ModeTracker.hear`. Raises ValueError for what cannot be."""
        self.look(now)
        before = self.authority.decided
        if self.authority.hear(decision, wall, now):
            if self.authority.decided != before:  # where it is the same, only a lost operator is back
                self._halted = False
            self._obey(now)

    def look(self, now: float) -> None:
        """Hold if the operator in charge is lost, or inverse kinematics in the midst of a trajectory: at each tick."""
        self._now = max(now, self._now)
        if self.authority.lapse(now):
            self._obey(now)
        if self._follower.activity is Activity.ACTIVE and not self.authority.is_fed(now):
            self._follower.stop(self.moment(now))

    def _obey(self, now: float) -> None:
        """Hold, because something else is in force now: nothing of another decision's trajectory goes on."""
        self._notice = ""
        self._ignored = 0
        self._homing = False
        if self.authority.mode is Mode.STOP:
            self._stop(now)
        else:
            self._follower.rest(self.moment(now))

    @property
    def homing(self) -> bool:
        """Whether the board may look for places that it does not know."""
        return self._homing

    def home(self) -> str:
        """Let the board look for places that it does not know; return why not, empty if it may.

        It ends with the decision that is in force, as other motion does.
        """
        if self._board is not State.READY or not self._active or self._halted:
            return self._deafness
        if self.authority.mode is Mode.STOP or self.authority.lost:
            return "nobody is in charge: choose a control mode other than STOP first, then home again"
        self._homing = bool(self._unplaced)
        return ""

    def halt(self, now: float) -> None:
        """Hold at once and ignore commands until the control mode changes."""
        self._halted, self._homing = True, False
        self._stop(now)

    def park(self, now: float) -> None:
        """Move to the park position now and ignore commands; `at_rest` tells when it is there."""
        self._follow_from_here(replace(self._limits, park_after=0.0))
        self._follower.setpoint(self.moment(now))
        self._halted, self._homing = True, False

    # the output -----------------------------------------------------------------------------------------------

    def setpoint(self, now: float) -> FloatArray | None:
        """Return the values to be sent at `now` [s], shape (n,); None: nothing may be sent. Call it at each tick."""
        if not self.can_move:
            return None
        dt = 0.0 if self._moved_at is None else min(max(0.0, now - self._moved_at), PULSE_PERIOD)
        self._moved_at = now if self._moved_at is None else max(now, self._moved_at)
        asked = np.clip(self._follower.setpoint(self.moment(now))[:-1], self._lower, self._held)
        if self._follower.activity is not Activity.HOLDING:  # that is to stay, also outside of the range
            speed = self._limits.speed[:-1]
            step = dt * (np.minimum(self._creep, speed) if self._creeping else speed)
            self._output = self._output + np.clip(asked - self._output, -step, step)
            behind = self._output != asked
            self._follower.joints[:-1][behind] = self._within(self._output)[behind]
            if self._creeping:
                end = np.clip(self._follower.end[:-1], self._lower, self._held)
                self._creeping = bool((np.abs(self._output - end) > self._near).any())
        return self._output.copy()

    def _leave(self, board: State, now: float, why: str) -> None:
        if self._board is State.FAULT:
            return
        if self._board is State.READY:
            self._follower.rest(self.moment(now))
        self._board, self._trouble, self._asked = board, why, False
        self._unplaced, self._homing = "", False

    def _stop(self, now: float) -> None:
        """Hold where the joints are, also after `park`."""
        if self._follower.limits is not self._limits:
            self._follow_from_here(self._limits)
        self._follower.stop(self.moment(now))

    def _follow_from_here(self, limits: CommandLimits) -> None:
        joints = [float(value) for value in self._follower.joints]
        self._follower = CommandFollower(limits, joints, longest_step=PULSE_PERIOD)

    def reject(self, error: ValueError) -> None:
        """Count a message that is refused."""
        self.rejected += 1
        self.last_rejection = str(error)
