"""Each example does what its page says, and ends well."""

import os
import re
import runpy
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names, line_naming, raises_naming

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
COMMANDS = dict(
    re.findall(r"`(python examples/(\w+)\.py[^`]*)`", (EXAMPLES / "README.md").read_text(encoding="utf-8"))
)
"""Name of the example by the command that runs it."""
SAYS = {
    "own_mesh": [(("tip", "beam"), r"\d\.\d\d mm.*\d\.\d\d mm")],
    "own_part": [(("notched.step", "faces"), r"26 .*80 mm")],
    "own_robot": [(("our own", "effector"), r"\d\.\d\d mm")],
    "own_maze": [
        (("refused", "maze 'closed.txt'", "goal"), r"row \d.*row \d"),
        (("goal", "after"), r"\d\.\d\d s"),
    ],
    "own_cloth": [(("contacts", "rim"), r"\d+.*-\d+ and \d+ mm")],
    "own_effect": [(("fastest node",), r"\d\.\d\d and \d\.\d\d m/s")],
}
"""What lines name, and the values in them, by the example that prints them in this order."""


def test_the_page_has_a_command_for_each_example() -> None:
    assert sorted(COMMANDS.values()) == sorted(p.stem for p in EXAMPLES.glob("*.py"))


@pytest.mark.parametrize("name", SAYS)
def test_an_example_ends_with_what_it_shows(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [name])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    out = capsys.readouterr().out
    lines = []
    for named, values in SAYS[name]:
        lines.append(line_naming(out, *named))
        assert re.search(values, lines[-1])
    assert lines == sorted(lines, key=out.index)


def test_the_mesh_and_the_scene_that_an_example_writes_run_from_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    example = runpy.run_path(str(EXAMPLES / "own_mesh.py"))
    example["write_mesh"](tmp_path / "finger.vtk")
    (tmp_path / "finger.toml").write_text(example["SCENE"])
    words = [
        sys.executable,
        "-m",
        "tripod_bringup",
        "run",
        "finger.toml",
        "--duration",
        "0.1",
        "--html",
        "f.html",
    ]
    subprocess.run(
        words, check=True, capture_output=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, timeout=300
    )
    assert "finger" in (tmp_path / "f.html").read_text(encoding="utf-8")


def test_an_own_effect_is_seen_to_be_wrong_if_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    example = runpy.run_path(str(EXAMPLES / "own_effect.py"))
    monkeypatch.setitem(example["main"].__globals__, "LIFT", 0.8)
    wrong = example["fall"]

    def fall(overrides: list[str], *, lift: float, drag: float) -> tuple[np.ndarray, np.ndarray]:
        return wrong(overrides, lift=0.9 * lift, drag=drag)

    monkeypatch.setitem(example["main"].__globals__, "fall", fall)
    with raises_naming(AssertionError, "gravity"):
        example["main"]()


def test_a_recording_is_read_without_ros(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from tests.examples.joint_bag import write_joint_bag

    write_joint_bag(tmp_path / "made")
    example = runpy.run_path(str(EXAMPLES / "read_recording.py"))
    example["main"](tmp_path / "made")
    out = capsys.readouterr().out
    assert re.search(r"^ +101 /sim/joint_states$", out, re.M)
    line_naming(out, "servo_1", "-57.3 to -5.7 degrees")
    line_naming(out, "effector", "10.0 mm", "1.0 s")


@pytest.mark.ros
def test_the_controller_lets_the_servos_wave_until_it_is_stopped(domain: int) -> None:
    pytest.importorskip("tripod_msgs")
    from tests.runtime.sim_graph import Graph

    graph = Graph(domain, set="mesh.level=1").start()
    words = [sys.executable, str(EXAMPLES / "controller.py"), "--ros-args"]
    words += ["-r", f"__ns:={graph.node.get_namespace()}"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    controller = subprocess.Popen(words, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)
    try:
        graph.wait(lambda: min(graph.joints()[:3]) < -0.5, "a servo at the end of its way")
        angles = graph.joints()[:3]
        assert max(angles) - min(angles) > 0.2
        assert graph.last_status().authority.source == "wave"
        controller.send_signal(signal.SIGINT)
        told, _ = controller.communicate(timeout=300)
        assert controller.returncode == 0
        assert_names(told, "tripod up", "Ctrl-C")
        assert told.count("\n") == 1
    finally:
        controller.kill()
        graph.close()


@pytest.mark.ros
def test_the_target_is_reached_and_the_example_ends(domain: int) -> None:
    pytest.importorskip("tripod_msgs")
    from tests.runtime.sim_graph import Graph

    graph = Graph(domain, set="mesh.level=1").start()
    space = ["--ros-args", "-r", f"__ns:={graph.node.get_namespace()}"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    ik = subprocess.Popen([sys.executable, "-m", "tripod_bringup", "ik", *space], cwd=ROOT, env=environment)
    words = [sys.executable, str(EXAMPLES / "target.py"), "0.001", "0", "-0.001", *space]
    example = subprocess.Popen(words, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)
    try:
        graph.wait(lambda: example.poll() is not None, "the effector at its target")
        assert example.returncode == 0
        told, _ = example.communicate(timeout=300)
        missing = float(re.findall(r"^(\S+) mm from", told, re.M)[-1])
        assert missing < 0.1
        assert graph.last_status().authority.source == "target"
        assert min(graph.joints()[:3]) < -0.05
    finally:
        example.kill()
        ik.kill()
        graph.close()


@pytest.mark.ros
def test_what_was_reached_before_is_not_the_target(domain: int) -> None:
    """While nothing is solved the status has the numbers of the last solve."""
    import rclpy
    from geometry_msgs.msg import Point
    from tripod_msgs.msg import IkStatus

    from tripod_graph import names
    from tripod_graph.qos import RELIABLE

    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("ik", context=context, namespace="/before")
    statuses = node.create_publisher(IkStatus, names.IK_STATUS, RELIABLE)
    words = [
        sys.executable,
        str(EXAMPLES / "target.py"),
        "0.001",
        "0",
        "-0.001",
        "--ros-args",
        "-r",
        "__ns:=/before",
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    example = subprocess.Popen(words, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)
    status = IkStatus(state=IkStatus.IDLE, target=Point(x=0.001, y=0.0, z=-0.001), error=4e-5)
    try:
        until, tracked = time.monotonic() + 300, 0
        while example.poll() is None and time.monotonic() < until:
            moves = status.state == IkStatus.IDLE and statuses.get_subscription_count() > 0
            status.state, tracked = (IkStatus.TRACKING, tracked + 1) if moves else (IkStatus.IDLE, tracked)
            status.error = 2e-3 if moves and tracked <= 6 else 4e-5
            statuses.publish(status)
            time.sleep(0.1)
        told, _ = example.communicate(timeout=60)
        *before, last = [float(value) for value in re.findall(r"^(\S+) mm from", told, re.M)]
        assert last == 0.04
        assert set(before) == {2.0}
        assert len(before) >= 3
    finally:
        example.kill()
        node.destroy_node()
        rclpy.shutdown(context=context)


@pytest.mark.ros
@pytest.mark.parametrize("homed", [True, False])
def test_winches_are_homed_and_the_answer_is_told(domain: int, *, homed: bool) -> None:
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from std_srvs.srv import Trigger

    from tripod_graph import names

    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    space = f"/home_{homed}".lower()
    node = rclpy.create_node("driver", context=context, namespace=space)

    def answer(_: object, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = homed, "each place is known"
        return response

    node.create_service(Trigger, names.ROBOT_HOME, answer)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    words = [sys.executable, str(EXAMPLES / "home.py"), "--ros-args", "-r", f"__ns:={space}"]
    example = subprocess.Popen(
        words, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, text=True
    )
    try:
        until = time.monotonic() + 60
        while example.poll() is None and time.monotonic() < until:
            executor.spin_once(timeout_sec=0.1)
        assert example.returncode == (0 if homed else 1)
        assert_names(example.communicate()[0], "each place is known")
    finally:
        example.kill()
        node.destroy_node()
        context.try_shutdown()


def test_the_measured_poses_are_off_by_what_their_first_line_says() -> None:
    from tripod_identify.measured import read_csv
    from tripod_identify.model import Told, plainly, predict
    from tripod_identify.observe import sources_of
    from tripod_sim import load_scene

    scene = load_scene("tripod")
    told = plainly(scene)
    data = read_csv(EXAMPLES / "poses.csv", scene, sources_of(scene, ()), {})
    first = (EXAMPLES / "poses.csv").read_text(encoding="utf-8").splitlines()[0]
    zero = np.array([float(number) for number in re.findall(r"-?\d\.\d\d(?=[, ])", first)])
    turned = Told(scene, zero, told.gain, told.sensor)
    plain, known = (np.sqrt(np.mean((predict(t, data, ()) - data.values) ** 2)) for t in (told, turned))
    assert zero.tolist() == [0.03, -0.02, 0.05]
    assert known == pytest.approx(2e-4, rel=0.3)
    assert plain > 2.5 * known


@pytest.mark.parametrize("name", ["controller", "target"])
def test_a_node_asked_for_help_moves_nothing(name: str) -> None:
    words = [sys.executable, str(EXAMPLES / f"{name}.py"), "--help"]
    told = subprocess.run(words, check=True, capture_output=True, text=True, timeout=300, cwd=ROOT)
    assert_names(told.stdout, "tripod up")
    assert "Ctrl-C" not in told.stdout
