"""`tripod up --accuracy`: the setting goes to the simulator as overrides of its scene."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.messages import assert_names, line_naming, names, raises_naming
from tripod_bringup.node_values import RawYaml
from tripod_bringup.up_command import settle, up_command
from tripod_sim import SceneError


@pytest.fixture
def study(tmp_path: Path) -> Path:
    point = {
        "label": "", "settings": {"dt": 0.002, "mesh.level": 1}, "status": "ok", "message": "", "unknowns": 400,
        "error": 0.01, "own_error": 0.001, "bound": 0.011, "cpu": 0.1,
    }  # fmt: skip
    made = {
        "format": 1, "study": "tripod_dynamic", "scene": "tripod", "base": {}, "cpu": "s per simulated second",
        "quantities": [{"name": "move", "unit": "m", "what": "how far the effector has moved", "scale": 0.01}],
        "points": [point],
    }  # fmt: skip
    path = tmp_path / "study.json"
    path.write_text(json.dumps(made))
    return path


def test_the_setting_comes_before_what_the_user_sets(study: Path) -> None:
    values: dict[str, dict[str, Any]] = {
        "sim": {"set": RawYaml("'dt=0.004; solver.mode=newton'")},
        "view": {"port": "1"},
    }
    sentence = settle("tripod", values, "5%", study)
    words = [word.strip() for word in values["sim"]["set"].split(";")]
    assert words == ["dt=0.002", "mesh.level=1", "dt=0.004", "solver.mode=newton"]
    assert not isinstance(values["sim"]["set"], RawYaml), "it is text, whatever YAML would make of it"
    assert values["sim"]["study"] == str(study), "it tells the simulator what is cheaper"
    assert_names(sentence, "study", "dt=0.004", "solver.mode=newton")
    assert not names(settle("tripod", {}, "5%", study), "not made with"), "which the study has measured"
    assert_names(sentence, "not made with")
    assert values["view"] == {"port": "1"}


def test_without_an_accuracy_nothing_is_touched() -> None:
    values: dict[str, dict[str, Any]] = {"sim": {"set": RawYaml("[")}}
    assert settle("tripod", values, None, None) == ""
    assert values == {"sim": {"set": "["}}


def test_what_is_wrong_is_named(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with raises_naming(ValueError, "--set sim.set=[", "YAML"):
        settle("tripod", {"sim": {"set": RawYaml("[")}}, "5%", study)
    with raises_naming(SceneError, "--study", "--accuracy"):
        settle("tripod", {}, None, study)
    code = up_command(
        [], scene="tripod", port="mock", record=None, view=False, view_port=None, demo=False, namespace="",
        duration=1.0, subnet=False, verbose=False, accuracy="0.1%", study=study,
    )  # fmt: skip
    assert code == 2
    message = capsys.readouterr().err
    line_naming(message, "tripod up: ", "--accuracy 0.1 %", "study 'tripod_dynamic'")
    assert len(message.splitlines()) == 1
