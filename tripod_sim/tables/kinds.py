"""Fields of a scene as the kinds that they are declared as, whoever gives them: a file, or a program."""

import types
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, Union, get_args, get_origin, get_type_hints

from tripod_sim.errors import SceneError, shown
from tripod_sim.tables.fields import units_of, with_unit

WORDS = {float: "a number", int: "a whole number", str: "text", bool: "true or false"}
"""What a field may be."""


@cache
def hints_of(cls: type) -> dict[str, Any]:
    """Return the kind of each field of a dataclass."""
    return get_type_hints(cls)


def kept(cls: Any, table: Any, path: str) -> Any:
    """Return a table of the dataclass `cls` with its fields as their kinds. Raises SceneError if it is none, or one of
    them is none.
    """
    if not isinstance(table, cls):
        raise SceneError(f"{path} is {shown(table)}; it must be a {cls.__name__} of tripod_sim")
    return cls(**kept_fields(cls, table, path))


def kept_fields(cls: Any, table: Any, path: str) -> dict[str, Any]:
    """Return the fields of a table of the dataclass `cls` as their kinds, by name. Raises SceneError."""
    hints = hints_of(cls)
    return {
        f.name: converted(
            hints[f.name],
            getattr(table, f.name),
            f"{path}.{f.name}" if path else f.name,
            f.metadata.get("unit", ""),
            kept,
            f.default,
        )
        for f in fields(cls)
    }


def converted(
    kind: Any,
    value: Any,
    path: str,
    unit: str,
    table_of: Callable[[Any, Any, str], Any],
    default: Any = None,
) -> Any:
    """Return `value` as the annotated type `kind`, or raise SceneError.

    Args:
        kind: A dataclass, number, text or truth value, a list of one of these, or none of it.
        value: NumPy's numbers and arrays become Python's.
        path: Of the field.
        unit: Of numbers, unless they say theirs.
        table_of: Makes a dataclass from what stands for it, with its path.
        default: Of the field, an example for messages.
    """
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        if value is None:
            return None
        inner = next(a for a in arguments if a is not type(None))
        return converted(inner, value, path, unit, table_of, default)
    if is_dataclass(kind):
        return table_of(kind, value, path)
    if hasattr(value, "tolist"):
        value = value.tolist()
    if origin is tuple:
        if isinstance(value, Mapping) and is_dataclass(arguments[0]):
            raise SceneError(
                f"{path} is one table; it must be a list of tables: [[{path}]] in a file, "
                f"{path}.0.FIELD=VALUE as a setting"
            )
        if not isinstance(value, list | tuple):
            raise SceneError(f"{path} is {shown(value)}; it must be {_list_words(arguments, unit, default)}")
        kinds = (arguments[0],) * len(value) if arguments[-1] is Ellipsis else arguments
        if len(value) != len(kinds):
            raise SceneError(
                f"{path} has {len(value)} values; it must be {_list_words(arguments, unit, default)}"
            )
        return tuple(
            converted(a, v, f"{path}.{i}", unit, table_of)
            for i, (a, v) in enumerate(zip(kinds, value, strict=True))
        )
    return _one(kind, value, path, unit)


def _list_words(kinds: tuple[Any, ...], unit: str, default: Any) -> str:
    """Return in words what a list must be: of how many values of which kind, with the default as an example."""
    if is_dataclass(kinds[0]):
        return "a list of tables"
    several = {float: "numbers", int: "whole numbers", str: "texts"}.get(kinds[0], "values")
    count = "" if kinds[-1] is Ellipsis else f"{len(kinds)} "
    example = isinstance(default, tuple) and default and isinstance(default[0], int | float)
    such = f", such as [{', '.join(f'{v:g}' for v in default)}]" if example else ""
    return f"a list of {count}{several}{unit and f' in {unit}'}{such}"


def _one(kind: Any, value: Any, path: str, unit: str) -> Any:
    """Return a number, text or truth value as `kind`, or raise SceneError."""
    if kind is float and unit and isinstance(value, str):
        with suppress(ValueError):
            value = with_unit(value, unit)
    number_given = isinstance(value, int | float) and not isinstance(value, bool)
    if number_given and isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise SceneError(f"{path} is a whole number of more than 64 bits; give a smaller one")
    if kind is float and number_given:
        return float(value)
    if isinstance(value, kind) and not (kind is int and isinstance(value, bool)):
        return value
    if path == "dt" and value == "auto":  # not of a file: there it is written out before
        raise SceneError("dt is 'auto', which only load_scene understands: load_scene(..., ['dt=auto'])")
    if path == "dt":
        raise SceneError(f"dt is {shown(value)}; it must be a number of seconds, or auto")
    units = f" in {unit}, or with its unit: {', '.join(units_of(unit))}" if kind is float and unit else ""
    raise SceneError(f"{path} is {shown(value)}; it must be {WORDS[kind]}{units}")
