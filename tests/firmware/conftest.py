"""A board that runs the firmware under simavr."""

from collections.abc import Callable, Iterator

import pytest

from tests.firmware import build
from tests.firmware.simulated_board import SimulatedBoard
from tests.firmware.terminal_board import TerminalBoard


@pytest.fixture
def make_board() -> Iterator[Callable[..., SimulatedBoard]]:
    """Return a function that switches on a board whose firmware is built with the given parameters."""
    boards = []

    def make(*, baudrate: int = 115200, **parameters: int) -> SimulatedBoard:
        build.need("make", "cc", *build.AVR, *build.SIMULATOR)
        library, elf = build.simulator(), build.firmware(**parameters)
        boards.append(SimulatedBoard(library, elf, baudrate=baudrate))
        return boards[-1]

    yield make
    for board in boards:
        board.close()


@pytest.fixture
def board(make_board: Callable[..., SimulatedBoard]) -> SimulatedBoard:
    """A board with the default parameters, 10 ms after power came."""
    board = make_board()
    board.run(0.010)
    return board


@pytest.fixture
def free_board(make_board: Callable[..., SimulatedBoard]) -> SimulatedBoard:
    """A board that lets a pulse differ from the one before it by any amount."""
    board = make_board(SLEW=20000)
    board.run(0.010)
    return board


@pytest.fixture
def terminal(board: SimulatedBoard) -> Iterator[TerminalBoard]:
    """The same board at the far end of a pseudo-terminal."""
    terminal = TerminalBoard(board)
    yield terminal
    terminal.close()
