"""The files of the page: viser's own, which draws in 3-D, with our panel beside it. Pure.

The panel is plain JavaScript and CSS in `web/`, without a build step; nothing is loaded from elsewhere.
"""

import gzip
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Final

import viser

KINDS: Final = {".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8"}
"""What is served of `web/`, by the ending of the file's name."""

FOLDER: Final = "/page/"
"""Path of these files, behind the token."""

HEAD: Final = """<link rel="stylesheet" href="/{token}/page/page.css" />
<script type="module" src="/{token}/page/main.js"></script>
</head>"""


@dataclass(frozen=True)
class File:
    """A file as it is sent: what kind it is, and its content, compressed by gzip."""

    kind: str
    packed: bytes


def page_files(token: str) -> dict[str, File]:
    """Return the files of the page by path behind `token`: "/" is the page itself."""
    index = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text(encoding="utf-8")
    before, head, after = index.partition("</head>")
    assert head, "viser's page has no head"
    page = before.replace("<title>Viser</title>", "<title>Tripod</title>") + HEAD.format(token=token) + after
    files = {"/": _file("text/html; charset=utf-8", page.encode())}
    for path in (resources.files("tripod_view") / "web").iterdir():
        if kind := KINDS.get(Path(path.name).suffix):
            files[FOLDER + path.name] = _file(kind, path.read_bytes())
    return files


def _file(kind: str, content: bytes) -> File:
    return File(kind, gzip.compress(content, mtime=0))
