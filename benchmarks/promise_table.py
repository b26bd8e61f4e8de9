"""The table of accuracy_promise.py in its page: rows of studies that were run are new, the others stay."""

from collections.abc import Sequence

from benchmarks.doc_parts import cells, part, renewed
from benchmarks.promise_cases import KINDS

PAGE, PART = "accuracy.md", "promise"

HEADS = (
    "study",
    "requested",
    "setting",
    "error in the study [%]",
    "error of its reference [%]",
    "cases",
    "within the request [%]",
    "median error [%]",
    "95 % of cases below [%]",
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
    """Return the rows that a page has."""
    found = [cells(line) for line in part(text, PART) if line.startswith("|")]
    return [row for row in found if len(row) == len(HEADS) and row[0] in KINDS]


def merged(old: Sequence[list[str]], new: Sequence[list[str]]) -> list[list[str]]:
    """Return the new rows and those of the old whose study has no new one, in the order of the kinds of cases."""
    run = {row[0] for row in new}
    return sorted(
        [*(row for row in old if row[0] not in run), *new], key=lambda row: list(KINDS).index(row[0])
    )


def table(rows: Sequence[list[str]], speed: str) -> list[str]:
    """Return rows as a Markdown table, with a line on the machine."""
    return ["| " + " | ".join(row) + " |" for row in ([*HEADS], ["---"] * len(HEADS), *rows)] + ["", speed]


def written(text: str, new: Sequence[list[str]], speed: str) -> str:
    """Return a page with its table renewed.

    Args:
        text: Of the page.
        new: Rows of the studies that were run.
        speed: A line on this machine.
    """
    command = "`python benchmarks/accuracy_promise.py --write`"
    return renewed(text, PART, table(merged(rows_of(text), new), f"{speed} {command}"))
