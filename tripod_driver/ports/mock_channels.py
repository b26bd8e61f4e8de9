"""Channels of a board in memory, as `firmware/channels.c` has them: winches and pressures with limited rates."""

from collections.abc import Callable, Sequence
from typing import Final

from tripod_driver.framed_messages import ChannelFlags, ChannelKind, ChannelState, ErrorCode

PERIOD: Final = 0.02
"""Between two changes of the set-points [s]."""

HIGHEST: Final = {ChannelKind.WINCH: 6000, ChannelKind.PRESSURE: 800}
SLEW: Final = {ChannelKind.WINCH: 10, ChannelKind.PRESSURE: 16}
"""WINCH_MAX, PRESSURE_MAX, WINCH_SLEW and PRESSURE_SLEW of the firmware unless it is built otherwise."""

LEAK_MARGIN, LEAK_TIME = 60, 1.0
"""A pressure may be so many counts too low [counts], for so long [s]."""

AT_HOME, IS_SLACK = 1, 2
"""Bits of what a winch measures."""


class MockChannel:
    """One of them.

    Attributes:
        kind: What it drives.
        broken: Whether its cable is torn, or its hose leaks.
        stuck: Whether its home switch never closes.
        flags, setpoint, measured: As told.
    """

    def __init__(self, kind: ChannelKind, homed: bool) -> None:
        self.kind = kind
        self.broken = self.stuck = False
        self._homed = homed or kind is ChannelKind.PRESSURE
        self._from_home = 0 if self._homed else 40  # where the drum really is [steps]
        self.restart()

    def restart(self) -> None:
        """Forget the place, as a reset does; a winch that was homed is at home."""
        self.flags = ChannelFlags.KNOWN if self._homed else ChannelFlags(0)
        self.setpoint = self.target = self.measured = 0
        self._low_for = 0.0
        self._from_home = 0 if self._homed else self._from_home

    @property
    def state(self) -> ChannelState:
        """The state that the board reports."""
        return ChannelState(self.flags, self.setpoint, self.measured)

    def home(self) -> None:
        """Begin homing, or let it continue."""
        if not self.flags & ChannelFlags.HOMING:
            self.flags, self.target = ChannelFlags.HOMING, 0
            self.setpoint = HIGHEST[self.kind] * 5 // 4

    def set(self, target: int) -> None:
        """Take a target; one below the set-point ends slack and leak."""
        if target < self.setpoint:
            self.flags &= ~(ChannelFlags.SLACK | ChannelFlags.LEAK)
            self._low_for = 0.0
        self.target = target

    def hold(self) -> None:
        """Stop; homing ends."""
        if not self.flags & ChannelFlags.KNOWN:
            self.setpoint = 0
        self.target = self.setpoint
        self.flags &= ~ChannelFlags.HOMING

    def vent(self) -> None:
        """Stop, and let a pressure go."""
        self.hold()
        if self.kind is ChannelKind.PRESSURE:
            self.setpoint = self.target = 0

    @property
    def at_rest(self) -> bool:
        """Whether another period changes nothing."""
        return self.setpoint == self.target and not self.flags & ChannelFlags.HOMING and not self.broken

    def period(self) -> None:
        """Another 20 ms."""
        self._measure()
        if self.flags & ChannelFlags.HOMING:
            self._home()
            return
        if not self.flags & ChannelFlags.KNOWN:
            return
        if self.kind is ChannelKind.WINCH:
            if self.measured & IS_SLACK and self.target > self.setpoint:
                self.flags |= ChannelFlags.SLACK
        elif self.setpoint > self.measured + LEAK_MARGIN:
            self._low_for += PERIOD
            if self._low_for > LEAK_TIME:
                self.flags |= ChannelFlags.LEAK
        else:
            self._low_for = 0.0
        if self.flags & (ChannelFlags.SLACK | ChannelFlags.LEAK):
            self.target = min(self.target, self.setpoint)
        slew, before = SLEW[self.kind], self.setpoint
        self.setpoint += min(max(self.target - before, -slew), slew)
        self._from_home += self.setpoint - before
        self._measure()

    def _measure(self) -> None:
        if self.kind is ChannelKind.PRESSURE:
            self.measured = 0 if self.broken else self.setpoint
        else:
            at_home = self._from_home <= 0 and not self.stuck
            self.measured = AT_HOME * at_home + IS_SLACK * self.broken

    def _home(self) -> None:
        if self.measured & AT_HOME:
            self.flags, self.setpoint = ChannelFlags.KNOWN, 0
        elif self.setpoint < 1:
            self.flags = ChannelFlags.HOME_FAILED
        else:
            self.setpoint -= 1
            self._from_home -= 1


class MockChannels:
    """All of a board.

    Attributes:
        all: In their order.
    """

    def __init__(
        self, kinds: Sequence[ChannelKind], clock: Callable[[], float], watchdog: float, *, homed: bool
    ) -> None:
        """`clock` gives the time of periods and `watchdog` [s]; `homed`: whether the winches are at home."""
        self._clock, self._watchdog = clock, watchdog
        self.all = [MockChannel(kind, homed) for kind in kinds]
        self.restart()

    def restart(self) -> None:
        """The board was reset."""
        for channel in self.all:
            channel.restart()
        self._kept_at: float | None = None
        self._at = self._clock()

    def keep(self) -> None:
        """The host said what keeps the channels."""
        self._kept_at = self._clock()

    def refusal(self, targets: Sequence[int]) -> tuple[ErrorCode, int] | None:
        """Return why these targets are refused, and the channel; None: they are taken."""
        for i, (channel, target) in enumerate(zip(self.all, targets, strict=True)):
            if target > HIGHEST[channel.kind]:
                return ErrorCode.CHANNEL, i
            if not channel.flags & ChannelFlags.KNOWN and target != channel.target:
                return ErrorCode.PLACE, i
        return None

    def advance(self) -> bool:
        """Let time pass; return whether the host was silent for the time of the watchdog."""
        if not self.all:
            return False
        now, silent = self._clock(), False
        while now >= self._at + PERIOD and not all(channel.at_rest for channel in self.all):
            self._at += PERIOD
            silent = self._is_silent(self._at) or silent
            for channel in self.all:
                channel.period()
        self._at += PERIOD * max(0, int((now - self._at) / PERIOD))
        return self._is_silent(now) or silent

    def _is_silent(self, now: float) -> bool:
        if (
            self._kept_at is None or now < self._kept_at + self._watchdog + 1e-3
        ):  # in whole milliseconds, as boards
            return False
        self._kept_at = None
        for channel in self.all:
            channel.vent()
        return True
