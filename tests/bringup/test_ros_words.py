"""What `ros2 run` and `ros2 launch` write behind every program's name: node, namespace, parameter files, log level."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from tests.services import call

pytestmark = pytest.mark.ros

ROOT = Path(__file__).parents[2]
TRIPOD = [sys.executable, "-m", "tripod_bringup.cli"]
NODES = {
    "sim": ["scene:=silicone"],
    "ik": [],
    "driver": ["port:=mock"],
    "view": ["port:=0"],
    "record": [],
}
DEADLINE = 120.0  # [s], for a loaded machine

FILE = """
/**:
  ros__parameters:
    of_another_node: 1.5
/**/robot_{name}:
  ros__parameters:
    {parameter}: {value}
"""
PARAMETER = {
    "sim": ("body_rate", 20.0),
    "ik": ("angle_speed", 2.0),
    "driver": ("rate", 25.0),
    "view": ("angle_speed", 2.0),
    "record": ("directory", ""),
}


@contextmanager
def asking(domain: int) -> Iterator[tuple[Any, Any]]:
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    context = rclpy.Context()
    context.init(domain_id=domain)
    node = rclpy.create_node("asking", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield node, executor
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()


def parameters_of(asker: tuple[Any, Any], name: str) -> dict[str, object]:
    """Return every parameter of a node, asked for in one call, as `ros2 param dump` does."""
    from rcl_interfaces.srv import GetParameters, ListParameters
    from rclpy.parameter import parameter_value_to_python

    node, executor = asker

    def wait(done: Callable[[], Any], what: str) -> None:
        deadline = time.monotonic() + DEADLINE
        while not done():
            assert time.monotonic() < deadline, f"no {what}"
            executor.spin_once(timeout_sec=0.1)

    def ask(kind: Any, verb: str, request: object) -> Any:
        return call(node, kind, f"{name}/{verb}", request, server=name, wait=wait)

    names = list(ask(ListParameters, "list_parameters", ListParameters.Request(depth=10)).result.names)
    values = ask(GetParameters, "get_parameters", GetParameters.Request(names=names)).values
    assert len(values) == len(names), "one parameter without a value leaves all without"
    return {name: parameter_value_to_python(value) for name, value in zip(names, values, strict=True)}


@pytest.mark.parametrize("name", NODES)
def test_a_node_takes_what_launch_appends(name: str, domain: int, tmp_path: Path) -> None:
    parameter, value = PARAMETER[name]
    value = str(tmp_path / "bags") if name == "record" else value
    file = tmp_path / "robot.yaml"
    file.write_text(FILE.format(name=name, parameter=parameter, value=value), encoding="utf-8")
    ros = [
        "-r",
        f"__node:=robot_{name}",
        "-r",
        "__ns:=/left",
        "--params-file",
        str(file),
        "--log-level",
        "info",
    ]
    words = [*TRIPOD, name, *NODES[name], "--ros-args", *ros]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    process = subprocess.Popen(words, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True)
    try:
        with asking(domain) as asker:
            given = parameters_of(asker, f"/left/robot_{name}")
            assert given[parameter] == value
        process.send_signal(2)
        _, said = process.communicate(timeout=DEADLINE)
    finally:
        process.kill()
    assert process.returncode == 0, said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("ros", "message"),
    [
        (
            ["-r", "__ns:=/9left"],
            "driver: failed to initialize rcl: Couldn't parse remap rule: '-r __ns:=/9left'",
        ),
        (
            ["-r", "__node:=a/b"],
            "driver: failed to initialize rcl: Couldn't parse remap rule: '-r __node:=a/b'",
        ),
        (
            ["--params-file", "none.yaml"],
            "driver: parameter file none.yaml cannot be read: No such file or directory",
        ),
        (
            ["--log-level", "loud"],
            "driver: failed to initialize rcl: Couldn't parse log level: '--log-level loud'",
        ),
        (["-p", "prot:=mock"], "driver: parameter 'prot' is unknown; parameters: "),
        (["-p", "rate:=900.0"], "driver: parameter 'rate' is 900.0; allowed: 5 to 50 Hz"),
    ],
)
def test_words_that_are_wrong_end_in_one_line(ros: list[str], message: str, domain: int) -> None:
    words = [*TRIPOD, "driver", "port:=mock", "--ros-args", *ros]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False, timeout=DEADLINE)
    assert done.returncode == 2
    own = [line for line in done.stderr.splitlines() if not line.startswith("[")]  # those of rcl begin so
    assert len(own) == 1 and own[0].startswith(message), done.stderr


def test_a_file_of_another_robot_is_named(domain: int, tmp_path: Path) -> None:
    file = tmp_path / "right.yaml"
    file.write_text("/right/driver:\n  ros__parameters:\n    rate: 25.0\n", encoding="utf-8")
    words = [*TRIPOD, "driver", "port:=mock", "--ros-args", "--params-file", str(file)]
    process = subprocess.Popen(words, cwd=ROOT, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        line = process.stderr.readline()
        process.send_signal(2)
        process.communicate(timeout=DEADLINE)
    finally:
        process.kill()
    assert f"parameter file {file} sets nothing of /driver: its blocks are for /right/driver" in line
