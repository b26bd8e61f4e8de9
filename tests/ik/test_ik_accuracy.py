"""`tripod ik --accuracy`: the mesh of the model, by the study of inverse kinematics."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks import ik_promise
from tests.messages import assert_names, line_naming, raises_naming
from tripod_bringup.cli import app
from tripod_ik.accuracy import choose_model
from tripod_ik.tracker_settings import Goal
from tripod_sim.errors import SceneError
from tripod_study.accuracy.stored import stored_studies

IK = ["ik", "--target", "0.005 0 -0.006"]


def same_speed() -> float:
    return 0.0337


def test_one_per_cent_takes_a_mesh_that_promises_it_and_no_setting_that_no_scene_has() -> None:
    choice = choose_model("tripod", "1%", speed=same_speed)
    assert choice.error <= 0.01
    assert {word.partition(".")[0] for word in choice.overrides} <= {"mesh", "material"}
    assert choice.outside == ()
    assert choose_model("tripod", "budget 30ms", speed=same_speed).seconds < 0.03


def test_what_the_study_has_not_seen_is_named() -> None:
    choice = choose_model(
        "tripod", "5%", ["material.young=1e5"], goal=Goal.POSE, slide=0.02, speed=same_speed
    )
    assert choice.outside == ("material.young=1e5", "--goal pose", "--slide 0.02")


@pytest.mark.parametrize(
    ("scene", "accuracy", "study", "named"),
    [
        ("tripod", "0.1%", None, ("study 'ik'", "0.64 %")),
        ("tripod", "budget 30%", None, ("'ik'", "at rest", "--accuracy", "percentage", "time")),
        ("tripod_sofa", "5%", None, ("--accuracy", "'tripod'", "'tripod_sofa'", "leave --accuracy out")),
        ("tripod", "5%", "tripod_static", ("--study", "'tripod_static'", "tripod study ik")),
    ],
)
def test_what_cannot_be_had_is_told_in_one_line(
    scene: str, accuracy: str, study: str | None, named: tuple[str, ...]
) -> None:
    path = next((path for path in stored_studies() if path.stem == study), None)
    with raises_naming(SceneError, *named) as error:
        choose_model(scene, accuracy, study=path, speed=same_speed)
    assert "\n" not in str(error.value)


def test_the_command_solves_with_it_and_says_so() -> None:
    done = CliRunner().invoke(app, [*IK, "--accuracy", "10%", "--json"])
    assert done.exit_code == 0, done.stderr
    found = json.loads(done.stdout)["accuracy"]
    assert found["settings"]["mesh.element"] == "h8_modes"
    done = CliRunner().invoke(app, [*IK, "--accuracy", "10%"])
    line_naming(done.stderr, "study ik", "error", "8.4 %", "pose")
    assert "reached" in done.stdout


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["ik", "--accuracy", "1%"], ("--accuracy", "--target")),
        (["ik", "--json", "--slide", "0.03"], ("--slide", "--target", "--set NAME=VALUE")),
        ([*IK, "--accuracy", "1"], ("--accuracy", "'1'", "percentage")),
        ([*IK, "--accuracy", "1%", "--budget", "2ms"], ("--accuracy", "--budget")),
    ],
)
def test_bad_words_end_with_2_and_one_line(words: list[str], named: tuple[str, ...]) -> None:
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2
    assert_names(done.stderr, *named)
    assert len(done.stderr.splitlines()) == 1


def test_the_promise_is_measured_on_the_robot_of_the_study(monkeypatch: pytest.MonkeyPatch) -> None:
    places = ik_promise.targets(2, 1)
    assert np.hypot(*places[:, :2].T).max() <= ik_promise.WIDE
    coarse = ik_promise.robot(1)
    monkeypatch.setattr(ik_promise, "robot", lambda _: coarse)
    same = ik_promise.errors(["mesh.element=h20", "mesh.level=1"], places)
    other = ik_promise.errors(["mesh.element=h8_modes", "mesh.level=1"], places)
    assert same.max() < 1e-4 < other.min()


def test_the_page_has_the_promise() -> None:
    text = (Path(__file__).parents[2] / "docs" / "accuracy.md").read_text(encoding="utf-8")
    rows = [
        line.split(" | ")
        for line in text.partition("<!-- ik promise -->")[2].splitlines()
        if "mesh.level" in line
    ]
    rows = [row for row in rows if row[0] in ("| 10%", "| 5%", "| 1%")][:3]
    for row in rows:
        choice = choose_model("tripod", row[0][2:], speed=same_speed)
        assert row[1] == ", ".join(choice.overrides)
        assert float(row[2]) == pytest.approx(100 * choice.error, rel=0.02)
        assert float(row[4]) >= 95
