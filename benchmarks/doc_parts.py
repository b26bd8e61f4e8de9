"""Parts of a page that a script writes: what stands between `<!-- name -->` and `<!-- end name -->`."""

from collections.abc import Sequence
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / "docs"


def write_part(page: str, name: str, lines: Sequence[str]) -> None:
    """Replace the part `name` of docs/`page` by `lines`."""
    path = DOCS / page
    begin, end = f"<!-- {name} -->\n", f"<!-- end {name} -->"
    head, rest = path.read_text().split(begin)
    path.write_text(head + begin + "\n".join(["", *lines, "", ""]) + end + rest.split(end)[1])
