"""Pages of the site that stand elsewhere in the repository, with their links as they are from the page's place."""

import posixpath
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = {
    "index.md": "README.md",
    "learn/examples.md": "examples/README.md",
    "learn/labs.md": "labs/README.md",
    "project/changelog.md": "CHANGELOG.md",
}
"""Where each page comes from; a source that is not there makes no page."""
PAGE_OF = {source: page for page, source in SOURCES.items()}


def pages() -> list[str]:
    """Return the pages of SOURCES whose source is there."""
    return [page for page, source in SOURCES.items() if (ROOT / source).exists()]


def copied(page: str) -> str:
    """Return the text of a page of SOURCES."""
    source = SOURCES[page]
    text = (ROOT / source).read_text(encoding="utf-8")

    def moved(match: re.Match[str]) -> str:
        mark, words, link = match.groups()
        path, _, place = link.partition("#")
        if "://" in link or not path:
            return match[0]
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
        inside = PAGE_OF.get(target) or (target.removeprefix("docs/") if target.startswith("docs/") else "")
        if not inside:
            return f"`{target}`" if mark else str(words)  # no page of the site: named, not linked
        place = f"#{place}" if place else ""
        return f"{mark}[{words}]({posixpath.relpath(inside, posixpath.dirname(page) or '.')}{place})"

    return re.sub(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)", moved, text)
