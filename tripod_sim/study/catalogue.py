"""The course report's tables by name. Each is a module with `study(full=...)`; only the one that runs is imported."""

import json
from collections.abc import Callable
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

    def cell(self, row: dict[str, Any]) -> str:
        """Return the value of a row as text; a dash where there is none."""
        return "-" if row[self.key] is None else self.text(row[self.key])


@dataclass(frozen=True)
class Study:
    """What runs and prints.

    Attributes:
        title: One line.
        columns: Of the table.
        cases: What each row sets, by key.
        measure: Returns what a row shows besides, by key.
        version: Raised when what `measure` returns for a case changes; rows of another one are measured again.
    """

    title: str
    columns: tuple[Column, ...]
    cases: tuple[dict[str, Any], ...]
    measure: Callable[[dict[str, Any]], dict[str, Any]]
    version: int

    def row(self, case: dict[str, Any]) -> dict[str, Any]:
        """Measure and return the row of `case`, by key."""
        return {**case, **self.measure(case)}

    def key(self, case: dict[str, Any]) -> str:
        """Return the name under which the row of `case` is kept."""
        return json.dumps([self.version, case], sort_keys=True)


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
