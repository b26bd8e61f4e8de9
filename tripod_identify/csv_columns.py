"""What a column of measured data is: a name, an axis and a unit, written as `effector.x_mm` or `servo_0_deg`."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from tripod_identify.errors import DataError

UNITS = {
    "s": ("time", 1.0), "ms": ("time", 1e-3),
    "m": ("length", 1.0), "cm": ("length", 1e-2), "mm": ("length", 1e-3),
    "rad": ("angle", 1.0), "mrad": ("angle", 1e-3), "deg": ("angle", math.pi / 180),
}  # fmt: skip
"""What a unit measures, and its size in SI."""

AXES = {"x": 0, "y": 1, "z": 2, "rx": 0, "ry": 1, "rz": 2}
"""Component of a position, or of a rotation vector."""

_COLUMN = re.compile(rf"(?P<name>.+?)(?:[._](?P<axis>{'|'.join(AXES)}))?_(?P<unit>{'|'.join(UNITS)})")

TIME = ("t", "time")
SLIDE = "slide"
EFFECTOR = ("effector", "imu")
"""Names of the disc; the second stands for its orientation."""

_SERVO = re.compile(r"servo_(\d+)")


@dataclass(frozen=True)
class Channel:
    """One measured number.

    Attributes:
        source: `effector`, or the name of a set or point of the body.
        axis: 0 to 2.
        angle: Whether it is a component of a rotation vector [rad]; else of a position [m].
    """

    source: str
    axis: int
    angle: bool = False

    @property
    def label(self) -> str:
        """As in a header, without the unit."""
        return f"{self.source}.{'r' if self.angle else ''}{'xyz'[self.axis]}"


@dataclass(frozen=True)
class Columns:
    """Which columns of a table are what, by their places, each with its size in SI.

    Attributes:
        time: Of the time; None: each row is a pose of its own.
        servos: Of the commanded angles, in order.
        slide: Of the commanded slide; None where there is none.
        channels: What was measured.
        ignored: Names of columns that belong to nothing in the scene.
    """

    time: tuple[int, float] | None
    servos: tuple[tuple[int, float], ...]
    slide: tuple[int, float] | None
    channels: tuple[tuple[int, float, Channel], ...]
    ignored: tuple[str, ...]


def read_header(
    header: Sequence[str],
    sources: Sequence[str],
    servos: int,
    renamed: dict[str, str],
    *,
    measured: bool = True,
) -> Columns:
    """Return what the columns are.

    Args:
        header: Their names.
        sources: What a scene can show: names of the disc, of sets, of points.
        servos: How many the scene has.
        renamed: Other names for some, without axis and unit.
        measured: Whether something must be measured; else the commands must be there.

    Raises:
        DataError: a column without a unit, one given twice, servos that the scene has not, or nothing to compare with.
    """
    bare = [name for name in header if not _COLUMN.fullmatch(name)]
    if bare:
        raise DataError(
            f"column {', '.join(map(repr, bare[:5]))}{(' and others' if len(bare) > 5 else '')}: no unit; "
            "add it at the end of the name, as in effector.x_mm, servo_0_rad, t_s; units: "
            f"{', '.join(UNITS)}"
        )
    time: tuple[int, float] | None = None
    slide: tuple[int, float] | None = None
    angles: dict[int, tuple[int, float]] = {}
    channels: dict[Channel, tuple[int, float]] = {}
    ignored = []
    for place, column in enumerate(header):
        found = _COLUMN.fullmatch(column)
        assert found
        name, axis, (kind, size) = found["name"], found["axis"], UNITS[found["unit"]]
        name = name.removeprefix("marker.")
        name = renamed.get(name, name)
        servo = _SERVO.fullmatch(name)
        if axis is None and name in TIME:
            _expect(column, kind, "time")
            time = _once(column, time, (place, size))
        elif axis is None and servo:
            _expect(column, kind, "angle")
            number = int(servo[1])
            angles[number] = _once(column, angles.get(number), (place, size))
        elif axis is None and name == SLIDE:
            _expect(column, kind, "length")
            slide = _once(column, slide, (place, size))
        elif axis is not None and name in sources:
            turned = axis.startswith("r")
            _expect(column, kind, "angle" if turned else "length")
            channel = Channel("effector" if name in EFFECTOR else name, AXES[axis], turned)
            channels[channel] = _once(column, channels.get(channel), (place, size))
        else:
            ignored.append(column)
    if sorted(angles) != list(range(len(angles))) or len(angles) not in (0, servos):
        given = ", ".join(f"servo_{i}" for i in sorted(angles))
        raise DataError(
            f"the data have commands for {given}; the scene has {servos} servos: does the file belong to "
            "another robot?"
        )
    if not (measured or angles):
        raise DataError(
            "no column gives the angle of a servo; name such columns servo_0_rad, servo_1_rad and so on"
        )
    if measured and not channels:
        raise DataError(
            "no column belongs to anything in the scene, which has "
            f"{', '.join(sources) or 'no effector and no marker'}; columns: {', '.join(header[:12])}; "
            "rename one with --rename OLD=NEW"
        )
    return Columns(
        time, tuple(angles[i] for i in range(len(angles))), slide,
        tuple((*place, channel) for channel, place in channels.items()), tuple(ignored),
    )  # fmt: skip


def _expect(column: str, kind: str, wanted: str) -> None:
    if kind != wanted:
        known = ", ".join(unit for unit, (what, _) in UNITS.items() if what == wanted)
        raise DataError(f"column {column!r} has a unit of {kind}; it needs one of {wanted}: {known}")


def _once(column: str, before: tuple[int, float] | None, place: tuple[int, float]) -> tuple[int, float]:
    if before is not None:
        raise DataError(f"column {column!r} gives the same number as another column; remove one")
    return place
