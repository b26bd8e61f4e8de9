"""Parameters of the driver, and the driver that they describe."""

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tripod_driver.calibration import Calibration, CalibrationError, ServoCalibration, default_channel
from tripod_driver.calibration_file import read_calibration
from tripod_driver.choose_session import PROTOCOLS, choose_sessions, common_bounds
from tripod_driver.driver import Driver
from tripod_driver.framed_messages import CHANNELS_MAX, SERVOS_MAX
from tripod_driver.link import Link
from tripod_driver.memory import Memory, state_folder
from tripod_driver.ports.choose import CHOICES, MOCK, choose_port
from tripod_driver.ports.mock import MockPort
from tripod_driver.ports.port import Port
from tripod_driver.protocol import SERVO_COUNT, AngleMapping
from tripod_driver.safety import Safety
from tripod_driver.session import Session
from tripod_graph.command import CommandLimits
from tripod_graph.joint import Joint
from tripod_graph.limits import JOINT_STATES_PARAMETER, LIMIT_PARAMETERS, RANGE_TIME_PARAMETER, limits_from
from tripod_graph.names import servo_names
from tripod_graph.parameters import Parameter

SLOWEST = 1200
"""Slowest speed of a serial port [bit/s]."""

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("port", "auto", f"Where the servos are: {CHOICES}"),
    Parameter(
        "protocol",
        "framed",
        "What the board speaks: the firmware of this project, the workshop's packet, or its closed-loop text; the "
        "last tries framed first, then legacy where the board is silent",
        choices=PROTOCOLS,
    ),
    Parameter("calibration", "", "File of `tripod calibrate`; without one, the servos are the workshop's"),
    Parameter(
        "baud", 0, "Speed of a serial port, in bits a second; 0: that of the protocol", low=0, high=4_000_000
    ),
    Parameter(
        "boot_time",
        2.0,
        "Time a board needs after its port was opened, which resets it; 0: opening does not reset it",
        "s",
        low=0.0,
        high=30.0,
    ),
    Parameter(
        "write_timeout", 0.05, "A serial port that takes no bytes so long is lost", "s", low=0.001, high=1.0
    ),
    Parameter(
        "retry_min", 0.5, "Time before the port is tried again; doubles each time", "s", low=0.05, high=60.0
    ),
    Parameter("retry_max", 5.0, "Longest time between two attempts", "s", low=0.05, high=600.0),
    Parameter(
        "angle_mapping",
        AngleMapping.ROUNDED.value,
        "Angle to degrees, legacy and ascii: to the nearest, or as the workshop's program does",
        choices=tuple(mapping.value for mapping in AngleMapping),
    ),
    Parameter("rate", 50.0, "Largest number of packets a second", "Hz", low=5.0, high=50.0, dynamic=True),
    Parameter(
        "keep_alive",
        0.1,
        "Time after which an unchanged packet is sent again; the firmware lets go after 0.5 s",
        "s",
        low=0.02,
        high=0.4,
        dynamic=True,
    ),
    Parameter(
        "servos",
        SERVO_COUNT,
        "How many servos the robot has: a board that tells another number is refused, port mock has as many",
        low=0,
        high=SERVOS_MAX,
    ),
    Parameter(
        "channels",
        "",
        "Cables and chambers beside the servos, in the order of the board's channels: name, unit (m: length pulled in "
        "by a winch, Pa: pressure), smallest and largest value, separated by semicolons: left m 0 0.03; air Pa 0 20000",
    ),
    RANGE_TIME_PARAMETER,
    Parameter(
        "start",
        [],
        "Angles of the servos after the board's own start, for boards that do not tell; unset: at 1500 us, where "
        "the workshop's firmware attaches them; of this project's, which attaches none, the park position as a guess",
        "rad",
    ),
    *LIMIT_PARAMETERS,
    Parameter(
        "park_time_max", 3.0, "Longest time for parking on exit", "s", low=0.0, high=60.0, dynamic=True
    ),
    JOINT_STATES_PARAMETER,
    Parameter("autostart", True, "Configure and activate at once; else a lifecycle manager does"),
)


def check(values: Mapping[str, Any]) -> None:
    """Raise ValueError, naming the parameter, where the values do not fit together; nothing is opened or written."""
    _parts(values)


def make_driver(values: Mapping[str, Any]) -> Driver:
    """Build the driver that the parameters describe; raise ValueError, naming the parameter, if they are wrong."""
    sessions, port, limits = _parts(values)
    start, memory = values["start"], Memory(state_folder(os.environ))
    if isinstance(port, MockPort):  # of which is known where it stands
        memory.turn_to(port.identity)
        place = [*(start or limits.park[: limits.count]), *limits.park[limits.count : -1]]
        if pulses := sessions[0].pulses(sessions[0].content(place)):
            memory.keep(pulses)
    return Driver(
        Link(port, *sessions, retry_min=values["retry_min"], retry_max=values["retry_max"]),
        Safety(limits, *common_bounds(sessions), start=start or None),
        keep_alive=values["keep_alive"],
        period=1.0 / values["rate"],
        memory=memory,
    )


def _parts(values: Mapping[str, Any]) -> tuple[list[Session], Port, CommandLimits]:
    """Return what speaks to the board, its port, still closed, and the limits of commands; raise ValueError."""
    start, count = values["start"], values["servos"]
    if start and len(start) != count:
        raise ValueError(f"parameter 'start' has {len(start)} values; it needs {count}")
    if values["retry_max"] < values["retry_min"]:
        raise ValueError(
            f"parameter 'retry_max' is {values['retry_max']:g} s; allowed: at least retry_min {values['retry_min']:g} s"
        )
    if 0 < values["baud"] < SLOWEST:
        raise ValueError(f"parameter 'baud' is {values['baud']}; allowed: 0 or at least {SLOWEST}")
    calibration = chosen_calibration(values)
    mapping = AngleMapping(values["angle_mapping"])
    sessions = choose_sessions(values["protocol"], mapping, calibration, start=start or None)
    port = choose_port(
        values["port"],
        baud=values["baud"] or sessions[0].baud,
        boot_time=values["boot_time"],
        write_timeout=values["write_timeout"],
        servos=count,
        channels=[channel.kind for channel in calibration.channels.values()],
    )
    return sessions, port, limits_from(values, count, channel_joints(values["channels"]))


def channel_joints(text: str) -> tuple[Joint, ...]:
    """Return the joints that the parameter `channels` names, without slew rates. Raises ValueError."""
    found: dict[str, Joint] = {}
    for part in filter(None, (part.strip() for part in text.split(";"))):
        words = part.split()
        try:
            name, unit, *ends = words
            low, high = map(float, ends)
        except ValueError:
            low = high = math.nan
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ValueError(
                f"parameter 'channels' has {part!r:.60}; it needs a name, a unit, and the smallest and largest value, "
                "as in: left m 0 0.03"
            )
        if name in found or name in servo_names(SERVOS_MAX):
            raise ValueError(f"parameter 'channels' names {name} twice, or as a servo; choose another name")
        found[name] = Joint(name, unit, low, high, 1.0)
    joints = tuple(found.values())
    if len(joints) > CHANNELS_MAX:
        raise ValueError(
            f"parameter 'channels' has {len(joints)} joints; a board drives at most {CHANNELS_MAX}"
        )
    for joint in joints:
        default_channel(joint)
    if [joint.unit for joint in joints] != sorted((joint.unit for joint in joints), key="m Pa".find):
        raise ValueError(
            "parameter 'channels' names a pressure before a cable; name the cables first, as boards do"
        )
    return joints


def chosen_calibration(values: Mapping[str, Any]) -> Calibration:
    """Return the calibration in the file that the parameters name, else the workshop's. Raises ValueError.

    Without a file, channels have that of the board in memory; there is none that fits any winch.
    """
    count, joints = values["servos"], channel_joints(values["channels"])
    if not count and not joints:
        raise ValueError("parameter 'servos' is 0 and 'channels' is empty; the driver needs a joint")
    if not values["calibration"]:
        if joints and values["port"] != MOCK:
            raise CalibrationError(
                f"{', '.join(joint.name for joint in joints)}: without a calibration; give --set calibration=FILE "
                "with its winches and pressures"
            )
        return Calibration(
            (ServoCalibration(),) * count, {joint.name: default_channel(joint) for joint in joints}
        )
    found = read_calibration(Path(values["calibration"]))
    _check_channels(values["calibration"], found, joints)
    if len(found.servos) != count:
        raise CalibrationError(
            f"{values['calibration']} is the calibration of {len(found.servos)} servos, but the robot has {count}; "
            "give the file of this robot, or correct the parameter 'servos'"
        )
    return found


def _check_channels(file: str, found: Calibration, joints: Sequence[Joint]) -> None:
    """Raise CalibrationError unless a calibration has these joints, in this order."""
    wanted = [(joint.name, joint.unit) for joint in joints]
    if [(name, channel.unit) for name, channel in found.channels.items()] != wanted:
        shown = [
            ", ".join(f"{name} [{unit}]" for name, unit in these) or "none"
            for these in ([(name, channel.unit) for name, channel in found.channels.items()], wanted)
        ]
        raise CalibrationError(
            f"{file} has the winches and pressures {shown[0]}, but the robot has {shown[1]}; give the file of this "
            "robot, or correct the parameter 'channels'"
        )
