"""The simulator's node with an accuracy: the setting of a study, said once, and what is refused."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

import rclpy

from tests.messages import raises_naming
from tripod_graph.run import ros_arguments
from tripod_sim import SceneError
from tripod_sim.node import SimNode

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
