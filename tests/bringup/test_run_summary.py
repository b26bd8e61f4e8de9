"""The table of `tripod run`: the rows of the estimated error of the time steps."""

import math
from typing import Any

from tests.messages import assert_names, names
from tripod_bringup.run_summary import result_rows


def rows(**more: Any) -> dict[str, str]:
    result = {
        "scene": "tripod", "time": 0.1, "steps": 10, "dt": 0.01, "effector": None, "angles": [], "energies": {},
        "residual": 1e-5, "newton_iterations": 40, "halvings": 0, "parts": 23, "rejected": 4,
        "step_ms": {"median": 1.0, "p99": 2.0},
    }  # fmt: skip
    return dict(result_rows(result | more))


def test_the_estimate_is_told_in_millimetres_with_its_worst() -> None:
    error = {
        "effector": 1.5e-5,
        "largest": 2e-5,
        "node": 7,
        "added": 1e-6,
        "worst_effector": 3e-5,
        "worst": 4e-5,
    }
    found = rows(time_error=error)
    effector, node = found["time error"].split(";")
    assert_names(effector, "effector 0.015 mm", "worst 0.03 mm")
    assert_names(node, "node 7", "0.02 mm", "worst 0.04 mm", "estimated")
    assert_names(found["solved by"], "40 Newton iterations", 23, 4)
    alone = rows(time_error=error | {"effector": math.nan, "worst_effector": math.nan})
    assert alone["time error"] == node.strip()
    with_ball = rows(time_error=error | {"ball": 1e-4, "worst_ball": 2e-4})["time error"]
    *before, ball = with_ball.split(";")
    assert [part.strip() for part in before] == [effector, node.partition("(")[0].strip()]
    assert_names(ball, "ball 0.1 mm", "worst 0.2 mm", "estimated")


def test_a_local_estimate_tells_what_a_part_added() -> None:
    nothing = dict.fromkeys(("effector", "largest", "worst_effector", "worst"), math.nan)
    found = rows(time_error=nothing | {"node": -1, "added": 1e-6, "worst_added": 2e-6})
    assert_names(found["time error"], "step", "at most 0.002 mm", "not estimated")


def test_without_an_estimate_nothing_is_told() -> None:
    found = rows()
    assert "time error" not in found
    assert_names(found["solved by"], "40 Newton iterations")
    assert not names(found["solved by"], 23)
    assert not names(found["solved by"], 4)


def test_the_error_of_the_mesh_is_told_beside_that_of_the_steps() -> None:
    mesh = {"effector": [0.0, 0.0, 9e-5], "distance": 9e-5, "worst": 1.2e-4}
    assert_names(rows(mesh_error=mesh)["error"], "effector", "mesh 0.09 mm", "worst 0.12", "estimated")
    step = {"effector": 3e-5, "largest": 4e-5, "node": 7, "added": 0, "worst_effector": 3e-5, "worst": 4e-5}
    both = rows(mesh_error=mesh, time_error=step)["error"]
    assert_names(both, "effector 0.12 mm", "mesh 0.09", "step 0.03", "worst 0.12", "estimated")
    unknown = rows(mesh_error=mesh | {"distance": math.nan})["error"]
    assert_names(unknown, "mesh", "no equilibrium")
    assert "error" not in rows()
