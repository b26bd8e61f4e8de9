"""The terminal by itself: taken, restored by every way out, gone."""

import os
import pty
import select
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.messages import raises_naming
from tripod_teleop.terminal import Terminal, TerminalError

ROOT = Path(__file__).parents[2]
DEADLINE = 60.0  # [s]
PROGRAM = """
import os, sys, time
from tripod_teleop.terminal import Terminal

terminal = Terminal()
{body}
"""


@pytest.fixture
def pair() -> Iterator[tuple[int, int]]:
    master, slave = pty.openpty()
    yield master, slave
    for fd in (master, slave):
        os.close(fd)


def start(slave: int, body: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", PROGRAM.format(body=body)]
    return subprocess.Popen(command, cwd=ROOT, stdin=slave, stdout=slave, stderr=subprocess.PIPE)


def wait_for(master: int, text: bytes) -> bytes:
    seen = b""
    while text not in seen:
        assert select.select([master], [], [], DEADLINE)[0], f"{text!r} did not come: {seen!r}"
        seen += os.read(master, 4096)
    return seen


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ("with terminal:\n    terminal.enter(); terminal.show('line')", 0),
        ("with terminal:\n    terminal.enter(); 1 / 0", 1),
        ("with terminal:\n    terminal.enter(); sys.exit(3)", 3),
        ("terminal.enter(); 1 / 0", 1),  # without the context: the end of Python restores it
        ("terminal.enter(); terminal.restore(); terminal.restore()", 0),
        ("terminal.enter(); sys.stdout.close(); terminal.show('x'); terminal.restore()", 0),
    ],
)
def test_every_way_out_restores_it(pair: tuple[int, int], body: str, code: int) -> None:
    master, slave = pair
    before = termios.tcgetattr(slave)
    check = "import termios\nassert not termios.tcgetattr(0)[3] & termios.ECHO"
    process = start(slave, body.replace("terminal.enter();", f"terminal.enter(); exec({check!r});"))
    errors = process.communicate(timeout=DEADLINE)[1].decode()
    assert process.returncode == code, errors
    assert "AssertionError" not in errors
    assert termios.tcgetattr(slave) == before
    shown = os.read(master, 4096)
    assert shown.count(b"\x1b[?2004h") == 1
    assert shown.count(b"\x1b[?2004l") == (0 if "close" in body else 1)


def test_keys_come_one_by_one_and_only_ctrl_c_is_a_signal(pair: tuple[int, int]) -> None:
    master, slave = pair
    terminal = Terminal(slave)
    try:
        terminal.enter()
        assert terminal.read() == b""
        os.write(master, b"a\r\x1a\x11\x13\x1c\x16\x1b[A")  # Enter, Ctrl-Z, -Q, -S, -\\, -V, Up
        read, end = b"", time.monotonic() + DEADLINE
        while len(read) < 10 and time.monotonic() < end:
            read += terminal.read()
        assert read == b"a\r\x1a\x11\x13\x1c\x16\x1b[A"
        attributes = termios.tcgetattr(slave)
        assert attributes[3] & termios.ISIG
        assert attributes[6][termios.VINTR] == b"\x03"
        assert attributes[1] & termios.OPOST  # lines of other programs still begin at the left
    finally:
        terminal.restore()


def test_after_a_stop_the_keys_are_taken_again(pair: tuple[int, int]) -> None:
    master, slave = pair
    process = start(
        slave,
        "with terminal:\n    terminal.enter(); print('ready', flush=True)\n"
        "    while (data := terminal.read()) != b'q': time.sleep(0.01); data and print(data, flush=True)",
    )
    wait_for(master, b"ready")
    cooked = termios.tcgetattr(slave)
    cooked[3] |= termios.ICANON | termios.ECHO  # what a shell does with the terminal of a stopped job
    process.send_signal(signal.SIGSTOP)
    os.waitpid(process.pid, os.WUNTRACED)
    termios.tcsetattr(slave, termios.TCSANOW, cooked)
    process.send_signal(signal.SIGCONT)
    end = time.monotonic() + DEADLINE
    while termios.tcgetattr(slave)[3] & termios.ICANON:
        assert time.monotonic() < end
    os.write(master, b"x")
    wait_for(master, b"b'x'")
    os.write(master, b"q")
    assert process.wait(timeout=DEADLINE) == 0


@pytest.mark.parametrize(
    ("columns", "shown"),
    [(2, "…"), (20, "?[2J" + 14 * "x" + "…"), (200, "?[2J" + 100 * "x"), (0, "?[2J" + 74 * "x" + "…")],
)
def test_a_line_never_wraps_nor_commands_the_terminal(
    pair: tuple[int, int], monkeypatch: pytest.MonkeyPatch, columns: int, shown: str
) -> None:
    master, slave = pair
    termios.tcsetwinsize(slave, (24, columns))
    with os.fdopen(os.dup(slave), "w") as screen:
        monkeypatch.setattr(sys, "stdout", screen)
        Terminal(slave).show("\x1b[2J" + 100 * "x")
        assert os.read(master, 4096).decode() == f"\r\x1b[K{shown}"


def test_what_is_no_terminal_is_refused() -> None:
    with Path("/dev/null").open("rb") as file, raises_naming(TerminalError, "teleop", "terminal"):
        Terminal(file.fileno())
    with raises_naming(TerminalError, "teleop", "terminal"):
        Terminal(999)


def test_a_terminal_that_is_gone_is_told_and_let_be() -> None:
    master, slave = pty.openpty()
    terminal = Terminal(slave)
    terminal.enter()
    os.close(master)
    with raises_naming(TerminalError, "terminal", "gone"):
        terminal.read()
    terminal.show("nobody sees this")
    assert terminal.width > 0
    terminal.restore()
    os.close(slave)
