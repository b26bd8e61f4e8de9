"""What the terminal shows: one status line, in degrees and millimetres."""

import math
from collections.abc import Sequence

from tripod_graph.command import CommandLimits
from tripod_graph.joint import Joint
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
    others: Sequence[Joint] = (),
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
        others: Joints that are no servos.
    """
    who = "these keys" if driving else source
    head = WORDS[mode] + (f" by {who}" if who and mode is not Mode.STOP else "")
    middle = notice or (f"to the {motion}" if motion else "")
    return " | ".join(part for part in (head, middle, angles_text(joints, servos, others)) if part)


def angles_text(joints: Joints | None, servos: int = 3, others: Sequence[Joint] = ()) -> str:
    """Return the angles [degrees], other joints and the slide [mm] as text; of constant length without others."""
    if joints is None:
        return "angles unknown" if servos or not others else "joints unknown"
    size = servos + len(others)
    angles = " ".join(f"{math.degrees(a):6.1f}" for a in joints[:servos])
    slide = f"slide {1000 * joints[size]:4.1f} mm" if len(joints) > size else ""
    told = (f"{joint.name} {joint.shown(v)}" for joint, v in zip(others, joints[servos:size], strict=False))
    return ", ".join(part for part in (f"{angles} deg" if servos else "", *told, slide) if part)


def range_text(limits: CommandLimits) -> str:
    """Return in one line how far the joints may go, servos in degrees."""
    servos = [
        f"{math.degrees(j.low):.1f} to {math.degrees(j.high):.1f}" for j in limits.table[: limits.count]
    ]
    others = (f"{j.name} {j.shown(j.low)} to {j.shown(j.high)}" for j in limits.others)
    return ", ".join([*(["servos go " + ", ".join(servos) + " deg"] if servos else []), *others])
