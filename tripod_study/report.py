"""What the course report's tables share: a scene's values varied, a row for each case."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

Case = Mapping[str, float]


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
class Report:
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


def one_by_one(base: Case, values: Mapping[str, Iterable[float]]) -> list[dict[str, float]]:
    """Return `base`, and `base` with each other one of the `values` of each name."""
    changed = [
        {**base, name: value} for name, many in values.items() for value in many if value != base[name]
    ]
    return [dict(base), *changed]


def combined(base: Case, values: Mapping[str, Iterable[float]]) -> list[dict[str, float]]:
    """Return `base` with all combinations of the `values`."""
    return [{**base, **dict(zip(values, chosen, strict=True))} for chosen in product(*values.values())]


GRAVITY = Column("g", "g [m/s²]", lambda v: f"{v:g}")
STEP = Column("dt", "dt [s]", lambda v: f"{v:g}")
STIFFNESS = Column("k", "k [N/m]", lambda v: f"{v:g}")
STABLE = Column("stable", "stable", lambda v: "yes" if v else "NO")
PARTS = Column("parts", "sub-steps", lambda v: f"{v:.3g}")
AMPLITUDE = Column("amplitude", "amplitude [m]", lambda v: f"{v:.3g}")
DRIFT = Column("drift", "energy drift", lambda v: f"{100 * v:+.2g} %")
WALL = Column("wall", "wall [s/s]", lambda v: f"{v:.2g}")
"""Sub-steps: parts of a step, on average; amplitude: the largest distance from where it began; wall: time of the
machine for each simulated second."""
