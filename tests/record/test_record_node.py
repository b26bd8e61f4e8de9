"""The record node from outside: what is published is in the file, however the node ends."""

import array
import errno
import itertools
import json
import os
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader as RosbagsReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.messages import assert_names, line_naming, lines_naming, names
from tests.record.bags import read_with_rosbags, string_of
from tripod_record.info import read_info

rclpy = pytest.importorskip("rclpy")
tripod_msgs = pytest.importorskip("tripod_msgs.msg")
pytestmark = pytest.mark.ros

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: E402
from shape_msgs.msg import Mesh, MeshTriangle  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402

from tests.services import call  # noqa: E402
from tripod_graph.qos import LATCHED, RELIABLE, SENSOR  # noqa: E402
from tripod_record import node as record_node  # noqa: E402

ROOT = Path(__file__).parents[2]
DEADLINE = 60.0  # [s], discovery alone may take three
ALL_KEPT = QoSProfile(depth=1000, reliability=RELIABLE.reliability)
"""For what is published faster than a recorder that the machine holds up may take it."""


class Graph:
    """A node in a domain of its own that publishes, and recorders beside it."""

    def __init__(self, domain: int) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.node = Node("probe", context=self.context)
        self.executor.add_node(self.node)
        self.processes: list[subprocess.Popen[str]] = []
        self.local: list[Node] = []
        self.health: dict[str, DiagnosticStatus] = {}
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, RELIABLE)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.health.update({status.name: status for status in message.status})

    def health_of(self, name: str) -> DiagnosticStatus:
        return self.health.get(name, DiagnosticStatus())

    def leave(self) -> None:
        """Leave the graph; before a process in it is killed: see `tests/domains.py`."""
        self.executor.shutdown()
        for node in (*self.local, self.node):
            node.destroy_node()
        rclpy.try_shutdown(context=self.context)

    def close(self) -> None:
        self.leave()
        for process in self.processes:
            process.kill()
            process.wait()

    def until(self, done: Callable[[], Any], what: str) -> Any:
        end = time.monotonic() + DEADLINE
        while time.monotonic() < end:
            if result := done():
                return result
            self.executor.spin_once(timeout_sec=0.02)
        raise AssertionError(f"{what} did not happen within {DEADLINE} s")

    def publisher(self, kind: type, topic: str, qos: QoSProfile = RELIABLE) -> Any:
        return self.node.create_publisher(kind, topic, qos)

    def heard(self, *publishers: Any) -> None:
        self.until(lambda: all(p.get_subscription_count() > 0 for p in publishers), "a subscription")

    def record(self, *arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-m", "tripod_record.node", *arguments],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.processes.append(process)
        return process

    def call(self, service: str) -> Trigger.Response:
        return call(self.node, Trigger, service, Trigger.Request(), server="record", wait=self.until)

    def in_process(self, tmp_path: Path, **parameters: Any) -> "record_node.RecordNode":
        """A recorder in this process, so that a test can reach into it."""
        values = {"directory": str(tmp_path), "name": "bag", "sync_period": 0.05, **parameters}
        overrides = [rclpy.parameter.Parameter(k, value=v) for k, v in values.items()]

        class Local(record_node.RecordNode):
            def __init__(self, graph: Graph) -> None:
                self._graph = graph
                super().__init__()

        original = Node.__init__
        try:
            Node.__init__ = lambda s, name: original(  # type: ignore[method-assign,assignment]
                s, name, context=self.context, parameter_overrides=overrides
            )
            recorder = Local(self)
        finally:
            Node.__init__ = original  # type: ignore[method-assign]
        self.executor.add_node(recorder)
        self.local.append(recorder)
        return recorder


@pytest.fixture
def graph(domain: int) -> Iterator[Graph]:
    made = Graph(domain)
    yield made
    made.close()


def line_of(process: subprocess.Popen[str], begin: str) -> str:
    """Return the rest of the next line on stdout, which must begin with `begin`."""
    assert process.stdout is not None
    ready, _, _ = select.select([process.stdout], [], [], DEADLINE)
    assert ready, f"no line on stdout within {DEADLINE} s"
    line = process.stdout.readline()
    assert line.startswith(begin + " "), line + (process.stderr.read() if not line and process.stderr else "")
    return line.removeprefix(begin).strip()


def finish(process: subprocess.Popen[str], number: signal.Signals | None) -> tuple[int, str, str]:
    if number is not None:
        process.send_signal(number)
    out, errors = process.communicate(timeout=DEADLINE)
    return process.returncode, out, errors


def recorded(path: Path, topic: str) -> int:
    """Return how many messages of a topic are in a file by now."""
    return sum(t.count for t in read_info(path).topics if t.name == topic)


def body_state(step: int) -> Any:
    message = tripod_msgs.BodyState(topology_id=7, step=step, time=0.01 * step)
    message.header.frame_id = "world"
    message.positions = array.array("d", [0.001 * step * i for i in range(1500)])
    return message


# what is published is in the file --------------------------------------------------------------------------


def test_counts_and_contents_equal_what_was_published(graph: Graph, tmp_path: Path) -> None:
    mesh = graph.publisher(Mesh, "sim/mesh", LATCHED)
    mesh.publish(Mesh(triangles=[MeshTriangle(vertex_indices=[0, 1, 2])]))  # before there is a recorder
    process = graph.record(f"directory:={tmp_path}", "name:=run", "sync_period:=0.05")
    path = Path(line_of(process, "recording"))
    assert path == tmp_path / "run" / "run_0.mcap"
    body = graph.publisher(tripod_msgs.BodyState, "sim/body_state", SENSOR)
    commands = graph.publisher(JointTrajectory, "joint_trajectory")
    modes = graph.publisher(tripod_msgs.ControlMode, "control_mode", LATCHED)
    statuses = [
        graph.publisher(getattr(tripod_msgs, kind), topic)
        for kind, topic in (
            ("SimStatus", "sim/status"),
            ("IkStatus", "ik/status"),
            ("RobotStatus", "robot/status"),
            ("Compliance", "sim/compliance"),
        )
    ]
    graph.heard(mesh, body, commands, modes, *statuses)
    for i in range(200):
        body.publish(body_state(i))
        if i % 2 == 0:
            commands.publish(JointTrajectory(joint_names=["servo_0", "servo_1", "servo_2"]))
        if i % 10 == 0:
            for publisher in statuses:
                publisher.publish(publisher.msg_type())
            # the middleware drops what nobody takes for long, as on a busy machine
            graph.until(lambda n=i: recorded(path, "/sim/body_state") == n + 1, "recording so far")
        graph.executor.spin_once(timeout_sec=0.002)
    modes.publish(tripod_msgs.ControlMode(mode=2, source="test"))
    late = graph.publisher(String, "late/comer")
    graph.heard(late)
    for i in range(5):
        late.publish(String(data=f"late {i}"))
    wanted = {
        "/sim/mesh": 1,
        "/sim/body_state": 200,
        "/joint_trajectory": 100,
        "/control_mode": 1,
        "/sim/status": 20,
        "/ik/status": 20,
        "/robot/status": 20,
        "/sim/compliance": 20,
        "/late/comer": 5,
    }
    graph.until(lambda: "/record" in graph.health, "diagnostics")
    graph.until(
        lambda: sum(t.count for t in read_info(path).topics) >= sum(wanted.values()), "recording it all"
    )
    code, out, errors = finish(process, signal.SIGTERM)
    assert (code, errors) == (0, "")

    messages = read_with_rosbags(path.parent)
    diagnostics = messages.pop("/diagnostics")
    counts = {topic: len(found) for topic, found in messages.items()}
    assert counts == wanted
    total = sum(wanted.values()) + len(diagnostics)
    assert_names(out, "recorded", path, f"{total} messages", "0 lost")
    assert out.count("\n") == 1
    with RosbagsReader(path.parent) as reader:
        assert reader.message_count == total
        stamps = [stamp for _, stamp, _ in reader.messages()]
        assert len(stamps) == total
        assert stamps == sorted(stamps)
        assert {c.topic: c.msgcount for c in reader.connections if c.topic != "/diagnostics"} == wanted
        store = get_typestore(Stores.EMPTY)
        for connection in reader.connections:
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        bodies = [
            store.deserialize_cdr(d, "tripod_msgs/msg/BodyState") for _, d in messages["/sim/body_state"]
        ]
        offered = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
        assert offered["/sim/body_state"].reliability.name == "BEST_EFFORT"
        assert offered["/sim/mesh"].durability.name == "TRANSIENT_LOCAL"
        assert all(re.fullmatch(r"RIHS01_[0-9a-f]{64}", c.digest) for c in reader.connections)
    assert [b.step for b in bodies] == list(range(200))
    assert bodies[150].positions[1000] == 150.0
    assert bodies[0].header.frame_id == "world"
    info = read_info(path.parent, check=True)
    assert (info.truncated, info.damage) == ("", ())
    assert not {"/rosout", "/parameter_events"} & {t.name for t in info.topics}


def test_kill_9_leaves_all_that_was_synced(graph: Graph, tmp_path: Path) -> None:
    """That is all but what came within the last `sync_period`, and the time that the disk takes."""
    process = graph.record(f"directory:={tmp_path}", "topics:=count")
    path = Path(line_of(process, "recording"))
    publisher = graph.publisher(String, "count", ALL_KEPT)
    graph.heard(publisher)
    sent = itertools.count()

    def publish() -> int:
        publisher.publish(String(data=str(next(sent))))
        return recorded(path, "/count")

    first = graph.until(publish, "a sync")
    graph.until(lambda: publish() > first, "the next sync")
    synced = publish()
    graph.leave()
    assert finish(process, signal.SIGKILL)[0] == -signal.SIGKILL
    found = read_with_rosbags(path.parent)["/count"]  # a strict reader, no repair
    assert synced <= len(found) <= next(sent)
    assert [int(string_of(data)) for _, data in found] == list(range(len(found)))
    assert_names(read_info(path.parent).truncated, "not closed", "killed")


def test_a_restricted_recorder_in_a_namespace(graph: Graph, tmp_path: Path) -> None:
    process = graph.record(f"directory:={tmp_path}", "topics:=sim/* /elsewhere", "__ns:=/one")
    path = Path(line_of(process, "recording"))
    publishers = [
        graph.publisher(String, name) for name in ("/one/sim/a", "/elsewhere", "/one/ik/b", "/sim/a")
    ]
    graph.heard(*publishers[:2])
    for publisher in publishers:
        publisher.publish(String(data=publisher.topic_name))
    graph.until(lambda: read_info(path).messages == 2, "recording")
    assert finish(process, signal.SIGINT)[0] == 0
    assert {t.name: t.count for t in read_info(path).topics} == {"/one/sim/a": 1, "/elsewhere": 1}


# services --------------------------------------------------------------------------------------------------


def test_what_is_asked_for_and_not_there_is_told_until_it_is(graph: Graph, tmp_path: Path) -> None:
    chatter = graph.publisher(String, "/chatter")
    process = graph.record(f"directory:={tmp_path}", "name:=bag", "topics:=chatter, sim/misspelled, ike/*")
    graph.heard(chatter)

    def without(*topics: str) -> bool:
        return names(graph.health_of("/record").message, "recording without", *topics)

    graph.until(lambda: without("/ike/*", "/sim/misspelled"), "the health")
    graph.publisher(String, "/ike/status")
    graph.until(lambda: without("/sim/misspelled") and not without("/ike/*"), "what is there by now")
    assert process.stderr
    graph.until(lambda: select.select([process.stderr], [], [], 0)[0], "a warning")
    assert_names(process.stderr.readline(), "nothing is published", "/sim/misspelled", "ros2 topic list")
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=DEADLINE)
    assert process.returncode == 0
    line_naming(out, "recorded", "0 messages", "0 lost", "nobody", "/sim/misspelled")


@pytest.mark.parametrize(("reliable", "reason"), [(True, "publisher"), (False, "best effort")])
def test_the_topic_of_lost_messages_is_named_with_the_reason(
    graph: Graph, tmp_path: Path, reliable: bool, reason: str
) -> None:
    reliability = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
    chatter = graph.publisher(String, "/chatter", QoSProfile(depth=10, reliability=reliability))
    process = graph.record(f"directory:={tmp_path}", "name:=bag", "topics:=/chatter")
    path = Path(line_of(process, "recording"))
    graph.heard(chatter)

    def came() -> bool:
        chatter.publish(String(data="one"))
        return recorded(path, "/chatter") > 0

    graph.until(came, "the first message")
    process.send_signal(signal.SIGSTOP)
    for _ in range(3000):
        chatter.publish(String(data="x" * 1000))
    process.send_signal(signal.SIGCONT)

    def warned() -> bool:
        chatter.publish(String(data="one"))
        return "messages lost" in graph.health_of("/record").message

    graph.until(warned, "the loss")
    _, out, errors = finish(process, signal.SIGINT)
    for line in (line_naming(out, "recorded", path, "lost"), line_naming(errors, "record", "lost")):
        assert_names(line, "/chatter", reason)


def test_a_recording_is_split_by_service_and_carries_scene_and_versions(graph: Graph, tmp_path: Path) -> None:
    process = graph.record(f"directory:={tmp_path}", "name:=run", "topics:=count sim/scene")
    path = Path(line_of(process, "recording"))
    scene, publisher = (
        graph.publisher(String, "sim/scene", LATCHED),
        graph.publisher(String, "count", ALL_KEPT),
    )
    scene.publish(String(data="name = 'tripod'"))
    graph.heard(publisher, scene)
    publisher.publish(String(data="one"))
    graph.until(lambda: read_info(path).messages == 2, "recording")
    answer = graph.call("record/split")
    second = path.with_name("run_1.mcap")
    assert answer.success
    assert_names(answer.message, "recording", second)
    publisher.publish(String(data="two"))
    graph.until(lambda: read_info(second).messages == 1, "recording")
    assert graph.call("record/stop").success
    assert not graph.call("record/split").success
    assert finish(process, signal.SIGINT)[0] == 0
    for file in (path, second):
        with file.open("rb") as stream:
            attached = {a.name: a.data.decode() for a in make_reader(stream).iter_attachments()}
        assert attached["sim/scene.toml"] == "name = 'tripod'"
        assert json.loads(attached["versions.json"])["numpy"]
    texts = [string_of(data) for _, data in read_with_rosbags(path.parent)["/count"]]
    assert texts == ["one", "two"]


def test_recordings_are_started_and_stopped_by_service(graph: Graph, tmp_path: Path) -> None:
    process = graph.record(f"directory:={tmp_path}", "autostart:=false", "name:=run", "topics:=chatter")
    publisher = graph.publisher(String, "chatter")
    for number, name in enumerate(("run", "run_2"), start=1):
        answer = graph.call("record/start")
        path = tmp_path / name / f"{name}_0.mcap"
        assert answer.success
        assert_names(answer.message, "recording", path)
        assert line_of(process, "recording") == str(path)
        again = graph.call("record/start")
        assert not again.success
        assert_names(again.message, "already recording", path)
        graph.heard(publisher)
        for i in range(number):
            publisher.publish(String(data=str(i)))
        graph.until(lambda p=path, n=number: read_info(p).messages == n, "recording")
        graph.until(lambda: graph.health_of("/record").message == "recording", "diagnostics")
        answer = graph.call("record/stop")
        ended = (path, f"{number} messages", "0 lost")
        assert answer.success
        assert_names(answer.message, "recorded", *ended)
        assert_names(line_of(process, "recorded"), *ended)
        graph.until(lambda: publisher.get_subscription_count() == 0, "the end of listening")
        assert len(read_with_rosbags(path)["/chatter"]) == number
    answer = graph.call("record/stop")
    assert not answer.success
    assert_names(answer.message, "not recording")
    assert finish(process, signal.SIGTERM) == (0, "", "")


# refusals --------------------------------------------------------------------------------------------------


def test_a_place_that_will_not_do_is_refused_at_the_start(graph: Graph, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    refusals = [
        (
            [f"directory:={tmp_path}/file"],
            (f"{tmp_path}/file", "file exists", "another directory", "writable"),
        ),
        (["directory:=/proc/1/none"], ("/proc/1/none", "no such file", "another directory", "writable")),
        ([f"directory:={tmp_path}", "name:=a/b"], ("recording name", "'a/b'", "letters")),
        ([f"directory:={tmp_path}", f"min_free:={10**17}"], (tmp_path, "100000000000.0 MB")),
        (["compression:=rar"], ("'compression'", "'rar'", "none, lz4, zstd")),
        (["sync_period:=2.0"], ("'sync_period'", "2.0", "0.05 to 0.5 s")),
    ]
    refused = [(graph.record(*arguments), named) for arguments, named in refusals]  # all at once
    for process, named in refused:
        code, out, errors = finish(process, None)
        assert (code, out) == (2, "")
        assert errors.startswith("record: ")
        assert_names(errors, *named)
        assert errors.count("\n") == 1


def test_a_service_call_that_cannot_be_met_says_why_and_the_node_lives_on(
    graph: Graph, tmp_path: Path
) -> None:
    target = tmp_path / "place"
    target.touch()
    process = graph.record(f"directory:={target}", "autostart:=false")
    answer = graph.call("record/start")
    assert not answer.success
    assert_names(answer.message, target, "file exists", "another directory")
    target.unlink()
    assert graph.call("record/start").success
    assert finish(process, signal.SIGTERM)[0] == 0


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 600 kB."""
    place = tmp_path / "disk"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=600k", "tmpfs", str(place)]
    if os.geteuid() != 0 or subprocess.run(command, check=False, capture_output=True).returncode != 0:
        pytest.skip("needs the right to mount; test_writer fills a disk by a limit of file size instead")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk_is_told_at_once_and_the_recording_goes_on_when_there_is_room(
    graph: Graph, small_disk: Path
) -> None:
    ballast = small_disk / "ballast"
    ballast.write_bytes(bytes(300_000))
    arguments = (f"directory:={small_disk}", "min_free:=0", "compression:=none", "topics:=sim/body_state")
    process = graph.record(*arguments, "sync_period:=0.1")
    path = Path(line_of(process, "recording"))
    body = graph.publisher(tripod_msgs.BodyState, "sim/body_state", ALL_KEPT)
    graph.heard(body)
    steps = itertools.count()

    full = os.strerror(errno.ENOSPC)

    def told(level: bytes, reason: str, *, publish: bool = True) -> Callable[[], bool]:
        def check() -> bool:
            if publish:
                body.publish(body_state(next(steps)))
            status = graph.health_of("/record")
            return status.level == level and reason in status.message

        return check

    graph.until(told(b"\2", full), "a full disk")
    assert_names(graph.health_of("/record").message, path, "memory")
    ballast.unlink()
    graph.until(told(b"\0", "recording", publish=False), "the recovery")
    sent = next(steps)
    graph.until(lambda: recorded(path, "/sim/body_state") == sent, "all that came")
    for k in range(sent + 1, sent + 60):  # beyond what the disk has room for
        body.publish(body_state(k))
    graph.until(told(b"\2", full, publish=False), "a full disk again")
    code, out, errors = finish(process, signal.SIGTERM)
    kept = [data for _, data in read_with_rosbags(path)["/sim/body_state"]]
    assert (code, out) == (1, "")
    assert lines_naming(errors, "recording: ", path, "memory")
    assert lines_naming(errors, "recording continues")
    assert "Traceback" not in errors
    last = errors.splitlines()[-1]
    offered = int(re.search(rf"\b{len(kept)} of (\d+) messages", last)[1])  # type: ignore[index]
    assert sent <= len(kept) < offered <= sent + 59
    text = yaml.safe_load((path.parent / "metadata.yaml").read_text())
    assert text["rosbag2_bagfile_information"]["message_count"] <= len(kept)


@pytest.mark.parametrize("harm", ["unlink", "cut"])
def test_a_file_that_another_program_harms_is_told_at_once_and_in_the_exit_code(
    graph: Graph, tmp_path: Path, harm: str
) -> None:
    process = graph.record(f"directory:={tmp_path}", "name:=run", "topics:=count")
    path = Path(line_of(process, "recording"))
    publisher = graph.publisher(String, "count", ALL_KEPT)
    graph.heard(publisher)
    for i in range(20):
        publisher.publish(String(data=str(i)))
    graph.until(lambda: recorded(path, "/count") == 20, "recording")
    if harm == "cut":
        os.truncate(path, 0)
    else:
        path.unlink()
    new = tmp_path / "run_2" / "run_2_0.mcap"
    graph.until(lambda: str(new) in graph.health_of("/record").message, "noticing")
    reason = (path, "another program", "cut" if harm == "cut" else "deleted or moved")
    assert graph.health["/record"].level == b"\1"
    assert_names(graph.health["/record"].message, *reason)
    assert line_of(process, "recording") == str(new)
    publisher.publish(String(data="20"))
    graph.until(lambda: recorded(new, "/count") > 0, "going on")
    graph.until(lambda: string_of(read_with_rosbags(new)["/count"][-1][1]) == "20", "going on")
    code, out, errors = finish(process, signal.SIGTERM)
    kept = [int(string_of(data)) for _, data in read_with_rosbags(new)["/count"]]
    assert kept == ([20] if harm == "cut" else list(range(21)))
    line_naming(out, "recorded", new, f"{len(kept)} messages", f"{21 - len(kept)} lost", *reason)
    assert code == 1
    assert lines_naming(errors, *reason)


def test_topics_that_follow_from_others_are_listened_to_only_on_request(graph: Graph, tmp_path: Path) -> None:
    own = ("sim/markers", "sim/point_cloud", "sim/field/von_mises", "sim/forces", "sim/status")
    publishers = [graph.publisher(String, name) for name in own]

    def heard() -> list[int]:
        return [p.get_subscription_count() for p in publishers]

    recorder = graph.in_process(tmp_path)
    graph.heard(publishers[-1])
    graph.until(lambda: recorder._look() or "/sim/status" in recorder._listeners, "a look at all topics")
    assert not {f"/{name}" for name in own[:-1]} & set(recorder._listeners)
    assert heard() == [0, 0, 0, 0, 1]
    recorder.close()
    for values, expected in (
        ({"derived": True}, [1, 1, 1, 1, 1]),
        ({"topics": "sim/*"}, [0, 0, 0, 0, 1]),
        ({"topics": "sim/markers sim/status"}, [1, 0, 0, 0, 1]),
    ):
        graph.until(lambda: heard() == [0, 0, 0, 0, 0], "the end of listening")
        recorder = graph.in_process(tmp_path, **values)
        graph.until(lambda e=expected: heard() == e, f"listening to {expected}")
        recorder.close()


# publishers that change ------------------------------------------------------------------------------------


def test_a_publisher_that_offers_less_is_recorded_too(graph: Graph, tmp_path: Path) -> None:
    recorder = graph.in_process(tmp_path)
    reliable = graph.publisher(String, "chatter", RELIABLE)
    graph.heard(reliable)
    reliable.publish(String(data="reliable"))
    graph.until(lambda: recorder._recorder.progress.messages >= 1, "recording")
    sensor = graph.publisher(String, "chatter", SENSOR)
    graph.heard(sensor)
    sensor.publish(String(data="best effort"))
    path = recorder._recorder.progress.path
    graph.until(lambda: len(read_with_rosbags(path).get("/chatter", [])) == 2, "both")
    recorder.close()
    assert [string_of(d) for _, d in read_with_rosbags(path)["/chatter"]] == ["reliable", "best effort"]


def test_a_type_that_is_not_installed_is_reported_and_the_rest_recorded(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusal = record_node.RecordError("type of the test")

    def text(name: str) -> str:
        if name == "std_msgs/msg/String":
            raise refusal
        return "float64[] data\n"

    monkeypatch.setattr(record_node, "definition_text", text)
    recorder = graph.in_process(tmp_path, topics="strange known")
    graph.publisher(String, "strange")
    known = graph.publisher(tripod_msgs.ControlMode, "known")
    graph.heard(known)
    known.publish(tripod_msgs.ControlMode())
    path = recorder._recorder.progress.path
    graph.until(lambda: read_info(path).messages == 1, "recording")
    graph.until(lambda: "/strange" in graph.health_of("/record").message, "a warning")
    health = graph.health["/record"]
    assert health.level == b"\1"
    assert_names(health.message, "recording without", "/strange")
    values = {v.key: v.value for v in health.values}
    assert values["refused /strange"] == str(refusal)
    recorder.close()
    assert {t.name for t in read_info(path).topics} == {"/known"}
