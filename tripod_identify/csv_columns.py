"""What a column of measured data is: a name, an axis and a unit, written as `effector.x_mm` or `tendon_mm`."""

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from tripod_identify.errors import DataError
from tripod_sim.tables.joints import Actuator

UNITS = {
    "s": ("time", 1.0), "ms": ("time", 1e-3),
    "m": ("length", 1.0), "cm": ("length", 1e-2), "mm": ("length", 1e-3),
    "rad": ("angle", 1.0), "mrad": ("angle", 1e-3), "deg": ("angle", math.pi / 180),
    "N": ("force", 1.0), "mN": ("force", 1e-3),
    "Pa": ("pressure", 1.0), "kPa": ("pressure", 1e3), "mbar": ("pressure", 1e2), "bar": ("pressure", 1e5),
    "m3": ("volume", 1.0), "cm3": ("volume", 1e-6), "mm3": ("volume", 1e-9), "ml": ("volume", 1e-6),
    "mL": ("volume", 1e-6),
}  # fmt: skip
"""What a unit measures, and its size in SI."""

COMMANDED = {
    "rad": ("angle", "rad"), "m": ("length", "mm"), "m³": ("volume", "ml"), "N": ("force", "N"),
    "Pa": ("pressure", "kPa"),
}  # fmt: skip
"""By the unit of a joint, what its command is and in which unit people write it."""

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
        commands: Of the commands of all joints but the slide, in their order; empty where there are none.
        slide: Of the commanded slide; None where there is none.
        channels: What was measured.
        ignored: Names of columns that belong to nothing in the scene.
    """

    time: tuple[int, float] | None
    commands: tuple[tuple[int, float], ...]
    slide: tuple[int, float] | None
    channels: tuple[tuple[int, float, Channel], ...]
    ignored: tuple[str, ...]


def read_header(
    header: Sequence[str],
    sources: Sequence[str],
    joints: Sequence[Actuator],
    renamed: dict[str, str],
    *,
    measured: bool = True,
) -> Columns:
    """Return what the columns are.

    Args:
        header: Their names.
        sources: What a scene can show: names of the disc, of sets, of points.
        joints: Of the scene, without the slide. A column of the name of a joint and a unit is a command, also where a
            set has that name: what was measured has an axis.
        renamed: Other names for some, without axis and unit.
        measured: Whether something must be measured; else the commands must be there.

    Raises:
        DataError: a column without a unit, one given twice, commands of some joints only or of servos that the scene
            has not, or nothing to compare with.
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
    kinds = {joint.name: COMMANDED[joint.unit][0] for joint in joints}
    commands: dict[str, tuple[int, float]] = {}
    channels: dict[Channel, tuple[int, float]] = {}
    ignored = []
    for place, column in enumerate(header):
        found = _COLUMN.fullmatch(column)
        assert found
        name, axis, (kind, size) = found["name"], found["axis"], UNITS[found["unit"]]
        name = name.removeprefix("marker.")
        name = renamed.get(name, name)
        whole = column.removesuffix(f"_{found['unit']}")
        if whole in kinds:  # a joint may be called pull_x: `pull.x` is measured
            name, axis = whole, None
        if axis is None and name in TIME:
            _expect(column, kind, "time")
            time = _once(column, time, (place, size))
        elif axis is None and (name in kinds or _SERVO.fullmatch(name)):
            _expect(column, kind, kinds.get(name, "angle"))
            commands[name] = _once(column, commands.get(name), (place, size))
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
    _complete(commands, joints)
    if not (measured or commands):
        columns = ", ".join(map(_column, joints))
        raise DataError(
            f"no column gives a command; name such columns {columns}"
            if joints
            else "the scene has no joints that could be commanded; poses to choose from need some"
        )
    if measured and not channels:
        raise DataError(
            "no column belongs to anything in the scene, which has "
            f"{', '.join(sources) or 'no effector and no marker'}; columns: {', '.join(header[:12])}; "
            "rename one with --rename OLD=NEW"
        )
    return Columns(
        time, tuple(commands[name] for name in kinds if commands), slide,
        tuple((*place, channel) for channel, place in channels.items()), tuple(ignored),
    )  # fmt: skip


def _complete(commands: Collection[str], joints: Sequence[Actuator]) -> None:
    """Raise DataError where a servo is commanded that the scene has not, or not all of its joints are."""
    servos = [joint.name for joint in joints if _SERVO.fullmatch(joint.name)]
    given = [name for name in commands if _SERVO.fullmatch(name)]
    if given and set(given) != set(servos):
        raise DataError(
            f"the data have commands for {', '.join(sorted(given))}; the scene has {len(servos)} servos: does the file "
            "belong to another robot?"
        )
    if commands and (missing := [joint for joint in joints if joint.name not in commands]):
        raise DataError(
            f"the data have commands for {', '.join(commands)}, but not for "
            f"{', '.join(joint.name for joint in missing)}; add a column {_column(missing[0])}, or remove all "
            "commands to keep the joints where they start"
        )


def _column(joint: Actuator) -> str:
    """Return what the column with the commands of a joint may be called."""
    return f"{joint.name}_{COMMANDED[joint.unit][1]}"


def _expect(column: str, kind: str, wanted: str) -> None:
    if kind != wanted:
        known = ", ".join(unit for unit, (what, _) in UNITS.items() if what == wanted)
        raise DataError(f"column {column!r} has a unit of {kind}; it needs one of {wanted}: {known}")


def _once(column: str, before: tuple[int, float] | None, place: tuple[int, float]) -> tuple[int, float]:
    if before is not None:
        raise DataError(f"column {column!r} gives the same number as another column; remove one")
    return place
