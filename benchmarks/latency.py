"""From key to byte: how long until a key pressed in `tripod teleop` changes what the driver sends to the board.

Terminal and board are pseudo-terminals; between them run the two nodes and ROS, as users start them. A press is timed
from its byte at the terminal to the arrival at the board of the first packet whose numbers differ. Before each press
the joints rest, so that the first difference is the key's. Times are of the wall clock: run it on a quiet machine.
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

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from tripod_driver.framed import Decoder
from tripod_driver.framed_messages import SetPulses
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.protocol import LegacyDecoder

ROOT = Path(__file__).parents[1]
UP, DOWN = b"\x1b[A", b"\x1b[B"
START_TIME = 30.0
PATIENCE = 2.0


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
        [sys.executable, "-m", f"tripod_{name}.node", *words],
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
        wait(lambda: board.packets, "the first packet")
        time.sleep(3.0)  # teleop hears the joints
        taken = np.full(presses, np.nan)
        for k in range(presses):
            if k == 0:
                os.write(keys, b"t")
                time.sleep(1.0)
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
    options = parser.parse_args()
    load = os.getloadavg()[0]
    print(f"1000 x 1000 float64 product, one thread: {1e3 * calibration():.1f} ms; load {load:.1f}")
    print("key to byte [ms]; a legacy packet changes only after a whole degree, 35 ms at 0.5 rad/s")
    columns = ("protocol", "presses", "lost", "p50", "p90", "p99", "worst")
    print("  ".join(f"{column:>8}" for column in columns))
    for protocol in options.protocols:
        taken = measure(protocol, options.presses, options.seed)
        heard = 1e3 * taken[np.isfinite(taken)]
        if not heard.size:
            sys.exit(f"{protocol}: no press reached the board")
        figures = [*np.percentile(heard, [50, 90, 99]), heard.max()]
        cells = [
            protocol,
            str(taken.size),
            str(taken.size - heard.size),
            *(f"{figure:.1f}" for figure in figures),
        ]
        print("  ".join(f"{cell:>8}" for cell in cells))


if __name__ == "__main__":
    main()
