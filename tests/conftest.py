"""What holds for all tests."""

import atexit
import os
import re
import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import mkdtemp

import pytest
from hypothesis import settings

from tests.domains import DOMAINS, own_domain
from tripod_bringup.compiling import garbage_left
from tripod_host.program import set_environment

# As in all programs: threads of linear algebra would wait for each other at full load.
set_environment()

INSTALL = re.compile(r"(sudo apt-get install|pip install) (.+)$")
"""How the reason of a skipped test ends if a program or a package is missing."""

MOST_WORKERS = 4
"""Processes that share the tests."""

# The same examples in every run: a failure is of the code, not of the draw. No deadline: machines are shared.
for _name, _count in {"fast": 50, "thorough": 300}.items():
    settings.register_profile(_name, derandomize=True, deadline=None, database=None, max_examples=_count)
settings.load_profile("fast")

# Nodes of tests meet no others and stay on this machine. A test that starts nodes takes the fixture `domain` besides.
os.environ["ROS_DOMAIN_ID"] = str(os.getpid() % DOMAINS[-1] + 1)
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

# What a driver remembers of its boards is nobody's but the test's, also in the processes that tests start.
os.environ["XDG_STATE_HOME"] = mkdtemp(prefix="tripod_state_")
atexit.register(shutil.rmtree, os.environ["XDG_STATE_HOME"], ignore_errors=True)

# Tests start some hundreds of processes: where bytecode is not kept beside the sources, keep it elsewhere, or each of
# them would compile all that it imports.
if os.environ.pop("PYTHONDONTWRITEBYTECODE", "") and "PYTHONPYCACHEPREFIX" not in os.environ:
    sys.pycache_prefix = str(Path(__file__).parents[1] / ".pytest_cache" / "bytecode")
    sys.dont_write_bytecode = False
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix

# In the background, or under `nohup`, a shell has SIGINT or SIGHUP ignored, and so would the processes that tests start
# and send them. What is handled is not inherited.
for _number in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, lambda *_: None)


def pytest_xdist_auto_num_workers() -> int:
    """Return how many processes `-n auto` means: one more than processors, since some tests wait.

    Each needs about 1 GB.
    """
    return min(len(os.sched_getaffinity(0)) + 1, MOST_WORKERS)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say in one line how many tests were skipped for lack of a program, and which commands install what they need."""
    packages: dict[str, set[str]] = {}
    count = 0
    for report in terminalreporter.stats.get("skipped", ()):
        if found := INSTALL.search(report.longrepr[2]):
            count += 1
            packages.setdefault(found[1], set()).update(found[2].split())
    commands = [" ".join([command, *sorted(names)]) for command, names in sorted(packages.items())]
    if count:
        terminalreporter.write_line(
            f"skipped for lack of a program: {count} tests; to run them: {'; '.join(commands)}"
        )


@pytest.fixture(scope="session", autouse=True)
def _garbage_left() -> Iterator[None]:
    """Tests compile much."""
    with garbage_left():
        yield


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS domain of the test's own, on this machine only; it is in the environment too."""
    with own_domain() as number:
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
        yield number
