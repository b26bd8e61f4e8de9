"""The executor of the nodes: what is ready is done, whoever made it and whenever, and nothing else."""

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy")

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

from tests.graph.bench import DEADLINE, Bench
from tripod_graph.executor import NodeExecutor, Patient
from tripod_graph.qos import LATCHED, RELIABLE, SENSOR

pytestmark = pytest.mark.ros


@pytest.fixture
def bench(domain: int) -> Iterator[Bench]:
    made = Bench(domain)
    yield made
    made.close()


@pytest.fixture
def node(bench: Bench) -> Any:
    return bench.add(Node("worker", context=bench.context))


def steady() -> Clock:
    return Clock(clock_type=ClockType.STEADY_TIME)


def test_timers_messages_and_services_are_answered(bench: Bench, node: Node) -> None:
    heard, calls = list[str](), list[int]()
    node.create_subscription(String, "words", lambda m: heard.append(m.data), RELIABLE)
    node.create_timer(0.01, lambda: calls.append(1), clock=steady())

    def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = "done"
        return response

    node.create_service(Trigger, "act", answer)
    client = node.create_client(Trigger, "act")
    publisher = node.create_publisher(String, "words", RELIABLE)
    bench.wait(lambda: publisher.get_subscription_count() and client.service_is_ready(), "both ends")
    for word in "abc":
        publisher.publish(String(data=word))
    answered = list[str]()
    client.call_async(Trigger.Request()).add_done_callback(lambda f: answered.append(f.result().message))
    bench.wait(lambda: len(heard) == 3 and answered and len(calls) > 3, (heard, answered, calls))
    assert heard == ["a", "b", "c"]
    assert answered == ["done"]


def test_what_a_callback_makes_is_heard_and_what_it_destroys_is_not(bench: Bench, node: Node) -> None:
    heard = list[str]()
    publisher = node.create_publisher(String, "words", LATCHED)
    publisher.publish(String(data="late"))

    def once() -> None:
        first.cancel()
        node.destroy_timer(doomed)
        node.create_subscription(String, "words", lambda m: heard.append(m.data), LATCHED)

    first = node.create_timer(0.0, once, clock=steady())
    doomed = node.create_timer(0.0, lambda: heard.append("doomed"), clock=steady())
    bench.wait(lambda: "late" in heard, "what was said before")
    assert heard == ["late"]


def test_a_guard_condition_of_another_thread_is_not_lost_where_things_are_made(
    bench: Bench, node: Node
) -> None:
    """All that is ready is left when something was made; a guard condition tells only once that it is."""
    calls = list[int]()
    guard = node.create_guard_condition(lambda: calls.append(1))
    made = list[Any]()
    timer = node.create_timer(
        0.0, lambda: (timer.cancel(), made.append(node.create_timer(9.0, print))), clock=steady()
    )
    guard.trigger()
    bench.wait(lambda: calls, "the guard condition")
    assert made
    assert calls == [1]


def test_what_a_callback_raises_is_raised(bench: Bench, node: Node) -> None:
    def fail() -> None:
        raise ValueError("out of order")

    node.create_timer(0.0, fail, clock=steady())
    with pytest.raises(ValueError, match="out of order"):
        bench.wait(lambda: False, "nothing")


def test_a_patient_subscription_wakes_nobody_and_comes_before_what_does(bench: Bench, node: Node) -> None:
    heard, witnessed, woken = list[str](), list[str](), threading.Semaphore(0)
    node.create_subscription(
        String, "words", lambda m: heard.append(m.data), RELIABLE, callback_group=Patient()
    )
    guard = node.create_guard_condition(lambda: (heard.append("woken"), woken.release()))
    publisher = node.create_publisher(String, "words", RELIABLE)
    bench.wait(publisher.get_subscription_count, "the subscription")
    witness = Node("witness", context=bench.context)
    witness.create_subscription(String, "words", lambda m: witnessed.append(m.data), RELIABLE)
    other = NodeExecutor(context=bench.context)
    other.add_node(witness)
    bench.wait(lambda: publisher.get_subscription_count() == 2, "the witness")
    bench.executor.spin_once(timeout_sec=0.0)  # nothing is left that would wake it
    for timer in list(node.timers):
        node.destroy_timer(timer)
    spin = threading.Thread(target=lambda: [bench.executor.spin_once(timeout_sec=60.0) for _ in range(3)])
    bench.executor.spin_once(timeout_sec=0.0)
    spin.start()
    publisher.publish(String(data="a"))
    publisher.publish(String(data="b"))
    end = time.monotonic() + DEADLINE
    while witnessed != ["a", "b"]:  # then the patient one has them, too
        assert time.monotonic() < end, f"the witness heard only {witnessed}"
        other.spin_once(timeout_sec=0.02)
    assert spin.is_alive()
    assert heard == []
    for _ in range(3):
        guard.trigger()
        assert woken.acquire(timeout=DEADLINE)
    spin.join(DEADLINE)
    assert heard == ["a", "b", "woken", "woken", "woken"]
    other.shutdown()
    witness.destroy_node()


def test_events_of_the_middleware_are_told(bench: Bench, node: Node) -> None:
    told = list[int]()
    events = SubscriptionEventCallbacks(incompatible_qos=lambda e: told.append(e.total_count))
    node.create_subscription(String, "words", print, RELIABLE, event_callbacks=events)
    node.create_publisher(String, "words", SENSOR)
    bench.wait(lambda: told, "that the qualities of service do not fit")
