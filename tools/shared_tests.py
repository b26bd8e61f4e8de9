"""What lets several pytests share the same tests: each runs the files of tests that it is the first to take.

`TRIPOD_TAKEN` names the directory where they are taken: a file for each. What another has taken is not even imported.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

TAKEN = "TRIPOD_TAKEN"
SHARED = pytest.StashKey[tuple[Path, list[pytest.Collector]]]()
"""Where files of tests are taken, and which there are, in the order of this process."""


def pytest_collection(session: pytest.Session) -> None:
    """Hook of pytest: where files are shared, leave what is in them for when they are taken."""
    taken = os.environ.pop(TAKEN, None)  # not for a pytest that a test starts
    if taken and not session.config.option.collectonly:
        files = session.perform_collect(genitems=False)
        session.stash[SHARED] = (Path(taken), [node for node in files if isinstance(node, pytest.Collector)])
        session.config.args = []  # no more is to be collected now


def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """Hook of pytest: run what this process takes; without the directory, leave all to pytest."""
    if SHARED not in session.stash:
        return None
    mine, count = _mine(session, *session.stash[SHARED]), 0
    item = next(mine, None)
    while item:
        count += 1
        following = next(mine, None)  # fixtures that it needs as well are kept for it
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        if session.shouldfail:
            raise session.Failed(session.shouldfail)
        if session.shouldstop:
            raise session.Interrupted(session.shouldstop)
        item = following
    session.testscollected = max(count, 1)  # it is no fault that the others had taken all
    return True


def _mine(session: pytest.Session, taken: Path, files: list[pytest.Collector]) -> Iterator[pytest.Item]:
    """Yield the tests, file by file in their order, of the files that nobody else has taken."""
    for file in files:
        try:
            (taken / file.nodeid.replace("/", "+")).touch(exist_ok=False)
        except FileExistsError:
            continue
        items = list(session.genitems(file))  # now it is imported
        session.config.hook.pytest_collection_modifyitems(session=session, config=session.config, items=items)
        yield from items
