"""The firmware under simavr, in virtual time: latency from command to pulse, errors of the pulses, hours of streaming.

The figures are those of a simulated ATmega328P at 16 MHz on a 115200 baud line, so they do not depend on the machine;
neither the USB bridge nor the computer is in them. `python benchmarks/firmware.py --help` lists the options. Needs the
Debian packages gcc-avr, avr-libc, libsimavr-dev and libelf-dev.
"""

import argparse
import random
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))  # the simulated board is part of the tests

from tests.firmware import build
from tests.firmware.session import PERIOD, Session
from tests.firmware.simulated_board import BOARD_PINS, SimulatedBoard
from tripod_driver.framed import Acknowledgement, SetPulses

SEED = 1


def switched_on() -> SimulatedBoard:
    """Return a board 10 ms after power came, whose pulses may change by any amount."""
    board = SimulatedBoard(build.simulator(), build.firmware(SLEW=20000))
    board.run(0.010)
    return board


def summary(name: str, values: list[float]) -> str:
    """Return a row of the table: minimum, median, 95th percentile, maximum."""
    values = sorted(values)
    columns = (values[0], values[len(values) // 2], values[int(0.95 * (len(values) - 1))], values[-1])
    return f"{name:<44}" + "".join(f"{value:9.2f}" for value in columns)


def latency(commands: int) -> None:
    """Send commands at random moments, 21 to 60 ms apart, and print when what they cause happens."""
    rng, board = random.Random(SEED), switched_on()
    session = Session(board)
    acknowledged: list[float] = []
    starts: list[list[float]] = [[], [], []]
    ends: list[list[float]] = [[], [], []]
    for i in range(commands):
        board.pulses()
        begin, width = board.now, 14000 + 2000 * (i % 2)  # each command differs from the one before
        session.send(SetPulses((width, width, width)))
        board.run(0.005)
        acknowledged += [1e3 * (at - begin) for at in board.arrivals[-1:]] if board.in_waiting else []
        session.received()
        board.run(rng.uniform(0.025, 0.055))
        pulses = board.pulses()
        for servo in range(3):
            new = [p for p in pulses if p.servo == servo and abs(p.width - width / 10) < 5]
            starts[servo].append(1e3 * (new[0].start - begin))
            ends[servo].append(1e3 * (new[0].end - begin))
    print(f"From the first byte of a command, {commands} commands [ms]     min   median     p95      max")
    print(summary("acknowledgement has arrived", acknowledged))
    for pin, values in zip(BOARD_PINS, starts, strict=True):
        print(summary(f"first new pulse of {pin} begins", values))
    for pin, values in zip(BOARD_PINS, ends, strict=True):
        print(summary(f"first new pulse of {pin} ends", values))


def errors() -> None:
    """Command every angle in steps of 0.1 degree and print how far the pulses are off."""
    board = switched_on()
    session = Session(board)
    wanted = [544 + 1856 * i / 1800 for i in range(1801)]
    for width in wanted:
        session.send(SetPulses((round(10 * width),) * 3))
        board.run(PERIOD)
    board.run(PERIOD)
    pulses = board.pulses()
    print("\nError of the pulse, 1801 angles [us]                min   median     p95      max")
    for servo, pin in enumerate(BOARD_PINS):
        widths = [p.width for p in pulses if p.servo == servo]
        print(summary(pin, [abs(a - b) for a, b in zip(widths, wanted, strict=False)]))


def stream(hours: float) -> bool:
    """Stream new commands at 50 Hz, print what came back and return whether all was acknowledged as commanded."""
    rng, board = random.Random(SEED), switched_on()
    session, frames = Session(board), round(hours * 3600 / PERIOD)
    lost = wrong = pulses = 0
    begun = time.monotonic()
    for first in range(0, frames, 50):
        sent = {}
        for _ in range(min(50, frames - first)):
            command = tuple(5 * rng.randrange(1088, 4801) for _ in range(3))
            sent[session.send(SetPulses(command))] = command
            board.run(PERIOD)
        for frame in session.received():
            command = sent.pop(frame.sequence, None)
            message = frame.message
            clean = isinstance(message, Acknowledgement) and message.dropped == 0
            wrong += not (clean and message.pulses == command)
        lost += len(sent)
        pulses += len(board.pulses())
        if sys.stderr.isatty() and first % 5000 == 0:
            print(f"\r{first / 50:.0f} of {frames / 50:.0f} s", end="", file=sys.stderr, flush=True)
    print(f"\n{frames} commands at 50 Hz, {frames * PERIOD / 3600:.3g} h of virtual time:")
    print(f"{lost} acknowledgements lost, {wrong} wrong, {pulses} pulses ({3 * frames} expected)")
    print(f"({frames * PERIOD / (time.monotonic() - begun):.0f} times as fast as real time)")
    return lost == wrong == 0


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--commands", type=int, default=1000, help="of the latency table (default: %(default)s)"
    )
    parser.add_argument(
        "--hours", type=float, default=0.02, help="of streaming, virtual (default: %(default)s)"
    )
    options = parser.parse_args()
    latency(options.commands)
    errors()
    if not stream(options.hours):
        sys.exit(1)


if __name__ == "__main__":
    main()
