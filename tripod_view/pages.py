"""The files of the page: plain HTML, JavaScript and CSS in `web/`, without a build step. Pure.

Nothing is loaded from elsewhere.
"""

import gzip
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Final

KINDS: Final = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
}
"""What is served of `web/`, by the ending of the file's name."""

FOLDER: Final = "/page/"
"""Path of these files, behind the token."""

PAGE: Final = "page.html"
"""The page itself, at "/"."""


@dataclass(frozen=True)
class File:
    """A file as it is sent: what kind it is, and its content, compressed by gzip."""

    kind: str
    packed: bytes


def page_files(token: str) -> dict[str, File]:
    """Return the files of the page by path behind `token`: "/" is the page itself."""
    files = {}
    for path in (resources.files("tripod_view") / "web").iterdir():
        if kind := KINDS.get(Path(path.name).suffix):
            content, name = path.read_bytes(), FOLDER + path.name
            if path.name == PAGE:
                content, name = content.replace(b"@@TOKEN@@", token.encode()), "/"
            files[name] = File(kind, gzip.compress(content, mtime=0))
    return files
