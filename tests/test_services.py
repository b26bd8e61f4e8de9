"""The calls of services in tests: asked once, answered also where the server has not found the client yet."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy")

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.service import Service
from std_srvs.srv import Trigger

from tests import services
from tests.messages import names, raises_naming

pytestmark = pytest.mark.ros

DEADLINE = 60.0


class Pair:
    """A server that counts and a client, in participants of their own: they have to find each other."""

    def __init__(self, domain: int) -> None:
        self.contexts = [rclpy.Context(), rclpy.Context()]
        for context in self.contexts:
            context.init(domain_id=domain)
        self.server, self.client = (
            Node(name, context=context)
            for name, context in zip(("counter", "asker"), self.contexts, strict=True)
        )
        self.executors = [SingleThreadedExecutor(context=context) for context in self.contexts]
        for executor, node in zip(self.executors, (self.server, self.client), strict=True):
            executor.add_node(node)
        self.count, self.deaf = 0, False
        self.server.create_service(Trigger, "count", self._on_count)

    def _on_count(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.count += 1
        response.success, response.message = True, str(self.count)
        return response

    def wait(self, condition: Callable[[], Any], what: str, seconds: float = DEADLINE) -> None:
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, f"waited in vain for {what}"
            for executor in self.executors[self.deaf :]:
                executor.spin_once(timeout_sec=0.01)

    def close(self) -> None:
        nodes = (self.server, self.client)
        for executor, node, context in zip(self.executors, nodes, self.contexts, strict=True):
            executor.shutdown()
            node.destroy_node()
            context.try_shutdown()


@pytest.fixture
def pair(domain: int) -> Iterator[Pair]:
    pair = Pair(domain)
    yield pair
    pair.close()


def test_each_call_is_made_once(pair: Pair) -> None:
    for expected in ("1", "2", "3"):
        answer = services.call(
            pair.client, Trigger, "count", Trigger.Request(), server="counter", wait=pair.wait
        )
        assert answer.message == expected
    assert pair.count == 3


def test_nothing_is_asked_of_a_server_that_drops_its_answers(
    pair: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As one does that has not found the client: the first two answers of all go nowhere."""
    monkeypatch.setattr(services, "PATIENCE", 0.05)
    dropped: list[str] = []
    send = Service.send_response

    def drop(self: Service, response: object, header: object) -> None:
        if len(dropped) < 2:
            dropped.append(self.srv_name)
        else:
            send(self, response, header)

    monkeypatch.setattr(Service, "send_response", drop)
    answer = services.call(pair.client, Trigger, "count", Trigger.Request(), server="counter", wait=pair.wait)
    assert answer.message == "1"
    assert pair.count == 1
    assert [name.rpartition("/")[2] for name in dropped] == ["get_parameters"] * 2


def test_what_does_not_come_is_named(pair: Pair) -> None:
    def wait(condition: Callable[[], Any], what: str) -> None:
        never_comes = names(what, "elsewhere") or names(what, "answer")
        pair.wait(condition, what, seconds=0.3 if never_comes else DEADLINE)

    with raises_naming(AssertionError, "service elsewhere"):
        services.call(pair.client, Trigger, "elsewhere", Trigger.Request(), server="counter", wait=wait)
    pair.deaf = True
    with raises_naming(AssertionError, "answer", "counter"):
        services.call(pair.client, Trigger, "count", Trigger.Request(), server="counter", wait=wait)
