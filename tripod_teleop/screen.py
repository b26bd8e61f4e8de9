"""What the terminal shows: one status line, in degrees and millimetres."""

import math

from tripod_graph.command import CommandLimits
from tripod_graph.mode import Mode
from tripod_teleop.joints import Joints

WORDS = {
    Mode.STOP: "STOP, all hold",
    Mode.TELEOP: "TELEOP",
    Mode.IK: "IK",
    Mode.REPLAY: "REPLAY",
}


def status_line(
    mode: Mode,
    source: str,
    joints: Joints | None,
    *,
    driving: bool,
    motion: str,
    notice: str,
    servos: int = 3,
) -> str:
    """Return the status in one line.

    Args:
        mode: The mode in force.
        source: Who decided on it.
        joints: Measured: the angles [rad], and the slide [m] if it is known; None if unknown.
        driving: Whether this terminal commands.
        motion: Name of the motion under way, empty if none.
        notice: One more line for the user, empty if none.
        servos: How many there are.
    """
    who = "these keys" if driving else source
    head = WORDS[mode] + (f" by {who}" if who and mode is not Mode.STOP else "")
    middle = notice or (f"to the {motion}" if motion else "")
    return " | ".join(part for part in (head, middle, angles_text(joints, servos)) if part)


def angles_text(joints: Joints | None, servos: int = 3) -> str:
    """Return the angles [degrees] and the slide [mm] as text of constant length."""
    if joints is None:
        return "angles unknown"
    angles = " ".join(f"{math.degrees(a):6.1f}" for a in joints[:servos])
    slide = f", slide {1000 * joints[servos]:4.1f} mm" if len(joints) > servos else ""
    return f"{angles} deg{slide}"


def range_text(limits: CommandLimits) -> str:
    """Return in one line how far the servos may go [degrees]."""
    ends = zip(limits.lower[:-1], limits.upper[:-1], strict=True)
    return (
        "servos go "
        + ", ".join(f"{math.degrees(low):.1f} to {math.degrees(high):.1f}" for low, high in ends)
        + " deg"
    )
