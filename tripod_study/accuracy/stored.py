"""Reading stored studies (see `tripod_study/result.py` for what they hold); files may come from anywhere."""

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from tripod_host.reading import read_file
from tripod_sim.errors import SceneError, shown

MAX_BYTES = 20_000_000
"""A study larger than this is refused unread."""

MOST_POINTS = 100_000
"""Of a study."""

FORMAT = 1
"""Meaning of the fields, as `tripod_study/result.py` writes it."""

FIELD = re.compile(r"[a-z_]+(\.[a-z_]+)?")
"""A field of a scene: a study sets no entries of lists."""

ENTRY = re.compile(r"[a-z_]+(\.[a-z_0-9]+){0,3}")
"""The same, or an entry of a list, which all points of a study may share."""

WORD = re.compile(r"[A-Za-z0-9_+-]{1,40}")
"""A word among the settings; it names no file."""

NUMBERS = re.compile(r"\{[a-z_]{1,40}=[0-9.e+-]{1,40}(, [a-z_]{1,40}=[0-9.e+-]{1,40}){0,9}\}")
"""An effect with numbers alone, such as {modes=20}."""

FORBIDDEN = ("source", "name", "description")
"""Last parts of fields that no study may set."""

Value = str | float | int | bool


@dataclass(frozen=True)
class StoredPoint:
    """A setting that worked.

    Attributes:
        settings: Values by field of the scene.
        error: Relative, of the study's first quantity.
        bound: The same with the reference's own error.
        cpu: CPU time of a simulated second, or of a solve [s], on the study's machine.
        unknowns: Of a step; None where the study does not say.
        others: Error and bound of each of the study's `others`.
    """

    settings: Mapping[str, Value]
    error: float
    bound: float
    cpu: float
    unknowns: int | None
    others: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class StoredStudy:
    """What of a study the choice of a setting needs.

    Attributes:
        name: Of the study.
        scene: That it varied.
        quantity: What its errors are of, in words.
        base: Values of fields that all points share.
        points: Those that worked.
        failed: How many did not.
        solves: Whether costs are of a static solve, not of a simulated second.
        calibration: CPU time of a 1000 x 1000 float64 product on the study's machine [s]; None if it was not timed.
        version: Of tripod that made it.
        quick: Whether it was made of few points against a coarse reference.
        others: What else is promised, in words.
        draft: Settings of the point that `--accuracy draft` takes; None: the cheapest that is exact enough for it.
        varied: Fields that it varied.
        studied: Digest of the scene as it was (see `studied.studied`); empty where the study does not say.
        size: What errors are relative to [m]: how far the quantity goes; None where it is no length or not alone.
    """

    name: str
    scene: str
    quantity: str
    base: Mapping[str, Value]
    points: tuple[StoredPoint, ...]
    failed: int
    solves: bool
    calibration: float | None
    version: str
    quick: bool
    others: tuple[str, ...] = ()
    draft: Mapping[str, Value] | None = None
    varied: tuple[str, ...] = ()
    studied: str = ""
    size: float | None = None


def stored_studies() -> list[Path]:
    """Return the files of the studies that come with tripod."""
    folder = Path(str(resources.files("tripod_study"))) / "studies"
    return sorted(folder.glob("*.json")) if folder.is_dir() else []


def read_study(path: Path) -> StoredStudy:
    """Return the study of a JSON file. Raises SceneError, naming the file and what is wrong with it."""
    try:
        data = read_file(path, MAX_BYTES)
    except OSError as error:
        raise SceneError(f"study {str(path)!r} cannot be read: {error.strerror}") from None
    try:
        table = json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # JSON and UTF-8 errors are ValueErrors
        raise SceneError(f"study {str(path)!r} is not valid JSON: {' '.join(str(error).split())}") from None
    try:
        return _study(table)
    except SceneError as error:
        raise SceneError(f"study {str(path)!r}: {error}") from None


def _study(table: Any) -> StoredStudy:
    top = _table(table, "the file")
    if top.get("format") != FORMAT or isinstance(top.get("format"), bool):
        raise SceneError(
            f"format is {shown(top.get('format'))}; this version reads format {FORMAT}: make the study "
            "again with `tripod study`"
        )
    rows = top.get("points")
    if not isinstance(rows, list) or len(rows) > MOST_POINTS:
        raise SceneError(f"points is {shown(rows)}; it must be a list of at most {MOST_POINTS}")
    quantities = top.get("quantities")
    first, *more = quantities if isinstance(quantities, list) and quantities else (None,)
    beside = [
        table
        for i, q in enumerate(more, 1)
        if (table := _table(q, f"quantities.{i}")).get("promised") is True
    ]
    points, failed = list[StoredPoint](), 0
    for i, row in enumerate(rows):
        point = _table(row, f"points.{i}")
        if point.get("status") != "ok" or point.get("bound") is None or point.get("cpu") is None:
            failed += 1
            continue
        unknowns = point.get("unknowns")
        points.append(
            StoredPoint(
                _settings(point.get("settings"), f"points.{i}.settings"),
                _number(point.get("error"), f"points.{i}.error"),
                _number(point.get("bound"), f"points.{i}.bound"),
                _number(point.get("cpu"), f"points.{i}.cpu", positive=True),
                None if unknowns is None else int(_number(unknowns, f"points.{i}.unknowns")),
                tuple(
                    _error(point.get("errors"), _text(q.get("name"), "quantities.name"), i) for q in beside
                ),
            )
        )
    cpu = _text(top.get("cpu"), "cpu")
    if cpu not in ("s per solve", "s per simulated second"):
        raise SceneError(f"cpu is {shown(cpu)}; it must be 's per solve' or 's per simulated second'")
    speed = _table(top.get("machine", {}), "machine").get("calibration")
    version = _table(top.get("versions", {}), "versions").get("tripod", "unknown")
    return StoredStudy(
        name=_text(top.get("study"), "study"),
        scene=_text(top.get("scene"), "scene"),
        quantity=_text(_table(first, "quantities.0").get("what"), "quantities.0.what"),
        base=_settings(top.get("base", {}), "base"),
        points=tuple(points),
        failed=failed,
        solves=cpu == "s per solve",
        calibration=None if speed is None else _number(speed, "machine.calibration", positive=True),
        version=_text(version, "versions.tripod"),
        quick=top.get("quick") is True,
        others=tuple(_text(q.get("what"), "quantities.what") for q in beside),
        draft=None if (draft := top.get("draft")) is None else _settings(draft, "draft"),
        varied=tuple(_settings(top.get("default", {}), "default")),
        studied="" if (studied := top.get("studied")) is None else _text(studied, "studied"),
        size=_size(first) if not beside else None,
    )


def _size(quantity: Any) -> float | None:
    """Return what the errors of a quantity are relative to [m]; None where it is no length, or nothing moves."""
    table = _table(quantity, "quantities.0")
    size = table.get("scale")
    return (
        _number(size, "quantities.0.scale") or None if table.get("unit") == "m" and size is not None else None
    )


def _error(errors: Any, name: str, i: int) -> tuple[float, float]:
    """Return error and bound of a quantity at point i."""
    path = f"points.{i}.errors.{name}"
    found = _table(_table(errors, f"points.{i}.errors").get(name), path)
    error = _number(found.get("relative"), f"{path}.relative")
    return error, error + _number(found.get("own"), f"{path}.own")


def _table(value: Any, path: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise SceneError(f"{path} is {shown(value)}; it must be a table")
    return value


def _text(value: Any, path: str) -> str:
    if not isinstance(value, str) or not value or len(value) > 1000 or not value.isprintable():
        raise SceneError(f"{path} is {shown(value)}; it must be a line of text")
    return value


def _number(value: Any, path: str, *, positive: bool = False) -> float:
    ok = isinstance(value, int | float) and not isinstance(value, bool)
    if not ok or not (abs(value) < 2**63 and math.isfinite(value)) or value < 0 or (positive and value == 0):
        raise SceneError(
            f"{path} is {shown(value)}; it must be a {'positive' if positive else 'finite, not negative'} number"
        )
    return float(value)


def _settings(value: Any, path: str) -> dict[str, Value]:
    """Return values by field; no field is a list or names a file, so that a study changes nothing but settings."""
    table, base = _table(value, path), path == "base"
    for field in table:
        form = ENTRY if base else FIELD
        if not form.fullmatch(field) or (not base and field.rpartition(".")[2] in FORBIDDEN):
            raise SceneError(
                f"{path}: {shown(field)} is not a field that an accuracy study may set; make the study again "
                "with `tripod study`"
            )
    return {field: _value(v, f"{path}.{field}", applied=not base) for field, v in table.items()}


def _value(value: Any, path: str, *, applied: bool) -> Value:
    """Return a value of a setting; one that is not `applied` may be any line of text, such as a list of numbers."""
    if isinstance(value, bool):
        return value
    if isinstance(value, int | float) and abs(value) < 2**63 and math.isfinite(value):
        return value
    if isinstance(value, str) and (
        WORD.fullmatch(value) or NUMBERS.fullmatch(value) or (not applied and _text(value, path))
    ):
        return value
    raise SceneError(
        f"{path} is {shown(value)}; it must be a word, a number, true or false, or a table of numbers"
    )
