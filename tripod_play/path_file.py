"""Paths as files: a table of key points, as CSV or JSON.

CSV: a line of column names, then one line a key point, commas between; `#` begins a comment. JSON: a list of objects
with the same names, or an object of lists. The columns are `time` [s], rising, and one of

    tilt_x, tilt_y    rotation vector of the plate in world [rad];
    tilt_x, tilt_z    the same as the workshop writes it, whose Y axis points up: its z is our -y;
    x, y, z           position of the effector [m].

Names may end in `_deg` (tilts) or `_mm` (positions). Between key points the path is straight.
"""

import csv
import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.reading import read_file
from tripod_play.errors import PlayError

MOST_BYTES = 10_000_000
MOST_POINTS = 100_000
TILT_MAX = 0.5
"""Largest tilt about an axis [rad]."""

REACH = 0.15
"""Largest coordinate of a position [m]."""


class Kind(StrEnum):
    """What a path prescribes."""

    TILT = "tilt"
    POSITION = "position"


@dataclass(frozen=True, eq=False)
class KeyPoints:
    """A path.

    Attributes:
        kind: What the values are.
        times: Rising [s], shape (k,).
        values: Tilts about x and y [rad], shape (k, 2), or positions [m], shape (k, 3).
    """

    kind: Kind
    times: FloatArray
    values: FloatArray

    def at(self, time: float) -> FloatArray:
        """Return the values at `time` [s], held before the first and after the last key point."""
        return np.array([np.interp(time, self.times, column) for column in self.values.T])


def read_path(path: Path) -> KeyPoints:
    """Return the key points of a file that ends in `.csv` or `.json`.

    Raises:
        PlayError: the file, a column or a row is wrong; the message names it.
    """
    name = f"path file {str(path)!r}"
    if path.suffix.lower() not in (".csv", ".json"):
        raise PlayError(f"{name} ends in {path.suffix!r}; allowed: .csv, .json")
    try:
        text = read_file(path, MOST_BYTES).decode("utf-8-sig")
    except OSError as error:
        raise PlayError(f"{name} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise PlayError(f"{name} is not a text file") from None
    rows = _json_rows(text, name) if path.suffix.lower() == ".json" else _csv_rows(text, name)
    return _key_points(rows, name)


def _csv_rows(text: str, name: str) -> list[tuple[str, Mapping[str, object]]]:
    lines = [
        (i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and line.lstrip()[0] != "#"
    ]
    if not lines:
        raise PlayError(f"{name} is empty; its first line names the columns, such as time, tilt_x, tilt_y")
    table = list(csv.reader((line for _, line in lines), skipinitialspace=True))
    header = [cell.strip() for cell in table[0]]
    rows: list[tuple[str, Mapping[str, object]]] = []
    for (number, _), cells in zip(lines[1:], table[1:], strict=False):
        where = f"{name}, line {number}"
        if len(cells) != len(header):
            raise PlayError(f"{where} has {len(cells)} values; the columns are {', '.join(header)}")
        rows.append((where, dict(zip(header, (cell.strip() for cell in cells), strict=True))))
    return rows


def _json_rows(text: str, name: str) -> list[tuple[str, Mapping[str, object]]]:
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise PlayError(f"{name} is not JSON: {error}") from None
    if isinstance(data, dict):
        if not data or not all(isinstance(v, list) for v in data.values()):
            raise PlayError(
                f"{name}: an object must hold a list for each column, such as time, tilt_x, tilt_y"
            )
        if len({len(v) for v in data.values()}) > 1:
            sizes = ", ".join(f"{k} {len(v)}" for k, v in data.items())
            raise PlayError(f"{name}: the columns differ in length: {sizes}")
        data = [dict(zip(data, row, strict=True)) for row in zip(*data.values(), strict=True)]
    if not isinstance(data, list) or not all(isinstance(row, dict) for row in data):
        raise PlayError(
            f"{name} must be a list of objects, such as {{'time': 0, 'tilt_x': 0, 'tilt_y': 0.1}}"
        )
    return [(f"{name}, key point {i}", row) for i, row in enumerate(data, 1)]


COLUMNS = {
    ("tilt_x", "tilt_y"): Kind.TILT,
    ("tilt_x", "tilt_z"): Kind.TILT,
    ("x", "y", "z"): Kind.POSITION,
}


def _key_points(rows: list[tuple[str, Mapping[str, object]]], name: str) -> KeyPoints:
    if not 0 < len(rows) <= MOST_POINTS:
        raise PlayError(f"{name} has {len(rows)} key points; allowed: 1 to {MOST_POINTS}")
    given = list(rows[0][1])
    plain = [column.removesuffix("_deg").removesuffix("_mm") for column in given]
    match = next((c for c in COLUMNS if sorted(["time", *c]) == sorted(plain)), None)
    if match is None:
        raise PlayError(
            f"{name} has the columns {', '.join(given)}; it needs time and either tilt_x, tilt_y or tilt_x, tilt_z or "
            "x, y, z (with _deg or _mm where they are)"
        )
    units = {p: _unit(column, COLUMNS[match], name) for p, column in zip(plain, given, strict=True)}
    names = dict(zip(plain, given, strict=True))
    table = np.array(
        [[_number(row, names[p], where) * units[p] for p in ("time", *match)] for where, row in rows]
    )
    times, values = table[:, 0], table[:, 1:]
    for i in range(len(times)):
        if times[i] < 0 or (i and times[i] <= times[i - 1]):
            before = f"after {times[i - 1]:g} s" if i else "it must not be negative"
            raise PlayError(f"{rows[i][0]}: time {times[i]:g} s {before}; times must increase")
    if match == ("tilt_x", "tilt_z"):
        values = values * np.array([1.0, -1.0])
    limit = TILT_MAX if COLUMNS[match] is Kind.TILT else REACH
    beyond = np.argwhere(np.abs(values) > limit)
    if len(beyond):
        i, j = beyond[0].tolist()
        unit = "rad" if COLUMNS[match] is Kind.TILT else "m"
        raise PlayError(
            f"{rows[i][0]}: {match[j]} is {abs(values[i, j]):g} {unit} in size; allowed: up to {limit:g} {unit}"
        )
    return KeyPoints(COLUMNS[match], times, values)


def _unit(column: str, kind: Kind, name: str) -> float:
    if column.endswith("_deg") and kind is Kind.TILT and column != "time_deg":
        return float(np.radians(1.0))
    if column.endswith("_mm") and kind is Kind.POSITION and column != "time_mm":
        return 1e-3
    if column.endswith(("_deg", "_mm")):
        raise PlayError(f"{name}: column {column} has a unit that does not fit a path of {kind}")
    return 1.0


def _number(row: Mapping[str, object], column: str, where: str) -> float:
    if column not in row:
        raise PlayError(f"{where}: {column} is missing")
    value = row[column]
    try:
        number = (
            float(value) if isinstance(value, str | int | float) and not isinstance(value, bool) else np.nan
        )
    except (ValueError, OverflowError):
        number = np.nan
    if not np.isfinite(number):
        raise PlayError(f"{where}: {column} is {str(value)[:40]!r}; it must be a finite number")
    return number
