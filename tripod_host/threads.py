"""Parts of one computation at the same time, in compiled loops that let other threads run meanwhile (`nogil`)."""

import os
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from typing import TypeVar

Found = TypeVar("Found")


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def thread_count() -> int:
    """Return how many threads share a computation: NUMBA_NUM_THREADS, or as many as there are processors."""
    named = os.environ.get("NUMBA_NUM_THREADS", "")
    return int(named) if named.isdecimal() and int(named) else processors()


def together(calls: Sequence[Callable[[], Found]]) -> list[Found]:
    """Return what `calls` return, in their order; whoever is free takes the next. Raises what one of them raises.

    They must not call `together` themselves.
    """
    helpers = min(thread_count(), len(calls)) - 1
    if helpers < 1:
        return [call() for call in calls]
    left, found = deque(enumerate(calls)), dict[int, Found]()

    def work() -> None:
        while left:
            try:
                k, call = left.popleft()
            except IndexError:  # another thread took it
                return
            found[k] = call()

    others = list[Future[None]]()
    with suppress(RuntimeError):  # while the interpreter ends no other thread begins: this one does it all
        for _ in range(helpers):
            others.append(_pool().submit(work))
    try:
        work()
    finally:
        begun = [other for other in others if not other.cancel()]
        for other in begun:
            other.exception()  # waits: nobody works on when this returns
    for other in begun:
        other.result()
    return [found[k] for k in range(len(calls))]


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(1, thread_count() - 1), "together")


os.register_at_fork(after_in_child=_pool.cache_clear)  # a child has none of the threads
