"""docs/topics.md names what the graph has: every topic with its type, every service, every action."""

import ast
import re
from pathlib import Path

import pytest

from tripod_graph import names

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "topics.md").read_text(encoding="utf-8")
NO_CHANNELS = {"WORLD", "BASE_LINK", "IMU_LINK", "SLIDE"}
NAMES = {key: value for key, value in vars(names).items() if key.isupper() and isinstance(value, str)}


def told() -> dict[str, str]:
    """What the second column of the page's tables tells of each name of the first."""
    found = {}
    for line in PAGE.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split(" | ")]
        if line.startswith("| `"):
            found |= dict.fromkeys(re.findall(r"`([\w/]+)`", cells[0]), cells[1])
    return found


def used() -> list[tuple[str, str]]:
    """Name and type of each topic that a node publishes or hears, where both are written out."""
    found = []
    for path in ROOT.glob("tripod_*/*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (
                isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and len(node.args) > 1
            ):
                continue
            if node.func.attr not in ("create_publisher", "create_subscription"):
                continue
            kind, topic = node.args[:2]
            key = topic.attr if isinstance(topic, ast.Attribute) else getattr(topic, "id", "")
            if isinstance(kind, ast.Name) and key in NAMES:
                found.append((NAMES[key], kind.id))
    return found


def test_every_name_is_on_the_page() -> None:
    last = {name.rsplit("/", 1)[-1] for name in told()}  # the action's name stands behind sim/ and robot/
    missing = [n for key, n in NAMES.items() if key not in NO_CHANNELS and n not in told() and n not in last]
    assert missing == []


def test_the_page_names_nothing_else() -> None:
    known = set(NAMES.values())
    assert [n for n in told() if n not in known and n.rsplit("/", 1)[-1] not in known] == []


@pytest.mark.parametrize(("topic", "kind"), sorted(set(used())))
def test_types_are_those_of_the_nodes(topic: str, kind: str) -> None:
    assert re.search(rf"\b{kind}\b", told()[topic])


def test_the_nodes_were_read() -> None:
    assert len(set(used())) > 20
