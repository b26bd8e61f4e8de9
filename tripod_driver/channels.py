"""State of a board's channels (winches, pressures): kind, set-point, and which ones the board holds."""

from collections.abc import Mapping, Sequence
from typing import Final

from tripod_driver.calibration import ChannelCalibration, WinchCalibration
from tripod_driver.framed_messages import (
    ChannelDescription,
    ChannelFlags,
    ChannelKind,
    ChannelState,
    DescribeChannel,
    GetChannels,
    HomeChannel,
    Message,
    SetChannels,
)

HOME_ADVICE: Final = "clear the way of the cables, then: ros2 service call /robot/home std_srvs/srv/Trigger"
"""What to do about a winch that was not homed."""

_WORDS: Final = {ChannelKind.WINCH: "winch", ChannelKind.PRESSURE: "pressure"}
_HELD: Final = ChannelFlags.SLACK | ChannelFlags.LEAK


class Channels:
    """The channels of a board in one conversation; without joints it is empty and says nothing.

    Attributes:
        states: As the board told last, one for each joint; empty: not told yet.
    """

    def __init__(self, joints: Mapping[str, ChannelCalibration]) -> None:
        """`joints`: calibrations by name, in the order of the board's channels."""
        self._joints = joints
        self._names = list(joints)
        self.begin()

    def begin(self) -> None:
        """Clear all states; call it when a conversation starts."""
        self._described = 0
        self.states: tuple[ChannelState, ...] = ()
        self._slew: list[int] = []

    @property
    def complete(self) -> bool:
        """Whether all is told."""
        return len(self.states) == len(self._joints)

    @property
    def question(self) -> Message:
        """What to ask next until all is told."""
        return DescribeChannel(self._described) if self._described < len(self._names) else GetChannels()

    @property
    def setpoints(self) -> tuple[int, ...]:
        """Present set-points [steps, counts]; 0 of a winch that was not homed."""
        return tuple(state.setpoint if state.flags & ChannelFlags.KNOWN else 0 for state in self.states)

    @property
    def steps(self) -> tuple[float, ...]:
        """Largest change of each joint in a period of the board, rounded up [m, Pa]."""
        return tuple((slew + 1) * c.scale for slew, c in zip(self._slew, self._joints.values(), strict=True))

    @property
    def kept(self) -> bool:
        """Whether the board lets a pressure go when it is told nothing."""
        pairs = zip(self._joints.values(), self.states, strict=False)
        return any(c.kind is ChannelKind.PRESSURE and s.setpoint > 0 for c, s in pairs)

    def describe(self, told: ChannelDescription) -> str:
        """Take what the board says of a channel; return why it cannot be driven, empty if it can."""
        count = len(self._names)
        if told.count != count:
            return (
                f"the board has {told.count} channels, the robot {count}: {', '.join(self._names)}; build the "
                "firmware with as many (WINCH_COUNT, PRESSURE_COUNT)"
            )
        if told.number != self._described:
            return ""
        name, joint = self._names[told.number], self._joints[self._names[told.number]]
        if told.kind is not joint.kind:
            return (
                f"channel {told.number} of the board is a {_WORDS[told.kind]}, but {name} needs a "
                f"{_WORDS[joint.kind]}; build the firmware with the channels of the robot"
            )
        most = joint.zero + joint.safe_range[1] / joint.scale
        if most > told.highest + 0.5:
            largest = (told.highest - joint.zero) * joint.scale
            return (
                f"{name} may go to {joint.safe_range[1]:g} {joint.unit}, set-point {most:.0f}; the board takes up to "
                f"{told.highest} ({largest:g} {joint.unit}): narrow its safe_range in the calibration"
            )
        self._slew.append(told.slew)
        self._described += 1
        return ""

    def hear(self, states: Sequence[ChannelState]) -> str:
        """Take states; return what the board did by itself since the last ones, empty if nothing."""
        before, self.states = self.states, tuple(states)
        for i, (old, new) in enumerate(zip(before, states, strict=False)):
            if new.flags & _HELD & ~old.flags:
                return self._why_held(i)
        return ""

    @property
    def held(self) -> Mapping[int, int]:
        """Set-points of the channels that the board holds since cable or hose failed, by their number."""
        return {i: state.setpoint for i, state in enumerate(self.states) if state.flags & _HELD}

    @property
    def odd(self) -> str:
        """Why channels are held; empty if none is."""
        return "; ".join(self._why_held(i) for i in self.held)

    def _why_held(self, i: int) -> str:
        name, joint, state = self._names[i], self._joints[self._names[i]], self.states[i]
        value = (state.setpoint - joint.zero) * joint.scale
        if isinstance(joint, WinchCalibration):
            return (
                f"{name} lost its tension at {1e3 * value:.1f} mm, and the winch holds: look whether the cable is "
                "torn or off its drum, then command less"
            )
        measured = (state.measured - joint.zero) * joint.scale
        return (
            f"{name} is at {1e-3 * measured:.2f} kPa where {1e-3 * value:.2f} kPa are asked for, so it leaks, and "
            "rises no further: look for the hole, then command less"
        )

    # homing -----------------------------------------------------------------------------------------------------

    @property
    def homing(self) -> bool:
        """Whether a winch looks for its home switch."""
        return any(state.flags & ChannelFlags.HOMING for state in self.states)

    def to_home(self, *, begin: bool) -> list[Message]:
        """Return what lets homing begin, of all winches that need it, or continue."""
        if not begin:  # another HomeChannel might begin again what has just ended
            return [SetChannels(self.setpoints)] if self.homing else []
        return [HomeChannel(i) for i, s in enumerate(self.states) if not s.flags & ChannelFlags.KNOWN]

    @property
    def unplaced(self) -> str:
        """Which winches were not homed, so that nothing may move, and what to do; empty if none."""
        pairs = list(zip(self._names, self.states, strict=False))
        lost = [name for name, state in pairs if not state.flags & ChannelFlags.KNOWN]
        if not lost:
            return ""
        if self.homing:
            return f"homing {', '.join(lost)}: the winches pay out slowly; STOP ends it"
        failed = [name for name, state in pairs if state.flags & ChannelFlags.HOME_FAILED]
        if failed:
            return f"{', '.join(failed)}: the home switch did not close; check switch, motor and supply; {HOME_ADVICE}"
        return f"{', '.join(lost)}: not homed, so nothing moves; {HOME_ADVICE}"

    @property
    def diagnostics(self) -> dict[str, object]:
        """Measured pressures."""
        pairs = zip(self._joints.items(), self.states, strict=False)
        return {
            f"{name} measured [{joint.unit}]": f"{(state.measured - joint.zero) * joint.scale:.0f}"
            for (name, joint), state in pairs
            if joint.kind is ChannelKind.PRESSURE
        }
