"""Pages of the site that stand elsewhere in the repository: README, changelog, citation."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def readme() -> str:
    """Return README.md as the first page of the site."""
    return _moved((ROOT / "README.md").read_text(encoding="utf-8"))


def changelog() -> str:
    """Return CHANGELOG.md as a page."""
    return _moved((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), up="../")


def _moved(text: str, up: str = "") -> str:
    """Return `text` with its links as they are from within docs/; links to other files become words."""
    text = re.sub(r"\]\(docs/", f"]({up}", text)
    text = text.replace("](CHANGELOG.md)", "](project/changelog.md)")
    return re.sub(r"\[([^\]]+)\]\((?!https?:|#)((?!\w+/)[A-Z]\w*(?:\.\w+)?)\)", r"\1", text)
