"""Where the servos are of a board that says nothing: known only if opening its port has reset it."""

from pathlib import Path

import numpy as np
import pytest

from tests.decisions import said
from tests.driver.bench import START, TICK, Bench
from tests.messages import assert_names
from tripod_driver.memory import Memory
from tripod_driver.ports.mock import Fault, MockPort
from tripod_driver.protocol import WORKSHOP, AngleMapping, LegacyProtocol
from tripod_driver.safety import CREEP
from tripod_graph.mode import Mode

BOARD = "2341:0043:85430353531351B0B1A2"
POSE = (-1.0, -0.8, -0.6)
BETWEEN_PACKETS = 4 * TICK
"""Least time between two changes of a bench [s]."""


class NamedPort(MockPort):
    identity = BOARD


def driven(folder: Path, protocol: str = "legacy", *, resets: bool = False) -> Bench:
    """Return a driver as a new process would be, with the files of those before it, and an operator in charge."""
    bench = Bench(protocol=protocol, known=False, resets=resets, memory=Memory(folder))
    bench.port.__class__ = NamedPort
    bench.safety.control_mode(said(Mode.TELEOP, 1.0), 1.0, bench.clock.now)
    return bench.run(0.1)


def moved(bench: Bench) -> Bench:
    """Let it go to POSE, however slowly."""
    for _ in range(300):
        bench.goto(*POSE)
        bench.run(0.05)
        if bench.safety.place_known and np.allclose(bench.sent[-1][1], POSE, atol=0.01):
            return bench
    raise AssertionError(bench.sent[-1])


def speeds(bench: Bench) -> np.ndarray:
    """Return the steps from packet to packet over the least time between them [rad/s], shape (n, 3)."""
    return np.abs(np.diff([angles for _, angles in bench.sent], axis=0)) / BETWEEN_PACKETS


@pytest.mark.parametrize("protocol", WORKSHOP)
def test_after_kill_9_on_a_port_that_resets_nothing_it_begins_at_the_last_packet_and_creeps(
    tmp_path: Path, protocol: str
) -> None:
    first = moved(driven(tmp_path, protocol))
    second = driven(tmp_path, protocol)  # the first is dropped in the midst of it
    assert not second.safety.place_known
    assert_names(second.driver.message, "unknown", "servos", "20 degrees")
    assert second.sent == []
    second.run(1.0, lambda: second.goto(-0.2, -0.2, -0.2))
    assert second.sent[0][1] == first.sent[-1][1]
    assert 0.8 * CREEP < np.ptp([angles[0] for _, angles in second.sent]) < 1.1 * CREEP
    degree = np.radians(1.0)  # packets are of whole degrees
    assert speeds(second).max() * BETWEEN_PACKETS <= CREEP * BETWEEN_PACKETS + degree + 1e-9
    assert not second.safety.place_known
    second.run(4.0, lambda: second.goto(-0.2, -0.2, -0.2))
    assert (second.safety.place_known, second.driver.message) == (True, "")
    second.goto(*POSE)
    second.run(0.2)
    assert np.ptp([angles[0] for _, angles in second.sent[-8:]]) > 2 * CREEP * 0.15


def test_a_board_that_opening_resets_is_where_its_firmware_starts(tmp_path: Path) -> None:
    moved(driven(tmp_path, resets=True))
    again = driven(tmp_path, resets=True)
    assert again.safety.place_known
    assert again.safety.place == START
    again.goto(*POSE)
    again.run(0.5)
    assert speeds(again).max() > 2 * CREEP


def test_a_board_that_nobody_remembers_is_guessed_where_its_firmware_starts(tmp_path: Path) -> None:
    bench = driven(tmp_path)
    assert not bench.safety.place_known
    assert bench.safety.place == START


def test_a_port_that_is_lost_and_resets_nothing_leaves_the_place_unknown(tmp_path: Path) -> None:
    bench = moved(driven(tmp_path))
    last = bench.sent[-1][1]
    bench.port.fault = Fault.UNPLUGGED
    bench.run(0.1)
    bench.port.fault = None
    bench.run(1.0)
    assert not bench.safety.place_known
    bench.goto(*START)
    bench.run(0.1)
    assert bench.sent[-1][1] == pytest.approx(last, abs=np.radians(3.0))


def test_what_a_silent_board_was_sent_is_only_a_guess_for_one_that_acknowledges(tmp_path: Path) -> None:
    """It was driven by `framed`, then by `legacy`, and has lost its power: the older packet is no longer true."""
    moved(driven(tmp_path, "framed"))
    legacy = driven(tmp_path)
    legacy.goto(-0.2, -0.2, -0.2)
    last = legacy.run(0.4).sent[-1][1]
    framed = driven(tmp_path, "framed")
    assert not framed.safety.place_known
    assert framed.safety.place == pytest.approx(last, abs=1e-3)


@pytest.mark.parametrize("mapping", AngleMapping)
def test_each_packet_is_remembered_as_pulses_that_become_the_same_packet(mapping: AngleMapping) -> None:
    session = Bench(protocol="legacy").link.session
    session._protocol = LegacyProtocol(mapping)
    for degrees in range(60, 181):
        content = (degrees,) * 3
        assert session.content(session.angles_of_pulses(session.pulses(content))) == content
