"""`tripod bag play` in a terminal: space pauses and goes on, `.` and the right arrow step, q ends."""

import os
import pty
import re
import select
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from tests.messages import assert_names
from tests.replay.test_topic_player import write_bag

pytestmark = pytest.mark.ros

ROOT = Path(__file__).parents[2]
DEADLINE = 60.0
LINE = re.compile(r"(playing|paused ) \[[# ]{16}\] +([\d.]+) / 59.90 s")


class Shown:
    """The command in a terminal of the test's own."""

    def __init__(self, words: list[str], domain: int) -> None:
        self._near, far = pty.openpty()
        self.before = termios.tcgetattr(far)
        self._far, self.said = far, ""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tripod_bringup.cli", *words], cwd=ROOT, stdin=far, stdout=far, stderr=far,
            env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
        )  # fmt: skip

    def press(self, keys: bytes) -> None:
        os.write(self._near, keys)

    def read(self) -> None:
        if select.select([self._near], [], [], 0.1)[0]:
            self.said += os.read(self._near, 65536).decode()

    def line(self, state: str, least: float = 0.0, most: float = float("inf")) -> float:
        """Wait until the last line tells this state, and a place in this range [s]; return the place."""
        deadline = time.monotonic() + DEADLINE
        while time.monotonic() < deadline:
            self.read()
            lines = LINE.findall(self.said)
            if lines and lines[-1][0].strip() == state and least <= float(lines[-1][1]) <= most:
                return float(lines[-1][1])
        raise AssertionError(f"waited in vain for {state}, {least} to {most} s: {self.said[-500:]!r}")

    def end(self) -> int:
        deadline = time.monotonic() + DEADLINE
        while self.process.poll() is None and time.monotonic() < deadline:
            self.read()
        self.read()
        return self.process.wait(0.1)

    @property
    def after(self) -> list:
        return termios.tcgetattr(self._far)

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._near)
        os.close(self._far)


@pytest.fixture
def shown(domain: int, tmp_path: Path) -> Iterator[Shown]:
    bag = write_bag(tmp_path / "bag", count=600)
    made = Shown(["bag", "play", str(bag), "--to", "topics"], domain)
    yield made
    made.close()


def test_space_pauses_and_goes_on_keys_step_and_q_ends(shown: Shown) -> None:
    shown.line("playing", least=0.2)
    before, _, keys = shown.said.partition(" / 59.90 s")
    assert_names(before.splitlines()[0], "tripod bag play: ", "reading")
    assert_names(keys, "space: pause", ".: step", "q: end")
    shown.press(b" ")
    place = shown.line("paused")
    shown.said = ""
    for _ in range(5):
        shown.read()
    assert shown.said == "", "it stands, and nothing is drawn again"
    shown.press(b"\x1b[200~q q\x1b[201~")  # pasted
    for key in (b".", b"\x1b[C", b"\x1bOC"):
        shown.press(key)
        place = shown.line("paused", least=place + 1e-6, most=place + 0.15)
    shown.press(b" ")
    shown.line("playing", least=place + 0.3)
    shown.press(b"q")
    assert shown.end() == 0
    assert_names(shown.said.rpartition("\x1b[?2004l")[2], "ended by q")
    assert shown.after == shown.before, "the terminal is as it was"
