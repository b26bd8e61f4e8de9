"""A few nodes in a context and an executor of their own."""

import time
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.node import Node

from tripod_graph.executor import NodeExecutor

DEADLINE = 60.0  # [s], for a loaded machine


class Bench:
    """Spins nodes until something has come about."""

    def __init__(self, domain: int) -> None:
        self.context = rclpy.Context()
        self.context.init(domain_id=domain)
        self.executor = NodeExecutor(context=self.context)
        self._nodes = list[Node]()

    def add(self, node: Any) -> Any:
        self.executor.add_node(node)
        self._nodes.append(node)
        return node

    def wait(self, condition: Callable[[], Any], what: object) -> None:
        deadline = time.monotonic() + DEADLINE
        while not condition():
            assert time.monotonic() < deadline, f"waited in vain for {what}"
            self.executor.spin_once(timeout_sec=0.02)

    def close(self) -> None:
        self.executor.shutdown()
        for node in self._nodes:
            node.destroy_node()
        self.context.try_shutdown()
