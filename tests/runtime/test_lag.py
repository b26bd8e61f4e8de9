"""What is said of steps that are slower than real time, and which setting is proposed; nothing is changed."""

import json
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.messages import assert_names, names
from tripod_runtime.lag import FULL, LASTING, LONGEST_HINT, QUIET, LagMonitor, Proposal, proposal
from tripod_runtime.realtime import Speed
from tripod_study.accuracy.choice import choose

DEAR = {"mesh.element": "h20", "mesh.level": 1, "inertia.scheme": "tr_bdf2", "dt": 0.002}
CHEAP = {"mesh.element": "h8_modes", "mesh.level": 1, "inertia.scheme": "bdf2", "dt": 0.005}
SET = ("mesh.level=1",)
"""Of the scene tripod: with it, it is the dearer setting."""

DEADLINE = 60.0
"""For a loaded machine [s]; nothing here waits so long unless it fails."""


def speed_of_the_study() -> float:
    return 0.03


@pytest.fixture
def study(tmp_path: Path) -> Callable[..., Path]:
    """Write a study of the two settings, whose CPU times are given [s]."""

    def write(dear: float = 0.9, cheap: float = 0.2, error: float = 0.02) -> Path:
        points = [
            {"settings": s, "status": "ok", "error": error, "bound": error, "cpu": cpu}
            for s, error, cpu in ((DEAR, 0.01, dear), (CHEAP, error, cheap))
        ]
        made = {
            "format": 1, "study": "two", "scene": "tripod", "base": {}, "cpu": "s per simulated second",
            "machine": {"calibration": 0.03}, "quantities": [{"what": "how far the effector has moved"}],
            "points": points,
        }  # fmt: skip
        path = tmp_path / "two.json"
        path.write_text(json.dumps(made))
        return path

    return write


def test_the_setting_that_real_time_takes_is_proposed_with_what_is_lost(study: Callable[..., Path]) -> None:
    told = proposal("tripod", SET, study=study(), speed=speed_of_the_study).words
    assert_names(
        told, "--accuracy real-time", "page", "mesh.element=h8_modes", "inertia.scheme=bdf2", "dt=0.005"
    )
    assert_names(told, "about 2 %", "instead of 1 %", "measured")
    assert not names(told, "mesh.level=1"), "which stays"
    told = proposal("tripod", SET, study=study(error=0.0101), speed=speed_of_the_study).words
    assert names(told, "about 1 %") and not names(told, "instead of")
    taken = choose("tripod", "real-time", study=study(), speed=speed_of_the_study)
    assert taken.settings == CHEAP, "and that is what the option takes"


def test_what_the_setting_takes_the_place_of_is_named(study: Callable[..., Path]) -> None:
    """`--accuracy` gives way to `--set`: who set it must leave it out."""
    told = proposal(
        "tripod", ("dt=0.001", *SET, "material.young=1e5"), study=study(), speed=speed_of_the_study
    ).words
    assert_names(told, "dt=0.005", "in place of dt=0.001")
    assert not names(told, "material.young=1e5"), "which goes with it"
    assert_names(told, "error not known")


@pytest.mark.parametrize(
    ("source", "words", "cpu", "named"),
    [
        # too slow at its cheapest; in real time already, by the study; no study; a study of statics
        ("tripod", SET, (9.0, 1.2), ("no setting", "0.5 s", "1.2 s", "mesh.element=h8_modes")),
        ("tripod", SET, (0.3, 0.2), ("study two", "no cheaper setting")),
        (
            "tripod_sofa",
            ("mesh.level=1",),
            None,
            ("no accuracy study", "'tripod_sofa'", "tripod study tripod_sofa"),
        ),
        ("tripod", ("inertia=off", "damping=off"), None, ("at rest", "'tripod_static'", "--budget")),
    ],
)
def test_where_there_is_none_it_says_why(
    source: str, words: tuple[str, ...], cpu: Any, named: tuple[str, ...], study: Callable[..., Path]
) -> None:
    told = proposal(source, words, study=study(*cpu) if cpu else None, speed=speed_of_the_study).words
    assert_names(told, *named)


class Log:
    """A monitor on a clock of the test, a second from look to look, and what it says."""

    def __init__(self, propose: Callable[[], Proposal] = lambda: Proposal("take less", "real-time")) -> None:
        self.lines: list[str] = []
        self.monitor, self.now = LagMonitor(propose, self.lines.append), 100.0

    def look(self, speed: Speed, times: int = 1) -> None:
        for _ in range(times):
            self.now += 1.0
            self.monitor.look(speed, self.now)

    def wait(self, count: int) -> None:
        deadline = time.monotonic() + DEADLINE
        while len(self.lines) < count:
            assert time.monotonic() < deadline, self.lines
            time.sleep(1e-3)


def lag(factor: float, load: float) -> Speed:
    return Speed(factor, 0.0, 0.0, 0, load, behind=factor < 0.95)


IN_TIME, BUSY, SLOW = lag(1.0, 0.4), lag(0.62, 0.4), lag(0.31, 3.2)


def test_a_setting_that_is_too_slow_is_found_in_the_first_second_and_told_once() -> None:
    log = Log()
    log.look(SLOW)
    log.wait(1)
    assert_names(log.lines[0], "factor 0.31", "3.2 s", "take less")
    log.look(SLOW, 2 * int(QUIET))
    assert len(log.lines) == 1
    assert log.monitor.words(SLOW) == log.lines[0]
    assert log.monitor.advice(SLOW) == log.monitor.proposal
    assert log.monitor.words(IN_TIME) == log.monitor.advice(IN_TIME) == ""


def test_a_setting_that_becomes_too_slow_later_is_told_then() -> None:
    """A cloth that has fallen onto a sphere takes longer than one that falls."""
    log = Log()
    log.look(IN_TIME, 10)
    assert not log.monitor.words(IN_TIME)
    log.look(SLOW)
    log.wait(1)
    assert_names(log.lines[0], "factor 0.31", "take less")


def test_a_busy_machine_is_no_fault_of_the_setting() -> None:
    asked = list[int]()
    log = Log(lambda: Proposal(str(asked.append(1))))
    log.look(BUSY, LASTING - 1)
    assert not log.lines, "it may be over soon"
    log.look(BUSY)
    (line,) = log.lines
    assert_names(line, "factor 0.62", "machine", "busy")
    for seconds, count in ((10, 1), (int(QUIET), 2)):  # it comes and goes
        log.look(IN_TIME, seconds)
        log.look(BUSY, LASTING + 1)
        assert len(log.lines) == count
    assert not asked
    assert not log.monitor.proposal


@pytest.mark.parametrize(("load", "own"), [(FULL - 0.01, False), (FULL, True)])
def test_the_setting_is_the_cause_where_it_takes_nearly_a_core(load: float, own: bool) -> None:
    log = Log()
    log.look(lag(0.9, load))
    if own:
        log.wait(1)
    assert bool(log.lines) == own


def test_a_load_near_the_limit_does_not_turn_the_advice_to_and_fro() -> None:
    log = Log()
    log.look(lag(0.9, FULL))
    log.wait(1)
    assert log.monitor.advice(lag(0.9, FULL - 0.1)) == log.monitor.proposal
    assert_names(log.monitor.advice(lag(0.62, 0.4)), "machine", "busy")
    both = log.monitor.advice(lag(0.06, 1.5))
    assert both.startswith(log.monitor.proposal)
    assert_names(both, "machine", "busy")


@pytest.mark.parametrize("option", ["real-time", "draft", ""])
def test_a_page_is_told_in_short_what_its_user_can_do(option: str) -> None:
    log = Log(lambda: Proposal("one cheaper setting " * 20, option))
    assert log.monitor.hint(IN_TIME) == ""
    assert_names(log.monitor.hint(replace(BUSY, rate=0.8)), "0.62", "chosen 0.8 x")
    assert_names(log.monitor.hint(BUSY), "0.62", "close", "speed")
    log.look(SLOW)
    log.wait(1)
    told = log.monitor.hint(SLOW)
    assert_names(told, "0.31", "lower", "speed")
    assert names(told, f"--accuracy {option}") == bool(option)
    assert names(log.monitor.hint(BUSY), "close") and not names(log.monitor.hint(BUSY), "--accuracy")
    assert max(len(told), len(log.monitor.hint(BUSY))) <= LONGEST_HINT


def test_nothing_is_said_after_the_end() -> None:
    go_on, begun = threading.Event(), threading.Event()

    def propose() -> Proposal:
        begun.set()
        assert go_on.wait(DEADLINE)
        return Proposal("take less")

    log = Log(propose)
    log.look(SLOW)
    assert begun.wait(DEADLINE)
    assert_names(log.monitor.words(SLOW), "factor 0.31")
    assert log.monitor.advice(SLOW) == "", "it is still being looked for"
    log.monitor.close()
    go_on.set()
    log.monitor.close()
    assert not log.lines
