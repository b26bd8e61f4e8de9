"""Calibrations as YAML text. A file is a stranger until it is parsed: all that is wrong is told in one line."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Final

import yaml

from tripod_driver.calibration import (
    Calibration,
    CalibrationError,
    ChannelCalibration,
    PressureCalibration,
    ServoCalibration,
    WinchCalibration,
)
from tripod_graph.names import servo_names
from tripod_host.reading import read_file

LARGEST_FILE: Final = 65536
"""Bytes that a calibration may have."""

LARGEST_NUMBER: Final = 1e9

LONGEST_QUOTE: Final = 24
"""Characters of a file that are quoted at most."""

CHANNELS: Final[dict[str, type[WinchCalibration] | type[PressureCalibration]]] = {
    "winches": WinchCalibration,
    "pressures": PressureCalibration,
}
"""Tables of the joints that are no servos, in the order of the board's channels."""

PAIRS: Final = ("pulse_range", "safe_range")

HEADER: Final = """\
# Calibration of the servos, as `tripod calibrate` writes it; `tripod driver --set calibration=FILE` uses it.
# offset: angle of the shaft when the piece is flat [rad, 0 to pi]; direction: 1, or -1 if the servo is mounted the
# other way round; pulse_range: pulse widths with the shaft at 0 and at pi [us]; safe_range: smallest and largest joint
# angle that may be sent [rad], 0 is the flat piece, negative bends the strip down.
"""


CHANNEL_HEADER: Final = """\
# winches: radius of the drum with its cable [m]; steps of the motor in a turn of the drum; zero: set-point at which the
# cable is just taut [steps from the home switch]; safe_range: smallest and largest length pulled in [m].
# pressures: scale: pressure of a count of the sensor [Pa]; zero: set-point at ambient pressure [counts]; safe_range:
# smallest and largest pressure above ambient [Pa].
"""


class _Loader(yaml.SafeLoader):
    """YAML without what a calibration never has: keys that come twice, and references."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            line = self.peek_event().start_mark.line + 1
            raise CalibrationError(
                f"line {line} refers to another part of the file (YAML alias); write the values out"
            )
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            name = str(key.value)
            if name in seen:
                raise CalibrationError(
                    f"{name:.40} is given twice, again in line {key.start_mark.line + 1}; remove one"
                )
            seen.add(name)
        found: dict[Any, Any] = super().construct_mapping(node, deep)
        return found


def parse_calibration(text: str) -> Calibration:
    """Return the calibration that YAML `text` describes; a field left out has its default.

    Raises:
        CalibrationError: anything is wrong with it; the message names servo and field.
    """
    try:
        table = yaml.load(text, Loader=_Loader)  # a SafeLoader
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"line {mark.line + 1}: " if mark is not None else ""
        reason = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise CalibrationError(f"{where}not valid YAML: {_brief(reason)}") from None
    except (ValueError, RecursionError) as error:
        if isinstance(error, CalibrationError):
            raise
        raise CalibrationError(f"a value cannot be read: {_brief(str(error))}") from None
    tables = _mapping(table, "the file", ("servos", *CHANNELS))
    channels: dict[str, ChannelCalibration] = {}
    for word, kind in CHANNELS.items():
        for name, row in _named(tables.get(word, {}), word).items():
            if name in channels or re.fullmatch(r"servo_\d+|slide", name):
                raise CalibrationError(f"{word}.{name:.40} has a name that another joint has; rename it")
            channels[name] = kind(**_values(f"{word}.{name}", row, kind))
    if channels and "servos" not in tables:
        return Calibration((), channels)
    servos = tables.get("servos")
    names = servo_names(max(1, len(servos) if isinstance(servos, dict) else 0))
    found = _mapping(servos, "servos", names)
    if missing := [name for name in names if name not in found]:
        raise CalibrationError(f"servos.{missing[0]} is missing; all of {', '.join(names)} are needed")
    rows = [ServoCalibration(**_values(f"servos.{name}", found[name], ServoCalibration)) for name in names]
    return Calibration(tuple(rows), channels)


def read_calibration(path: Path) -> Calibration:
    """Return the calibration in the file at `path`; raise CalibrationError, naming the file, if there is none."""
    try:
        return parse_calibration(read_file(path, LARGEST_FILE).decode("utf-8"))
    except OSError as error:
        raise CalibrationError(
            f"calibration {path}: {error.strerror}; make it with `tripod calibrate`"
        ) from None
    except UnicodeDecodeError as error:
        raise CalibrationError(
            f"calibration {path}: byte {error.start} is not UTF-8 text; make the file again with `tripod "
            "calibrate`"
        ) from None
    except CalibrationError as error:
        raise CalibrationError(f"calibration {path}: {error}") from None


def calibration_text(calibration: Calibration) -> str:
    """Return the YAML of a calibration, with what its fields mean; `parse_calibration` reads it back."""
    lines = [HEADER + "servos:"] if calibration.servos else []
    names = servo_names(len(calibration.servos))
    for name, servo in zip(names, calibration.servos, strict=True):
        pulses = ", ".join(f"{pulse:.1f}" for pulse in servo.pulse_range)
        safe = ", ".join(f"{angle:.6f}" for angle in servo.safe_range)
        lines += [
            f"  {name}:",
            f"    offset: {servo.offset:.6f}",
            f"    direction: {servo.direction}",
            f"    pulse_range: [{pulses}]",
            f"    safe_range: [{safe}]",
        ]
    lines += [CHANNEL_HEADER[:-1]] if calibration.channels else []
    for word, kind in CHANNELS.items():
        rows = {name: c for name, c in calibration.channels.items() if isinstance(c, kind)}
        lines += [f"{word}:"] if rows else []
        for name, channel in rows.items():
            values = {key: list(v) if key in PAIRS else v for key, v in asdict(channel).items()}
            text = yaml.safe_dump(values, default_flow_style=None, sort_keys=False)
            lines += [f"  {name}:", *(f"    {line}" for line in text.splitlines())]
    return "\n".join(lines) + "\n"


def _named(value: object, what: str) -> Mapping[str, Any]:
    """Return a table whose keys are names of joints."""
    if not isinstance(value, Mapping) or not all(isinstance(key, str) and key for key in value):
        raise CalibrationError(f"{what} is {_shown(value)}; it must be a table of joints by their names")
    return value


def _values(what: str, table: object, kind: type) -> dict[str, Any]:
    """Return the fields of a joint that fit its `kind`."""
    values: dict[str, Any] = {}
    for key, value in _mapping(table, what, tuple(field.name for field in fields(kind))).items():
        if key in PAIRS:
            if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 2:
                raise CalibrationError(f"{what}.{key} is {_shown(value)}; it needs two numbers, [low, high]")
            values[key] = tuple(_number(f"{what}.{key}[{i}]", v) for i, v in enumerate(value))
        else:
            values[key] = _number(f"{what}.{key}", value)
    try:
        kind(**values)
    except CalibrationError as error:
        raise CalibrationError(f"{what}.{error}") from None
    return values


def _mapping(value: object, what: str, known: Sequence[str]) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise CalibrationError(f"{what} is {_shown(value)}; it must be a table of {', '.join(known)}")
    if unknown := [key for key in value if key not in known]:
        raise CalibrationError(
            f"{what} has an unknown field {_shown(unknown[0])}; fields: {', '.join(known)}"
        )
    return value


def _number(what: str, value: object) -> float:
    # as a whole number it may have any length
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LARGEST_NUMBER:
        raise CalibrationError(f"{what} is {_shown(value)}; it must be a finite number")
    return value


def _shown(value: object) -> str:
    """Return a value for a message, or what kind it is: the file may be anything, and nobody's secrets are told."""
    text = repr(value)
    if len(text) <= LONGEST_QUOTE:
        return text
    kinds: dict[type, str] = {str: "a long text", list: "a list", dict: "a table"}
    return kinds.get(type(value), f"{text:.{LONGEST_QUOTE}}...")


def _brief(reason: str) -> str:
    """Return why YAML refuses a file, without what it quotes at length."""
    return re.sub(f"'[^']{{{LONGEST_QUOTE},}}'", "...", reason)[:100]
