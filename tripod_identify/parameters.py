"""The values that can be identified: numeric fields of a scene, zeros and gains of servos, how the data see the robot.

A fit goes over u, with value = exp(u) for fields that are positive, such as a modulus, and value = u `unit` for others:
then all that a fit moves is of order one.
"""

import difflib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_identify.errors import DataError
from tripod_identify.model import MORE, Told
from tripod_identify.observe import Sensor
from tripod_sim.scene import Scene
from tripod_sim.tables.fields import allowed
from tripod_sim.tables.short_forms import effector_of

ZERO, GAIN, FRAME, MOUNT, START = "servos.zero", "servos.gain", "frame", "mount", "start"
"""Families that are no fields: arm angle = gain command + zero [rad]; pose of the world in the data [m, rad]; the point
of the disc that is seen [m]; time of the data at which a motion begins [s]."""

FAMILIES = {
    ZERO: "arm angle at command 0 [rad]", GAIN: "arm angle over command", FRAME: "x y z [m], rx ry rz [rad]",
    MOUNT: "x y z [m] in the disc's frame", START: "[s]",
}  # fmt: skip

PLAUSIBLE = {"rad": 0.2, "m": 0.01, "s": 0.1, "": 0.2, "log": math.log(2.0)}
"""How far a value may be from what is assumed before anything is measured: standard deviation, by unit; of positive
values a factor of two."""


@dataclass(frozen=True)
class Parameter:
    """One value to be identified.

    Attributes:
        name: `material.young`, `servos.zero.0`, `frame.x`.
        value: Where to begin, in SI.
        low, high: Bounds of the value.
        unit: Of the value.
        log: Whether u is its logarithm.
        plausible: Standard deviation of u before anything is measured.
        nuisance: Whether it only takes away how the frame of the data lies.
    """

    name: str
    value: float
    low: float
    high: float
    unit: str
    log: bool
    plausible: float
    nuisance: bool = False

    def to_u(self, value: float) -> float:
        """Return u of a value."""
        return math.log(value) if self.log else value / self.plausible

    def of_u(self, u: float) -> float:
        """Return the value of u."""
        return math.exp(u) if self.log else u * self.plausible

    def slope(self, u: float) -> float:
        """Return d value / d u."""
        return math.exp(u) if self.log else self.plausible

    @property
    def width(self) -> float:
        """Standard deviation of u before anything is measured."""
        return self.plausible if self.log else 1.0

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds of u."""
        low = -np.inf if self.log and self.low <= 0 else self.to_u(self.low)
        return low, self.to_u(self.high)

    @property
    def is_field(self) -> bool:
        """Whether it is a field of the scene."""
        return not _is_family(self.name)


def _is_family(name: str) -> bool:
    return any(name == family or name.startswith(family + ".") for family in FAMILIES)


def parameters(scene: Scene, names: Sequence[str], *, align: str = "none") -> list[Parameter]:
    """Return the parameters of some names, families written out, and those that an alignment stands for.

    Raises:
        DataError: a name that is no numeric field and no family, or one given twice.
    """
    found: list[Parameter] = []
    for name in names:
        found += _named(scene, name)
    if align != "none":
        whole = "xyz" if align == "translation" else ("x", "y", "z", "rx", "ry", "rz")
        wanted = [f"{FRAME}.{axis}" for axis in whole]
        found += [replace(p, nuisance=True) for name in wanted for p in _named(scene, name) if p not in found]
    every = [p.name for p in found]
    if twice := [name for name in every if every.count(name) > 1]:
        raise DataError(f"--fit {twice[0]} is given twice; remove one")
    return found


def _named(scene: Scene, name: str) -> list[Parameter]:
    family = next((f for f in FAMILIES if name == f or name.startswith(f + ".")), "")
    if not family:
        return [_field(scene, name)]
    count = scene.servos.count if scene.servos else 0
    members = {
        ZERO: [str(i) for i in range(count)],
        GAIN: [str(i) for i in range(count)],
        FRAME: ["x", "y", "z", "rx", "ry", "rz"],
        MOUNT: ["x", "y", "z"],
        START: [""],
    }[family]
    rest = name.removeprefix(family).removeprefix(".")
    if rest and rest not in members:
        raise DataError(
            f"--fit {name}: {family} has {', '.join(members) or 'no entry, as the scene has no servos'}"
        )
    if not members:
        raise DataError(f"--fit {name}: scene {scene.name!r} has no servos; leave it out, or add [servos]")
    if family == MOUNT and not effector_of(scene):
        raise DataError(
            f"--fit {name}: scene {scene.name!r} has no effector; leave it out, or add [effector]"
        )
    return [_of_family(family, member) for member in ([rest] if rest else members)]


def _of_family(family: str, member: str) -> Parameter:
    name = f"{family}.{member}" if member else family
    if family == ZERO:
        return Parameter(name, 0.0, -MORE, MORE, "rad", False, 0.1)
    if family == GAIN:
        return Parameter(name, 1.0, 0.5, 1.5, "", False, 0.1)
    if family == START:
        return Parameter(name, 0.0, -1e3, 1e6, "s", False, PLAUSIBLE["s"])
    if member.startswith("r"):
        return Parameter(name, 0.0, -2 * math.pi, 2 * math.pi, "rad", False, PLAUSIBLE["rad"])
    most = 10.0 if family == FRAME else 0.5
    return Parameter(name, 0.0, -most, most, "m", False, 0.02)


def _field(scene: Scene, name: str) -> Parameter:
    """Return the parameter of a numeric field."""
    value, meta = field_at(scene, name)
    unit = meta.get("unit", "")
    low = meta.get("above") if meta.get("above") is not None else meta.get("low")
    high = meta.get("high")
    positive = meta.get("above") == 0 and value > 0
    plausible = PLAUSIBLE["log"] if positive else PLAUSIBLE.get(unit, 0.0) or abs(value)
    if not positive and value and unit not in ("rad", "m"):
        plausible = max(0.5 * abs(value), 1e-12)
    bounds = (-np.inf if low is None else low, np.inf if high is None else high)
    if name == "servos.slide" and scene.servos:
        bounds = (0.0, scene.servos.slide_max)
    if positive:
        bounds = (max(bounds[0], value * 1e-4), min(bounds[1], value * 1e4))
    return Parameter(name, value, *bounds, unit, positive, plausible or 1.0)


def _numbers(table: Any, path: str, *, declared: bool) -> Iterator[tuple[str, float]]:
    """Yield the names of the numbers in a table of a scene that can be fitted, and their values."""
    if is_dataclass(table):
        for f in fields(table):
            where = f"{path}.{f.name}" if path else f.name
            yield from _numbers(getattr(table, f.name), where, declared="unit" in f.metadata)
    elif isinstance(table, tuple):
        for i, part in enumerate(table):
            yield from _numbers(part, f"{path}.{i}", declared=declared)
    elif declared and isinstance(table, float):
        yield path, table


def _instead(scene: Scene, path: str) -> str:
    """Return what could be typed in place of a name that cannot be fitted: close names, or an example."""
    numbers = dict(_numbers(scene, "", declared=False))
    inside = sorted((name for name in numbers if name.startswith(f"{path}.")), key=lambda n: numbers[n] == 0)
    names = [name for name in FAMILIES if name not in (ZERO, GAIN) or scene.servos] + list(numbers)
    head, _, last = path.rpartition(".")
    near = inside or [name for name in names if name.rpartition(".")[2] == last]
    siblings = {name.rpartition(".")[2]: name for name in names if name.rpartition(".")[0] == head}
    near = near or [siblings[word] for word in difflib.get_close_matches(last, siblings, 1)]
    if near:
        return f"; did you mean {near[0]}?"
    example = next((name for name in ("material.young", *numbers) if name in numbers), "")
    return (
        f"; name a number of the scene{example and f', such as {example}'}, or one of {', '.join(FAMILIES)}"
    )


def field_at(scene: Scene, path: str) -> tuple[float, Any]:
    """Return a numeric field of a scene and its declaration. Raises DataError for anything else."""
    node: Any = scene
    meta: Any = {}
    keys = path.split(".")
    for depth, key in enumerate(keys):
        where = ".".join(keys[:depth]) or "the scene"
        if is_dataclass(node):
            known = {f.name: f for f in fields(node)}
            if key not in known:
                raise DataError(f"--fit {path}: {where} has no {key!r}{_instead(scene, path)}")
            meta, node = known[key].metadata, getattr(node, key)
        elif isinstance(node, tuple) and key.isdigit() and int(key) < len(node):
            node = node[int(key)]
        else:
            raise DataError(
                f"--fit {path}: {where} has no {key!r}"
                + (f"; {where} is off: add [{where}] to the scene" if node is None else _instead(scene, path))
            )
    if isinstance(node, tuple) and node and isinstance(node[0], float):
        raise DataError(
            f"--fit {path} is a list of {len(node)} numbers; name one of them{_instead(scene, path)}"
        )
    if isinstance(node, bool) or not isinstance(node, int | float) or "unit" not in meta:
        if node is None:
            raise DataError(
                f"--fit {path} has no value; give it one in the scene first, with --set {path}=VALUE"
            )
        raise DataError(f"--fit {path} is {node!r}, which is not a number{_instead(scene, path)}")
    if isinstance(node, int):
        raise DataError(
            f"--fit {path} is a whole number, {node}; only numbers that can vary continuously can be fitted"
        )
    return float(node), meta


def with_field(table: Any, keys: Sequence[str], value: float) -> Any:
    """Return a table with another value of one field. Raises SceneError where it is out of range."""
    first, rest = keys[0], keys[1:]
    if isinstance(table, tuple):
        i = int(first)
        part = with_field(table[i], rest, value) if rest else value
        return (*table[:i], part, *table[i + 1 :])
    part = with_field(getattr(table, first), rest, value) if rest else value
    return replace(table, **{first: part})


def told(base: Told, wanted: Sequence[Parameter], u: FloatArray) -> Told:
    """Return what is assumed with the parameters at `u`. Raises SceneError where the scene refuses a value."""
    scene, zero, gain, start = base.scene, base.zero.copy(), base.gain.copy(), base.start
    sensor = Sensor(base.sensor.shift.copy(), base.sensor.turn.copy(), base.sensor.mount.copy())
    for p, own in zip(wanted, u.tolist(), strict=True):
        value = min(max(p.of_u(own), p.low), p.high)
        family, _, member = p.name.rpartition(".")
        if p.name == START:
            start = value
        elif family == ZERO:
            zero[int(member)] = value
        elif family == GAIN:
            gain[int(member)] = value
        elif family == FRAME:
            (sensor.turn if member.startswith("r") else sensor.shift)["xyz".index(member[-1])] = value
        elif family == MOUNT:
            sensor.mount["xyz".index(member)] = value
        else:
            scene = with_field(scene, p.name.split("."), value)
    return Told(scene, zero, gain, sensor, start)


def check_range(p: Parameter, value: float, meta_of: Scene) -> None:
    """Raise DataError where a value that was given for a parameter is out of its range."""
    if p.low <= value <= p.high and math.isfinite(value):
        return
    said = (
        allowed(field_at(meta_of, p.name)[1])
        if p.is_field
        else f"it must be {p.low:g} to {p.high:g} {p.unit}"
    )
    raise DataError(f"{p.name} is {value:g}; {said}")
