"""The simulator's node with an accuracy: the setting of a study, what is refused, and what a slow machine changes."""

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

import rclpy

from tests.messages import lines_naming, raises_naming
from tripod_graph import names
from tripod_graph.run import ros_arguments
from tripod_runtime import lag
from tripod_runtime.node import SimNode
from tripod_runtime.realtime import RealTime, Speed
from tripod_sim import SceneError

pytestmark = pytest.mark.ros


@pytest.fixture
def study(tmp_path: Path) -> Path:
    point = {"settings": {"dt": 0.002}, "status": "ok", "error": 0.01, "bound": 0.011, "cpu": 0.1}
    made = {
        "format": 1, "study": "tripod_dynamic", "scene": "tripod", "base": {}, "cpu": "s per simulated second",
        "quantities": [{"what": "how far the effector has moved"}], "points": [point],
    }  # fmt: skip
    path = tmp_path / "study.json"
    path.write_text(json.dumps(made))
    return path


@pytest.fixture
def graph(domain: int) -> Iterator[None]:
    before = sys.getswitchinterval()
    yield
    sys.setswitchinterval(before)
    rclpy.try_shutdown()


def start(**parameters: str) -> SimNode:
    rclpy.init(args=ros_arguments([f'{k}:="{v}"' for k, v in parameters.items()]))
    return SimNode()


@pytest.mark.usefixtures("graph")
def test_the_node_takes_the_setting_and_the_user_wins(study: Path) -> None:
    node = start(set="mesh.level=1; solver.mode=newton", accuracy="5%", study=str(study))
    try:
        assert node._physics.simulation.scene.dt == 0.002
        assert node._physics.simulation.scene.mesh.level == 1
        assert node._physics.simulation.scene.solver.mode == "newton"
    finally:
        node.close()
        node.destroy_node()


@pytest.mark.usefixtures("graph")
def test_an_accuracy_that_no_setting_reaches_is_refused(study: Path) -> None:
    with raises_naming(SceneError, "--accuracy", "0.1 %", "no setting", "'tripod_dynamic'"):
        start(set="mesh.level=1", accuracy="0.1%", study=str(study))


@pytest.mark.parametrize("simulated", [False, True])
def test_a_setting_that_is_too_slow_is_told_everywhere_and_stays_as_it_is(
    make: Callable[..., Any], study: Path, monkeypatch: pytest.MonkeyPatch, simulated: bool
) -> None:
    """With simulated time nothing has to be real time, so nothing is proposed."""
    slow = Speed(0.31, 1e-3, 1e-3, 0, 3.2, behind=True)
    monkeypatch.setattr(RealTime, "speed", lambda physics: slow)
    told = lambda source, words, *, study: lag.Proposal(f"take {source}, {words}, {study}", "draft")  # noqa: E731
    monkeypatch.setattr(lag, "proposal", told)
    graph = make(study=str(study), publish_clock=simulated).start()
    before = graph.node._physics.simulation
    what = () if simulated else ("3.2 s", "take tripod", "mesh.level=1", study)
    graph.next(names.SIM_STATUS, lambda s: lines_naming(s.message, "factor 0.31", *what))
    report = graph.next(names.DIAGNOSTICS, lambda m: lines_naming(m.status[0].message, "factor 0.31", *what))
    assert report.status[0].level == b"\x01"
    noticed = lambda m: lines_naming(json.loads(m.data)["notice"], "0.31 x", "draft")  # noqa: E731
    if not simulated:
        graph.next(names.SIM_FIGURES, noticed)
    step = graph.status().step
    graph.next(names.SIM_STATUS, lambda s: s.step > step + 100)
    assert graph.node._physics.simulation is before
    assert len(graph.heard[names.SCENE]) == 1
    if simulated:
        assert not graph.node._lag.proposal
