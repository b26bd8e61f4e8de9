"""The labs run, and their notebooks show what the present texts say."""

import re
import runpy
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import pytest

from tests.messages import assert_names
from tools import labs

NAMES = labs.names()
PARTS = (
    "- **Objectives**:",
    "- **Prerequisites**:",
    "- **Time**:",
    "## Equations",
    "## What does accuracy cost?",
    "**Question:",
    "## Break it",
    "## Repair it",
    "## Questions",
    "<details><summary>Solutions</summary>",
    "</details>",
)
LARGEST = 600_000
"""Bytes of a notebook, pictures included."""


def notebook(name: str) -> nbformat.NotebookNode:
    return nbformat.read(labs.LABS / f"{name}.ipynb", as_version=4)


def test_there_is_a_lab_for_pendulum_cloth_and_each_of_the_nine_steps() -> None:
    assert [name.split("_")[0] for name in NAMES] == ["a", "b", *["step"] * 9]
    assert [name.split("_")[1] for name in NAMES[2:]] == [str(k) for k in range(1, 10)]
    linked = re.findall(r"\]\((\w+)\.ipynb\)", (labs.LABS / "README.md").read_text(encoding="utf-8"))
    assert linked == NAMES
    assert sorted(p.stem for p in labs.LABS.glob("*.ipynb")) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_was_made_of_the_present_text(name: str) -> None:
    shown, text = notebook(name).cells, labs.cells(name).cells
    assert [(c.cell_type, c.source) for c in shown] == [(c.cell_type, c.source) for c in text], (
        "run `python -m tools.labs`"
    )


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_has_pictures_and_no_error_in_it(name: str) -> None:
    outputs = [o for cell in notebook(name).cells if cell.cell_type == "code" for o in cell.outputs]
    assert all(cell.execution_count for cell in notebook(name).cells if cell.cell_type == "code")
    assert not [o for o in outputs if o.output_type == "error" or o.get("name") == "stderr"]
    assert sum("image/png" in o.get("data", {}) for o in outputs) >= 3
    assert (labs.LABS / f"{name}.ipynb").stat().st_size < LARGEST


@pytest.mark.parametrize("name", NAMES)
def test_a_lab_has_its_parts_in_their_order(name: str) -> None:
    words = "\n".join(c.source for c in labs.cells(name).cells if c.cell_type == "markdown")
    at = [words.find(part) for part in PARTS]
    assert min(at) > 0
    assert at == sorted(at)
    questions, solutions = words[at[-3] :].split("<details>")
    assert len(re.findall(r"^\d\. ", questions, re.M)) == len(re.findall(r"^<p>\d\. ", solutions, re.M)) >= 2


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_lab_runs(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)  # what it needs comes along with it
    monkeypatch.syspath_prepend(str(labs.LABS))
    plt.switch_backend("agg")
    try:
        runpy.run_path(str(labs.LABS / f"{name}.py"))
    finally:
        plt.close("all")
        sys.modules.pop("show", None)


def test_an_unknown_lab_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["labs", "a_pendulum", "step_10"])
    assert labs.main() == 2
    assert_names(capsys.readouterr().err, "no lab", "'step_10'", *NAMES)
