"""ROS domains for tests: each its own, however many tests run on this machine at once."""

import fcntl
import itertools
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

DOMAINS = range(1, 102)
"""0 is where users are; above 101 the ports of DDS are among those that Linux gives away by itself."""

_turn = itertools.islice(itertools.cycle(DOMAINS), os.getpid() % len(DOMAINS), None)
_held: set[int] = set()


@cache
def _locks() -> int:
    """Return the open file whose byte n is locked by the process that has domain n; it ends with the process."""
    path = Path(tempfile.gettempdir()) / f"tripod-tests-{os.getuid()}.domains"
    return os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)


@contextmanager
def own_domain() -> Iterator[int]:
    """Hold a ROS domain that no other test on this machine has meanwhile.

    This process takes them in turn: what a test leaves behind meets none of the hundred that follow.
    """
    for domain in itertools.islice(_turn, len(DOMAINS)):
        if domain in _held:  # locks are of a process: it would get this one again
            continue
        try:
            fcntl.lockf(_locks(), fcntl.LOCK_EX | fcntl.LOCK_NB, 1, domain)
        except OSError:
            continue
        break
    else:
        raise RuntimeError(f"tests have all ROS domains from {DOMAINS[0]} to {DOMAINS[-1]}")
    _held.add(domain)
    try:
        yield domain
    finally:
        _held.discard(domain)
        fcntl.lockf(_locks(), fcntl.LOCK_UN, 1, domain)
