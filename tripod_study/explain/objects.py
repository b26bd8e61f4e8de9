"""Everything that an object of the library holds: what memory is counted from, and what tests look for."""

from collections.abc import Iterator, Mapping
from functools import partial
from types import FunctionType, MethodType
from typing import Any

import numpy as np

ENTERED = ("tripod_sim", "scipy.sparse")
"""Packages whose objects are looked into."""


def walk(*roots: object, skip: tuple[object, ...] = ()) -> Iterator[tuple[object, str]]:
    """Yield every library object and array below `roots`, once each, with the module of the object that holds it.

    Arrays are yielded as what owns their memory. Containers, bound methods and closures are looked into and not
    yielded. The module of the roots is their own.

    Args:
        roots: Where to begin.
        skip: Objects that are left out, with what only they hold.
    """
    seen = {id(s) for s in skip}
    keep: list[object] = []  # so that no id serves twice
    todo = [(root, type(root).__module__) for root in roots]
    while todo:
        value, owner = todo.pop()
        if isinstance(value, np.ndarray):
            value = owned(value)
        if id(value) in seen or isinstance(value, str | bytes | int | float | type | None):
            continue
        seen.add(id(value))
        keep.append(value)
        if isinstance(value, np.ndarray):
            yield value, owner
            if value.dtype == object:
                todo += [(v, owner) for v in value.ravel()]
            continue
        home = type(value).__module__
        if home.startswith(ENTERED):
            if home.startswith("tripod_sim"):
                owner = home
                yield value, owner
        elif not isinstance(
            value, Mapping | list | tuple | set | frozenset | FunctionType | MethodType | partial
        ):
            continue
        todo += [(v, owner) for v in _inside(value)]


def owned(array: Any) -> Any:
    """Return the array that owns the memory which `array` views, as far as NumPy knows it."""
    while isinstance(array.base, np.ndarray):
        array = array.base
    return array


def _inside(value: Any) -> list[object]:
    """Return what an object holds."""
    if isinstance(value, FunctionType):
        return [c.cell_contents for c in value.__closure__ or () if _filled(c)]
    if isinstance(value, MethodType):
        return [value.__self__, *_inside(value.__func__)] if isinstance(value.__func__, FunctionType) else []
    if isinstance(value, partial):
        return [value.func, *value.args, *value.keywords.values()]
    found: list[object] = list(vars(value).values()) if hasattr(value, "__dict__") else []
    for kind in type(value).__mro__:
        slots = vars(kind).get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if hasattr(value, name) and not name.startswith("__"):
                found.append(getattr(value, name))
    if isinstance(value, Mapping):
        found += value.values()
    elif isinstance(value, list | tuple | set | frozenset):
        found += value
    return found


def _filled(cell: Any) -> bool:
    try:
        return cell.cell_contents is not None
    except ValueError:  # a name that is not bound yet
        return False
