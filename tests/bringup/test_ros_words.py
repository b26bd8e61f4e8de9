"""What `ros2 run` and `ros2 launch` write behind every program's name, and what `ros2 param` asks of it."""

import os
import pty
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from tests.messages import assert_names, lines_naming
from tests.services import call
from tests.tiers import sampled
from tripod_bringup.node_command import parameter_table
from tripod_graph.parameters import Parameter

pytestmark = pytest.mark.ros

ROOT = Path(__file__).parents[2]
TRIPOD = [sys.executable, "-m", "tripod_bringup.cli"]
PROGRAMS = {
    "sim": ["silicone"],
    "ik": [],
    "driver": ["--set", "port=mock"],
    "teleop": [],
    "view": ["--set", "port=0"],
    "record": [],
    "play": ["--live"],
}
DEADLINE = 120.0  # [s], for a loaded machine

FILE = """
/**:
  ros__parameters:
    of_another_node: 1.5
    qos_overrides: {{/tf: {{publisher: {{depth: 5}}}}}}
/**/robot_{name}:
  ros__parameters:
    {parameter}: {value}
"""
PARAMETER = {
    "sim": ("body_rate", 20.0),
    "ik": ("angle_speed", 2.0),
    "driver": ("rate", 25.0),
    "teleop": ("speed", 0.25),
    "view": ("angle_speed", 2.0),
    "record": ("directory", ""),
    "play": ("use_sim_time", False),
}


class Asker:
    """A node that asks others for their parameters, as `ros2 param` does."""

    def __init__(self, node: Any, executor: Any) -> None:
        self.node, self._executor = node, executor

    def wait(self, done: Callable[[], Any], what: str) -> None:
        deadline = time.monotonic() + DEADLINE
        while not done():
            assert time.monotonic() < deadline, f"no {what}"
            self._executor.spin_once(timeout_sec=0.1)

    def _ask(self, kind: Any, name: str, verb: str, request: object) -> Any:
        return call(self.node, kind, f"{name}/{verb}", request, server=name, wait=self.wait)

    def dump(self, name: str) -> dict[str, Any]:
        """Return every parameter of a node, asked for in one call."""
        from rcl_interfaces.srv import GetParameters, ListParameters
        from rclpy.parameter import parameter_value_to_python

        found = self._ask(ListParameters, name, "list_parameters", ListParameters.Request(depth=10)).result
        values = self._ask(
            GetParameters, name, "get_parameters", GetParameters.Request(names=found.names)
        ).values
        assert len(values) == len(found.names), "one parameter without a value leaves all without"
        return {n: parameter_value_to_python(value) for n, value in zip(found.names, values, strict=True)}

    def change(self, name: str, values: Mapping[str, object]) -> dict[str, str]:
        """Set parameters of a node one by one; return why each was refused, empty if it was not."""
        from rcl_interfaces.srv import SetParameters
        from rclpy.parameter import Parameter as RosParameter

        given = [RosParameter(n, value=value).to_parameter_msg() for n, value in values.items()]
        answer = self._ask(SetParameters, name, "set_parameters", SetParameters.Request(parameters=given))
        assert all(result.successful != bool(result.reason) for result in answer.results)
        return {n: result.reason for n, result in zip(values, answer.results, strict=True)}

    def topics(self, name: str, namespace: str) -> set[str]:
        """Return what a node publishes and listens to, once the graph knows it by name."""
        self.wait(lambda: (name, namespace) in self.node.get_node_names_and_namespaces(), f"node {name}")
        found = self.node.get_publisher_names_and_types_by_node(name, namespace)
        found += self.node.get_subscriber_names_and_types_by_node(name, namespace)
        return {topic for topic, _ in found}


@contextmanager
def asking(domain: int) -> Iterator[Asker]:
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    context = rclpy.Context()
    context.init(domain_id=domain)
    node = rclpy.create_node("asking", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield Asker(node, executor)
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()


@contextmanager
def running(words: list[str], domain: int) -> Iterator[subprocess.Popen[str]]:
    """Run a program where its standard input is a terminal, which teleop needs."""
    near, far = pty.openpty()
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    process = subprocess.Popen(
        [*TRIPOD, *words], cwd=ROOT, env=environment, stdin=far, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.communicate()
        os.close(near)
        os.close(far)


def other_value(p: Parameter) -> object:
    """Return another value that is allowed: a little nearer to an end of the range."""
    if isinstance(p.default, list):
        return [0.9 * v for v in p.default]
    assert isinstance(p.default, float)
    return 0.9 * p.default + 0.1 * (p.low or 0.0)


@pytest.mark.parametrize("name", sampled(PROGRAMS, "driver"))
def test_a_program_takes_what_launch_appends_and_its_parameters_answer(
    name: str, domain: int, tmp_path: Path
) -> None:
    parameter, value = PARAMETER[name]
    value = str(tmp_path / "bags") if name == "record" else value
    file = tmp_path / "robot.yaml"
    text = FILE.format(name=name, parameter=parameter, value=str(value).lower() if value is False else value)
    file.write_text(text, encoding="utf-8")
    remaps = [f"__node:=robot_{name}", "__ns:=/left", "control_mode:=operator", "/diagnostics:=health"]
    ros = [word for remap in remaps for word in ("-r", remap)]
    ros += ["--params-file", str(file), "--log-level", "info"]
    node = f"/left/robot_{name}"
    table = parameter_table(name) if name != "play" else ()
    with running([name, *PROGRAMS[name], "--ros-args", *ros], domain) as process:
        with asking(domain) as asker:
            given = asker.dump(node)
            assert given[parameter] == value
            assert set(given) == {p.name for p in table} | {"use_sim_time", "start_type_description_service"}
            assert ("/left/health" if name == "record" else "/left/operator") in asker.topics(
                f"robot_{name}", "/left"
            )
            changes = {p.name: other_value(p) for p in table if p.dynamic}
            fixed = {p.name: given[p.name] for p in table if not p.dynamic and given[p.name] != []}
            if table:
                refused = asker.change(node, {**changes, **fixed})
                assert refused == {**dict.fromkeys(changes, ""), **{n: refused[n] for n in fixed}}
                for parameter in fixed:
                    assert_names(refused[parameter], parameter, "read-only")
            now = asker.dump(node)
            assert {n: now[n] for n in changes} == {n: pytest.approx(v) for n, v in changes.items()}
        process.send_signal(2)
        _, said = process.communicate(timeout=DEADLINE)
    assert process.returncode == (1 if name == "play" else 0), said  # a game that is stopped is not won
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("ros", "named"),
    [
        (["-r", "__ns:=/9left"], ("namespace '/9left'", "letters, digits and _")),
        (["-r", "__ns:=/left/"], ("namespace '/left/'", "letters, digits and _")),
        (["-r", "__ns:=left"], ("namespace 'left'", "__ns:=/left")),
        (["-r", "joint_trajectory:=a//b"], ("remap rule", "'-r joint_trajectory:=a//b'")),
        (["-r", "joint_trajectory:=9a"], ("remap rule", "'-r joint_trajectory:=9a'")),
        (["-r", "__node:=a/b"], ("remap rule", "'-r __node:=a/b'")),
        (["--params-file", "none.yaml"], ("none.yaml", "No such file")),
        (["--log-level", "loud"], ("log level", "'--log-level loud'")),
        (["--params-fil", "a.yaml"], ("argument '--params-fil'",)),
        (["-p", "use_sim_time:=5"], ("parameter 'use_sim_time'", "'5'", "'INTEGER'")),
        (
            ["-p", "qos_overrides./robot/status.publisher.depth:=5"],
            ("parameter 'qos_overrides./robot/status.publisher.depth'", "quality of service"),
        ),
        (["-p", "prot:=mock"], ("parameter 'prot'", "port", "rate")),
        (["-p", "rate:=900.0"], ("parameter 'rate'", "900.0", "5 to 50 Hz")),
    ],
)
def test_words_that_are_wrong_end_in_one_line(ros: list[str], named: tuple[str, ...], domain: int) -> None:
    words = [*TRIPOD, "driver", "--set", "port=mock", "--ros-args", *ros]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False, timeout=DEADLINE)
    assert done.returncode == 2
    own = [line for line in done.stderr.splitlines() if not line.startswith("[")]  # those of rcl begin so
    assert len(own) == 1 and own[0].startswith("driver: "), done.stderr
    assert_names(own[0], *named)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("/driver:\n  ros__parameters:\n    rate: [\n", ("parse", "robot.yaml")),
        ("/driver:\n  ros__parameters:\n    rate: fast\n", ("parameter 'rate'", "'fast'", "type float")),
        ("/driver:\n  ros__parameters:\n    rates: 9.0\n", ("parameter 'rates'", "port", "rate")),
    ],
)
def test_a_parameter_file_that_is_wrong_ends_in_one_line(
    text: str, named: tuple[str, ...], domain: int, tmp_path: Path
) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(text, encoding="utf-8")
    test_words_that_are_wrong_end_in_one_line(["--params-file", str(file)], named, domain)


@pytest.mark.parametrize("name", ["teleop", "play"])
def test_programs_with_more_than_a_node_refuse_a_namespace_that_is_none(name: str, domain: int) -> None:
    with running([name, *PROGRAMS[name], "--ros-args", "-r", "__ns:=/a b"], domain) as process:
        _, said = process.communicate(timeout=DEADLINE)
    assert process.returncode == 2
    assert said.startswith("solve: " if name == "play" else f"{name}: ")  # the name of the node
    assert_names(said, "namespace '/a b'")
    assert said.count("\n") == 1


def test_a_file_of_another_robot_is_named(domain: int, tmp_path: Path) -> None:
    file = tmp_path / "right.yaml"
    file.write_text("/right/driver:\n  ros__parameters:\n    rate: 25.0\n", encoding="utf-8")
    words = [*TRIPOD, "driver", "--set", "port=mock", "--ros-args", "--params-file", str(file)]
    process = subprocess.Popen(words, cwd=ROOT, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        line = process.stderr.readline()
        process.send_signal(2)
        process.communicate(timeout=DEADLINE)
    finally:
        process.kill()
    assert_names(line, file)
    assert set(re.findall(r"/(?:right/)?driver\b", line)) == {"/driver", "/right/driver"}


def test_a_servo_script_moves_the_simulator_and_stop_ends_it(domain: int) -> None:
    from sensor_msgs.msg import JointState
    from tripod_msgs.msg import ControlMode

    from tripod_graph import names
    from tripod_graph.qos import LATCHED, RELIABLE

    script = "0:0,0,0; 0.5:-0.3,-0.2,-0.1; 600:-0.3,-0.2,-0.1"
    with running(["sim", "--servo", script, "--ros-args", "-r", "__node:=robot_sim"], domain) as process:
        with asking(domain) as asker:
            heard: list[list[float]] = []
            modes: list[ControlMode] = []
            stop = asker.node.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
            asker.node.create_subscription(
                JointState, names.SIM_JOINT_STATES, lambda m: heard.append(list(m.position[:3])), RELIABLE
            )
            asker.node.create_subscription(ControlMode, names.CONTROL_MODE, modes.append, LATCHED)
            asker.wait(lambda: heard and heard[-1] == pytest.approx([-0.3, -0.2, -0.1], abs=1e-3), "motion")
            asker.wait(lambda: modes and modes[-1].mode == ControlMode.REPLAY, "the mode")
            assert "script#" in modes[-1].source
            asker.wait(lambda: {"robot_sim", "script"} <= set(asker.node.get_node_names()), "both nodes")
            stop.publish(ControlMode(mode=ControlMode.STOP, source="operator#1"))
            asker.wait(lambda: heard[-1] == pytest.approx([0.0] * 3, abs=1e-3), "parked servos")
        process.send_signal(2)
        _, said = process.communicate(timeout=DEADLINE)
        assert process.returncode == 0
        assert lines_naming(said, "script: ", "STOP", "operator")
        assert "Traceback" not in said
