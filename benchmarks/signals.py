"""Interrupts the commands of `tripod` at many instants, from the first millisecond on, and counts how they end.

    python benchmarks/signals.py [--instants 25] [--up 4]

Each command is started as people start it and gets one signal after a delay. It ends well if it says nothing but its
own lines (no traceback), with exit code 0, or by the signal, or with 128 and its number, which is what a shell shows;
and if no process of it is left. Delays are wall time, the verdict is not: a busy machine only shifts the instants.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

TRIPOD = Path(sys.executable).with_name("tripod")

QUICK: dict[str, tuple[str, ...]] = {
    "--version": ("--version",),
    "print scene": ("print", "scene"),
    "print maze": ("print", "maze", "random:7"),
    "run": ("run", "tripod", "--duration", "20", "--out", "run.npz"),
    "run --json": ("run", "silicone", "--json"),
    "ik --target": ("ik", "--target", "0.005 0 -0.006"),
    "reach": ("reach", "--count", "3", "--out", "reach.csv"),
    "play a path": ("play", "missing.csv"),
    "play": ("play", "holes"),
    "explain": ("explain", "silicone"),
    "study": ("study", "pendulum", "--quick", "--out", "studies"),
    "doctor": ("doctor",),
    "bag info": ("bag", "info", "missing"),
}
"""Commands that end by themselves."""

NODES: dict[str, tuple[str, ...]] = {
    "sim": ("sim",),
    "ik": ("ik",),
    "driver": ("driver", "--set", "port=mock"),
    "view": ("view", "--set", "port=0"),
    "record": ("record", "--set", "directory=recordings"),
    "play --live": ("play", "--live"),
}
"""Commands that run until they are told to stop."""

OWN_CODES = (0, 1, 2)
"""Of a command that ended by itself before the signal came: `doctor` finds faults, `play` and `bag info` no file."""

WELL = "well"
GRACE = 120.0
"""Time after which a command that does not end is killed and counted [s]."""


@dataclass(frozen=True)
class Ended:
    """How an interrupted command ended: `WELL`, or what was wrong with it."""

    verdict: str
    code: int
    errors: str


def interrupted(words: Sequence[str], number: signal.Signals, delay: float, folder: Path) -> Ended:
    """Start `tripod` with `words` in `folder`, send it the signal after `delay` [s], and return how it ended."""
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(
            [TRIPOD, *words], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=errors,
            start_new_session=True,
        )  # fmt: skip
        time.sleep(delay)
        process.send_signal(number)
        try:
            code = process.wait(GRACE)
            verdict = WELL if code in (*OWN_CODES, -number, 128 + number) else f"exit code {code}"
        except subprocess.TimeoutExpired:
            verdict, code = f"did not end within {GRACE:g} s", -1
        left = _left(process.pid)
        if process.poll() is None or left:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        errors.seek(0)
        said = errors.read().decode(errors="replace")
    if "Traceback" in said or "Exception ignored" in said or "Fatal Python error" in said:
        verdict = "a traceback"
    elif left and verdict == WELL:
        verdict = "left a process behind"
    parts = [path.name for path in folder.rglob(".tripod-*.part")]
    return Ended(f"left {parts[0]}" if parts and verdict == WELL else verdict, code, said)


def _left(group: int) -> list[int]:
    """Return the processes of a session that do not end by themselves soon."""
    for _ in range(100):
        if not (left := list(_group(group))):
            break
        time.sleep(0.1)
    return left


def _group(group: int) -> Iterator[int]:
    """Yield the processes of a session that still run."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == group and fields[0] != "Z":
            yield int(stat.parent.name)


def instants(count: int, last: float) -> list[float]:
    """Return delays [s]: half of them in the first tenth of a second, evenly, the others up to `last`."""
    early = (count + 1) // 2
    return [
        *(0.1 * k / early for k in range(early)),
        *(0.1 + (last - 0.1) * (k + 1) / (count - early) for k in range(count - early)),
    ]


def main() -> int:
    """Interrupt, print the table, return 1 if a command did not end well."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--instants", type=int, default=24, help="of each command and signal")
    parser.add_argument("--up", type=int, default=8, help="instants of `tripod up`")
    parser.add_argument("--only", help="one command")
    given = parser.parse_args()
    signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # a shell's background ignores it, and so would children
    commands = [(name, words, given.instants, 2.0) for name, words in QUICK.items()]
    commands += [(name, words, given.instants, 4.0) for name, words in NODES.items()]
    commands += [("up", ("up", "--no-view", "--record", "recordings"), given.up, 20.0)]
    bad = 0
    print(f"{'command':<14}{'signal':<10}{'times':>6}{'well':>6}   else")
    for name, words, count, last in commands:
        if given.only not in (None, name):
            continue
        for number in (signal.SIGINT, signal.SIGTERM):
            found: dict[str, int] = {}
            for delay in instants(count, last):
                with tempfile.TemporaryDirectory() as folder:
                    ended = interrupted(words, number, delay, Path(folder))
                found[ended.verdict] = found.get(ended.verdict, 0) + 1
                if ended.verdict != WELL:
                    print(f"{name} {delay:.3f} s: {ended.verdict}\n{ended.errors}", file=sys.stderr)
            well = found.pop(WELL, 0)
            bad += count - well
            rest = ", ".join(f"{n} {verdict}" for verdict, n in found.items())
            print(f"{name:<14}{number.name:<10}{count:>6}{well:>6}   {rest}".rstrip(), flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
