"""From key to byte: how long until a key pressed in `tripod teleop` changes what the driver sends to the board, and how
long after a STOP the last change leaves (`--stop`).

Terminal and board are pseudo-terminals; between them run the two nodes and ROS, as users start them. A press is timed
from its byte at the terminal to the arrival at the board of the first packet whose numbers differ. Before each press
the joints rest, so that the first difference is the key's. Times are of the wall clock: run it on a quiet machine.

For STOP, an operator of this program keeps the servos moving, and goes on sending after it. Another one says STOP: by
the space key of `tripod teleop`, or by a message such as page, `tripod up` and `ros2 topic pub` send. What both stamp
is drawn again each time: now, an hour ago, an hour or 30 years ahead, nothing. A STOP is timed from its byte, or its
publication, to the arrival of the last packet whose numbers differ; `--busy N` keeps N processors busy meanwhile.
"""

import argparse
import contextlib
import os
import random
import select
import signal
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path

from calibration import busy, calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from tripod_bringup.node_values import node_package
from tripod_driver.framed import Decoder
from tripod_driver.framed_messages import SetPulses
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.protocol import LegacyDecoder
from tripod_graph.mode import Decision, Mode

ROOT = Path(__file__).parents[1]
UP, DOWN = b"\x1b[A", b"\x1b[B"
START_TIME = 30.0
PATIENCE = 2.0
REST = 0.4


class Board:
    """The far end of a pseudo-terminal: answers in `framed`, and notes when packets with new numbers arrive."""

    def __init__(self, protocol: str) -> None:
        self._near, far = os.openpty()
        tty.setraw(far)
        self._far, self.path = far, os.ttyname(far)
        self._firmware = MockBoard(time.monotonic) if protocol == "framed" else None
        self._decoder = Decoder() if protocol == "framed" else LegacyDecoder()
        self.packets, self.changes = 0, list[float]()
        self._last: object = None
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ended.is_set():
            if not select.select([self._near], [], [], 0.1)[0]:
                continue
            data = os.read(self._near, 4096)
            now = time.monotonic()
            if self._firmware is not None:
                self._firmware.write(data)
                os.write(self._near, self._firmware.read())
            for found in self._decoder.feed(data):
                numbers = getattr(found, "message", found)
                if isinstance(numbers, SetPulses | tuple):
                    self.packets += 1
                    if numbers != self._last:
                        self.changes.append(now)
                        self._last = numbers

    def close(self) -> None:
        """Unplug it."""
        self._ended.set()
        self._thread.join()
        os.close(self._near)
        os.close(self._far)


@contextlib.contextmanager
def node(name: str, *words: str, terminal: int = subprocess.DEVNULL) -> Iterator[subprocess.Popen[bytes]]:
    """Run a node of the suite until the block ends."""
    process = subprocess.Popen(
        [sys.executable, "-m", f"{node_package(name)}.node", *words],
        cwd=ROOT,
        stdin=terminal,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(20)


def wait(condition, what: str) -> None:
    """Wait until `condition()`; end the program, naming `what`, if that takes too long."""
    deadline = time.monotonic() + START_TIME
    while not condition():
        if time.monotonic() > deadline:
            sys.exit(f"waited in vain for {what}")
        time.sleep(0.02)


def measure(protocol: str, presses: int, seed: int) -> np.ndarray:
    """Return the time from key to byte of each press [s]; NaN where no packet changed within `PATIENCE`."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randint(1, 100))
    rng = np.random.default_rng(seed)
    board = Board(protocol)
    keys, terminal = os.openpty()
    words = (
        f"port:={board.path}",
        f"protocol:={protocol}",
        "boot_time:=0",
        "start:=[-1.0,-1.0,-1.0]",
        "park_after:=600",
    )
    with node("driver", *words), node("teleop", terminal=terminal):
        begin(board, keys)
        taken = np.full(presses, np.nan)
        for k in range(presses):
            count = len(board.changes)
            pressed = time.monotonic()
            os.write(keys, UP if k % 2 else DOWN)
            while len(board.changes) == count and time.monotonic() < pressed + PATIENCE:
                time.sleep(0.001)
            if len(board.changes) > count:
                taken[k] = board.changes[count] - pressed
            time.sleep(0.5 + 0.1 * rng.random())  # the press has ended and the joints rest, at no fixed phase
    board.close()
    os.close(keys)
    os.close(terminal)
    return taken


def begin(board: Board, keys: int) -> None:
    """Take charge and press keys until the servos, whose place nobody knows at first, have moved and rest."""
    pressed = float("-inf")

    def moved() -> bool:
        nonlocal pressed
        if time.monotonic() > pressed + 1.0:
            pressed = time.monotonic()
            os.write(keys, b"t" + DOWN)  # in vain until the nodes have found each other
        return board.packets > 0

    wait(moved, "the first packet")
    wait(lambda: time.monotonic() > board.changes[-1] + 2.0, "the servos to rest")


class Mover:
    """Operators of this program in the graph: one moves the servos, one says STOP."""

    def __init__(self, rng: np.random.Generator) -> None:
        import rclpy  # noqa: PLC0415 - after the range of discovery is set
        from rclpy.executors import SingleThreadedExecutor  # noqa: PLC0415
        from rclpy.node import Node  # noqa: PLC0415
        from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint  # noqa: PLC0415
        from tripod_msgs.msg import ControlMode  # noqa: PLC0415

        from tripod_graph import names  # noqa: PLC0415
        from tripod_graph.control_mode import control_mode_message  # noqa: PLC0415
        from tripod_graph.qos import LATCHED, RELIABLE  # noqa: PLC0415

        rclpy.init()
        self._rng, self._rclpy, self._message = rng, rclpy, control_mode_message
        self.node = Node("mover")
        self._modes = [self.node.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED) for _ in range(2)]
        self._commands = self.node.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)
        self._source, self._count = "", 0

        def send() -> None:
            angle = -1.0 + 0.4 * np.sin(3.0 * time.monotonic())
            message = JointTrajectory(joint_names=list(names.SERVOS))
            message.points = [JointTrajectoryPoint(positions=[angle] * 3)]
            message.header.frame_id = self._source
            self._commands.publish(message)

        self.node.create_timer(0.02, send)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def say(self, mode: int, publisher: int) -> None:
        """Decide on `mode` as another operator each time, for as long as the round lasts."""
        shift = self._rng.choice([0.0, -3600.0, 3600.0, 30 * 365 * 86400.0, np.nan])
        stamp = 0.0 if np.isnan(shift) else time.time() + shift
        self._count += 1
        source = f"/bench#{self._count}"
        if mode:
            self._source = source
        self._modes[publisher].publish(self._message(Decision(mode, source, stamp, 60.0)))

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._thread.join()
        self.node.destroy_node()
        self._rclpy.try_shutdown()


def measure_stop(operator: str, stops: int, seed: int) -> np.ndarray:
    """Return the time from each STOP to the last changed packet [s]: 0 where none came after it, NaN if it moved on."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randint(1, 100))
    rng, board = np.random.default_rng(seed), Board("framed")
    keys, terminal = os.openpty()
    words = (f"port:={board.path}", "boot_time:=0", "start:=[-1.0,-1.0,-1.0]", "park_after:=600")
    taken = np.full(stops, np.nan)
    with node("driver", *words), node("teleop", terminal=terminal):
        mover = Mover(rng)
        time.sleep(3.0)
        mover.say(Mode.TELEOP, 0)
        wait(lambda: board.packets, "the first packet")
        time.sleep(3.0)
        for k in range(stops):
            count = len(board.changes)
            mover.say(Mode.STOP, 0)  # a decision that is an hour old overrules none but a STOP that is older
            mover.say(Mode.TELEOP, 0)
            deadline = time.monotonic() + PATIENCE
            while len(board.changes) < count + 5:
                if time.monotonic() > deadline:  # it was stamped too early to count
                    mover.say(Mode.TELEOP, 0)
                    deadline = time.monotonic() + PATIENCE
                time.sleep(0.01)
            time.sleep(0.1 * rng.random())
            said = time.monotonic()
            if operator == "teleop":
                os.write(keys, b" ")
            else:
                mover.say(Mode.STOP, 1)
            while time.monotonic() < max(said, board.changes[-1]) + REST < said + PATIENCE:
                time.sleep(0.01)
            if board.changes[-1] + REST < said + PATIENCE:
                taken[k] = max(0.0, board.changes[-1] - said)
        mover.close()
    board.close()
    os.close(keys)
    os.close(terminal)
    return taken


def table(rows: list[tuple[str, np.ndarray]], what: str) -> None:
    """Print percentiles of times [s] in ms; NaN is what was lost."""
    print("  ".join(f"{column:>8}" for column in (what, "number", "lost", "p50", "p90", "p99", "worst")))
    for name, taken in rows:
        heard = 1e3 * taken[np.isfinite(taken)]
        figures = [*np.percentile(heard, [50, 90, 99]), heard.max()] if heard.size else [np.nan] * 4
        cells = [
            name,
            str(taken.size),
            str(taken.size - heard.size),
            *(f"{figure:.1f}" for figure in figures),
        ]
        print("  ".join(f"{cell:>8}" for cell in cells))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--presses", type=int, default=300, help="key presses of each row (default 300)")
    parser.add_argument("--seed", type=int, default=0, help="of the pauses between presses (default 0)")
    parser.add_argument(
        "--protocols", nargs="+", default=["framed", "legacy"], choices=["framed", "legacy"], help="rows"
    )
    parser.add_argument("--stop", action="store_true", help="time STOP instead of keys")
    parser.add_argument("--busy", type=int, default=0, help="processors kept busy meanwhile (default 0)")
    options = parser.parse_args()
    load = os.getloadavg()[0]
    print(f"1000 x 1000 float64 product, one thread: {1e3 * calibration():.1f} ms; load {load:.1f}")
    with busy(options.busy):
        if options.stop:
            print(f"STOP to the last changed packet [ms], {options.busy} processors busy")
            operators = ("teleop", "message")
            table([(who, measure_stop(who, options.presses, options.seed)) for who in operators], "operator")
            return
        print("key to byte [ms]; a legacy packet changes only after a whole degree, 35 ms at 0.5 rad/s")
        rows = [(name, measure(name, options.presses, options.seed)) for name in options.protocols]
    table(rows, "protocol")


if __name__ == "__main__":
    main()
