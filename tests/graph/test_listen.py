"""The topic control_mode: heard from who keeps its word and from who does not, and each word once."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("tripod_msgs", reason="the messages are not built: run `make setup`")

from rclpy.node import Node
from rclpy.qos import QoSProfile
from tripod_msgs.msg import ControlMode

from tests.graph.bench import Bench
from tripod_graph import names
from tripod_graph.control_mode import EARS, listen
from tripod_graph.mode import Decision, Mode
from tripod_graph.qos import LATCHED

pytestmark = pytest.mark.ros


class EarBench(Bench):
    """A node that speaks, and one that listens once `listen` is called."""

    def __init__(self, domain: int) -> None:
        super().__init__(domain)
        self.speaker, self.ear = (self.add(Node(name, context=self.context)) for name in ("speaker", "ear"))
        self.heard: list[Decision] = []

    def publisher(self, quality: QoSProfile | int) -> Any:
        return self.speaker.create_publisher(ControlMode, names.CONTROL_MODE, quality)

    def hear(self, condition: Callable[[], Any]) -> None:
        self.wait(condition, self.heard)


@pytest.fixture
def bench(domain: int) -> Iterator[EarBench]:
    one = EarBench(domain)
    yield one
    one.close()


def test_stop_is_heard_of_who_keeps_no_word(bench: EarBench) -> None:
    listen(bench.ear, bench.heard.append)
    plain = bench.publisher(10)  # as `ros2 topic pub` has it
    bench.hear(lambda: plain.get_subscription_count() == 1)
    plain.publish(ControlMode(mode=int(Mode.STOP)))
    bench.hear(lambda: bench.heard)
    assert bench.heard == [Decision(Mode.STOP, "", 0.0, 0.0)]


def test_each_word_is_heard_once_also_by_who_comes_late(bench: EarBench) -> None:
    keeping = bench.publisher(LATCHED)
    keeping.publish(ControlMode(mode=1, source="early"))
    listen(bench.ear, bench.heard.append)
    bench.hear(lambda: bench.heard)
    bench.hear(lambda: keeping.get_subscription_count() == len(EARS))
    for k in range(1, 6):
        keeping.publish(ControlMode(mode=1, source="me", lease=float(k)))
        bench.hear(lambda k=k: bench.heard[-1].lease == k)
    keeping.publish(ControlMode(mode=1, source="me", lease=5.0))  # said again, it is another word
    bench.hear(lambda: len(bench.heard) >= 7)
    keeping.publish(ControlMode(mode=0, source="last"))
    bench.hear(lambda: bench.heard[-1].source == "last")
    assert [d.lease for d in bench.heard] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 5.0, 0.0]
