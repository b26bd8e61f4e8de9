"""What runs in each process of `tripod up`: `python -m tripod_bringup.child MODULE [ARGUMENT ...]`.

It ties the process to the supervisor before it becomes the node. The supervisor holds the other end of
standard input and never writes to it: when the supervisor ends, for whatever reason, the pipe closes, this
process gets SIGTERM (so that a driver parks and a recorder closes its file) and, if it is still there after
a grace period, SIGKILL.
"""

from tripod_host.stop import end_at_once

end_at_once()

import os  # noqa: E402
import runpy  # noqa: E402
import signal  # noqa: E402
import sys  # noqa: E402
import threading  # noqa: E402
import time  # noqa: E402

from tripod_host.effort import Effort  # noqa: E402
from tripod_host.program import program  # noqa: E402

GRACE = 10.0
"""Busy and idle time to stop in order after the supervisor is gone [s]; TRIPOD_GRACE in the environment sets it."""

PERIOD = 0.1
"""Between two looks at how much of it is gone [s]."""


def watch_supervisor(lifeline: int, grace: float) -> None:
    """Block until the pipe `lifeline` closes, then end this process: SIGTERM, SIGKILL after `grace` [s]."""
    while os.read(lifeline, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
    effort = Effort(os.getpid())
    while effort.busy + effort.idle < grace:
        time.sleep(PERIOD)
        effort.again()
    os.kill(os.getpid(), signal.SIGKILL)


def take_lifeline() -> int:
    """Move the pipe on standard input to a descriptor that no child inherits, and return that."""
    lifeline = os.dup(0)
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.close(null)
    return lifeline


def main() -> None:
    """Tie this process to its supervisor and run the module named on the command line as a program."""
    grace = float(os.environ.get("TRIPOD_GRACE", GRACE))
    threading.Thread(
        target=watch_supervisor, args=(take_lifeline(), grace), name="lifeline", daemon=True
    ).start()
    module = sys.argv[1]
    sys.argv = sys.argv[1:]
    with program(module):
        runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
