"""What scripts write into docs/: parts of pages, from `<!-- name -->` to `<!-- end name -->`; long tables as CSV.

A part that a script has measured is also the store of its figures: `evidence.py` reads them from there.
"""

import csv
from collections.abc import Iterable, Sequence
from itertools import takewhile
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / "docs"


def renewed(text: str, name: str, lines: Sequence[str]) -> str:
    """Return a page with its part `name` replaced by `lines`. Raises ValueError where it has no such part, or two."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end {name} -->"
    if (text.count(begin), text.count(end)) != (1, 1):
        raise ValueError(f"the page must have the marks {begin.strip()} and {end} once each")
    head, _, rest = text.partition(begin)
    return head + begin + "\n".join(["", *lines, "", ""]) + end + rest.partition(end)[2]


def part(text: str, name: str) -> list[str]:
    """Return the lines of the part `name` of a page. Raises ValueError as `renewed`."""
    renewed(text, name, ())
    return text.partition(f"<!-- {name} -->\n")[2].partition(f"<!-- end {name} -->")[0].strip().splitlines()


def table_of(text: str, name: str) -> list[dict[str, str]]:
    """Return the rows of the first table in the part `name` of a page, by the names of its columns."""
    lines = part(text, name)
    start = next(i for i, line in enumerate(lines) if line.startswith("|"))
    rows = [cells(line) for line in takewhile(lambda line: line.startswith("|"), lines[start:])]
    return [dict(zip(rows[0], row, strict=True)) for row in rows[2:]]


def cells(line: str) -> list[str]:
    """Return the cells of a line of a Markdown table."""
    return [cell.strip() for cell in line.strip()[1:-1].split("|")]


def folded(summary: str, lines: Sequence[str]) -> list[str]:
    """Return lines in a block that opens when the reader clicks on its summary."""
    return ['<details markdown="1">', f"<summary>{summary}</summary>", "", *lines, "", "</details>"]


def write_part(page: str, name: str, lines: Sequence[str]) -> None:
    """Replace the part `name` of docs/`page` by `lines`; raises ValueError as `renewed`."""
    path = DOCS / page
    path.write_text(renewed(path.read_text(encoding="utf-8"), name, lines), encoding="utf-8")


def write_rows(file: str, case: str, table: Sequence[str]) -> None:
    """Replace the rows of `case` in docs/`file`, a CSV whose first column is the case, by those of a Markdown table."""
    names, _, *rows = map(cells, table)
    path = DOCS / file
    kept = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))[1:] if path.exists() else []
    cases = list(dict.fromkeys([row[0] for row in kept] + [case]))
    of = {name: [row for row in kept if row[0] == name] for name in cases} | {
        case: [[case, *row] for row in rows]
    }
    with path.open("w", encoding="utf-8", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["case", *names])
        writer.writerows(row for name in cases for row in of[name])


def read_rows(file: str) -> list[dict[str, str]]:
    """Return the rows of docs/`file` by the names of their columns."""
    return list(csv.DictReader((DOCS / file).read_text(encoding="utf-8").splitlines()))


def markdown(rows: Sequence[dict[str, str]], columns: Sequence[str]) -> list[str]:
    """Return rows as a Markdown table of some of their columns."""
    return table_lines(columns, [[row[name] for name in columns] for row in rows])


def table_lines(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Return rows of cells as a Markdown table."""
    head, *lines = ("| " + " | ".join(map(str, row)) + " |" for row in (heads, *rows))
    return [head, "|" + "---|" * len(heads), *lines]
