"""ROS domains for tests: each its own, however many tests run on this machine at once.

A test leaves its domain before it kills a process there: Fast DDS 2.14 crashes now and then where a participant ends
just after one that sent to it through shared memory was killed.
"""

import fcntl
import itertools
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from tripod_host.locks import open_lock, private_directory

DOMAINS = range(1, 102)
"""0 is where users are; above 101 the ports of DDS are among those that Linux gives away by itself."""

PARTICIPANTS = 5
"""How many of a domain are looked for: who has one at all has one of the first, unless those have left."""

_turn = itertools.islice(itertools.cycle(DOMAINS), os.getpid() % len(DOMAINS), None)
_held: set[int] = set()


@cache
def _locks() -> int:
    """Return the open file whose byte n is locked by the process that has domain n; it ends with the process."""
    return open_lock(private_directory(os.environ) / "tests.domains")


@contextmanager
def own_domain() -> Iterator[int]:
    """Hold a ROS domain that no other test on this machine has meanwhile, and nobody else by now.

    This process takes them in turn: what a test leaves behind meets none of the hundred that follow.
    """
    for domain in itertools.islice(_turn, len(DOMAINS)):
        if domain in _held or not _lock(domain):  # locks are of a process: it would get its own again
            continue
        if _is_empty(domain):
            break
        _unlock(domain)
    else:
        raise RuntimeError(f"all ROS domains from {DOMAINS[0]} to {DOMAINS[-1]} are in use")
    _held.add(domain)
    try:
        yield domain
    finally:
        _held.discard(domain)
        _unlock(domain)


def _lock(domain: int) -> bool:
    try:
        fcntl.lockf(_locks(), fcntl.LOCK_EX | fcntl.LOCK_NB, 1, domain)
    except OSError:
        return False
    return True


def _unlock(domain: int) -> None:
    fcntl.lockf(_locks(), fcntl.LOCK_UN, 1, domain)


def _is_empty(domain: int) -> bool:
    """Whether none of the first participants of the domain is there: each listens to two ports (DDSI-RTPS 9.6.1.1)."""
    first = 7400 + 250 * domain + 10
    for port in range(first, first + 2 * PARTICIPANTS):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", port))
            except OSError:
                return False
    return True
