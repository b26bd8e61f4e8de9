"""The messages that docs/faq.md quotes are those of the code."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "faq.md").read_text(encoding="utf-8")
GAP = "\0"
"""Stands in a text of the code for what is only known when it is said."""


def texts_of_the_code() -> list[str]:
    """Every string of the programs, f-strings with a gap for each value."""
    found = []
    for path in [p for name in ("tripod_*", "tools") for p in ROOT.glob(f"{name}/**/*.py")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                found.append("".join(v.value if isinstance(v, ast.Constant) else GAP for v in node.values))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append(node.value.replace("{}", GAP))
    return found


CODE = texts_of_the_code()
QUOTED = [match[1].strip("`") for match in re.finditer(r"^\| (`+.+?`)(?: fails)? \|", PAGE, re.MULTILINE)]


def test_messages_are_quoted() -> None:
    assert len(QUOTED) > 30


@pytest.mark.parametrize("message", QUOTED)
def test_each_quoted_message_is_one_of_the_code(message: str) -> None:
    parts = [part.strip(" ;:,()") for part in message.split("...")]
    assert any(len(part) > 4 for part in parts)
    pattern = re.compile(".*".join(map(re.escape, parts)), re.DOTALL)
    assert any(pattern.search(text) for text in CODE)
