"""How the tables of a scene declare their fields: units, ranges, choices."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import MISSING, field, fields, is_dataclass
from functools import partial
from typing import Any

from tripod_sim.errors import Doubt, SceneError, shown

Described = Any
"""A `tripod_sim.scene.scene.Scene`, for what that is made of: none of it may import the whole."""


def number(
    default: Any = MISSING,
    *,
    unit: str = "",
    above: float | None = None,
    low: float | None = None,
    high: float | None = None,
    usual: tuple[float, float] | None = None,
) -> Any:
    """Declare a field with its unit and range: `above` excludes the bound, `low` and `high` include it; `usual`: sizes
    out of which a number is told, see `unusual`.
    """
    meta = {"unit": unit, "above": above, "low": low, "high": high, "usual": usual}
    return field(default=default, metadata=meta)


def one_of(*choices: str, default: str) -> Any:
    """Declare a field that takes one of some words."""
    return field(default=default, metadata={"choices": choices})


def check_fields(table: Any, path: str) -> None:
    """Raise SceneError if a field of a dataclass, or of one in it, is out of the range that its declaration names."""
    for f in fields(table):
        value, meta = getattr(table, f.name), f.metadata
        where = f"{path}.{f.name}" if path else f.name
        if is_dataclass(value):
            check_fields(value, where)
            continue
        if isinstance(value, tuple) and value and is_dataclass(value[0]):
            for i, part in enumerate(value):
                check_fields(part, f"{where}.{i}")
            continue
        if choices := meta.get("choices"):
            if value not in choices:
                raise SceneError(f"{where} is {shown(value)}; allowed: {', '.join(choices)}")
            continue
        if "unit" not in meta or value is None:
            continue
        for v in _numbers(value):
            if not _within(meta, v):
                fits = partial(_within, meta)
                raise SceneError(f"{where} is {value}; {allowed(meta)}{other_unit(v, meta['unit'], fits)}")


def tables_in(table: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield a dataclass and those in it, each before what is in it, and its path: empty, `mesh`, `obstacles.0` ..."""
    yield path, table
    for f in fields(table):
        value, where = getattr(table, f.name), f"{path}.{f.name}" if path else f.name
        if is_dataclass(value):
            yield from tables_in(value, where)
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            for i, part in enumerate(value):
                yield from tables_in(part, f"{where}.{i}")


def unusual(table: Any) -> list[Doubt]:
    """Return which fields of a dataclass, and of those in it, are of an unusual size, one sentence each."""
    found = list[Doubt]()
    for path, part in tables_in(table):
        for f in fields(part):
            value, where = getattr(part, f.name), f"{path}.{f.name}" if path else f.name
            if value is not None and (usual := f.metadata.get("usual")):
                for v in _numbers(value):
                    if said := out_of_usual(v, f.metadata["unit"], usual):
                        found.append(Doubt(f"{where} {said}"))
    return found


LIKELY_UNITS = {
    "Pa": (("kPa", 1e3), ("MPa", 1e6), ("GPa", 1e9)),
    "kg/m³": (("g/cm³", 1e3),),
    "kg": (("g", 1e-3),),
    "m/s²": (("mm/s²", 1e-3),),
}
"""Units that a number may have been meant in, and their sizes."""


def out_of_usual(value: float, unit: str, usual: tuple[float, float]) -> str:
    """Return in words that the size of a number is out of what is usual, and in which unit it would not be; else empty.

    Zero is usual.
    """
    low, high = usual
    if value == 0 or low <= abs(value) <= high:
        return ""
    hint = next(
        (f'; if you meant {name}, write "{value:g}{name}"'
         for name, size in LIKELY_UNITS.get(unit, ()) if low <= abs(value) * size <= high), "",
    )  # fmt: skip
    return f"is {value:.4g} {unit}; usual values are {low:g} to {high:g} {unit}{hint}"


def _numbers(value: Any) -> Iterator[float]:
    """Yield the numbers of a field: one, or a list of numbers or lists."""
    if isinstance(value, tuple):
        for part in value:
            yield from _numbers(part)
    else:
        yield value


def _within(meta: Any, v: float) -> bool:
    """Return whether a number is in the range that a declaration names."""
    ok = v - v == 0  # finite: inf - inf and nan - nan are nan
    ok &= meta["above"] is None or v > meta["above"]
    return ok and (meta["low"] is None or v >= meta["low"]) and (meta["high"] is None or v <= meta["high"])


OTHER_UNITS = {
    "rad": ("degrees", "deg", math.pi / 180, 3.2),
    "m": ("millimetres", "mm", 1e-3, 0.5),
    "s": ("milliseconds", "ms", 1e-3, 0.9),
}
"""What a number may have been meant in: the unit, its sign, its size, and from where on."""


FURTHER_UNITS = {"m": {"cm": 1e-2}, "m³": {"ml": 1e-6}}
"""Units in which numbers may be given besides, and their sizes."""

TYPED = str.maketrans("²³⁴", "234")
"""How powers are typed."""


def units_of(unit: str) -> dict[str, float]:
    """Return the units in which a number of the SI unit `unit` may be given, and their sizes, that one first."""
    _, sign, size, _ = OTHER_UNITS.get(unit, ("", unit, 1.0, math.inf))
    return {unit: 1.0, sign: size, **dict(LIKELY_UNITS.get(unit, ())), **FURTHER_UNITS.get(unit, {})}


def with_unit(text: str, unit: str) -> float:
    """Return the number of a text in SI: `-1.5` or `-85deg`, `0.035` or `35mm`, `100 kPa`. Raises ValueError."""
    bare = text.strip()
    for sign, size in sorted(units_of(unit).items(), key=lambda one: -len(one[0])):
        for written in (sign, sign.translate(TYPED)):
            if bare.endswith(written):
                return float(bare.removesuffix(written)) * size
    return float(bare)


def other_unit(value: float, unit: str, fits: Callable[[float], bool]) -> str:
    """Return a hint that a number out of range would be in range in another unit; empty if it would not."""
    name, sign, size, least = OTHER_UNITS.get(unit, ("", "", 0.0, math.inf))
    if not (least < abs(value) < math.inf and fits(value * size)):
        return ""
    return f"; if you meant {name}, write {value:g}{sign}"


def allowed(meta: Any) -> str:
    """Return in words what a numeric field may be."""
    unit = f" {meta['unit']}" if meta["unit"] else ""
    bounds = []
    if meta["above"] is not None:
        bounds.append(f"above {meta['above']:g}{unit}")
    if meta["low"] is not None:
        bounds.append(f"at least {meta['low']:g}{unit}")
    if meta["high"] is not None:
        bounds.append(f"at most {meta['high']:g}{unit}")
    return "it must be " + (" and ".join(bounds) if bounds else f"a finite number{unit}")


def check_box(where: str, low: Sequence[float] | None, high: Sequence[float] | None) -> None:
    """Raise SceneError if corners of a box [m] are in the wrong order."""
    if low is not None and high is not None and not all(a <= b for a, b in zip(low, high, strict=True)):
        raise SceneError(f"{where}: low {low} must not be above high {high} [m]; exchange them")


def check_axes(where: str, axes: str) -> None:
    """Raise SceneError if a text is not some of the axes x, y, z."""
    if not axes or sorted(set(axes) & set("xyz")) != sorted(axes):
        raise SceneError(f"{where}.axes is {shown(axes)}; allowed: one or more of x, y, z")


def check_unit(where: str, quaternion: tuple[float, ...]) -> None:
    """Raise SceneError if a quaternion is far from having norm 1."""
    size = sum(c * c for c in quaternion) ** 0.5
    if not abs(size - 1) <= 0.01:
        raise SceneError(
            f"{where} is {quaternion}, of norm {size:.4g}; it must be a unit quaternion x, y, z, w: "
            "divide it by its norm"
        )
