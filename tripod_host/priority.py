"""Who goes first where the processors are busy."""

import os
from contextlib import suppress


def stand_back() -> None:
    """Let the calling thread, and those that it starts, interrupt no other when they wake: eyes and files have time.

    Its share of the processors stays (SCHED_BATCH of Linux). Where there is no such thing, or it is refused, nothing
    changes.
    """
    with suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
