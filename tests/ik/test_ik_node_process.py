import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

import rclpy
from tripod_msgs.msg import IkStatus

from tests.messages import assert_names, raises_naming
from tripod_graph import names
from tripod_graph.parameters import ParameterError
from tripod_graph.qos import RELIABLE
from tripod_ik.settings import PARAMETERS

pytestmark = pytest.mark.ros

DEADLINE = 60.0
"""For a loaded machine [s]; nothing here waits so long unless it fails."""


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        ({"angle_speed": 0.0}, ("'angle_speed'", "0.0", "0.01 to 20 rad/s")),
        ({"goal": "yaw"}, ("'goal'", "'yaw'", "position, orientation, pose")),
        ({"feedback": "eye"}, ("'feedback'", "'eye'", "none, pose, imu")),
        ({"weights": [1.0, 1.0]}, ("'weights'", 2, 3)),
        ({"box_low": [0.0, 0.0, 0.0]}, ("'box_high'", 0, 3, "x, y, z")),
        (
            {"box_low": [0.0] * 3, "box_high": [0.1, 0.0, 0.1]},
            ("effector box", "low [0.0, 0.0, 0.0] m", "high [0.1, 0.0, 0.1] m"),
        ),
        ({"target_low": [0.0, 0.0]}, ("target_low", "(2,)")),
        ({"target_low": [0.2, 0.0, 0.0]}, ("target_low [0.2, 0.0, 0.0] m", "target_high")),
        ({"angle_min": 0.7}, ("low 0.7 rad", "high 0.6 rad")),
        ({"speed": 1.0}, ("'speed'", "angle_speed")),
        ({"scene": "nosuch"}, ("'nosuch'", "tripod", ".toml")),
        ({"scene": "nosuch.toml"}, ("scene file", "'nosuch.toml'")),
    ],
)
def test_bad_parameters_are_refused_by_name(graph, parameters, named):
    with raises_naming((ParameterError, ValueError), *named):
        graph.start(**parameters)


@pytest.mark.parametrize(
    ("word", "named"),
    [
        ("tolerance:=-1", ("'tolerance'", "-1.0", "1e-07 m")),
        ("scene:=nosuch", ("ik: ", "'nosuch'", "tripod")),
    ],
)
@pytest.mark.usefixtures("domain")
def test_the_process_refuses_bad_parameters_with_code_2(word, named):
    run = subprocess.run(
        [sys.executable, "-m", "tripod_ik.node", word],
        capture_output=True,
        text=True,
        timeout=DEADLINE,
        check=False,
    )
    assert run.returncode == 2
    assert_names(run.stderr, *named)
    assert run.stderr.count("\n") == 1


def test_the_process_says_what_it_does_and_ends_in_order_on_ctrl_c(domain):
    """It says the latter in its last status, and leaves with code 0."""
    rclpy.init(domain_id=domain)
    ear = rclpy.create_node("ear")
    states = []
    ear.create_subscription(IkStatus, names.IK_STATUS, states.append, RELIABLE)
    process = subprocess.Popen(
        [sys.executable, "-m", "tripod_ik.node", "torque_max:=.inf"],
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        deadline = time.monotonic() + DEADLINE
        while not states and time.monotonic() < deadline:
            rclpy.spin_once(ear, timeout_sec=0.1)
        assert states
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=DEADLINE)
        deadline = time.monotonic() + DEADLINE
        while states[-1].message != "stopped" and time.monotonic() < deadline:
            rclpy.spin_once(ear, timeout_sec=0.1)
    finally:
        ear.destroy_node()
        rclpy.try_shutdown()
        process.kill()  # after the graph was left: see tests/domains.py
        process.wait()
    assert process.returncode == 0
    (line,) = errors.splitlines()
    topics = (names.JOINT_TRAJECTORY, names.TARGET_POSE, names.COMPLIANCE)
    assert_names(line, "[ik]:", *topics, "position", "mode IK", "scene tripod")
    assert states[-1].message == "stopped"


def test_every_parameter_says_what_it_does():
    assert len({p.name for p in PARAMETERS}) == len(PARAMETERS)
    for parameter in PARAMETERS:
        parameter.check(parameter.default)
        assert len(parameter.help) > 10
