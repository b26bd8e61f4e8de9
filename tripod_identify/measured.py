"""Measured data: commands and what was seen with them, in SI; read from CSV."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_host.reading import read_file
from tripod_identify.csv_columns import Channel, read_header
from tripod_identify.errors import DataError
from tripod_sim.scene import Scene
from tripod_sim.tables.short_forms import joints_of

MOST_BYTES = 100_000_000
"""Of a CSV file."""

EXAMPLE = (
    "it has a row for each pose below a header, servo_0_deg,servo_1_deg,servo_2_deg,slide_mm,effector.x_mm and so on: "
    "examples/poses.csv is one"
)
"""What to say of a file that is not there."""

LARGEST = 1e3
"""Of a place [m] or rotation [rad] of a robot."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Rows of measured numbers.

    Attributes:
        times: Rising [s], shape (k,); None: each row is a pose at rest.
        commands: Of all joints but the slide, in the units of the scene's joints, shape (k, a); None where the data
            have none: those that the scene starts with.
        slide: Commanded [m], shape (k,); None likewise.
        channels: What was measured, m of them.
        values: [m] or [rad], shape (k, m); NaN where there is none.
        notes: What users should know of them.
    """

    times: FloatArray | None
    commands: FloatArray | None
    slide: FloatArray | None
    channels: tuple[Channel, ...]
    values: FloatArray
    notes: tuple[str, ...] = field(default=())

    def rows(self, chosen: NDArray[np.bool_]) -> "Measured":
        """Return some of the rows, `chosen` of shape (k,)."""
        parts = [None if a is None else a[chosen] for a in (self.times, self.commands, self.slide)]
        return replace(self, times=parts[0], commands=parts[1], slide=parts[2], values=self.values[chosen])

    def joints(self, scene: Scene) -> FloatArray:
        """Return the commands of the scene's joints and the slide [m] of each row, shape (k, a + 1)."""
        known = joints_of(scene)
        start = known.start if known else np.zeros(1)
        joints = np.tile(start, (len(self.values), 1))
        if self.commands is not None:
            joints[:, :-1] = self.commands
        if self.slide is not None:
            joints[:, -1] = self.slide
        return joints


def read_csv(
    path: Path, scene: Scene, sources: Sequence[str], renamed: dict[str, str], *, poses: bool = False
) -> Measured:
    """Return the data of a CSV file with units in its header.

    Args:
        path: Its first line names the columns, `t_s, servo_0_rad, effector.x_mm`; lines with # are left out.
        scene: That they shall be compared with.
        sources: Names that columns may have in it, see `columns.read_header`.
        renamed: Other names for some columns.
        poses: Each row is a pose at rest, whatever its time.

    Raises:
        DataError: anything wrong with the file; the message names the row or column.
    """
    header, numbers, table = _table(path)
    joints = joints_of(scene)
    columns = read_header(header, sources, joints.actuators if joints else (), renamed)
    times = None
    if columns.time and not poses:
        times = _whole(table[:, columns.time[0]], numbers, "the time") * columns.time[1]
    commands = None
    if columns.commands:
        commands = np.column_stack(
            [_whole(table[:, i], numbers, header[i]) * size for i, size in columns.commands]
        )
    slide = None
    if columns.slide:
        slide = _whole(table[:, columns.slide[0]], numbers, header[columns.slide[0]]) * columns.slide[1]
    values = np.column_stack([table[:, i] * size for i, size, _ in columns.channels])
    notes = (
        [f"these columns belong to nothing in the scene and are left out: {', '.join(columns.ignored)}"]
        if columns.ignored
        else []
    )
    if joints and joints.others and commands is None:
        notes.append(
            f"no column gives a command, so these stay where the scene starts them: "
            f"{', '.join(a.name for a in joints.actuators)}"
        )
    measured = Measured(times, commands, slide, tuple(c for *_, c in columns.channels), values, tuple(notes))
    return checked(measured, scene, numbers)


def _table(path: Path) -> tuple[list[str], list[int], FloatArray]:
    """Return the names of the columns, the number of each row's line, and the numbers, NaN where a cell is empty."""
    try:
        text = read_file(path, MOST_BYTES).decode("utf-8-sig")
    except OSError as error:
        hint = f"; {EXAMPLE}" if isinstance(error, FileNotFoundError) else ""
        raise DataError(f"{path} cannot be read: {error.strerror or error}{hint}") from None
    except UnicodeDecodeError:
        raise DataError(f"{path} is not UTF-8 text") from None
    lines = [
        (i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")
    ]
    if len(lines) < 2:
        raise DataError(f"{path} has {len(lines)} lines; it needs a header and at least one row")
    header = [name.strip() for name in next(csv.reader([lines[0][1]]))]
    table = np.array([_row(line, number, header) for number, line in lines[1:]])
    return header, [number for number, _ in lines[1:]], table


def read_commands(path: Path, scene: Scene) -> FloatArray:
    """Return the poses that a CSV file commands: joints and slide [m], shape (n, a + 1). Raises DataError."""
    header, numbers, table = _table(path)
    joints = joints_of(scene)
    columns = read_header(header, (), joints.actuators if joints else (), {}, measured=False)
    found = np.column_stack([_whole(table[:, i], numbers, header[i]) * size for i, size in columns.commands])
    slide = _whole(table[:, columns.slide[0]], numbers, "slide") * columns.slide[1] if columns.slide else None
    commands = Measured(None, found, slide, (Channel("effector", 0),), np.zeros((len(found), 1)))
    return checked(commands, scene, numbers).joints(scene)


def _row(line: str, number: int, header: list[str]) -> list[float]:
    cells = [cell.strip() for cell in next(csv.reader([line]))]
    if len(cells) != len(header):
        raise DataError(f"line {number} has {len(cells)} cells; the header has {len(header)}")
    row = []
    for cell, name in zip(cells, header, strict=True):
        try:
            row.append(float(cell) if cell else np.nan)
        except ValueError:
            raise DataError(f"line {number}, column {name!r}: {cell[:40]!r} is not a number") from None
    return row


def _whole(column: FloatArray, lines: Sequence[int], name: str) -> FloatArray:
    """Return a column in which nothing may be missing."""
    bad = np.flatnonzero(~np.isfinite(column))
    if bad.size:
        raise DataError(
            f"line {lines[bad[0]]}: {name} is {column[bad[0]]:g}; commands and times cannot be empty: "
            "fill the cell or remove the line"
        )
    return column


def checked(measured: Measured, scene: Scene, lines: Sequence[int]) -> Measured:
    """Return data that fit a scene, with a note on what is missing; `lines` name the rows in messages.

    Raises:
        DataError: times that fall, commands that the joints of the scene cannot follow, values beyond all reason, none.
    """
    times, values = measured.times, measured.values
    if times is not None and (falls := np.flatnonzero(np.diff(times) <= 0)).size:
        i = falls[0]
        raise DataError(
            f"line {lines[i + 1]}: time {times[i + 1]:g} s after {times[i]:g} s; times must rise (--poses takes each "
            "row as a pose of its own)"
        )
    servos, joints = scene.servos, joints_of(scene)
    if (measured.commands is not None and not joints) or (measured.slide is not None and not servos):
        raise DataError(
            f"the data have commands for servos, but scene {scene.name!r} has none: does the file belong "
            "to another robot?"
        )
    if measured.commands is not None and joints:
        most = 1e-6 * joints.spans
        bad = np.argwhere(
            ~((measured.commands >= joints.low - most) & (measured.commands <= joints.high + most))
        )
        if len(bad):
            k, i = bad[0]
            joint = joints.actuators[i]
            units = "degrees labelled as radians" if joint.unit == "rad" else "its units others than labelled"
            raise DataError(
                f"line {lines[k]}: {joint.name} at {measured.commands[k, i]:g} {joint.unit}; the scene allows "
                f"{joint.low:g} to {joint.high:g} {joint.unit}: does the file belong to another robot, or are "
                f"{units}?"
            )
        others = slice(
            len(joints.arms), None
        )  # a simulation takes no command beyond the range, not by rounding
        commands = measured.commands.copy()
        commands[:, others] = np.clip(commands[:, others], joints.low[others], joints.high[others])
        measured = replace(measured, commands=commands)
    if measured.slide is not None and servos:
        out = np.flatnonzero(~((measured.slide >= -1e-9) & (measured.slide <= servos.slide_max + 1e-9)))
        if out.size:
            k = out[0]
            raise DataError(
                f"line {lines[k]}: slide at {measured.slide[k]:g} m; the scene allows 0 to {servos.slide_max:g} m"
            )
    if (far := np.argwhere(np.abs(values) > LARGEST)).size:
        k, j = far[0]
        channel, unit = measured.channels[j], "rad" if measured.channels[j].angle else "m"
        raise DataError(
            f"line {lines[k]}: {channel.label} is {values[k, j]:g} {unit}; allowed: -{LARGEST:g} to {LARGEST:g}; leave "
            "the cell empty where nothing was measured"
        )
    missing, some = int(np.isnan(values).sum()), [bool(np.isfinite(column).any()) for column in values.T]
    if missing == values.size:
        raise DataError("all measured values are missing (empty or NaN)")
    channels = tuple(c for c, has in zip(measured.channels, some, strict=True) if has)
    measured = replace(measured, channels=channels, values=values[:, some])
    if missing:
        note = f"{missing} of {values.size} values are missing (empty or NaN) and left out"
        return replace(measured, notes=(*measured.notes, note))
    return measured
