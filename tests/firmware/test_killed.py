"""kill -9 of the driver, of the simulator, of all: the servos hold, then are let go, in the board's own time.

The processes are those of `tripod up --demo`, in motion; the board is the real firmware behind a pseudo-terminal.
"""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("tripod_msgs", reason="the messages are not built: run `make setup`")

from tests.firmware.session import PERIOD, is_row_of, rows
from tests.firmware.terminal_board import TerminalBoard
from tests.messages import lines_naming
from tests.tiers import sampled
from tripod_driver.framed import Decoder, SetPulses

ROOT = Path(__file__).parents[2]
DEADLINE = 120.0
"""For a loaded machine [s]; nothing here waits so long unless it fails."""

WATCHDOG = 0.5
PARKED = (24000, 24000, 24000)
"""Pulses of the flat piece [0.1 us]."""


@pytest.fixture
def suite(terminal: TerminalBoard, tmp_path: Path, domain: int) -> Iterator[subprocess.Popen[bytes]]:
    environment = dict(
        os.environ,
        PYTHONPATH=str(ROOT),
        ROS_DOMAIN_ID=str(domain),
        ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
        XDG_RUNTIME_DIR=str(tmp_path),
    )
    words = ["up", "--demo", "--no-view", "--duration", "600", "--port", terminal.path, "driver.boot_time:=0"]
    words += ["driver.park_time_max:=8"]  # a board that a loaded machine simulates answers late
    with log(tmp_path).open("w") as file:
        process = subprocess.Popen(
            [sys.executable, "-c", "from tripod_bringup.cli import main; main()", *words],
            env=environment,
            cwd=tmp_path,
            stdout=file,
            stderr=file,
        )
    yield process
    for pid in [*nodes(process.pid).values(), process.pid]:
        kill(pid)
    process.wait()


def log(directory: Path) -> Path:
    return directory / "up.log"


def nodes(pid: int) -> dict[str, int]:
    """Return the processes of the nodes that `pid` started, by name."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return {}
    found = {}
    for child in children:
        words = Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
        found |= {
            w.decode()[len("tripod_") : -len(".node")]: int(child) for w in words if w.endswith(b".node")
        }
    return {{"runtime": "sim"}.get(name, name): child for name, child in found.items()}


def kill(pid: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def until(condition: Callable[[], object], what: str) -> None:
    end = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < end, f"waited in vain for {what}"
        time.sleep(0.02)


def commands(terminal: TerminalBoard) -> list[tuple[int, ...]]:
    """Return the pulses of every frame that the board was sent [0.1 us]."""
    frames = Decoder().feed(terminal.heard)
    return [frame.message.pulses for frame in frames if isinstance(frame.message, SetPulses)]


def moves(terminal: TerminalBoard) -> bool:
    """Whether the servos are under way: the newest commands differ, and are not near the park position."""
    newest = commands(terminal)[-5:]
    return len(set(newest)) == 5 and max(newest[-1]) < PARKED[0] - 1000


@pytest.mark.ros
@pytest.mark.parametrize("victim", sampled(["driver", "sim", "all"], "all"))
def test_after_kill_9_the_servos_hold_and_are_then_let_go(victim: str, suite, terminal, tmp_path) -> None:
    until(lambda: moves(terminal) or suite.poll() is not None, "motion")
    assert suite.poll() is None, log(tmp_path).read_text()
    running = nodes(suite.pid)
    assert {"sim", "ik", "driver"} <= set(running)
    for pid in [suite.pid, *running.values()] if victim == "all" else [running[victim]]:
        kill(pid)
    if victim != "all":  # the rest ends in order, and tells why
        assert suite.wait(DEADLINE) == {"driver": 12, "sim": 10}[victim]
        assert lines_naming(log(tmp_path).read_text(), victim, "SIGKILL")
    until(lambda: terminal.now > terminal.heard_at + 4 * WATCHDOG, "the board's time")
    last, at = commands(terminal)[-1], terminal.heard_at
    if victim == "sim":
        assert last == PARKED  # the driver lived on, and parked
    held = [pulse for pulse in terminal.pulses() if pulse.start > at + 2 * PERIOD]
    held = held[-(len(held) // 3 * 3) :]
    assert all(is_row_of(row, last) for row in rows(held))
    assert len(rows(held)) > 0.8 * 2 * WATCHDOG / PERIOD
    assert 2 * WATCHDOG - 2 * PERIOD < held[-1].start - at < 2 * WATCHDOG + 2 * PERIOD
