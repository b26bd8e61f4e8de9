"""A study that the user has made tells the error of later runs."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.messages import assert_names, line_naming
from tripod_bringup import cli
from tripod_bringup.accuracy_option import own_study


def tripod(*words: str):
    return CliRunner().invoke(cli.app, list(words))


def error_of(stdout: str) -> str:
    return next(line for line in stdout.splitlines() if line.startswith("error "))


def test_a_run_after_a_study_of_the_scene_knows_its_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the same changes of the scene only; a study that comes with a scene goes first."""
    monkeypatch.chdir(tmp_path)
    assert_names(error_of(tripod("run", "incline").stdout), "not known")
    studied = tripod("study", "incline", "--quick")
    assert studied.exit_code == 0, studied.output
    line_naming(studied.stderr, "next", "tripod run incline")
    file = Path("studies") / "incline.json"
    assert own_study("incline", []) == file
    assert own_study("incline", ["contact.friction=0.4"]) is None
    assert own_study("tripod", []) is None
    assert_names(error_of(tripod("run", "incline").stdout), "%", str(file))
    (Path("studies") / "broken.json").write_text("{")
    assert own_study("incline", []) == file
