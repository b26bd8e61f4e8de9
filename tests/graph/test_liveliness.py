"""Two nodes that publish the same topics tell of each other, and of nobody who only was there."""

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

from rclpy.node import Node
from std_msgs.msg import String

from tests.graph.bench import Bench
from tests.messages import assert_names
from tripod_graph import liveliness
from tripod_graph.liveliness import Mix, Rival
from tripod_graph.qos import RELIABLE

pytestmark = pytest.mark.ros


@pytest.fixture
def bench(domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setattr(liveliness, "PERIOD", 0.1)
    bench = Bench(domain)
    yield bench
    bench.close()


class Teller:
    """A node that publishes a status each time it is asked to, and looks for rivals."""

    def __init__(self, bench: Bench, namespace: str = "/left") -> None:
        self.node: Any = bench.add(Node("sim", namespace=namespace, context=bench.context))
        self.publisher = self.node.create_publisher(String, "sim/status", RELIABLE)
        self.rival = Rival(self.node, self.publisher)
        self.warned: list[str] = []
        self.node.get_logger = lambda: self
        self.warning = self.warned.append

    def say(self) -> None:
        self.publisher.publish(String(data="running"))


def each_speaks(tellers: list[Teller], condition: Callable[[], Any]) -> Callable[[], Any]:
    def check() -> Any:
        for teller in tellers:
            teller.say()
        return condition()

    return check


def test_both_of_two_warn_once_of_each_other_and_what_to_do(bench: Bench) -> None:
    tellers = [Teller(bench), Teller(bench)]
    apart = Teller(bench, "/right")
    bench.wait(each_speaks([*tellers, apart], lambda: all(t.rival.notice for t in tellers)), "both notices")
    looks = iter(range(200))
    bench.wait(each_speaks([*tellers, apart], lambda: next(looks) == 100), "more looks")
    for teller in tellers:
        assert teller.warned == [teller.rival.notice]
        assert_names(
            teller.rival.notice, "node /left/sim", "/left/sim/status", "__ns:=/NAME", "ROS_DOMAIN_ID"
        )
    assert not apart.rival.notice, "another namespace has other topics"
    tellers[1].node.destroy_publisher(tellers[1].publisher)
    bench.wait(lambda: not tellers[0].rival.notice, "the end of the notice")
    assert not list(tellers[0].node.subscriptions), "alone it does not listen to itself"


def test_one_that_is_known_but_silent_is_none(bench: Bench) -> None:
    """So is one that was killed, until its time is over."""
    teller, silent = Teller(bench), Teller(bench)
    bench.wait(lambda: list(teller.node.subscriptions), "the look")
    looks = iter(range(100))
    bench.wait(each_speaks([teller], lambda: next(looks) == 50), "more looks")
    assert silent.node.count_publishers("sim/status") == 2
    assert not teller.rival.notice


@pytest.mark.parametrize(
    ("numbers", "mixed"),
    [([500, 501, 1, 2, 3], False), ([500, 1, 501, 2], True), ([1, 1, 2, 2], True)],
    ids=["one after the other", "in turns", "begun together"],
)
def test_who_takes_the_place_of_another_does_not_mix(numbers: list[int], mixed: bool) -> None:
    """A publisher is still known for a while after it has gone, as when the simulator begins again."""
    mix = Mix(SimpleNamespace(count_publishers=lambda topic: 2), "sim/status")
    for number in numbers:
        mix.hear({"publication_sequence_number": number})
    assert mix.mixed is mixed
