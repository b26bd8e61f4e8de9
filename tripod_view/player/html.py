"""A film as one HTML file: nothing beside it is needed, and it asks no network for anything. Pure."""

import base64
import html
import json
import zlib
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Final

from tripod_host.writing import replaced_text
from tripod_view.player.film import Film
from tripod_view.player.packing import reel, stage

WEB: Final = "tripod_view.web"
"""The folder of what films and the live page have in common."""


def write_html(film: Film, path: str | Path) -> None:
    """Write a page that plays `film`. Raises OSError where `path` cannot be written."""
    with replaced_text(path) as file:
        file.write(player_page(stage(film), reel(film)))


def player_page(stage: dict[str, Any], reel: dict[str, Any] | None) -> str:
    """Return the page of a film; without a `reel` it asks the server that it came from for one, again and again."""
    parts = {
        "TITLE": html.escape(stage["title"]),
        "STYLE": _file("view.css", WEB) + _file("player.css"),
        "LIBRARY": _packed("three.js", WEB),
        "SCRIPT": "\n".join(
            [_file(name, WEB) for name in ("view.js", "toolbar.js", "colours.js", "plot.js")]
            + [_file(name) for name in ("film.js", "player.js")]
        ),
        "STAGE": _json(stage),
        "REEL": _json(reel),
    }
    page = _file("player.html")
    before, *rest = page.split("@@")
    return before + "".join(parts.get(text, text) for text in rest)


def _json(value: Any) -> str:
    """Return JSON that may stand in a script of a page."""
    return json.dumps(value, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _file(name: str, folder: str = "tripod_view.player") -> str:
    return (resources.files(folder) / name).read_text(encoding="utf-8").replace('"use strict";\n', "")


@cache
def _packed(name: str, folder: str) -> str:
    """Return a file as text: zlib's format in base64."""
    content = (resources.files(folder) / name).read_bytes()
    return base64.b64encode(zlib.compress(content, 9)).decode("ascii")
