"""Pages of the site that stand elsewhere in the repository, with their links as they are from the page's place."""

import posixpath
import re
from pathlib import Path

from tools.reference import notebooks

ROOT = Path(__file__).resolve().parents[2]
LABS = "labs"


def sources() -> dict[str, str]:
    """Return where each page comes from, those whose source is there."""
    found = {
        "index.md": "README.md",
        "learn/examples.md": "examples/README.md",
        "learn/labs.md": f"{LABS}/README.md",
        "project/changelog.md": "CHANGELOG.md",
    }
    found |= {
        f"learn/{path.stem}.md": f"{LABS}/{path.name}" for path in sorted((ROOT / LABS).glob("*.ipynb"))
    }
    return {page: source for page, source in found.items() if (ROOT / source).exists()}


def copied(page: str) -> str:
    """Return the text of a page."""
    found = sources()
    source = found[page]
    text = (ROOT / source).read_text(encoding="utf-8")
    if source.endswith(".ipynb"):
        text = notebooks.markdown(text)
    return relinked(text, source, page)


def relinked(text: str, source: str, page: str) -> str:
    """Return the text of `source`, a path in the repository, with its links as they are from `page` of the site."""
    page_of = {origin: name for name, origin in sources().items()}

    def moved(match: re.Match[str]) -> str:
        mark, words, link = match.groups()
        path, _, place = link.partition("#")
        if ":" in link or not path:
            return match[0]
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
        inside = page_of.get(target) or (target.removeprefix("docs/") if target.startswith("docs/") else "")
        if not inside:
            return f"`{target}`" if mark else str(words)  # no page of the site: named, not linked
        place = f"#{place}" if place else ""
        return f"{mark}[{words}]({posixpath.relpath(inside, posixpath.dirname(page) or '.')}{place})"

    return re.sub(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)", moved, text)
