"""What scripts write into docs/: parts of pages, from `<!-- name -->` to `<!-- end name -->`; long tables as CSV."""

import csv
from collections.abc import Sequence
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / "docs"


def renewed(text: str, name: str, lines: Sequence[str]) -> str:
    """Return a page with its part `name` replaced by `lines`. Raises ValueError where it has no such part, or two."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end {name} -->"
    if (text.count(begin), text.count(end)) != (1, 1):
        raise ValueError(f"the page must have the marks {begin.strip()} and {end} once each")
    head, _, rest = text.partition(begin)
    return head + begin + "\n".join(["", *lines, "", ""]) + end + rest.partition(end)[2]


def write_part(page: str, name: str, lines: Sequence[str]) -> None:
    """Replace the part `name` of docs/`page` by `lines`; raises ValueError as `renewed`."""
    path = DOCS / page
    path.write_text(renewed(path.read_text(encoding="utf-8"), name, lines), encoding="utf-8")


def write_rows(file: str, case: str, table: Sequence[str]) -> None:
    """Replace the rows of `case` in docs/`file`, a CSV whose first column is the case, by those of a Markdown table."""
    names, _, *rows = [[cell.strip() for cell in line.strip()[1:-1].split("|")] for line in table]
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
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    return lines + ["| " + " | ".join(row[name] for name in columns) + " |" for row in rows]
