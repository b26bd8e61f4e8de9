"""Promises about the files of the project: pins, make targets, changelog, nothing of one developer's machine."""

import re
import subprocess
import tomllib
import xml.etree.ElementTree as ET
from importlib.metadata import distributions
from itertools import chain
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]

# a letter in brackets keeps each pattern from matching this very file
FOREIGN = {
    "address of a package registry": r"py[p]i\.org|py[t]honhosted\.|an[a]conda\.(org|com)|extra-[i]ndex|index-[u]rl",
    "path of a developer's machine": r"(?<![\w.~])/(?:h[o]me/\w|U[s]ers/\w|r[o]ot/|w[o]rk/)|[A-Z]:\\\\?U[s]ers",
}


def tracked_files() -> list[Path]:
    """Files that git tracks, or would; the test that asks is skipped where there is no checkout."""
    words = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    try:
        listed = subprocess.run(words, cwd=ROOT, check=True, capture_output=True).stdout
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    return [p for name in listed.decode().split("\0") if name and (p := ROOT / name).is_file()]


def foreign_words(text: str) -> list[str]:
    return [what for what, pattern in FOREIGN.items() if re.search(pattern, text)]


def pins(lines: list[str]) -> dict[str, str]:
    """Name to version; a line that is no pin raises ValueError."""
    found = {}
    for line in lines:
        match = re.fullmatch(r"([A-Za-z0-9][\w.-]*)(?:\[[\w,]+\])?==([\w.]+)", line)
        if match is None:
            raise ValueError(f"{line!r} pins nothing")
        found[re.sub(r"[-_.]+", "-", match[1]).lower()] = match[2]
    return found


def test_no_file_names_a_registry_or_a_developers_machine() -> None:
    files = tracked_files()
    assert ROOT / "pyproject.toml" in files
    found = [
        f"{path.relative_to(ROOT)}: {what}"
        for path in files
        for what in foreign_words(path.read_text(encoding="utf-8", errors="replace"))
    ]
    assert not found


@pytest.mark.parametrize(
    "text",
    [
        "see https://py" + "pi.org/simple",
        "pip install --index" + "-url=x",
        "open('/ho" + "me/jo/x')",
        'cwd = "/wo' + 'rk/main"',
        "cd /ro" + "ot/x",
        "/Us" + "ers/jo",
    ],
)
def test_the_search_for_foreign_words_finds_them(text: str) -> None:
    assert len(foreign_words(text)) == 1
    assert not foreign_words("the framework/x, ./root/y, ~/home/z and a/work/b are nobody's")


def test_dependencies_are_ranges_that_the_pins_of_constraints_are_in() -> None:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    constraints = pins([line for line in lines if not line.startswith("#")])
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    direct = [
        Requirement(r) for r in chain(project["dependencies"], *project["optional-dependencies"].values())
    ]
    assert len(direct) > 30
    assert not [str(r) for r in direct if not r.specifier or any(s.operator == "==" for s in r.specifier)]
    assert not [str(r) for r in direct if constraints.get(canonicalize_name(r.name), "") not in r.specifier]


def test_the_oldest_python_takes_every_pinned_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    oldest = project["requires-python"].removeprefix(">=") + ".0"
    wanted = {d.metadata["Name"]: d.metadata.get("Requires-Python") for d in distributions()}
    assert len(wanted) > 50
    assert not [name for name, range_ in wanted.items() if range_ and oldest not in SpecifierSet(range_)]


def test_the_version_is_the_same_everywhere() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for path in (ROOT / "package.xml", ROOT / "msgs" / "package.xml"):
        assert ET.parse(path).findtext("version") == project["version"], path
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert (citation["version"], citation["license"]) == (project["version"], project["license"])
    page = (ROOT / "docs" / "citing.md").read_text(encoding="utf-8")
    assert f"version = {{{project['version']}}}" in page
    assert citation["title"] in page


def test_the_packages_are_what_ros_takes_for_packages() -> None:
    catkin_pkg = pytest.importorskip("catkin_pkg.package")
    for path in (ROOT / "package.xml", ROOT / "msgs" / "package.xml"):
        warnings: list[str] = []
        package = catkin_pkg.parse_package(path, warnings=warnings)
        package.validate(warnings)
        assert not warnings
        assert [m.email for m in package.maintainers] == ["maintainers@tripod.invalid"]
        assert [(u.type, u.url) for u in package.urls] == [("website", "https://tripod.invalid")]


def test_make_lists_every_target_by_default() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.search(r"^\.PHONY: (.*)$", makefile, re.M)[1].split())
    tests = {"test", "test-slow", "test-all", "lint"}
    assert targets == tests | {"help", "setup", "demo", "bench", "docs", "labs", "firmware", "clean"}
    result = subprocess.run(
        ["make", "--no-print-directory"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert set(re.findall(r"^  make ([\w-]+)", result.stdout, re.M)) == targets


def test_the_changelog_says_what_is_unreleased() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    unreleased = re.search(r"^## \[Unreleased\]\n(.*?)(?=^## |\Z)", text, re.M | re.S)
    assert unreleased is not None
    entries = re.findall(r"^- \S.{20,}", unreleased[1], re.M)
    assert entries, "say under [Unreleased] what changed for users"
