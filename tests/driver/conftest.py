"""A board made of a pseudo-terminal, the driver as a process, and a ROS client that talks to it."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.protocol import LegacyDecoder

DEADLINE = 60.0
"""For a loaded machine [s]; nothing here waits so long unless it fails."""

PROJECT = Path(__file__).parents[2]

UNO, NODE = ("-m", "tests.driver.uno"), ("-m", "tripod_driver.node")
"""The driver where opening the port resets the board, and as it is: opening a pseudo-terminal resets nothing."""


class Board:
    """A pseudo-terminal that reads what the driver writes; it can be unplugged and plugged in again.

    Attributes:
        path: Device for the driver: a link, so that it stays the same after a replug.
        decoder: Speaks the driver's protocol.
        packets: Angles of every packet that arrived [rad], in order.
        times: When they arrived, steady clock [s].
        firmware: Answers what arrives; None: nobody does, as in the workshop's firmware.
        received: All bytes that arrived.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.decoder = LegacyDecoder()
        self.packets: list[tuple[float, ...]] = []
        self.times: list[float] = []
        self.firmware: MockBoard | None = None
        self.received = b""
        self._near: int | None = None
        self._reader: threading.Thread | None = None

    def plug(self) -> None:
        near, far = os.openpty()
        tty.setraw(far)
        self.path.symlink_to(os.ttyname(far))
        self._near = near
        if self.firmware is not None:
            self.firmware.restart()
        self._unplugged = threading.Event()
        self._reader = threading.Thread(target=self._read, args=(near, far, self._unplugged), daemon=True)
        self._reader.start()

    def unplug(self) -> None:
        if self._reader is None:
            return
        self.path.unlink()
        self._unplugged.set()
        self._reader.join()
        self._reader = None

    def say(self, data: bytes) -> None:
        """Send bytes to the driver."""
        assert self._near is not None
        os.write(self._near, data)

    def _read(self, near: int, far: int, unplugged: threading.Event) -> None:
        os.set_blocking(near, False)
        while not unplugged.wait(0.002):
            with contextlib.suppress(BlockingIOError):
                data = os.read(near, 4096)
                self.received += data
                if self.firmware is not None:
                    self.firmware.write(data)
                    os.write(near, self.firmware.read())
                for angles in self.decoder.feed(data):
                    self.packets.append(angles)
                    self.times.append(time.monotonic())
        os.close(far)
        os.close(near)


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Board]:
    board = Board(tmp_path / "ttyBoard")
    board.plug()
    yield board
    board.unplug()


class DriverProcess:
    """The driver, started as a user would, with its output in files."""

    def __init__(self, folder: Path, arguments: Sequence[str], program: Sequence[str]) -> None:
        self._log = folder / f"driver{len(list(folder.iterdir()))}.log"
        with self._log.open("w") as log:
            self.process = subprocess.Popen(
                [sys.executable, *program, *arguments], cwd=PROJECT, stdout=log, stderr=log
            )

    @property
    def log(self) -> str:
        return self._log.read_text()

    def stop(self, number: signal.Signals = signal.SIGINT) -> int:
        self.process.send_signal(number)
        return self.process.wait(DEADLINE)


class Client:
    """A ROS node of the test in domain and namespace of the driver, spun only while the test waits."""

    def __init__(self, domain: int, namespace: str) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node

        self.context = rclpy.Context()
        self.context.init(domain_id=domain)
        self.node = Node("tester", namespace=namespace, context=self.context, enable_rosout=False)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)

    def wait(
        self, condition: Callable[[], Any], what: str, *, meanwhile: Callable[[], None] | None = None
    ) -> None:
        """Spin until `condition`; every 20 ms do `meanwhile`. Fail, naming `what`, at the deadline."""
        deadline = time.monotonic() + DEADLINE
        due = 0.0
        while not condition():
            assert time.monotonic() < deadline, f"waited in vain for {what}"
            if meanwhile is not None and time.monotonic() >= due:
                due = time.monotonic() + 0.02
                meanwhile()
            self._executor.spin_once(timeout_sec=0.01)

    def call(self, kind: type, name: str, request: object) -> Any:
        """Ask a service of the driver once and return its answer."""
        from tests.services import call

        return call(self.node, kind, name, request, server="driver", wait=self.wait)

    def close(self) -> None:
        """Leave the graph; a second time does nothing."""
        if not self.context.ok():
            return
        self._executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def namespace() -> str:
    """A namespace, as a robot among others has."""
    return f"/robot_{random.getrandbits(48):x}"


@pytest.fixture
def client(domain: int, namespace: str, start_driver: Callable[..., DriverProcess]) -> Iterator[Client]:
    """It leaves the graph before the drivers are killed: see `tests/domains.py`."""
    client = Client(domain, namespace)
    yield client
    client.close()


@pytest.fixture
def start_driver(tmp_path: Path, domain: int, namespace: str) -> Iterator[Callable[..., DriverProcess]]:
    """Start drivers with the words of a command line; none outlives the test."""
    started: list[DriverProcess] = []

    def start(*arguments: str, program: Sequence[str] = UNO) -> DriverProcess:
        started.append(DriverProcess(tmp_path, [*arguments, f"__ns:={namespace}"], program))
        return started[-1]

    yield start
    for driver in started:
        if driver.process.poll() is None:
            driver.process.kill()
            driver.process.wait()


@pytest.fixture
def operator(client: Client):
    """What the tests say to the driver and hear from it."""
    from tests.driver.operator import Operator

    return Operator(client)
