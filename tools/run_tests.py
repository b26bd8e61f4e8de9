"""Run the tests: `python -m tools.run_tests [pytest arguments]`.

Without arguments, and with two processors or more, in two halves at once: the tests of the simulator compute, the
others mostly start processes and wait for them.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
HALVES = (("tests/sim",), ("tests", "--ignore=tests/sim"))
INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run pytest, once or in halves; return its exit code, or that of a half that failed."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words or len(os.sched_getaffinity(0)) < 2:
        return run_halves([words])
    return run_halves(HALVES)


def run_halves(halves: Sequence[Sequence[str]], directory: Path = ROOT) -> int:
    """Run a pytest for each of the halves at once; show what the first prints as it comes, the others' when they end.

    Return the exit code of the first that failed, 0 if none did.
    """
    running: list[subprocess.Popen[bytes]] = []
    with tempfile.TemporaryDirectory() as kept:
        said = [Path(kept) / f"{i}.log" for i in range(1, len(halves))]
        try:
            for words, log in zip(halves, [None, *said], strict=True):
                command = [sys.executable, "-m", "pytest", *words]
                if log is None:
                    running.append(subprocess.Popen(command, cwd=directory))
                    continue
                with log.open("wb") as file:
                    started = subprocess.Popen(command, cwd=directory, stdout=file, stderr=subprocess.STDOUT)
                running.append(started)
            codes = [running[0].wait()]
            if any(process.poll() is None for process in running):
                print("waiting for the other tests", flush=True)
            codes += [process.wait() for process in running[1:]]
        except KeyboardInterrupt:  # the terminal has told them, too
            codes = [INTERRUPTED, *(process.wait() for process in running)]
        finally:
            for process in running:
                if process.poll() is None:
                    process.terminate()
            for words, log in zip(halves[1:], said, strict=True):
                if log.exists():
                    print(f"\npytest {' '.join(words)}", flush=True)
                    print(log.read_text(errors="replace"), end="", flush=True)
    return next((code for code in codes if code), 0)


if __name__ == "__main__":
    sys.exit(main())
