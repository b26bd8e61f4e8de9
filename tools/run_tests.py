"""Run the tests: `python -m tools.run_tests [pytest arguments]`.

Without arguments, and with two processors or more, in two halves at once: the tests of the simulator compute, the
others mostly start processes and wait for them. Processes and real clocks fail on a machine that is too busy for them:
what failed runs once more when both halves have ended, is named, and counts if it fails again.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
HALVES = (("tests/sim",), ("tests", "--ignore=tests/sim"))
INTERRUPTED = 130
FAILED = 1
"""What pytest returns if tests failed, and nothing worse happened."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run pytest, once or in halves; return its exit code, or that of a half that failed."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words or len(os.sched_getaffinity(0)) < 2:
        return run_halves([words])
    return run_halves(HALVES)


def run_halves(halves: Sequence[Sequence[str]], directory: Path = ROOT) -> int:
    """Run a pytest for each of the halves at once; show what the first prints as it comes, the others' when they end.

    Where there are several, run what failed once more. Return the exit code of the first that failed, 0 if none did.
    """
    running: list[subprocess.Popen[bytes]] = []
    with tempfile.TemporaryDirectory() as kept:
        said = [Path(kept) / f"{i}.log" for i in range(1, len(halves))]
        caches = [Path(kept) / f"{i}.cache" for i in range(len(halves))]
        try:
            for words, log, cache in zip(halves, [None, *said], caches, strict=True):
                command = pytest_command(words, cache)
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
        if len(halves) > 1 and INTERRUPTED not in codes:
            codes = [
                run_failed(words, cache, directory) if code == FAILED else code
                for code, words, cache in zip(codes, halves, caches, strict=True)
            ]
    return next((code for code in codes if code), 0)


def pytest_command(words: Sequence[str], cache: Path) -> list[str]:
    """Return the command of a pytest that keeps what failed in the directory `cache`."""
    return [sys.executable, "-m", "pytest", "-o", f"cache_dir={cache}", *words]


def run_failed(words: Sequence[str], cache: Path, directory: Path) -> int:
    """Run the tests again that failed by the directory `cache`, alone; return the exit code."""
    failed = json.loads((cache / "v" / "cache" / "lastfailed").read_text())
    print("\nfailed beside the other half, once more without it:", *failed, sep="\n  ", flush=True)
    command = [*pytest_command(words, cache), "--last-failed", "--last-failed-no-failures=none"]
    return subprocess.call(command, cwd=directory)


if __name__ == "__main__":
    sys.exit(main())
