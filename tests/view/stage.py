"""The node of the page as a process, with a simulator that knows no mechanics beside it."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable
from pathlib import Path

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.publisher import Publisher
from rclpy.service import Service
from rclpy.subscription import Subscription

from tests.view.fake_browser import FakeBrowser
from tests.view.fake_simulator import FakeSimulator
from tripod_graph import names
from tripod_graph.source import name_of

DEADLINE = 60.0  # [s], for a loaded machine


class View:
    """The node as a process; its namespace is its own: pages of several tests share the domain."""

    def __init__(self, domain: int, *parameters: str) -> None:
        self.namespace = f"/view_{uuid.uuid4().hex[:12]}"
        words = [w for p in parameters for w in ("-p", p)]
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tripod_view.node", "--ros-args", "-r", f"__ns:={self.namespace}", *words],
            cwd=Path(__file__).parents[2],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._asked_to_stop = False

    def page(self) -> tuple[str, str]:
        """Return the address of the page and what was printed until it was said."""
        printed = ""
        for line in self.process.stdout:
            printed += line
            if found := re.fullmatch(r"page (http://127\.0\.0\.1:\d+/[\w-]{22})\n", line):
                return found[1], printed
        raise AssertionError(printed + self.process.stderr.read())

    def ask_to_stop(self) -> None:
        """Ask it to stop, once: a second signal ends a Python that is about to exit by itself."""
        if not self._asked_to_stop:
            self._asked_to_stop = True
            self.process.send_signal(signal.SIGTERM)

    def stop(self) -> tuple[int, str]:
        """Ask it to stop, unless that was done; return exit code and what it said on stderr."""
        self.ask_to_stop()
        return self.end()

    def end(self) -> tuple[int, str]:
        """Wait for its end; return exit code and what it said on stderr."""
        try:
            _, errors = self.process.communicate(timeout=DEADLINE)
        finally:
            self.process.kill()
            self.process.wait()
        return self.process.returncode, errors


class Stage:
    """A page with a simulator; `browser()` opens the page."""

    def __init__(self, context: rclpy.Context, *parameters: str) -> None:
        """`parameters`: more of the page's."""
        self.view = View(context.get_domain_id(), "port:=0", *parameters)
        self.changed = threading.Condition()
        self.sim = FakeSimulator(namespace=self.view.namespace, context=context)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.sim)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()
        self.url, _ = self.view.page()

    def browser(self) -> FakeBrowser:
        """Open the page and wait until it shows the body moving."""
        browser = FakeBrowser(self.url)
        browser.wait(lambda: browser.pictures() > 3)
        return browser

    def destroy(self, *entities: Publisher | Subscription | Service) -> None:
        """Remove publishers, subscriptions and services of the simulator in the thread that spins it.

        From another thread, the executor may be just about to wait for them, and ends with InvalidHandle.
        """
        kinds = {
            Publisher: self.sim.destroy_publisher,
            Subscription: self.sim.destroy_subscription,
            Service: self.sim.destroy_service,
        }
        for entity in entities:
            self.wait(self._executor.create_task(kinds[type(entity)], entity).done)

    def wait(self, what: Callable[[], object], found_instead: Callable[[], str] = str) -> object:
        """Wait until `what` returns something true, and return it; `found_instead` describes what is there if not."""
        until = time.monotonic() + DEADLINE
        while not (found := what()):
            assert time.monotonic() < until, found_instead()
            time.sleep(0.01)
        return found

    def mode(self) -> tuple[int, str] | None:
        """Return the newest decision that was published."""
        return (self.sim.modes[-1].mode, name_of(self.sim.modes[-1].source)) if self.sim.modes else None

    def watchers(self) -> int:
        """Return how many listen to the body."""
        return self.sim.count_subscribers(f"{self.view.namespace}/{names.BODY_STATE}")

    def close(self) -> tuple[int, str]:
        result = self.view.stop()
        self._executor.shutdown()
        self._thread.join(DEADLINE)
        self.sim.close()
        return result
