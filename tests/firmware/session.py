"""A host's end of the framed protocol on a simulated board."""

from tests.firmware.simulated_board import Pulse, SimulatedBoard
from tripod_driver.framed import Decoder, Frame, Message, SetPulses, encode

PERIOD = 0.020
"""From pulse to pulse [s]."""

TOLERANCE = (1.0, 1.0, 6.0, 6.0, 6.0, 6.0)
"""Largest error of a pulse on D9, D10, D11, D5, D6, D7 [us]."""


class Session:
    """Sends messages with a sequence that counts up, and takes the replies apart.

    Attributes:
        board: The board.
        decoder: Of what the board says.
    """

    def __init__(self, board: SimulatedBoard) -> None:
        self.board, self.decoder = board, Decoder()
        self.sequence = 0

    def send(self, message: Message) -> int:
        """Send `message` without waiting; return its sequence."""
        sequence, self.sequence = self.sequence, (self.sequence + 1) % 256
        self.board.write(encode(message, sequence))
        return sequence

    def received(self) -> list[Frame]:
        """Return the frames that have come."""
        return self.decoder.feed(self.board.read(self.board.in_waiting))

    def ask(self, message: Message) -> Message:
        """Send `message` and return its answer, which must come within 10 ms."""
        sequence = self.send(message)
        self.board.run(0.010)
        frames = [frame for frame in self.received() if frame.sequence == sequence]
        assert len(frames) == 1, f"{len(frames)} answers to {message}"
        return frames[0].message

    def stream(self, commands: list[tuple[int, ...]]) -> None:
        """Send one command a period."""
        for pulses in commands:
            self.send(SetPulses(pulses))
            self.board.run(PERIOD)


def pulses_so_far(board: SimulatedBoard) -> list[Pulse]:
    """Return the pulses since the last call, once the last period begun has no more of them to come."""
    found, end = board.pulses(), board.now + PERIOD / 4
    while board.now < end or (found and board.now < found[-1].end + PERIOD / 4):
        board.run(0.001)
        found += board.pulses()
    return found


def rows(pulses: list[Pulse], servos: int = 3) -> list[tuple[float, ...]]:
    """Return the widths of the servos [us], one row a period; every period must be complete."""
    by_servo = [[p for p in pulses if p.servo == servo] for servo in range(servos)]
    assert len({len(p) for p in by_servo}) == 1, "a servo lacks pulses"
    assert sum(map(len, by_servo)) == len(pulses), "a pin without a servo has pulses"
    for together in zip(*by_servo, strict=True):
        assert max(p.start for p in together) - min(p.start for p in together) < 0.65 * PERIOD
    return [tuple(p.width for p in together) for together in zip(*by_servo, strict=True)]


def is_row_of(row: tuple[float, ...], command: tuple[int, ...]) -> bool:
    """Whether the widths [us] are those of a command [0.1 us], within the tolerance of each pin."""
    allowed = TOLERANCE[: len(command)]
    return all(abs(w - c / 10) <= t for w, c, t in zip(row, command, allowed, strict=True))
