"""Lines of nodes, the status line, and how both are drawn."""

import io

import pytest

from tripod_bringup.log_lines import Level, LogLine, parse
from tripod_bringup.screen import Screen, is_terminal
from tripod_bringup.status_line import ChainStatus, status_line


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (
            "page http://127.0.0.1:80",
            LogLine(Level.INFO, "page http://127.0.0.1:80", "page", "http://127.0.0.1:80"),
        ),
        (
            "[INFO] [1700000000.123456] [record]: recording /data/a b",
            LogLine(Level.INFO, "recording /data/a b", "recording", "/data/a b"),
        ),
        ("[WARN] [1.5] [left.driver]: no port", LogLine(Level.WARN, "no port")),
        ("[INFO] [1.5] [sim]: ready", LogLine(Level.INFO, "ready")),
        ("Traceback (most recent call last):", LogLine(Level.ERROR, "Traceback (most recent call last):")),
        ("recording", LogLine(Level.ERROR, "recording")),
    ],
)
def test_a_line_is_understood(line: str, expected: LogLine) -> None:
    assert parse(line) == expected


def test_the_status_line_tells_mode_speed_error_state_and_packets() -> None:
    status = ChainStatus("IK", "RUNNING", 0.998, 0.62e-3, "TRACKING", 0.05e-3, "ACTIVE", 1234, "ik: slow")
    assert status_line(status) == (
        "mode IK | sim running 1.00x, step 0.62 ms | ik tracking 0.05 mm | "
        "robot active, 1234 packets | ik: slow"
    )


def test_what_is_not_known_is_a_dash() -> None:
    assert status_line(ChainStatus()) == "mode - | sim - -, step - | ik - | robot -"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_in_a_terminal_the_status_is_redrawn_below_the_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "12")
    stream = io.StringIO()
    screen = Screen(stream, terminal=True)
    screen.status("a status that is too long")
    screen.line("news")
    screen.close()
    assert stream.getvalue() == "a status th" + "\r\x1b[2Knews\na status th" + "\r\x1b[2K"


def test_elsewhere_the_status_is_a_line_now_and_then() -> None:
    stream = io.StringIO()
    screen = Screen(stream, terminal=False)
    for _ in range(100):
        screen.status("one")
    screen.line("news")
    screen.close()
    assert stream.getvalue() == "one\nnews\n"


def test_a_status_that_is_not_shown_is_not_asked_for() -> None:
    asked = list[int]()

    def tell() -> str:
        asked.append(1)
        return "told"

    stream = io.StringIO()
    screen = Screen(stream, terminal=False)
    for _ in range(100):
        screen.status(tell)
    assert (asked, stream.getvalue()) == ([1], "told\n")


def test_a_broken_pipe_silences_the_screen_and_nothing_else() -> None:
    class Broken(io.StringIO):
        writes = 0

        def write(self, _text: str) -> int:
            Broken.writes += 1
            raise BrokenPipeError

    screen = Screen(Broken(), terminal=False)
    screen.line("one")
    screen.line("two")
    assert Broken.writes == 1


def test_a_dumb_terminal_is_none() -> None:
    assert is_terminal(Terminal(), {"TERM": "xterm"})
    assert not is_terminal(Terminal(), {"TERM": "dumb"})
    assert not is_terminal(Terminal(), {})
    assert not is_terminal(io.StringIO(), {"TERM": "xterm"})
