"""A robot with four legs: simulated, described, and steered by inverse kinematics as the Tripod is."""

import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tripod_ik.inverse import InverseSolver, Outcome
from tripod_ik.limits import AngleLimit
from tripod_ik.model import StaticModel, linear_state
from tripod_ik.solve_once import solve_once
from tripod_ik.tasks import PositionTask
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.scene.description import urdf
from tripod_study.run import run

CROSS = ("cross", ("mesh.level=1",))
HOME = -1.4965


def test_four_legs_are_symmetric_and_a_quarter_turn_apart() -> None:
    """Bent alike the disc goes straight down; bent one by one it goes the same way, a quarter turn on."""
    model = StaticModel(load_scene(*CROSS))
    down = model.state()
    assert np.abs(down.equilibrium[:2]).max() < 1e-9
    assert down.equilibrium[2] < -5e-3
    ways = []
    for servo in range(4):
        angles = np.full(4, HOME)
        angles[servo] += 0.1
        ways.append(model.move(angles).equilibrium)
        model.go_home()
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    assert np.linalg.norm(ways[0][:2]) > 5e-4
    for before, after in pairwise(ways):
        np.testing.assert_allclose(after, quarter @ before, atol=1e-8)


def test_jacobian_of_four_servos_is_that_of_differences() -> None:
    model = StaticModel(load_scene(*CROSS))
    state = model.state()
    assert state.jacobian.shape == (6, 4)
    for servo in range(4):
        ends = []
        for turn in (-1e-3, 1e-3):
            angles = np.full(4, HOME)
            angles[servo] += turn
            ends.append(model.move(angles).equilibrium)
            model.go_home()
        np.testing.assert_allclose(
            (ends[1] - ends[0]) / 2e-3, state.jacobian[:3, servo], rtol=2e-3, atol=2e-6
        )


@pytest.mark.parametrize("target", [(0.0, 0.0, -0.0065), (0.003, -0.002, -0.008)])
def test_inverse_kinematics_finds_four_angles_for_a_target(target: tuple[float, float, float]) -> None:
    scene = load_scene(*CROSS)
    found = solve_once(scene, target, slide=0.035)
    assert found["reached"], found["reason"]
    assert len(found["angles"]) == len(found["torques"]) == 4
    model = StaticModel(scene)
    np.testing.assert_allclose(model.move(np.array(found["angles"])).equilibrium, target, atol=2e-6)


def test_run_takes_four_angles_and_tells_four_torques() -> None:
    result = run(
        "cross", servo="0: 0,0,0,0; 0.2: -0.3,-0.3,-0.3,-0.3", duration=0.5, overrides=list(CROSS[1])
    )
    assert result["angles"] == [-0.3] * 4
    assert np.ptp(result["torques"]) < 1e-3 * abs(result["torques"][0])
    with raises_naming(SceneError, "'time: value, ...'", "4 finite values"):
        run("cross", servo="0: 0,0,0")
    with raises_naming(SceneError, "servos.angles", 3, 4):
        load_scene("cross", ["servos.angles=[0, 0, 0]"])
    with raises_naming(SceneError, "servo_2", "node 93"):
        Simulation(load_scene("cross", ["mesh.legs=3"]))


def test_description_and_compliance_name_four_servos() -> None:
    robot = ET.fromstring(urdf(load_scene(*CROSS)))
    names = [joint.get("name") for joint in robot.iter("joint")]
    assert [n for n in names if n and n.startswith("servo_")] == [f"servo_{i}" for i in range(4)]
    state = linear_state(Simulation(load_scene(*CROSS)).compliance())
    assert state.joint_names == ("servo_0", "servo_1", "servo_2", "servo_3")


EMIO = Path(__file__).parents[2] / "examples" / "emio.toml"


def test_a_robot_whose_own_pose_is_firmer_begins_there_and_reaches_what_is_below_it() -> None:
    """From the Tripod's working pose the search creeps along a snap, 19 mm off."""
    scene = load_scene(EMIO)
    np.testing.assert_array_equal(StaticModel(scene).home, np.zeros(4))
    target = (0.005, -0.15, 0.0)
    found = solve_once(scene, target, slide=0.035)
    assert found["reached"], found["reason"]
    np.testing.assert_allclose(found["position"], target, atol=1e-6)


@pytest.mark.slow
def test_a_search_that_creeps_along_a_snap_ends_and_says_so() -> None:
    model = StaticModel(load_scene(EMIO), angles=np.full(4, HOME))
    solver = InverseSolver(model, AngleLimit(-3.15, 3.15))
    found = solver.solve([PositionTask(np.array([0.005, -0.15, 0.0]))])
    assert found.outcome is Outcome.UNFINISHED
    assert found.iterations < 60
    assert_names(found.reason, f"{found.iterations} iterations", "snap", "another pose")
