"""One `tripod up` a user, ROS domain and namespace: a lock file that the kernel releases however its holder ends."""

import fcntl
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from tripod_host.locks import open_lock

HIGHEST_DOMAIN = 232
"""Above it the UDP ports of DDS would exceed 65535."""


class DomainError(ValueError):
    """ROS_DOMAIN_ID is no domain; the message says what is allowed."""


class DomainBusyError(RuntimeError):
    """Another `tripod up` runs on the domain, in the same namespace; the message names its process.

    Attributes:
        pid: Process of the holder, None if it has not written it yet.
    """

    def __init__(self, domain: int, namespace: str, pid: int | None) -> None:
        super().__init__(
            f"another `tripod up` (process {pid or 'unknown'}) runs on ROS domain {domain} in namespace "
            f"{namespace}: stop it, give this one another --namespace, or set ROS_DOMAIN_ID to another "
            "number"
        )
        self.pid = pid


def domain_id(environment: Mapping[str, str]) -> int:
    """Return the ROS domain that `environment` names, 0 if none. Raises DomainError."""
    text = environment.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not text.isdecimal() or int(text) > HIGHEST_DOMAIN:
        raise DomainError(f"ROS_DOMAIN_ID is {text!r}; allowed: a whole number from 0 to {HIGHEST_DOMAIN}")
    return int(text)


@contextmanager
def only_one(domain: int, namespace: str, directory: Path) -> Iterator[Path]:
    """Hold the lock of a full `namespace` in `domain` for this user; yields the file. Raises DomainBusyError, OSError.

    The lock belongs to the open file, not to its content: a holder that was killed leaves a file, not a lock.
    """
    machine = os.uname().nodename  # a home may be shared by several
    path = directory / f"tripod-up-{machine}-{domain}{namespace.replace('/', '-').rstrip('-')}.lock"
    handle = open_lock(path)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            text = os.pread(handle, 32, 0).decode("ascii", "replace").strip()
            raise DomainBusyError(domain, namespace, int(text) if text.isdecimal() else None) from None
        except OSError as error:  # of a file system without locks
            raise OSError(error.errno, error.strerror, str(path)) from None
        os.ftruncate(handle, 0)
        os.pwrite(handle, f"{os.getpid()}\n".encode("ascii"), 0)
        yield path
        os.ftruncate(handle, 0)
    finally:
        os.close(handle)
