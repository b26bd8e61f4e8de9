"""What may reach the servos, and when. Pure: the caller gives the time."""

from collections.abc import Sequence
from dataclasses import replace
from enum import IntEnum

import numpy as np

from tripod_driver.link import Link, LinkState
from tripod_driver.protocol import LegacyProtocol
from tripod_graph.command import Activity, CommandFollower, CommandLimits
from tripod_graph.mode import Mode, ModeTracker
from tripod_graph.names import SERVOS


class DriverState(IntEnum):
    """Values of tripod_msgs/RobotStatus.state; FAULT is for protocols whose board can report one."""

    DISCONNECTED = 0
    CONNECTING = 1
    READY = 2
    ACTIVE = 3
    HOLDING = 4
    PARKED = 5


class Driver:
    """Turns commands into packets on a link.

    Packets leave only between `activate` and `deactivate`, while the link is ready: one when the bytes
    change, at most one per `tick`, and the last one again after `keep_alive`. Trajectories are followed only
    when the control mode is not STOP and `halt` was not called since it last changed; others are checked and
    ignored. Whatever interrupts the motion (STOP, `halt`, another mode, a lost link, `deactivate`) makes the
    joints hold; the next command ramps from there, at the slew rate.

    Attributes:
        link: The port and its state.
        protocol: The language of the board.
        rejected: Messages refused.
        last_rejection: Why the newest of them was refused.
        packets_sent: Packets handed to the port.
        bytes_sent: Their bytes.
    """

    def __init__(
        self,
        link: Link,
        protocol: LegacyProtocol,
        limits: CommandLimits,
        *,
        start: Sequence[float] | None = None,
        keep_alive: float = 0.1,
        period: float = 0.02,
    ) -> None:
        """Begin disconnected and inactive.

        Args:
            link: The port and its state.
            protocol: The language of the board.
            limits: Bounds of what may be commanded.
            start: Angles in which the servos are assumed now [rad], shape (3,): the board cannot be asked.
                None means the park position.
            keep_alive: Longest time between two packets [s].
            period: Time from one `tick` to the next [s]; after a stall the joints move on as if it had been two.
        """
        self.link, self.protocol = link, protocol
        self.rejected, self.last_rejection = 0, ""
        self.packets_sent, self.bytes_sent = 0, 0
        self._period, self._keep_alive = period, keep_alive
        joints = None if start is None else [*start, limits.park[3]]
        self._follower = CommandFollower(limits, joints, longest_step=2 * period)
        self._mode = ModeTracker()
        self._active = self._halted = self._connected = False
        self._ignored = 0
        self._packet, self._sent_at = b"", float("-inf")
        self._sent = (float("nan"),) * len(SERVOS)

    @property
    def state(self) -> DriverState:
        """What it is doing."""
        if self.link.state is not LinkState.READY:
            return DriverState[self.link.state.name]
        if not self._active:
            return DriverState.READY
        return {
            Activity.ACTIVE: DriverState.ACTIVE,
            Activity.HOLDING: DriverState.HOLDING,
            Activity.PARKED: DriverState.PARKED,
        }[self._follower.activity]

    @property
    def message(self) -> str:
        """What is wrong and what to do about it; empty when all is well."""
        if self.link.message:
            return self.link.message
        if self._halted:
            return "stopped by service; change the control mode to go on"
        if self._ignored and not self._active:
            return "not active: commands are ignored"
        if self._ignored and self._mode.mode is Mode.STOP:
            return "control mode is STOP: commands are ignored"
        low, high = self.protocol.lowest, self.protocol.highest
        for name, angle in zip(SERVOS, self._follower.joints, strict=False):
            if not low <= angle <= high:
                carried = f"protocol {self.protocol.name} carries {low:.3f} to {high:.3f} rad"
                return f"{name} is asked for {angle:.3f} rad, {carried}: the nearest is sent"
        return ""

    @property
    def mode(self) -> Mode:
        """The control mode in force."""
        return self._mode.mode

    @property
    def commanded(self) -> tuple[float, ...]:
        """Angles asked for, within limits [rad], shape (3,)."""
        return tuple(float(angle) for angle in self._follower.goal[: len(SERVOS)])

    @property
    def sent(self) -> tuple[float, ...]:
        """Angles in the last packet, decoded [rad], shape (3,); NaN before the first."""
        return self._sent

    @property
    def can_move(self) -> bool:
        """Whether packets may leave now."""
        return self._active and self.link.state is LinkState.READY

    @property
    def at_rest(self) -> bool:
        """Whether the set-point is where it should be and the last packet says so."""
        joints = self._follower.joints
        return np.allclose(joints, self._follower.goal, rtol=0, atol=1e-9) and self._packet == self._bytes()

    def connect(self) -> None:
        """Let `tick` open the port, and open it again whenever it is lost."""
        self._connected = True

    def disconnect(self) -> None:
        """Close the port."""
        self._active = self._connected = False
        self._packet = b""
        self.link.close()

    def activate(self, now: float) -> None:
        """Allow motion; the joints begin by holding where they are assumed or were sent."""
        self._active = True
        self._ignored = 0
        self._rest(now)

    def deactivate(self) -> None:
        """Send nothing more; the servos keep the last angles."""
        self._active = False
        self._ignored = 0

    def trajectory(
        self, names: Sequence[str], times: Sequence[float], positions: Sequence[Sequence[float]], now: float
    ) -> None:
        """Follow a trajectory from `now` [s] on, if that is allowed; see `CommandFollower.accept`.

        Raises:
            CommandError: it is refused and counted, whether motion is allowed or not.
        """
        allowed = self.can_move and not self._halted and self._mode.mode is not Mode.STOP
        try:
            if allowed:
                self._follower.accept(names, times, positions, now)
            else:
                self._follower.check(names, times, positions)
                self._ignored += 1
        except ValueError as error:
            self._reject(error)
            raise

    def control_mode(self, mode: int, stamp: float, now: float) -> None:
        """Take what an operator decided at `stamp` [s]; an unknown mode raises ValueError and is counted."""
        try:
            changed = self._mode.update(mode, stamp)
        except ValueError as error:
            self._reject(error)
            raise
        if not changed:
            return
        self._halted = False
        self._ignored = 0
        if self._mode.mode is Mode.STOP:
            self._follower.stop(now)
        else:
            self._rest(now)

    def halt(self, now: float) -> None:
        """Hold at once and ignore commands until the control mode changes."""
        self._halted = True
        self._follower.stop(now)

    def park(self, now: float) -> None:
        """Move to the park position now and ignore commands; `at_rest` tells when it is there."""
        limits = replace(self._follower.limits, park_after=0.0)
        joints = [float(value) for value in self._follower.joints]
        self._follower = CommandFollower(limits, joints, longest_step=2 * self._period)
        self._follower.setpoint(now)
        self._halted = True

    def tick(self, now: float) -> bool:
        """Do what is due at `now` [s]; return whether a packet was sent. Call it at the packet rate."""
        if not self._connected:
            return False
        before = self.link.state
        if self.link.poll(now) is not LinkState.READY:
            return False
        if before is not LinkState.READY:
            self._packet = b""
            self._rest(now)
        if not self._active:
            return False
        self._follower.setpoint(now)
        packet = self._bytes()
        if packet == self._packet and now + self._period <= self._sent_at + self._keep_alive:
            return False
        if not self.link.write(packet, now):
            return False
        self._packet, self._sent_at, self._sent = packet, now, self.protocol.decode(packet)
        self.packets_sent += 1
        self.bytes_sent += len(packet)
        return True

    def _bytes(self) -> bytes:
        return self.protocol.encode([float(angle) for angle in self._follower.joints[: len(SERVOS)]])

    def _rest(self, now: float) -> None:
        """Hold where the joints are; what is parked, or on its way there, stays so."""
        if self._follower.activity is not Activity.PARKED:
            self._follower.stop(now)

    def _reject(self, error: ValueError) -> None:
        self.rejected += 1
        self.last_rejection = str(error)
