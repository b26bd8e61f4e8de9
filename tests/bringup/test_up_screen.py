"""Lines of nodes, the status line, and how both are drawn."""

import io
from types import SimpleNamespace

import pytest

from tests.messages import assert_names
from tripod_bringup import screen as screen_module
from tripod_bringup.log_lines import Level, LogLine, parse
from tripod_bringup.screen import PLAIN_PERIOD, Screen, is_terminal
from tripod_bringup.status_line import CONTROL, ChainStatus, status_line
from tripod_graph.mode import Mode


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
        (
            "recorded /data/a 7 messages, 0 lost",
            LogLine(
                Level.ERROR, "recorded /data/a 7 messages, 0 lost", "recorded", "/data/a 7 messages, 0 lost"
            ),
        ),
        (
            "[ERROR] [1.5] [record]: the recording ended: /data/a: no room",
            LogLine(Level.ERROR, "the recording ended: /data/a: no room", "recorded", "/data/a: no room"),
        ),
    ],
)
def test_a_line_is_understood(line: str, expected: LogLine) -> None:
    assert parse(line) == expected


def test_the_status_line_tells_mode_speed_error_state_and_packets() -> None:
    status = ChainStatus("IK", "RUNNING", 0.998, 0.62e-3, "TRACKING", 0.05e-3, "ACTIVE", 1234, "ik: slow")
    mode, sim, ik, robot, note = status_line(status).split(" | ")
    assert mode == CONTROL["IK"]
    assert_names(sim, "sim running", "1.00x", "step 0.62 ms")
    assert_names(ik, "ik tracking", "0.05 mm")
    assert_names(robot, "robot active", "1234 packets")
    assert note == "ik: slow"


@pytest.mark.parametrize("mode", list(Mode))
def test_every_control_mode_is_said_in_words(mode: Mode) -> None:
    assert status_line(ChainStatus(mode.name)).startswith(CONTROL[mode.name] + " | ")


def test_what_is_not_known_is_a_dash() -> None:
    columns = status_line(ChainStatus()).split(" | ")
    assert [column.split()[0] for column in columns] == ["control", "sim", "ik", "robot"]
    assert [column.count("-") for column in columns] == [1, 3, 1, 1]


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


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The clock of the screen: it stands still unless the test sets its `now` [s]."""
    clock = SimpleNamespace(now=100.0)
    clock.monotonic = lambda: clock.now
    monkeypatch.setattr(screen_module, "time", clock)
    return clock


def test_elsewhere_the_status_is_a_line_now_and_then(clock: SimpleNamespace) -> None:
    stream = io.StringIO()
    screen = Screen(stream, terminal=False)
    for _ in range(100):
        screen.status("one")
        clock.now += 0.9 * PLAIN_PERIOD / 100
    screen.line("news")
    clock.now += 0.2 * PLAIN_PERIOD
    screen.status("two")
    screen.close()
    assert stream.getvalue() == "one\nnews\ntwo\n"


def test_a_status_that_is_not_shown_is_not_asked_for(clock: SimpleNamespace) -> None:
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
