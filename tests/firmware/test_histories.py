"""Nothing jumps: the short version of benchmarks/histories.py, and what its measure sees."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.firmware import build
from tests.firmware.histories import SLEW_STEP, Result, World, allowed, play
from tests.firmware.simulated_board import SimulatedBoard
from tripod_graph.mode import Mode


@pytest.fixture
def switched_on(tmp_path: Path):
    """Return a function that switches on a board for a protocol."""
    boards = []

    def switch_on(protocol: str) -> SimulatedBoard:
        build.need("make", "cc", *build.AVR, *build.SIMULATOR)
        elf = build.firmware() if protocol == "framed" else build.workshop()
        boards.append(SimulatedBoard(build.simulator(), elf))
        return boards[-1]

    yield switch_on
    for board in boards:
        board.close()


def failing(
    switched_on, protocol: str, folder: Path, seeds, *, hidden: bool, resets: bool = True
) -> dict[int, Result]:
    found = {}
    for seed in seeds:
        board = switched_on(protocol)
        result = play(board, protocol, folder / str(seed), seed, hidden=hidden, resets=resets)
        assert result.pulses > 50
        if result.step > allowed(protocol):
            found[seed] = result
    return found


def halves(seeds: Sequence[int]) -> list[object]:
    """Return the first seeds, for `make test`, and the others, for `make test-slow`."""
    return [seeds[:8], pytest.param(seeds[8:], marks=pytest.mark.slow)]


FAILED_FRAMED = (*range(21), 42, 64, 197)
"""The first of them failed before ramps began at the place of the servos, the last ones on the way there."""

FAILED_LEGACY = range(24)
"""The first six were seen to fail, at the first connect, before the driver knew where that firmware puts the servos."""


@pytest.mark.parametrize("seeds", halves(FAILED_FRAMED), ids=["first", "rest"])
def test_in_random_histories_no_pulse_of_the_projects_firmware_jumps(switched_on, tmp_path, seeds) -> None:
    assert failing(switched_on, "framed", tmp_path, seeds, hidden=True) == {}


@pytest.mark.parametrize("seeds", halves(FAILED_LEGACY), ids=["first", "rest"])
def test_in_random_histories_no_pulse_of_the_workshops_firmware_jumps(switched_on, tmp_path, seeds) -> None:
    assert failing(switched_on, "legacy", tmp_path, seeds, hidden=False) == {}


@pytest.mark.parametrize("seeds", halves(FAILED_LEGACY), ids=["first", "rest"])
def test_no_pulse_of_the_workshops_firmware_jumps_where_opening_the_port_resets_nothing(
    switched_on, tmp_path, seeds
) -> None:
    assert failing(switched_on, "legacy", tmp_path, seeds, hidden=False, resets=False) == {}


def test_the_measure_sees_a_jump(switched_on, tmp_path) -> None:
    """A driver that forgets where it left the servos is found out when the board has lost its power."""
    world = World(switched_on("framed"), "framed", tmp_path, 1, hidden=True)
    world.recognised = False
    world.start()
    world.run(1.0)
    world.mode(Mode.TELEOP)
    world.send([-1.5, -1.5, -1.5], 0.5)
    world.run(1.5)
    world.kill()
    world.reset(told=True, power=True)
    world.start()
    world.run(2.0)
    world.mode(Mode.TELEOP)
    world.send([-1.5, -1.5, -1.5], 0.5)
    world.run(1.0)
    assert world.judged().step > 3 * SLEW_STEP


def test_the_workshops_boards_attach_at_1500_us_and_make_the_librarys_pulses(switched_on) -> None:
    board = switched_on("legacy")
    board.run(0.1)
    started = board.pulses()
    assert len(started) >= 12
    assert all(abs(pulse.width - 1500) < 6 for pulse in started)
    board.write(bytes([1, 2, 255, 60, 93, 200]))  # what is before a 255 means nothing, beyond 180 is 180
    board.run(0.1)
    last = board.pulses()[-3:]
    assert [round(p.width) for p in sorted(last, key=lambda p: p.servo)] == pytest.approx(
        [1162, 1502, 2400], abs=6
    )
    board.write(bytes([255, 90, 255]))  # it waits for the rest, and takes a 255 for an angle
    board.run(0.1)
    assert [round(p.width) for p in board.pulses()[-3:]] == [round(p.width) for p in last]
    board.write(bytes([0]))
    board.run(0.1)
    last = sorted(board.pulses()[-3:], key=lambda p: p.servo)
    assert [round(p.width) for p in last] == pytest.approx([1472, 2400, 544], abs=6)
