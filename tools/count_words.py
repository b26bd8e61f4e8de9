"""Count the words of docs/*.md, text and evidence apart: `python -m tools.count_words`.

Evidence is what scripts write, from `<!-- NAME -->` to `<!-- end NAME -->` and the pages of `WRITTEN`, and tables of
measurements that a page folds (`<details>`). A word is what `wc -w` counts.
"""

import re
from pathlib import Path
from typing import NamedTuple

DOCS = Path(__file__).resolve().parents[1] / "docs"
LIMIT = 40_000
"""Largest number of words of text of all pages."""

WRITTEN = ("peers.md",)
"""Pages that scripts write from the first line to the last."""

_PART = re.compile(r"<!-- (?!end )([^>]*?) -->(.*?)<!-- end \1 -->|<details.*?</details>", re.DOTALL)


class Words(NamedTuple):
    """Numbers of words of a page."""

    text: int
    evidence: int


def words(text: str) -> Words:
    """Return the numbers of words of a page of Markdown, given its text."""
    rest = len(_PART.sub("", text).split())
    return Words(rest, len(text.split()) - rest)


def pages() -> dict[str, Words]:
    """Return the numbers of words of each page of docs/, by its name."""
    found = {path.name: words(path.read_text(encoding="utf-8")) for path in sorted(DOCS.glob("*.md"))}
    return found | {name: Words(0, sum(found[name])) for name in WRITTEN}


if __name__ == "__main__":
    found = pages()
    total = Words(sum(w.text for w in found.values()), sum(w.evidence for w in found.values()))
    print(f"{'page':<34}{'text':>7}{'evidence':>11}")
    for name, counted in {**found, f"all (limit {LIMIT})": total}.items():
        print(f"{name:<34}{counted.text:>7}{counted.evidence:>11}")
