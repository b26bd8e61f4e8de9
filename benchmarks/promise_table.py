"""The table of accuracy_promise.py in its document: rows of studies that were run are new, the others stay."""

from collections.abc import Sequence
from pathlib import Path

from benchmarks.promise_cases import KINDS

MARK, END = "## Measured", "<!-- end -->"

HEADS = (
    "study",
    "asked",
    "setting",
    "its error in the study [%]",
    "of the study's reference [%]",
    "cases",
    "under the asked [%]",
    "median error [%]",
    "95 % of cases under [%]",
    "worst [%]",
    "factor",
    "margin",
    "seeds",
    "reference [%]",
    "reference off by [%]",
)


def percent(error: float) -> str:
    """Return a relative error in percent, in two digits."""
    return f"{100 * error:.2g}"


def rows_of(text: str) -> list[list[str]]:
    """Return the rows that a document has."""
    lines = text.partition(MARK)[2].partition(END)[0].splitlines()
    found = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    return [row for row in found if len(row) == len(HEADS) and row[0] in KINDS]


def merged(old: Sequence[list[str]], new: Sequence[list[str]]) -> list[list[str]]:
    """Return the new rows and those of the old whose study has no new one, in the order of the kinds of cases."""
    run = {row[0] for row in new}
    return sorted(
        [*(row for row in old if row[0] not in run), *new], key=lambda row: list(KINDS).index(row[0])
    )


def written(text: str, new: Sequence[list[str]], speed: str, path: Path | None = None) -> str:
    """Return a document with its table renewed; without a `path` the table alone.

    Args:
        text: Of the document.
        new: Rows of the studies that were run.
        speed: A line on this machine.
        path: Of the document.
    """
    table = [list(HEADS), ["---"] * len(HEADS), *merged(rows_of(text), new)]
    made = ["| " + " | ".join(row) + " |" for row in table] + ["", speed]
    if path is None:
        return "\n".join(made)
    head, _, rest = text.partition(MARK)
    command = f"`python benchmarks/accuracy_promise.py --write {path}` wrote this:"
    return "\n".join([f"{head}{MARK}", "", command, "", *made, "", f"{END}{rest.partition(END)[2]}"])
