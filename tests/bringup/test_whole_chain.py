"""The whole chain for real: `tripod up --demo` with every node, and what it left on the disk."""

import os
import re
import signal
import socket
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("tripod_msgs", reason="the messages are not built: run `make setup`")

import numpy as np
from mcap.reader import NonSeekingReader
from rosbags.highlevel import AnyReader

from tests import messages
from tests.bringup.processes import DEADLINE, wait_until
from tests.domains import own_domain
from tests.messages import assert_names, line_naming
from tripod_bringup.demo_summary import NOT_MEASURED
from tripod_bringup.demo_target import DemoTarget
from tripod_graph import names
from tripod_graph.mode import NONE, Mode

ROOT = Path(__file__).parents[2]
TRACK = 6.0
LIGHT = ("mesh.element=h8_modes", "inertia.scheme=bdf2", "dt=0.005")
"""A tenth of the work of the scene: what is shown here is the chain, also beside others on the machine."""
TOPICS = {
    f"/{topic}".replace("//", "/")
    for topic in (
        names.JOINT_TRAJECTORY,
        names.CONTROL_MODE,
        names.TARGET_POSE,
        names.BODY_STATE,
        names.MESH,
        names.MAZE_MESH,
        names.BALL_SHAPE,
        names.SIM_JOINT_STATES,
        names.EFFECTOR_POSE,
        names.COMPLIANCE,
        names.SIM_STATUS,
        names.IK_STATUS,
        names.ROBOT_JOINT_STATES,
        names.ROBOT_STATUS,
        names.DIAGNOSTICS,
    )
}
"""What every session holds; nobody asked for what follows from other topics."""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        number: int = probe.getsockname()[1]
        return number


def start(*words: str, directory: Path, domain: int) -> subprocess.Popen[str]:
    environment = dict(
        os.environ,
        PYTHONPATH=str(ROOT),
        ROS_DOMAIN_ID=str(domain),
        ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
        XDG_RUNTIME_DIR=str(directory),
    )
    command = [sys.executable, "-c", "from tripod_bringup.cli import main; main()", "up", *words]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, cwd=directory
    )


class Session:
    """A demo that was played: its exit code, what it printed, its recording."""

    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err
        match = re.search(r"^recording (\S.*)$", out, re.MULTILINE)
        self.recording = Path(match[1].strip()) if match else Path("none")

    @property
    def token(self) -> str:
        """End of the address of the page; fail if there is none."""
        match = re.search(r"^page http://127\.0\.0\.1:\d+/([\w-]{22})$", self.out, re.MULTILINE)
        assert match, self.out
        return match[1]

    def summary(self, *what: str) -> str:
        """Return the cell of the closing table whose row names `what`."""
        table = [line for line in self.out.splitlines() if re.search(r"\S  +\S", line)]
        return re.split(r"  +", line_naming("\n".join(table), *what).strip(), maxsplit=1)[1]

    def heard(self, topic: str) -> list[tuple[int, Any]]:
        """Return time stamp [ns] and message of all that was recorded of a topic."""
        with AnyReader([self.recording.parent]) as reader:
            wanted = [c for c in reader.connections if c.topic == f"/{topic}"]
            found = [(t, reader.deserialize(raw, c.msgtype)) for c, t, raw in reader.messages(wanted)]
        assert found, topic
        return found


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    directory = tmp_path_factory.mktemp("chain")
    words = ("--demo", "--duration", str(TRACK), "--record", "bags", "--view-port", str(free_port()))
    words += tuple(word for change in LIGHT for word in ("--set", change))
    with own_domain() as domain:
        process = start(*words, directory=directory, domain=domain)
        try:
            out, err = process.communicate(timeout=5 * DEADLINE)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGTERM)
            out, err = process.communicate(timeout=DEADLINE)
            pytest.fail(f"the demo did not end:\n{out}\n{err}")
    played = Session(process.returncode, out, err)
    played.recording = directory / played.recording
    return played


def figure(text: str) -> float:
    return float(re.match(r"[-+.\de]+", text)[0])  # type: ignore[index]


def off_the_path(points: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Return the distances [m] of `points`, shape (n, 3), from the polyline through `path`, shape (m, 3)."""
    begin, along = path[:-1], np.diff(path, axis=0)
    squares = np.maximum((along**2).sum(axis=1), 1e-18)
    share = np.einsum("nmi,mi->nm", points[:, None] - begin, along) / squares
    nearest = begin + np.clip(share, 0.0, 1.0)[:, :, None] * along
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)


@pytest.mark.ros
def test_the_demo_ends_well_and_tells_every_figure(session: Session) -> None:
    assert session.code == 0, f"{session.out}\n{session.err}"
    assert NOT_MEASURED not in session.out
    factors = [status.real_time_factor for _, status in session.heard(names.SIM_STATUS)]
    factor = figure(session.summary("real-time factor"))
    assert min(factors) - 0.01 < factor < min(max(factors) + 0.01, 1.2)
    assert 0 < figure(session.summary("step time, median")) <= figure(session.summary("step time, p99"))
    error = session.summary("effector", "target", "rms")
    assert messages.names(error, "MORE THAN USUAL") == (figure(error) >= 0.5)
    assert "the installation works" in session.out
    assert max(status.packets_sent for _, status in session.heard(names.ROBOT_STATUS)) > 0
    assert figure(session.summary("packets sent")) > 0
    assert figure(session.summary("body states")) > 0
    assert session.token


@pytest.mark.ros
def test_the_token_of_the_page_is_printed_once(session: Session) -> None:
    """What runs for days as a service would have it in its log every few seconds."""
    assert (session.out + session.err).count(session.token) == 1


@pytest.mark.ros
def test_the_recording_holds_every_topic_in_order(session: Session) -> None:
    counts: dict[str, int] = defaultdict(int)
    stamps: dict[str, list[int]] = defaultdict(list)
    modes: list[int] = []
    robot = None
    with AnyReader([session.recording.parent]) as reader:
        present = {connection.topic for connection in reader.connections}
        for connection, _, raw in reader.messages():
            counts[connection.topic] += 1
            message = reader.deserialize(raw, connection.msgtype)
            if connection.topic == f"/{names.CONTROL_MODE}" and message.mode != NONE:  # type: ignore[attr-defined]
                modes.append(message.mode)  # type: ignore[attr-defined]
            if connection.topic == f"/{names.ROBOT_STATUS}":
                robot = message
            if hasattr(message, "header") and connection.topic != names.DIAGNOSTICS:
                stamp = message.header.stamp
                stamps[connection.topic].append(stamp.sec * 10**9 + stamp.nanosec)
    assert present >= TOPICS
    assert not present & {f"/{names.MARKERS}", f"/{names.POINT_CLOUD}"}
    assert_names(session.summary("recording", "messages"), f"{sum(counts.values())} messages")
    for topic, rate in ((names.TARGET_POSE, 25), (names.BODY_STATE, 10), (names.SIM_STATUS, 5)):
        # the usual time between two: a machine that holds all up for a while leaves out many, and does not change it
        assert np.median(np.diff(stamps[f"/{topic}"])) < 1e9 / rate, topic
    for topic, values in stamps.items():
        if topic != f"/{names.JOINT_TRAJECTORY}":  # whose stamp 0 means "now"
            assert values == sorted(values), f"{topic}: a stamp goes back in time"
            assert values[0] > 0, topic
    assert [m for i, m in enumerate(modes) if i == 0 or m != modes[i - 1]] == [
        Mode.TELEOP,
        Mode.IK,
        Mode.STOP,
    ]
    parked = 5
    assert robot.state == parked  # type: ignore[attr-defined]
    assert not robot.sent.any(), "the recording ends after the servos are parked"  # type: ignore[attr-defined]


@pytest.mark.ros
def test_the_file_itself_is_in_the_order_of_time(session: Session) -> None:
    """Record by record, as rosbags would sort what it reads."""
    with session.recording.open("rb") as file:
        stamps = [m.log_time for _, _, m in NonSeekingReader(file).iter_messages(log_time_order=False)]
    assert len(stamps) > 100
    assert stamps == sorted(stamps)


@pytest.mark.ros
def test_the_token_of_the_page_is_in_no_message(session: Session) -> None:
    """Logs and diagnostics are topics too: others may read them, and recordings are given away."""
    token = session.token.encode()
    with session.recording.open("rb") as file:
        said = [m.data for _, _, m in NonSeekingReader(file).iter_messages(log_time_order=False)]
    assert any(b"page http://127.0.0.1:" in data for data in said)
    assert not any(token in data for data in said)


@pytest.mark.ros
def test_the_recorded_effector_follows_the_path_of_the_recorded_targets(session: Session) -> None:
    """How late it is, and how much of each bend it cuts, depends on the machine; the demo tells the former.

    With simulated time tests/ik/test_ik_tripod.py holds such a circle to tenths of a millimetre.
    """

    def places(topic: str) -> tuple[np.ndarray, np.ndarray]:
        """Return stamps [s] and positions [m]."""
        found = [message for _, message in session.heard(topic)]
        stamps = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in found]
        points = [[m.pose.position.x, m.pose.position.y, m.pose.position.z] for m in found]
        return np.array(stamps), np.array(points)

    (sent, path), (seen, points) = places(names.TARGET_POSE), places(names.EFFECTOR_POSE)
    points = points[(seen > sent[0] + 1.0) & (seen < sent[-1])]
    assert len(points) > TRACK, "more than one a second, however late"
    radius = DemoTarget((0.0, 0.0, 0.0)).radius
    assert np.sqrt(np.mean(off_the_path(points, path) ** 2)) < radius / 5
    for way in (path, points):
        assert np.ptp(way, axis=0).max() > radius, "they did draw a circle"


@pytest.mark.ros
def test_ctrl_c_during_start_ends_in_order_and_leaves_no_process(tmp_path: Path, domain: int) -> None:
    process = start("--no-view", directory=tmp_path, domain=domain)
    try:
        assert wait_until(lambda: children(process.pid))
        left = children(process.pid)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=DEADLINE)
    finally:
        if process.poll() is None:
            process.kill()
    assert process.returncode == 0, f"{out}\n{err}"
    line_naming(out, "stopped", "Ctrl-C")
    assert "Traceback" not in out + err
    assert not any(Path(f"/proc/{pid}").exists() for pid in left)


def children(pid: int) -> list[int]:
    """Return the processes that `pid` started."""
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(word) for word in text.split()]


@pytest.mark.slow
@pytest.mark.ros
def test_two_robots_share_a_domain_in_two_namespaces(tmp_path: Path, domain: int) -> None:
    """Each hears its own nodes only; one more in a namespace that is taken is refused."""
    import rclpy

    words = ("--no-view", "--scene", "silicone", "--namespace")
    robots = [start(*words, name, directory=tmp_path, domain=domain) for name in ("left", "right")]
    wanted = {
        f"/{robot}/{node}" for robot in ("left", "right") for node in ("bringup", "sim", "ik", "driver")
    }
    context = rclpy.Context()
    context.init(domain_id=domain)
    asking = rclpy.create_node("asking", context=context)
    try:

        def all_there() -> bool:
            assert all(robot.poll() is None for robot in robots)
            return set(asking.get_fully_qualified_node_names()) == wanted | {"/asking"}

        assert wait_until(all_there), asking.get_fully_qualified_node_names()
        third = start(*words, "/left", directory=tmp_path, domain=domain)
        _, said = third.communicate(timeout=DEADLINE)
        assert third.returncode == 3
        assert_names(said, f"process {robots[0].pid}", f"domain {domain}", "namespace /left")
        topics = {name for name, _ in asking.get_topic_names_and_types()}
        assert {f"/{robot}/{names.CONTROL_MODE}" for robot in ("left", "right")} <= topics
        assert not [t for t in topics if t.lstrip("/") in vars(names).values() and t != names.DIAGNOSTICS]
    finally:
        asking.destroy_node()
        context.try_shutdown()
        ended = []
        for robot in robots:
            robot.send_signal(signal.SIGINT)
        for robot in robots:
            out, err = robot.communicate(timeout=DEADLINE)
            ended.append((robot.returncode, out + err))
    assert [code for code, _ in ended] == [0, 0], ended
