"""What lets several pytests share the same tests: each runs the files of tests that it is the first to take.

`TRIPOD_TAKEN` names the directory where they are taken: a file for each.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

TAKEN = "TRIPOD_TAKEN"


def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """Hook of pytest: run what this process takes; without the directory, leave all to pytest."""
    taken = os.environ.pop(TAKEN, None)  # not for a pytest that a test starts
    if not taken or session.testsfailed or session.config.option.collectonly:
        return None
    mine = _mine(session.items, Path(taken))
    item = next(mine, None)
    while item:
        following = next(mine, None)  # fixtures that it needs as well are kept for it
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        if session.shouldfail:
            raise session.Failed(session.shouldfail)
        if session.shouldstop:
            raise session.Interrupted(session.shouldstop)
        item = following
    return True


def _mine(items: list[pytest.Item], taken: Path) -> Iterator[pytest.Item]:
    """Yield the tests, file by file in their order, of the files that nobody else has taken."""
    files: dict[str, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.nodeid.partition("::")[0], []).append(item)
    for name, tests in files.items():
        try:
            (taken / name.replace("/", "+")).touch(exist_ok=False)
        except FileExistsError:
            continue
        yield from tests
