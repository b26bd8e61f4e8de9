"""What the doctor says about serial ports: which could be the robot, who may open them, who has, and what answers."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from tripod_bringup.check import Check, Verdict
from tripod_driver.ask import Answer, ask
from tripod_driver.ports.boards import FoundPort, serial_ports
from tripod_driver.ports.holders import Holder, holders
from tripod_driver.ports.port import PortError
from tripod_driver.ports.serial_port import SerialPort, group_of

NAME: Final = "serial port"
RULES: Final = Path(__file__).resolve().parents[1] / "tripod_driver" / "60-tripod.rules"
"""The udev rule: whoever sits at this machine may open the robot's boards."""

MUTE: Final = (
    "the workshop's firmware never answers, drive it with --set protocol=legacy; else `tripod flash`"
)
HINT: Final = "`tripod doctor --ask` tells firmware and round-trip time; opening the port resets the board"


def may_open(device: str) -> bool:
    """Whether this user may read and write the device."""
    return os.access(device, os.R_OK | os.W_OK)


def ask_device(device: str) -> Answer:
    """Return what the board at `device` answers. Raises PortError."""
    return ask(SerialPort(device))


def check_ports(
    ports: Sequence[FoundPort] | None = None,
    *,
    accessible: Callable[[str], bool] = may_open,
    held_by: Callable[[str], Sequence[Holder]] = holders,
    answer_of: Callable[[str], Answer] | None = None,
    user: str = "",
) -> list[Check]:
    """Return a finding for each USB serial port, or one that there is none.

    Args:
        ports: The ports; None looks for them.
        accessible: Whether this user may open a device.
        held_by: Which programs have it open.
        answer_of: Asks a known board for its firmware; None asks none.
        user: Name for the command that gives permission; empty takes the environment's.
    """
    found = [p for p in (serial_ports() if ports is None else ports) if p.vid is not None]
    if not found:
        advice = "`tripod up` simulates the board; for the robot plug its board in (some cables only charge)"
        return [Check(NAME, Verdict.OK, "no USB serial port", advice)]
    return [_check(port, accessible, held_by, answer_of, user) for port in found]


def _check(
    port: FoundPort,
    accessible: Callable[[str], bool],
    held_by: Callable[[str], Sequence[Holder]],
    answer_of: Callable[[str], Answer] | None,
    user: str,
) -> Check:
    if not accessible(port.device):
        return Check(NAME, Verdict.FAIL, str(port), permission_advice(port.device, user))
    if holding := held_by(port.device):
        who = ", ".join(map(str, holding))
        return Check(NAME, Verdict.WARN, f"{port}, in use by {who}", "stop it before you start the driver")
    if not port.board:
        return Check(
            NAME, Verdict.OK, f"{port}, no known board", f"if it is the robot: --set port={port.device}"
        )
    return Check(NAME, Verdict.OK, str(port), HINT) if answer_of is None else _asked(port, answer_of)


def _asked(port: FoundPort, answer_of: Callable[[str], Answer]) -> Check:
    try:
        answer = answer_of(port.device)
    except PortError as error:
        return Check(NAME, Verdict.FAIL, str(port), str(error))
    if answer.message:
        return Check(NAME, Verdict.WARN, f"{port}: {answer.message}", MUTE)
    said = (
        f"firmware {answer.firmware}, answers in {1e3 * answer.round_trip:.1f} ms, last reset: {answer.reset}"
    )
    return Check(NAME, Verdict.OK, f"{port}, {said}")


def permission_advice(device: str, user: str = "") -> str:
    """Return how to get permission for a device: the command for the group, and the one for the udev rule."""
    name = user or os.environ.get("USER", "$USER")
    return (
        f"no permission for {device}: sudo usermod -aG {group_of(device)} {name}, then log in again; or, for whoever "
        f"sits here: sudo cp {RULES} /etc/udev/rules.d/ && sudo udevadm control --reload && sudo udevadm trigger"
    )
