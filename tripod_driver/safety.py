"""What may reach the servos, and when: a state machine without port, clock or thread; the caller gives the time."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import IntEnum
from typing import Final

import numpy as np

from tripod_driver.place import Place
from tripod_graph.command import Activity, CommandError, CommandFollower, CommandLimits
from tripod_graph.goal import Motion, motion_of
from tripod_graph.mode import Decision, Mode, ModeTracker
from tripod_graph.names import servo_names
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
    """Decides at each moment which angles may be sent, if any.

    `setpoint` gives angles only between `activate` and `deactivate`, only while the board is ready, and only after a
    command, or to hold what the board holds on this driver's behalf. The first are those of the place where the servos
    stand, see `ready`; from there on they move no faster than the slew rate, into the safe range of each servo and
    within it, whatever happens in between. Where nobody knows the place, the motion to the first commanded pose creeps.
    Trajectories are followed only from the source in charge (`ModeTracker`), and not after `halt` until another
    decision is in force; others are checked and ignored. Whatever interrupts the motion (STOP, `halt`, another mode,
    a lost operator, a lost or reset board, `deactivate`) makes the joints hold; the next command ramps from there.
    Silence makes them hold, then park. A fault ends all motion until `clear`.

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
            lower: Smallest angles that may be sent [rad], shape (s,).
            upper: Largest angles that may be sent [rad], shape (s,).
            start: Where the servos are guessed to be before a place is known [rad], shape (s,); None means the park
                position.

        Raises:
            CommandError: a servo has no angle that may both be commanded and sent.
        """
        self._lower, self._upper = np.array(lower, float), np.array(upper, float)
        for i, name in enumerate(servo_names(limits.count)):
            if not max(self._lower[i], limits.angle_min) < min(self._upper[i], limits.angle_max):
                safe = f"{self._lower[i]:g} to {self._upper[i]:g} rad"
                asked = f"angle_min {limits.angle_min:g} to angle_max {limits.angle_max:g} rad"
                raise CommandError(
                    f"{name} has the safe range {safe}, which does not overlap with {asked}: calibrate, or change "
                    "angle_min and angle_max"
                )
        self.range = limits.within(lower, upper, [limits.angle_speed] * limits.count)
        self.rejected, self.last_rejection = 0, ""
        self.moment: Callable[[float], float] = lambda now: now
        self._limits = limits
        joints = None if start is None else [*start, limits.park[-1]]
        self._follower = CommandFollower(limits, joints, longest_step=PULSE_PERIOD)
        self.authority = ModeTracker()
        self._board = State.DISCONNECTED
        self._trouble = "the port was not opened yet"
        self._notice = ""
        self._active = self._halted = False
        self._asked = False
        self._creeping = False
        self._ignored = 0
        self._now = float("-inf")
        self._output = self._follower.joints[:-1].copy()
        self._moved_at: float | None = None

    def adopt(self, limits: CommandLimits) -> None:
        """Keep to other slew rates and times from now on; their angles are those of before."""
        parking = self._follower.limits is not self._limits
        self.range = limits.within(
            self._lower.tolist(), self._upper.tolist(), [limits.angle_speed] * limits.count
        )
        self._limits = limits
        self._follower.limits = replace(limits, park_after=0.0) if parking else limits

    @property
    def servos(self) -> tuple[str, ...]:
        """Names of the servos' joints."""
        return servo_names(self._limits.count)

    @property
    def state(self) -> State:
        """What it is doing."""
        if self._board is not State.READY or not self._active:
            return self._board
        return MOVING[self._follower.activity]

    @property
    def message(self) -> str:
        """What is wrong and what to do about it; empty when all is well."""
        if self._board is not State.READY:
            return self._trouble
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
        return "" if self._active else "the driver is not active: commands are ignored"

    def motion(self, now: float) -> Motion:
        """Return what it does at `now` [s], for who waits for the end of a trajectory."""
        why = self._deafness or self._notice or self.authority.in_force
        found = motion_of(self._follower, self.place, self.moment(now), why)
        return found if self.listens else replace(found, trajectory=None)

    @property
    def commanded(self) -> tuple[float, ...]:
        """Angles asked for, within limits [rad], shape (s,)."""
        return tuple(float(angle) for angle in self._follower.goal[:-1])

    @property
    def place(self) -> tuple[float, ...]:
        """Where the servos are, or are guessed to be [rad], shape (s,)."""
        return tuple(float(angle) for angle in self._output)

    @property
    def place_known(self) -> bool:
        """Whether the servos surely are at `place`."""
        return self._board is State.READY and not self._creeping

    @property
    def can_move(self) -> bool:
        """Whether packets may leave now: it is active, the board ready, and something asked for."""
        return self.listens and self._asked

    @property
    def longest_step(self) -> float:
        """Longest way from one packet to the next [rad]."""
        return self._limits.angle_speed * PULSE_PERIOD

    @property
    def is_active(self) -> bool:
        """Whether motion is allowed, be the board ready or not."""
        return self._active

    @property
    def listens(self) -> bool:
        """Whether commands may move the servos: it is active and the board ready."""
        return self._active and self._board is State.READY

    @property
    def at_rest(self) -> bool:
        """Whether what may be sent is where it should be."""
        goal = np.clip(self._follower.goal[:-1], self._lower, self._upper)
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
        parked = np.allclose(joints, self._limits.park, rtol=0, atol=np.radians(0.5))
        if not (parked and self._follower.activity is Activity.PARKED):
            self._follower = CommandFollower(self._limits, joints.tolist(), longest_step=PULSE_PERIOD)
            self._follower.stop(self.moment(now))

    def moved(self, angles: Sequence[float]) -> None:
        """Somebody else has moved the servos to `angles` [rad], shape (s,): what is sent goes on from there."""
        self._follower.joints = self._stand(angles)

    def _stand(self, angles: Sequence[float]) -> FloatArray:
        """Take the place of the servos [rad], shape (s,); return the nearest joints within limits, shape (s + 1,)."""
        self._output, self._moved_at = np.array(angles, float), None
        joints = self._follower.joints.copy()
        joints[:-1] = np.clip(angles, self._limits.angle_min, self._limits.angle_max)
        return joints

    def clear(self) -> None:
        """Forget a fault: somebody has looked."""
        if self._board is State.FAULT:
            self._board, self._trouble = State.DISCONNECTED, "the port was not opened yet"

    def interrupt(self, now: float, why: str) -> None:
        """Hold because of `why`, if there is a motion; the next command goes on from there."""
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
        """Give no more angles."""
        self._active = self._asked = False
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
            place[:-1] = np.clip(self.place, self._limits.angle_min, self._limits.angle_max)
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
        if self.authority.mode is Mode.STOP:
            self._stop(now)
        else:
            self._follower.rest(self.moment(now))

    def halt(self, now: float) -> None:
        """Hold at once and ignore commands until the control mode changes."""
        self._halted = True
        self._stop(now)

    def park(self, now: float) -> None:
        """Move to the park position now and ignore commands; `at_rest` tells when it is there."""
        self._follow_from_here(replace(self._limits, park_after=0.0))
        self._follower.setpoint(self.moment(now))
        self._halted = True

    # the output -----------------------------------------------------------------------------------------------

    def setpoint(self, now: float) -> FloatArray | None:
        """Return the angles to be sent at `now` [s], shape (s,); None: nothing may be sent. Call it at each tick."""
        if not self.can_move:
            return None
        dt = 0.0 if self._moved_at is None else min(max(0.0, now - self._moved_at), PULSE_PERIOD)
        self._moved_at = now if self._moved_at is None else max(now, self._moved_at)
        asked = np.clip(self._follower.setpoint(self.moment(now))[:-1], self._lower, self._upper)
        if self._follower.activity is not Activity.HOLDING:  # that is to stay, also outside of the range
            step = dt * (min(CREEP, self._limits.angle_speed) if self._creeping else self._limits.angle_speed)
            self._output = self._output + np.clip(asked - self._output, -step, step)
            behind = self._output != asked
            self._follower.joints[:-1][behind] = np.clip(
                self._output, self._limits.angle_min, self._limits.angle_max
            )[behind]
            if self._creeping:
                end = np.clip(self._follower.end[:-1], self._lower, self._upper)
                self._creeping = not np.allclose(self._output, end, rtol=0, atol=np.radians(0.5))
        return self._output.copy()

    def _leave(self, board: State, now: float, why: str) -> None:
        if self._board is State.FAULT:
            return
        if self._board is State.READY:
            self._follower.rest(self.moment(now))
        self._board, self._trouble, self._asked = board, why, False

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
