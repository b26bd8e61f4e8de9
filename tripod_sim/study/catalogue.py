"""The studies by name. Each is a module with `TITLE`, `COLUMNS`, `rows`; only the one that runs is imported."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from tripod_sim.errors import SceneError

STUDIES = {"pendulum": "tripod_sim.study.pendulum", "drape": "tripod_sim.study.drape"}


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes:
        key: Of a row's value.
        title: Its head, with the unit.
        text: Writes a value.
    """

    key: str
    title: str
    text: Callable[[Any], str] = str


@dataclass(frozen=True)
class Study:
    """What runs and prints.

    Attributes:
        title: One line.
        columns: Of the table.
        count: Number of rows.
        rows: Yields them one after the other, by key.
    """

    title: str
    columns: tuple[Column, ...]
    count: int
    rows: Iterator[dict[str, Any]]


def study(name: str, *, full: bool) -> Study:
    """Return a study, not yet run. Raises SceneError if there is none of that name.

    Args:
        name: A key of `STUDIES`.
        full: All combinations of the values instead of one varied at a time.
    """
    if name not in STUDIES:
        raise SceneError(f"study {name!r} is unknown; studies: {', '.join(STUDIES)}")
    made = import_module(STUDIES[name]).study(full=full)
    assert isinstance(made, Study)
    return made
