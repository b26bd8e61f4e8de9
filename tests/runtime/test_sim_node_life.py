"""The simulator in a graph: how it starts, pauses, fails, recovers and ends."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from tripod_msgs.msg import ControlMode, SimStatus

from tests.messages import assert_names, lines_naming, raises_naming
from tests.runtime.sim_graph import DEADLINE, Graph
from tripod_graph import names
from tripod_graph.command import CommandError, CommandLimits
from tripod_graph.limits import LIMIT_PARAMETERS
from tripod_graph.parameters import ParameterError
from tripod_graph.qos import RELIABLE
from tripod_runtime.node import _within_scene
from tripod_sim import SceneError, StepError, load_scene
from tripod_sim.scene import Scene
from tripod_sim.tables.short_forms import joints_of

pytestmark = pytest.mark.ros

ROOT = Path(__file__).parents[2]


def body_at_start(graph: Graph) -> tuple[float, ...]:
    """Reset and return the positions of step 0."""
    assert graph.reset().success
    return tuple(graph.next(names.BODY_STATE, lambda m: m.step == 0).positions)


def test_pause_step_and_reset(make) -> None:
    graph = make().start()
    answer = graph.step()
    assert not answer.success
    assert_names(answer.message, "not paused", "sim/pause")
    answer = graph.pause(True)
    assert (answer.success, answer.message) == (True, "paused")
    first = graph.status(state=SimStatus.PAUSED).step
    for k in (1, 2, 3):
        answer = graph.step()
        assert (answer.success, answer.message) == (True, f"step {first + k}")
    assert graph.status(state=SimStatus.PAUSED).step == first + 3
    graph.next(names.BODY_STATE, lambda m: m.step == first + 3)
    graph.next(names.BODY_STATE, lambda m: m.step == first + 3)  # again, for who comes late

    start = body_at_start(graph)
    assert graph.status(state=SimStatus.PAUSED).step == 0
    answer = graph.pause(False)
    assert (answer.success, answer.message) == (True, "running")
    graph.choose(ControlMode.TELEOP)
    graph.command([-0.4, -0.4, -0.4])
    graph.wait(lambda: graph.joints()[0] < -0.3, "motion")
    graph.pause(True)
    assert body_at_start(graph) == start
    graph.pause(False)
    assert graph.joints() == [0, 0, 0, 0]  # the old command is gone
    assert graph.status().state == SimStatus.PARKED


def test_reset_while_a_command_runs_goes_to_the_start_and_stays(make) -> None:
    graph = make(timeout=10.0, pose_rate=1000.0).start()
    graph.choose(ControlMode.TELEOP)
    graph.command([-0.5, -0.5, -0.5], seconds=3.0)
    graph.wait(lambda: graph.joints()[0] < -0.05, "motion")
    answer = graph.reset()
    assert answer.success
    assert_names(answer.message, "start")
    assert graph.joints() == [0, 0, 0, 0]
    graph.next(names.SIM_STATUS, lambda s: s.step > 100)
    assert graph.joints() == [0, 0, 0, 0]
    assert graph.status().rejected_commands == 0


def test_a_failed_step_is_reported_and_reset_recovers(make, monkeypatch) -> None:
    graph = make().start()
    graph.status(state=SimStatus.PARKED)

    failure = "element 7 is crushed"

    def crush(joints: object) -> None:
        raise StepError(failure)

    with monkeypatch.context() as patch:
        patch.setattr(graph.node._physics._simulation, "step", crush)
        status = graph.status(state=SimStatus.FAILED)
        assert_names(status.message, failure, "sim/reset")
        assert graph.status().step == status.step
        for answer in (graph.pause(True), graph.pause(False), graph.step()):
            assert not answer.success
            assert answer.message == failure
        body = graph.next(names.BODY_STATE)
        assert body.step == status.step  # the last good state, still shown
        report = graph.next(
            names.DIAGNOSTICS, lambda m: m.status[0].name.startswith(graph.node.get_namespace())
        )
        assert report.status[0].level == b"\x02"
        assert report.status[0].message == failure
    assert graph.reset().success
    status = graph.status(state=SimStatus.PARKED)
    assert status.message == ""
    graph.next(names.SIM_STATUS, lambda s: s.step > status.step)


@pytest.mark.parametrize(
    ("parameters", "error", "named"),
    [
        ({"scene": "tripot"}, SceneError, ("scene 'tripot'", "unknown", "'tripod'?")),
        ({"set": "mesh.level=1;dt=soon"}, SceneError, ("dt is 'soon'", "number")),
        ({"body_rate": 0}, ParameterError, ("'body_rate'", "0.0", "0.1 to 1000 Hz")),
        ({"pose_rate": "fast"}, ParameterError, ("'pose_rate'", "'fast'", "float")),
        ({"speed": 1.0}, ParameterError, ("'speed'", "unknown", "parameters: ", "angle_speed")),
        ({"park": "[0.0, 0.0]"}, CommandError, ("park position", "2 values", "4")),
        ({"angle_max": -0.1}, CommandError, ("park position", "servo_0", "0 rad", "-2.1 to -0.1 rad")),
        ({"angle_max": -2.5, "angle_min": -3.0}, CommandError, ("park position", "servo_0", "0 rad")),
        ({"set": "mesh.level=1;servos.angles=[0.1,0,0]", "angle_max": 0.05}, CommandError,
         ("start position", "servo_0", "0.1 rad", "-2.1 to 0.05 rad")),
        ({"set": "mesh.level=1;solver.max_iterations=1;solver.max_halvings=0;servos.angles=[-2,-2,-2]"}, ParameterError,
         ("scene 'tripod'", "cannot start", "step 1 at 0 s")),
    ],
)  # fmt: skip
def test_bad_parameters_are_refused_by_name(make, parameters, error, named: tuple[str, ...]) -> None:
    graph = make(**parameters)
    with raises_naming(error, *named):
        graph.start()


def limits_of(scene: Scene, **changes) -> CommandLimits:
    """Return the limits of the node for a scene, with these parameters."""
    values = {p.name: p.default for p in LIMIT_PARAMETERS} | changes
    return _within_scene(values, scene, joints_of(scene))


def test_limits_are_the_narrower_of_parameters_and_scene() -> None:
    scene = load_scene("tripod", ["servos.angle_min=-1.0", "servos.angle_max=0.5", "servos.slide_max=0.03"])
    wide = limits_of(scene, angle_min=-2.0, angle_max=0.6, slide_max=0.04)
    assert wide.lower == pytest.approx([-1.0] * 3 + [0.0])
    assert wide.upper == pytest.approx([0.5] * 3 + [0.03])
    narrow = limits_of(scene, angle_min=-0.5, angle_max=0.2, slide_max=0.01)
    assert narrow.lower == pytest.approx([-0.5] * 3 + [0.0])
    assert narrow.upper == pytest.approx([0.2] * 3 + [0.01])
    assert limits_of(replace(scene, servos=None, clamp=None)) == CommandLimits()
    apart = SimpleNamespace(count=3, others=(), arms=[SimpleNamespace(low=-2.0, high=-1.0)] * 3)
    values = {p.name: p.default for p in LIMIT_PARAMETERS} | {"angle_min": -0.5}
    with raises_naming(ParameterError, "angle_min", "-0.5", "angle_max", "-2.0 to -1.0 rad"):
        _within_scene(values, scene, apart)


def test_limits_are_of_as_many_servos_as_the_scene_has() -> None:
    assert limits_of(load_scene("cross")).joints == ("servo_0", "servo_1", "servo_2", "servo_3", "slide")
    six = limits_of(load_scene("two_tripods", ["body.1.servos.angle_min=-1.0"]))
    assert six.lower == pytest.approx([-2.1] * 3 + [-1.0] * 3 + [0.0])
    with raises_naming(CommandError, "park position", "4 values", "5: servo_0"):
        limits_of(load_scene("cross"), park=[0.0] * 4)


class Process:
    """The node as a user starts it; what it prints goes to a file."""

    def __init__(self, log: Path, *words: str) -> None:
        self._log = log
        with log.open("w") as file:
            self.child = subprocess.Popen(
                [sys.executable, "-m", "tripod_runtime.node", *words],
                cwd=ROOT,
                env=os.environ | {"RCUTILS_LOGGING_BUFFERED_STREAM": "0"},
                stdout=file,
                stderr=file,
            )

    def output(self) -> str:
        return self._log.read_text()


@pytest.fixture
def launch(tmp_path: Path, domain: int) -> Iterator[Callable[..., Process]]:
    """Start processes in the domain of the test; none outlives it."""
    started: list[Process] = []

    def run(*words: str) -> Process:
        started.append(Process(tmp_path / f"{len(started)}.log", *words))
        return started[-1]

    yield run
    for process in started:
        with contextlib.suppress(ProcessLookupError):
            process.child.kill()
        process.child.wait()


def test_the_process_refuses_bad_parameters_with_code_2_in_one_line(launch) -> None:
    refused = [
        (launch("scene:=tripot"), ("scene 'tripot'", "unknown", "scenes: ")),
        (launch("set:=material.young=-1"), ("material.young", "-1.0", "above 0 Pa")),
        (launch("body_rate:=0"), ("'body_rate'", "0.0", "0.1 to 1000 Hz")),
    ]
    for process, named in refused:
        assert process.child.wait(DEADLINE) == 2
        assert process.output().startswith("sim: ")
        assert_names(process.output(), *named)
        assert process.output().count("\n") == 1


def test_another_that_publishes_the_same_topics_is_told(make) -> None:
    graph = make().start()
    other = graph.ear.create_publisher(SimStatus, names.SIM_STATUS, RELIABLE)
    own = graph.node.get_namespace()
    said = (f"another node {own}/ear", f"{own}/sim/status")

    def told() -> bool:
        other.publish(SimStatus())
        health = graph.heard[names.DIAGNOSTICS]
        return any(s.level == b"\x01" and lines_naming(s.message, *said) for m in health for s in m.status)

    graph.wait(told, "the warning")


def test_the_process_ends_in_order_on_signals(launch) -> None:
    running = [
        (launch("set:=mesh.level=1", f"__ns:=/{number.name}"), number)
        for number in (signal.SIGINT, signal.SIGTERM)
    ]
    deadline = time.monotonic() + DEADLINE
    for process, number in running:
        while not lines_naming(process.output(), "scene tripod", "456 nodes"):
            assert process.child.poll() is None, process.output()
            assert time.monotonic() < deadline, process.output()
            time.sleep(0.02)
        process.child.send_signal(number)
    for process, _ in running:
        assert process.child.wait(DEADLINE) == 0
        assert process.output().count("\n") == 1  # the greeting, and no traceback
