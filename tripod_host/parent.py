"""The tie of a helping process to the one that started it."""

import ctypes
import os
import signal
import sys
from collections.abc import Callable

PR_SET_PDEATHSIG = 1


def die_with_parent(parent: int) -> None:
    """End this process, at once and whatever it computes, when the thread of the process `parent` that started it ends.

    Only Linux can do that; elsewhere nothing happens.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it was quicker
            os.kill(os.getpid(), signal.SIGKILL)


def helped(parent: int, work: Callable[[], None]) -> int:
    """Do `work` as a program that the process `parent` started, and return the exit code: 0, or 1 where it raised.

    Standard output holds the reason then and nothing else: what libraries print goes to standard error. The process
    ends with `parent`, and at Ctrl-C at once, also within compiled code.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # compiled code would not hear of Python's handler
    die_with_parent(parent)
    answer = os.dup(1)
    os.dup2(2, 1)
    try:
        work()
    except Exception as error:  # noqa: BLE001 - whatever a library meets in a file that is broken
        os.write(answer, (str(error) or type(error).__name__).encode())
        return 1
    return 0
