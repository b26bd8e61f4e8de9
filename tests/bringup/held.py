"""A terminal that another program has open."""

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator

HOLD = "import os, sys; os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY); print(flush=True); sys.stdin.read()"


@contextlib.contextmanager
def held_terminal() -> Iterator[tuple[str, int]]:
    """Give the path of a pseudo-terminal and the process that has it open."""
    near, far = os.openpty()
    name = os.ttyname(far)
    command = [sys.executable, "-c", HOLD, name]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        holder.stdout.readline()
        yield name, holder.pid
        holder.kill()
    os.close(near)
    os.close(far)
