"""Tiers 1 and 2: what is no host moves nothing, before the first sound frame as well as after it."""

import random

import pytest

from tests.firmware.session import PERIOD, rows
from tests.firmware.test_native_protocol import NativeProtocol
from tripod_driver.framed import BoardState
from tripod_driver.protocol import LegacyProtocol

NOISES = {
    "uniform": lambda rng: rng.randbytes(40),
    "half of it 255": lambda rng: bytes(rng.choice([255, rng.randrange(256)]) for _ in range(40)),
    "angles and 255": lambda rng: bytes(
        rng.choice([255, 255, *rng.choices(range(181), k=5)]) for _ in range(40)
    ),
    "packets that do not agree": lambda rng: (
        b"".join(bytes([255, *(rng.randrange(181) for _ in range(3))]) for _ in range(2)) + b"\x07"
    ),
    "one packet": lambda rng: bytes([255, 90, 90, 90, rng.randrange(255)]),
    "text": lambda rng: bytes(rng.randrange(32, 127) for _ in range(40)),
}


@pytest.fixture(scope="module")
def native():
    native = NativeProtocol()
    yield native
    assert native.close() == 0


def test_of_a_thousand_windows_of_random_bytes_none_begins_a_pulse(native: NativeProtocol) -> None:
    """With silence between them and without: the only bytes on the line of a board that was just reset."""
    rng = random.Random(1)
    for _ in range(1000):
        native.begin()
        for _ in range(5):
            native.receive(rng.randbytes(1000))
            native.tick(rng.choice([0, 1, 10]))
        assert native.state is BoardState.IDLE


@pytest.mark.parametrize("kind", NOISES)
def test_noise_of_every_kind_begins_no_pulse_and_does_not_keep_a_host_out(native, kind: str) -> None:
    rng = random.Random(2)
    for _ in range(300):
        native.begin()
        for _ in range(30):
            native.receive(NOISES[kind](rng))
            native.tick(rng.choice([0, 1, 5]))
            assert native.state is BoardState.IDLE
        for angle in (-0.5, -0.55, -0.6):
            assert not native.emits
            native.tick(10)
            native.receive(LegacyProtocol().encode([angle] * 3))
        assert native.state is BoardState.ACTIVE


@pytest.mark.slow
def test_seventy_five_windows_of_noise_on_the_line_make_no_pulse(make_board) -> None:
    for seed in range(75):
        board, rng = make_board(), random.Random(seed)
        board.run(0.010)
        for _ in range(20):
            board.write(rng.randbytes(rng.randrange(60)))
            board.run(rng.uniform(0.0, 0.02))
        board.run(0.1)
        assert board.pulses() == []
        for _ in range(3):
            board.write(bytes([255, 150, 150, 150]))
            board.run(PERIOD)
        board.run(2 * PERIOD)
        assert len(rows(board.pulses()[:3])) == 1
        board.close()
