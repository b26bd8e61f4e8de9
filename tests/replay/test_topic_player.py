"""Recorded topics in a graph: at their pace, latched ones at any start, nothing that could move a robot unasked."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.serialization import serialize_message
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from tests.messages import assert_names, raises_naming
from tripod_graph.qos import LATCHED, RELIABLE
from tripod_record.bag import Bag, decoded, store_of
from tripod_record.definitions import definition_text
from tripod_record.errors import RecordError
from tripod_record.play_node import COMMANDING, TopicPlayer, conversion
from tripod_record.selection import is_selected
from tripod_record.topic import Qos, Topic
from tripod_record.writer import BagWriter

pytestmark = pytest.mark.ros

DEADLINE = 60.0
START = 1_700_000_000_000_000_000  # [ns]
TEXT = definition_text("std_msgs/msg/String")


def write_bag(directory: Path, *, count: int = 10, period: float = 0.1, request: str = "") -> Path:
    """Write /said, /kept (latched: two messages at the beginning), a command, and a request if there is one."""
    writer = BagWriter(directory)
    writer.add_topic(Topic("/said", "std_msgs/msg/String", TEXT, (Qos(),)))
    writer.add_topic(
        Topic("/kept", "std_msgs/msg/String", TEXT, (Qos(durability="transient_local", depth=1),))
    )
    command = "trajectory_msgs/msg/JointTrajectory"
    writer.add_topic(Topic("/joint_trajectory", command, definition_text(command), (Qos(),)))
    if request:
        writer.add_topic(Topic("/sim/request", "std_msgs/msg/String", TEXT, (Qos(),)))
        writer.write("/sim/request", serialize_message(String(data=request)), START)
    for text in ("old", "kept"):
        writer.write("/kept", serialize_message(String(data=text)), START)
    for i in range(count):
        stamp = START + round(1e9 * period * i)
        writer.write("/said", serialize_message(String(data=str(i))), stamp)
        writer.write("/joint_trajectory", serialize_message(JointTrajectory()), stamp)
    writer.close()
    return directory


def unasked(topic: str) -> bool:
    """What is played where nobody names topics."""
    return is_selected(topic, "/", ("/*",), tuple(f"*/{name}" for name in COMMANDING))


class Graph:
    def __init__(self) -> None:
        self.ear = Node("ear")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.ear)
        self.heard: dict[str, list[Any]] = {"/said": [], "/kept": [], "/joint_trajectory": []}
        for topic, kind in (("/said", String), ("/joint_trajectory", JointTrajectory)):
            self.ear.create_subscription(kind, topic, self.heard[topic].append, RELIABLE)
        self.player: TopicPlayer | None = None

    def play(self, path: Path, **options: Any) -> TopicPlayer:
        options = {"start": 0.0, "rate": 1.0, **options}
        self.player = TopicPlayer(Bag(path), options.pop("wanted", unasked), **options)
        self.executor.add_node(self.player)
        return self.player

    def until(self, condition: Callable[[], Any]) -> None:
        end = time.monotonic() + DEADLINE
        while not condition():
            assert time.monotonic() < end, self.heard
            self.executor.spin_once(timeout_sec=0.01)

    def said(self) -> list[int]:
        return [int(m.data) for m in self.heard["/said"]]

    def close(self) -> None:
        if self.player:
            self.player.close()
        self.executor.shutdown()
        self.ear.destroy_node()


@pytest.fixture
def graph(domain: int) -> Iterator[Graph]:
    rclpy.init(args=[], domain_id=domain)
    graph = Graph()
    yield graph
    graph.close()
    rclpy.try_shutdown()


def test_what_was_recorded_is_heard_in_its_order_but_no_command(graph: Graph, tmp_path: Path) -> None:
    player = graph.play(write_bag(tmp_path / "bag"))
    graph.until(lambda: player.done)
    assert_names(player.done, "12 messages")
    graph.until(lambda: 9 in graph.said())
    assert graph.said() == sorted(graph.said())
    assert not graph.heard["/joint_trajectory"]
    assert not player.count_publishers("/joint_trajectory")


def test_a_command_that_is_named_is_played(graph: Graph, tmp_path: Path) -> None:
    player = graph.play(write_bag(tmp_path / "bag"), wanted="/joint_trajectory".__eq__)
    graph.until(lambda: player.done and graph.heard["/joint_trajectory"])
    assert not graph.heard["/said"]


def test_what_was_latched_before_the_start_is_there_for_who_comes_late(graph: Graph, tmp_path: Path) -> None:
    player = graph.play(write_bag(tmp_path / "bag"), start=0.45)
    graph.until(lambda: player.done)
    assert_names(player.done, "6 messages")  # the newest latched one, and 5 to 9
    graph.ear.create_subscription(String, "/kept", graph.heard["/kept"].append, LATCHED)
    graph.until(lambda: graph.heard["/kept"])
    assert [m.data for m in graph.heard["/kept"]] == ["kept"]
    assert set(graph.said()) <= {5, 6, 7, 8, 9}


def test_paused_it_goes_on_one_message_a_step(graph: Graph, tmp_path: Path) -> None:
    player = graph.play(write_bag(tmp_path / "bag", period=1000.0), wanted="/said".__eq__)
    graph.until(player._played["/said"].get_subscription_count)
    player.toggle()
    assert player.paused
    graph.until(lambda: graph.said() == [0])
    for wanted in (1, 2, 3):
        player.step()
        graph.until(lambda wanted=wanted: graph.said() == list(range(wanted + 1)))
    assert player.place == pytest.approx(3000.0)
    assert not player.done


def test_what_another_node_publishes_is_not_mixed_with(graph: Graph, tmp_path: Path) -> None:
    graph.ear.create_publisher(String, "/said", RELIABLE)
    with raises_naming(RecordError, "/ear", "/said", "--topics"):
        graph.play(write_bag(tmp_path / "bag"))


def test_the_page_that_may_command_and_ask_is_no_other_publisher(graph: Graph, tmp_path: Path) -> None:
    for topic, kind in (("/sim/request", String), ("/joint_trajectory", JointTrajectory)):
        graph.ear.create_publisher(kind, topic, RELIABLE)
    player = graph.play(write_bag(tmp_path / "bag", request="reset"))
    graph.until(lambda: player.done)
    assert "/sim/request" not in player._played


def test_a_type_with_other_fields_is_told_and_left_out(graph: Graph, tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag")
    writer.add_topic(Topic("/said", "std_msgs/msg/String", "string data\nint32 more\n", (Qos(),)))
    writer.write("/said", serialize_message(String(data="1")), START)
    writer.close()
    with raises_naming(RecordError, tmp_path / "bag", "no topic", "installed"):
        graph.play(tmp_path / "bag")


def earlier(kind: str, later: str) -> str:
    """Return the definition of a type of ours without the fields that `later` is part of the names of."""
    return "".join(line for line in definition_text(kind).splitlines(keepends=True) if later not in line)


def test_a_recording_from_before_fields_were_added_is_played_with_their_default_values(
    graph: Graph, tmp_path: Path
) -> None:
    status = pytest.importorskip("tripod_msgs.msg").SimStatus
    kind = "tripod_msgs/msg/SimStatus"
    text = earlier(kind, "mesh_error").replace("float64 effector_error ", "# ")
    for added in ("string[] joint_names ", "string[] units ", "float64[] speed "):
        text = text.replace(added, "# ")
    assert definition_text(kind).count("float64 effector_") == text.count("float64 effector_") + 2
    store = store_of(kind, text)
    T = store.types
    header = T["std_msgs/msg/Header"](
        stamp=T["builtin_interfaces/msg/Time"](sec=1, nanosec=2), frame_id="world"
    )
    authority = decoded(
        store_of(kind, definition_text(kind)), serialize_message(status(upper=[1.0])), kind
    ).authority
    blank = status()
    fields = {name: getattr(blank, name) for name, _ in store.fielddefs[kind][1]}
    fields |= {
        "header": header, "authority": authority, "time_error": 3e-5, "residual": 7.0, "last_rejection": "none of them",
        "lower": np.array([-1.0]), "upper": np.array([0.5]),
    }  # fmt: skip
    writer = BagWriter(tmp_path / "bag")
    writer.add_topic(Topic("/sim/status", kind, text, (Qos(),)))
    writer.write("/sim/status", bytes(store.serialize_cdr(T[kind](**fields), kind)), START)
    writer.close()
    heard: list[Any] = []
    graph.ear.create_subscription(status, "/sim/status", heard.append, RELIABLE)
    graph.play(tmp_path / "bag")
    graph.until(lambda: heard)
    (found,) = heard
    assert (found.time_error, found.residual, found.last_rejection) == (3e-5, 7.0, "none of them")
    assert (found.header.stamp.sec, list(found.lower), list(found.upper)) == (1, [-1.0], [0.5])
    assert (found.effector_mesh_error, found.effector_error) == (-1.0, -1.0)
    assert (list(found.joint_names), list(found.units), list(found.speed)) == ([], [], [])


@pytest.mark.parametrize("missing", ["stability_margin_slope", "slide"])
def test_what_has_been_added_without_a_default_value_is_not_made_up(missing: str) -> None:
    pytest.importorskip("tripod_msgs.msg")
    kind = "tripod_msgs/msg/Compliance"

    def found(definition: str) -> Any:
        return conversion(kind, store_of(kind, definition))

    assert found(earlier(kind, "mesh_error"))
    assert found(earlier(kind, f"{missing} ")) is None
    assert found("float64 more\n" + definition_text(kind)) is None
    assert found(definition_text(kind).replace("float64 slide", "float32 slide")) is None
    assert found(earlier(kind, "mesh_error").replace("string frame_id", "string frame")) is None
