"""Run the tests: `python -m tools.run_tests [pytest arguments]`.

Without arguments, and with two processors or more, by two at once, each of which takes the next file of tests that the
other has not taken. One begins with the tests of the simulator, which compute, the other with the rest, most of which
start processes and wait for them. Processes and real clocks fail on a machine that is too busy for them: what failed
runs once more when both have ended, is named, and counts if it fails again.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tools.shared_tests import TAKEN

ROOT = Path(__file__).parents[1]
COMPUTING = ["tests/sim"]
OTHERS = [
    f"tests/{path.name}" for path in sorted((ROOT / "tests").iterdir()) if path.name != "sim" and (
        next(path.glob("test_*.py"), None) or path.match("test_*.py")
    )
]  # fmt: skip
ORDERS = ([*COMPUTING, *OTHERS], [*OTHERS, *COMPUTING])
INTERRUPTED = 130
FAILED = 1
"""What pytest returns if tests failed, and nothing worse happened."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run pytest, once or two that share all tests; return its exit code, or that of one that failed."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words or len(os.sched_getaffinity(0)) < 2:
        return run_shared([words])
    return run_shared(ORDERS)


def run_shared(orders: Sequence[Sequence[str]], directory: Path = ROOT) -> int:
    """Run a pytest with each of `orders` at once; show what the first prints as it comes, the others' when they end.

    What is in several is run by the first that comes to it. Where there are several, run what failed once more. Return
    the exit code of the first that failed, 0 if none did.
    """
    running: list[subprocess.Popen[bytes]] = []
    with tempfile.TemporaryDirectory() as kept:
        said = [Path(kept) / f"{i}.log" for i in range(1, len(orders))]
        caches = [Path(kept) / f"{i}.cache" for i in range(len(orders))]
        environment = environment_of(Path(kept))
        try:
            for words, log, cache in zip(orders, [None, *said], caches, strict=True):
                command = pytest_command(words, cache)
                shared = (
                    {**environment, TAKEN: _made(Path(kept) / "taken")} if len(orders) > 1 else environment
                )
                if log is None:
                    running.append(subprocess.Popen(command, cwd=directory, env=shared))
                    continue
                with log.open("wb") as file:
                    started = subprocess.Popen(
                        command, cwd=directory, env=shared, stdout=file, stderr=subprocess.STDOUT
                    )
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
            for words, log in zip(orders[1:], said, strict=True):
                if log.exists():
                    print(f"\npytest {' '.join(words)}", flush=True)
                    print(log.read_text(errors="replace"), end="", flush=True)
        if len(orders) > 1 and INTERRUPTED not in codes:
            codes = [
                run_failed(words, cache, directory, environment) if code == FAILED else code
                for code, words, cache in zip(codes, orders, caches, strict=True)
            ]
    return next((code for code in codes if code), 0)


def environment_of(kept: Path) -> dict[str, str]:
    """Return the environment of the tests, in which what Python compiles is kept while they run.

    They start some hundreds of processes: where `PYTHONDONTWRITEBYTECODE` is set, each would compile all that it
    imports.
    """
    environment = dict(os.environ)
    if environment.pop("PYTHONDONTWRITEBYTECODE", "") and "PYTHONPYCACHEPREFIX" not in environment:
        environment["PYTHONPYCACHEPREFIX"] = _made(kept / "bytecode")
    return environment


def pytest_command(words: Sequence[str], cache: Path) -> list[str]:
    """Return the command of a pytest that keeps what failed in the directory `cache`."""
    return [sys.executable, "-m", "pytest", "-o", f"cache_dir={cache}", *words]


def run_failed(words: Sequence[str], cache: Path, directory: Path, environment: dict[str, str]) -> int:
    """Run the tests again that failed by the directory `cache`, alone; return the exit code."""
    failed = json.loads((cache / "v" / "cache" / "lastfailed").read_text())
    print("\nfailed beside the other tests, once more without them:", *failed, sep="\n  ", flush=True)
    command = [*pytest_command(words, cache), "--last-failed", "--last-failed-no-failures=none"]
    return subprocess.call(command, cwd=directory, env=environment)


def _made(directory: Path) -> str:
    directory.mkdir(exist_ok=True)
    return str(directory)


if __name__ == "__main__":
    sys.exit(main())
