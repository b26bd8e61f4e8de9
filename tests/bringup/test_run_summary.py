"""The lines of `tripod run`: those for everybody, and those of `--verbose`."""

import math
import shlex
from typing import Any

import pytest

from tests.messages import assert_names, names
from tripod_bringup import run_summary
from tripod_bringup.run_summary import result_rows, summary_rows


def rows(**more: Any) -> dict[str, str]:
    result = {
        "scene": "tripod", "time": 0.1, "steps": 10, "dt": 0.01, "effector": None, "angles": [], "energies": {},
        "residual": 1e-5, "newton_iterations": 40, "halvings": 0, "parts": 23, "rejected": 4,
        "step_ms": {"median": 1.0, "p99": 2.0},
    }  # fmt: skip
    return dict(result_rows(result | more))


def test_the_largest_error_of_the_run_is_told_in_millimetres() -> None:
    error = {"effector": 3e-5, "largest": 4e-5, "node": 7, "added": 1e-6}
    found = rows(time_error=error)
    effector, node = found["time error"].split(";")
    assert_names(effector, "effector", "0.03 mm")
    assert_names(node, "node 7", "0.04 mm", "estimated")
    assert_names(found["solved by"], "40 Newton iterations", 23, 4)
    alone = rows(time_error=error | {"effector": math.nan})
    assert alone["time error"] == node.strip()
    with_ball = rows(time_error=error | {"ball": 2e-4})["time error"]
    *before, ball = with_ball.split(";")
    assert [part.strip() for part in before] == [effector, node.partition("(")[0].strip()]
    assert_names(ball, "ball", "0.2 mm", "estimated")


def test_a_local_estimate_tells_what_a_part_added() -> None:
    nothing = dict.fromkeys(("effector", "largest"), math.nan)
    found = rows(time_error=nothing | {"node": -1, "added": 2e-6})
    assert_names(found["time error"], "step", "0.002 mm", "not estimated")


def test_without_an_estimate_nothing_is_told() -> None:
    found = rows()
    assert "time error" not in found
    assert_names(found["solved by"], "40 Newton iterations")
    assert not names(found["solved by"], 23)
    assert not names(found["solved by"], 4)


def test_the_largest_error_of_the_mesh_is_told_beside_that_of_the_steps() -> None:
    mesh = {"effector": [0.0, 0.0, 1e-6], "distance": 1e-6, "largest": 9e-5, "largest_with_steps": 9e-5}
    assert_names(rows(mesh_error=mesh)["error"], "effector", "0.09 mm", "mesh 0.09", "estimated")
    step = {"effector": 3e-5, "largest": 4e-5, "node": 7, "added": 0}
    both = rows(mesh_error=mesh | {"largest_with_steps": 1.1e-4}, time_error=step)["error"]
    assert_names(both, "effector", "0.11 mm", "mesh 0.09", "step 0.03", "estimated")
    unknown = rows(mesh_error=mesh | {"largest": math.nan})["error"]
    assert_names(unknown, "mesh", "no equilibrium")
    assert "error" not in rows()


def test_effects_are_named_without_costs() -> None:
    balance = {"lost": 0.0, "grew": False, "moved": 0.0, "unsure": 0.0, "work": 0.0, "since": 0.0}
    stable = {"residual": 0.0, "halvings": 0, "energy": balance, "at_rest": True, "dt_limit": None}
    stable |= {"contacts": None, "stability_margin": None, "unstable": ""}
    found = rows(figures={"accuracy": "not known", "effects": ["gravity", "inertia"], "stability": stable})
    assert found["effects"] == "gravity, inertia"
    assert not {"would add", "would save"} & found.keys()


def short(*words: str, **more: Any) -> dict[str, str]:
    result = {
        "scene": "cloth", "time": 0.1, "steps": 10, "dt": 0.01, "effector": None, "angles": [], "torques": [],
        "energies": {"kinetic": 0.2, "strain": 0.1, "gravity": -0.4}, "step_ms": {"median": 25.0, "p99": 2.0},
        "seconds": 0.256, "displacement": {"node": 3, "largest": 0.0413},
    }  # fmt: skip
    figures = {
        "error": {"measured": 0.0131, "bound": 0.03},
        "quantity": "the free corner",
        "finer": "1%",
        "accuracy": "",
    }
    return dict(summary_rows(result | {"figures": figures} | more, ["tripod", "run", "cloth", *words]))


def test_the_measured_error_is_told_with_its_meaning_and_what_makes_it_smaller() -> None:
    found = short()
    assert_names(found["result"], "41.3 mm", "still moving")
    assert_names(found["error"], "1.3 %", "measured", "study of this scene", "free corner")
    assert not names(found["error"], 3, "%"), "no bound beside a measured value"
    assert_names(found["cost"], "25 ms", "2.5 s")
    assert_names(found["next"], "tripod run cloth --accuracy 1%")


def test_of_a_motion_of_ones_own_the_study_knows_nothing() -> None:
    assert_names(short("--servo", "0:0,0,0")["error"], "1.3 %", "another")
    assert not names(short()["error"], "another")


def test_what_a_step_costs_is_asked_with_the_settings_of_the_run() -> None:
    estimated = {"effector": math.nan, "largest": 1e-4, "node": 3, "added": 0}
    words = ("--duration", "0.5", "--set", "dt=2ms", "--set", "time_error={}")
    found = short(*words, figures={"quantity": "tip"}, time_error=estimated)
    assert_names(found["next"], "tripod explain cloth --set dt=2ms --set 'time_error={}'")


def test_a_study_of_ones_own_is_named_and_used_again() -> None:
    found = short(study="studies/cloth.json")
    assert_names(found["error"], "1.3 %", "studies/cloth.json")
    assert_names(found["next"], "--accuracy 1% --study studies/cloth.json")


def test_an_error_that_nobody_measured_is_said_to_be_unknown_with_the_command_that_measures_it() -> None:
    unknown = {
        "error": {"measured": None, "bound": None},
        "quantity": "",
        "finer": None,
        "accuracy": "not known",
    }
    found = short(figures=unknown)
    assert_names(found["error"], "not known")
    assert_names(found["next"], "tripod study cloth --quick")
    own = short("--actuate", "tendon=0:0; 1:5mm", "--set", "dt=0.01", figures={"error": unknown["error"]})
    assert_names(own["next"], shlex.quote('motion={actuate=["tendon=0:0; 1:5mm"]}'))
    assert not names(own["next"], "--actuate"), "a study takes the motion of the scene"
    estimated = short(
        figures=unknown, time_error={"effector": 3e-5, "largest": 4e-5, "node": 7, "added": 1e-6}
    )
    assert_names(estimated["error"], "effector", "0.03 mm", "estimated")
    assert not names(estimated["next"], "tripod study")


def test_what_is_below_the_noise_is_not_shown() -> None:
    found = short(displacement={"node": 3, "largest": 8e-9}, energies={"kinetic": 1e-12, "strain": 0.1})
    assert_names(found["result"], "below 0.001 mm", "at rest")


def test_an_error_is_told_of_how_much() -> None:
    measured = {"error": {"measured": 0.35}, "quantity": "tip", "size": 0.0195}
    text = run_summary._error({"figures": measured}, own_motion=False)
    assert_names(text, "35 % of 19.5 mm", "tip")


def test_a_motion_that_grows_leads_to_smaller_steps() -> None:
    assert_names(short(instability="grew")["next"], "tripod run cloth --set dt=0.005")


@pytest.mark.parametrize(("largest", "warned"), [(0.58, True), (0.01, False)])
def test_an_estimated_error_beyond_the_motion_says_so(largest: float, *, warned: bool) -> None:
    error = {"effector": math.nan, "largest": largest, "node": 3, "added": 0}
    result = {"time_error": error, "displacement": {"largest": 0.094}}
    measured = {"error": {"measured": 0.13}, "quantity": "ends of the strips"}
    text = run_summary._error(result | {"figures": measured}, own_motion=False)
    assert_names(text, "13 %", "ends of the strips", "node 3", f"{1e3 * largest:.2g} mm")
    assert names(text, "estimate fails", "half of dt") == warned


def test_an_estimate_that_is_not_promised_any_longer_says_so() -> None:
    error = {"effector": math.nan, "largest": 0.001, "node": 3, "added": 0}
    result = {"time_error": error, "displacement": {"largest": 0.094}}
    note = "time_error.accuracy = 0.05 is not promised any longer: a point has gone far"
    assert_names(run_summary._error(result | {"notes": [note]}, own_motion=False), "too small", "note")
    assert not names(run_summary._error(result | {"notes": ["another"]}, own_motion=False), "too small")
