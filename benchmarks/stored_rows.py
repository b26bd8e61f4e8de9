"""Rows that a benchmark has measured, one line of JSON each, so that it continues where it was stopped."""

import json
from pathlib import Path
from typing import Any


def stored(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a file, none if it does not exist; make its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def store(path: Path, row: dict[str, Any]) -> None:
    """Append a row to a file."""
    with path.open("a") as out:
        out.write(json.dumps(row) + "\n")
