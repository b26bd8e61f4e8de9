"""Calls of services that are answered however slowly the two sides find each other."""

import time
from collections.abc import Callable
from typing import Any

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.task import Future

PATIENCE = 1.0
"""After this time [s] without an answer a server is asked for its parameters again."""

Wait = Callable[[Callable[[], Any], str], Any]
"""Spins until the first argument returns something true; fails at a deadline, naming the second."""


def call(node: Node, kind: Any, name: str, request: object, *, server: str, wait: Wait) -> Any:
    """Ask the service `name` of the node `server` once and return its answer.

    That a service is ready says that the client has found the server, not that the server has found the client: it
    may take the request, find nobody to answer, and drop the answer, for which the client then waits for ever
    (ros2/rmw_fastrtps issue 842). To ask again would help, but a step that is asked for twice is made twice. So first
    the server is asked for its parameters, which may be repeated, by a client that was made after the one of the
    service: what one participant announces is taken in its order, so that an answer to the later client says that the
    earlier one is known too.
    """
    client = node.create_client(kind, name)
    try:
        wait(client.service_is_ready, f"service {name}")
        wait_until_known(node, server, wait)
        future = client.call_async(request)
        wait(future.done, f"an answer of {name}")
        return future.result()
    finally:
        node.destroy_client(client)


def wait_until_known(node: Node, server: str, wait: Wait) -> None:
    """Wait until `server` has found every client that `node` has by now."""
    greeter = node.create_client(GetParameters, f"{server}/get_parameters")
    answers: list[Future] = []
    due = 0.0

    def answered() -> bool:
        nonlocal due
        if time.monotonic() >= due:
            due = time.monotonic() + PATIENCE
            answers.append(greeter.call_async(GetParameters.Request()))
        return any(answer.done() for answer in answers)

    try:
        wait(greeter.service_is_ready, f"the parameters of {server}")
        wait(answered, f"an answer of {server}")
    finally:
        node.destroy_client(greeter)
