"""How many points a serialised trajectory has, before anybody takes the time to read them. Pure."""

import struct

from tripod_graph.command import CommandError

MOST_POINTS = 2000
"""Points of a trajectory; reading them takes 20 ms, a fraction of what a board waits for a sign of life."""

MOST_BYTES = 1_000_000
"""Length of a trajectory as it is sent."""

MOST_NAMES = 16
"""Joint names of a trajectory."""


def check_size(data: bytes) -> None:
    """Raise CommandError if `data`, a trajectory_msgs/JointTrajectory in CDR, is larger than what is read.

    CDR (DDS-XTypes 1.3, 7.4): four bytes say the byte order; then stamp (8 bytes), frame_id, joint_names, points;
    strings and sequences begin with their length, uint32, at a multiple of four bytes.
    """
    if len(data) > MOST_BYTES:
        raise CommandError(
            f"a trajectory has {len(data)} bytes; allowed: at most {MOST_BYTES} bytes and {MOST_POINTS} "
            "points; send a shorter one"
        )
    try:
        order = "<" if data[1] & 1 else ">"
        at = _after_string(data, order, 12)
        (names,) = struct.unpack_from(order + "I", data, at)
        if names > MOST_NAMES:
            raise CommandError(f"a trajectory has {names} joints; allowed: at most {MOST_NAMES}")
        at += 4
        for _ in range(names):
            at = _after_string(data, order, at)
        (points,) = struct.unpack_from(order + "I", data, at)
    except (struct.error, IndexError):
        raise CommandError(
            f"a trajectory of {len(data)} bytes ends before its points: it is damaged"
        ) from None
    if points > MOST_POINTS:
        raise CommandError(
            f"a trajectory has {points} points; allowed: at most {MOST_POINTS}; send a shorter one"
        )


def _after_string(data: bytes, order: str, at: int) -> int:
    """Return where the next length stands after the string at `at`: the four bytes of the byte order keep multiples of
    four.
    """
    (length,) = struct.unpack_from(order + "I", data, at)
    return int(at + 4 + (length + 3) // 4 * 4)
