"""Code that pages and pictures name exists: modules, classes, functions and methods."""

import re
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

from docs import step_picture

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").glob("*.md"))
STEP = "how_a_step_works.md"
MOVED = "versions.md"
"""The page whose tables have old names in their first column."""

NAME = re.compile(r"`(tripod_\w+(?:\.\w+)+)(?:\(\))?`")
"""A name with its package, on any page."""

SHORT = re.compile(r"`([a-z_]\w*(?:\.\w+)+)(?:\(\))?`")
"""A name with a dot."""

NO_CODE = {"tripod.toml", "solver.tolerance"}
"""What has a dot on the page of a step and is no code."""


def exists(name: str) -> bool:
    """Return whether a dotted name is a module, or something in one, or in a class there."""
    first, *rest = name.split(".")
    if not first.startswith("tripod_"):
        first, rest = "tripod_sim", [first, *rest]
    if not find_spec(first):
        return False
    found = import_module(first)
    for k, part in enumerate(rest):
        path = ".".join([first, *rest[: k + 1]])
        if hasattr(found, "__path__") and find_spec(path):
            found = import_module(path)
        elif hasattr(found, part):
            found = getattr(found, part)
        else:
            return False
    return True


def missing(text: str, pattern: re.Pattern[str]) -> Iterator[str]:
    """Yield the names of a page that are no code."""
    for name in dict.fromkeys(pattern.findall(text)):
        if name not in NO_CODE and not name.endswith((".py", ".toml", ".md")) and not exists(name):
            yield name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_code_that_a_page_names_exists(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    if page.name == MOVED:
        text = re.sub(r"^\|[^|]*\|", "|", text, flags=re.M)
    assert list(missing(text, NAME)) == []


def test_the_code_on_the_page_of_a_step_exists() -> None:
    text = (ROOT / "docs" / STEP).read_text(encoding="utf-8")
    assert len(SHORT.findall(text)) > 15
    assert list(missing(text, SHORT)) == []
    single = set(re.findall(r"`([a-z]\w+_\w+)`", text))
    assert [name for name in single if not exists(name)] == []


def test_a_name_that_does_not_exist_is_found() -> None:
    text = "`scene.Scene`, `scene.Sceme`, `system.System.evaluate`, `state.State.fly`, `nowhere.at_all`, `tripod.toml`"
    assert list(missing(text, SHORT)) == ["scene.Sceme", "state.State.fly", "nowhere.at_all"]
    assert list(missing("`tripod_sim.scene.Scene` `tripod_sim.none`", NAME)) == ["tripod_sim.none"]


def test_the_page_of_a_step_fits_one_screen_and_follows_the_picture() -> None:
    text = (ROOT / "docs" / STEP).read_text(encoding="utf-8")
    assert len(text.split()) < 420
    for _, _, names in step_picture.ROOMS:
        assert all(f"`{name}`" in text and exists(name) for name in names)
    assert step_picture.PICTURE.read_text(encoding="utf-8") == step_picture.svg(), "run docs/step_picture.py"
