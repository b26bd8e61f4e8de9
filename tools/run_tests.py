"""Run the tests: `python -m tools.run_tests [pytest arguments]`.

Without arguments, and with two processors or more, by several at once, each of which takes the next file of tests that
no other has taken: one for each processor, and one more of low priority, so that no processor idles while a test waits.
One begins with the tests that start processes and wait for them, the others with those that compute, the longest first;
the one of low priority takes only files that look at no clock, the longest last. Processes and real clocks fail on a
machine that is too busy for them: what failed runs once more when all have ended, is named, and counts if it fails
again.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tools.shared_tests import TAKEN
from tripod_host.program import ENVIRONMENT

ROOT = Path(__file__).parents[1]
COMPUTING = ("tests/sim", "tests/ik", "tests/identify")
LONGEST = (
    "tests/tools/test_labs.py",
    "tests/sim/test_stability.py",
    "tests/ik/test_ik_pathfinder.py",
    "tests/identify/test_identify.py",
    "tests/sim/test_mesh_error.py",
    "tests/sim/test_contact_schemes.py",
    "tests/sim/test_pairs.py",
    "tests/sim/test_contact_scene.py",
    "tests/ik/test_ik_inverse.py",
    "tests/bringup/test_measuring.py",
    "tests/sim/test_run.py",
    "tests/identify/test_together.py",
)
"""Files that compute longest: begun last, one of them would keep all waiting."""

CLOCKS = re.compile(
    r"\b(?:import|from) (?:time|threading|subprocess|socket)\b|_graph\b|\bdomain\b|\bmake: |\(graph\b"
)
"""What a file of tests says that looks at a clock, or starts what does: processes, threads, nodes."""

IDLE = 15
"""Nice value of the pytest that takes what the others leave of the processors."""

MOST = 4
"""Processors that are made use of: each pytest needs about 1 GB."""

INTERRUPTED = 130
FAILED = 1
"""What pytest returns if tests failed, and nothing worse happened."""


@dataclass(frozen=True)
class Share:
    """What one pytest runs: its arguments, and its nice value beside the others."""

    words: Sequence[str]
    nice: int = 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run pytest, once or several that share all tests; return its exit code, or that of one that failed."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    processors = min(len(os.sched_getaffinity(0)), MOST)
    if words or processors < 2:
        return run_shared([Share(words)])
    return run_shared(shares(processors))


def shares(processors: int) -> list[Share]:
    """Return what is run on so many processors: who computes, who waits, and who takes what is left."""
    files = [str(path.relative_to(ROOT)) for path in sorted((ROOT / "tests").rglob("test_*.py"))]
    computing = [*LONGEST, *(f for f in files if f.startswith(COMPUTING) and f not in LONGEST)]
    waiting = [f for f in files if f not in computing]
    clockless = [f for f in reversed(computing) if not CLOCKS.search((ROOT / f).read_text(encoding="utf-8"))]
    return [
        *[Share([*computing, *waiting])] * (processors - 1),
        Share([*waiting, *computing]),
        Share(clockless, IDLE),
    ]


def run_shared(shares: Sequence[Share], directory: Path = ROOT) -> int:
    """Run a pytest for each share at once; show what the first prints as it comes, the others' when they end.

    What is in several is run by the first that comes to it. Where there are several, run what failed once more. Return
    the exit code of the first that failed, 0 if none did.
    """
    running: list[subprocess.Popen[bytes]] = []
    several = len(shares) > 1
    with tempfile.TemporaryDirectory() as kept:
        said = [Path(kept) / f"{i}.log" for i in range(1, len(shares))]
        caches = [Path(kept) / f"{i}.cache" for i in range(len(shares))]
        environment = environment_of(Path(kept))
        sharing = {**environment, TAKEN: _made(Path(kept) / "taken")} if several else environment
        try:
            for share, log, cache in zip(shares, [None, *said], caches, strict=True):
                command = [*_niced(share.nice), *pytest_command(share.words, cache)]
                if several:  # nobody knows what all of it is
                    command += ["-o", "console_output_style=classic"]
                if log is None:
                    running.append(subprocess.Popen(command, cwd=directory, env=sharing))
                    continue
                with log.open("wb") as file:
                    started = subprocess.Popen(
                        command, cwd=directory, env=sharing, stdout=file, stderr=subprocess.STDOUT
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
            for number, log in enumerate(said, start=2):
                if log.exists():
                    print(f"\npytest {number} of {len(shares)}", flush=True)
                    print(log.read_text(errors="replace"), end="", flush=True)
        if several and INTERRUPTED not in codes:
            codes = [
                run_failed(cache, directory, environment) if code == FAILED else code
                for code, cache in zip(codes, caches, strict=True)
            ]
    return next((code for code in codes if code), 0)


def environment_of(kept: Path) -> dict[str, str]:
    """Return the environment of the tests: that of all programs, and what Python compiles is kept while they run.

    They start some hundreds of processes: where `PYTHONDONTWRITEBYTECODE` is set, each would compile all that it
    imports. Threads of linear algebra wait for each other at full load, longest where others use the processors, too.
    """
    environment = {**ENVIRONMENT, **os.environ}
    if environment.pop("PYTHONDONTWRITEBYTECODE", "") and "PYTHONPYCACHEPREFIX" not in environment:
        environment["PYTHONPYCACHEPREFIX"] = _made(kept / "bytecode")
    return environment


def pytest_command(words: Sequence[str], cache: Path) -> list[str]:
    """Return the command of a pytest that keeps what failed in the directory `cache`."""
    return [sys.executable, "-m", "pytest", "-o", f"cache_dir={cache}", *words]


def run_failed(cache: Path, directory: Path, environment: dict[str, str]) -> int:
    """Run the tests again that failed by the directory `cache`, alone; return the exit code."""
    failed = json.loads((cache / "v" / "cache" / "lastfailed").read_text())
    print("\nfailed beside the other tests, once more without them:", *failed, sep="\n  ", flush=True)
    return subprocess.call(pytest_command(list(failed), cache), cwd=directory, env=environment)


def _niced(nice: int) -> list[str]:
    return ["nice", "-n", str(nice)] if nice else []


def _made(directory: Path) -> str:
    directory.mkdir(exist_ok=True)
    return str(directory)


if __name__ == "__main__":
    sys.exit(main())
