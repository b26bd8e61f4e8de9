"""Nothing jumps: random histories of operator, driver, line and board, and the largest step of a servo's pulse in them.

Each history has eight events: modes, commands, streams of them, a clock that steps, a computer that stalls, `kill -9`,
Ctrl-C, the cable pulled and put back with and without the board's power, the USB bridge reset, the board reset or its
supply failing without the host's knowledge, a second program that writes to the port. The driver is the real one, the
board runs the real firmware, or what the workshop's boards do, under simavr, in virtual time; the limit is that of the
defaults, 4 rad/s. Needs the packages of the tests of the firmware.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.firmware import build
from tests.firmware.histories import Result, allowed, play
from tests.firmware.simulated_board import SimulatedBoard

US_PER_DEGREE = (2400 - 544) / 180


@dataclass(frozen=True)
class Row:
    """A row of the table.

    Attributes:
        name: What it is called.
        protocol: Of the driver.
        firmware: Builds that of the board.
        hidden: Whether what no driver of the workshop's firmware can know of happens too.
        resets: Whether opening the port resets the board of the workshop.
    """

    name: str
    protocol: str
    firmware: Callable[[], Path]
    hidden: bool
    resets: bool = True


ROWS = (
    Row("`framed`, this project's firmware", "framed", build.firmware, hidden=True),
    Row("`legacy`, the workshop's firmware", "legacy", build.workshop, hidden=False),
    Row("the same, with resets and writers that nobody tells of", "legacy", build.workshop, hidden=True),
    Row("`legacy`, opening the port resets nothing", "legacy", build.workshop, hidden=False, resets=False),
)


def one(row: Row, seed: int) -> Result:
    """Play history number `seed` of a row on a board of its own."""
    board = SimulatedBoard(build.simulator(), row.firmware())
    try:
        with tempfile.TemporaryDirectory() as folder:
            return play(board, row.protocol, Path(folder), seed, hidden=row.hidden, resets=row.resets)
    finally:
        board.close()


def _task(task: tuple[int, int]) -> Result:
    return one(ROWS[task[0]], task[1])


def main() -> None:
    """Print the table; exit with 1 if a history fails."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--histories", type=int, default=500, help="of each row (default: %(default)s)")
    parser.add_argument("--first", type=int, default=0, help="number of the first (default: %(default)s)")
    parser.add_argument("--processes", type=int, default=1, help="at a time (default: %(default)s)")
    options = parser.parse_args()
    build.simulator()
    seeds = range(options.first, options.first + options.histories)
    failed = 0
    print("| | histories | failed | largest step [degree] | allowed | moved [degree] | unknowable step |")
    print("|---|---|---|---|---|---|---|")
    for i, row in enumerate(ROWS):
        row.firmware()
        with get_context("fork").Pool(options.processes) as pool:
            results = pool.map(_task, [(i, seed) for seed in seeds], chunksize=4)
        limit = allowed(row.protocol)
        bad = [seed for seed, result in zip(seeds, results, strict=True) if result.step > limit]
        failed += len(bad)
        unknowable = max(result.hidden for result in results)
        figures = [max(result.step for result in results), limit, sum(result.way for result in results)]
        cells = [
            f"{figure / US_PER_DEGREE:.{digits}f}" for figure, digits in zip(figures, (2, 2, 0), strict=True)
        ]
        last = f"{unknowable / US_PER_DEGREE:.0f}" if unknowable > limit else "none"
        print(f"| {row.name} | {len(results)} | {len(bad)} | {' | '.join(cells)} | {last} |", flush=True)
        for seed in bad:
            print(f"  {seed}: {results[seed - options.first]}", file=sys.stderr)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
