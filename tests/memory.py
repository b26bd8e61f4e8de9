"""What steady work keeps of the memory."""

import gc
import sys
import tracemalloc
from collections.abc import Callable, Iterable

SMALLEST = 500
"""Of the blocks that count [bytes]: the interpreter keeps some hundred freed small objects, now more, now fewer."""


def kept(step: Callable[..., object], arguments: Iterable[object], *, warm_up: int = 20) -> int:
    """Call `step` with each of the arguments; return by how much the memory held grew after `warm_up` of them [bytes].

    Only blocks that could be arrays count.
    """
    before = 0
    tracemalloc.start()
    try:
        for k, argument in enumerate(arguments):
            if k == warm_up:
                before = _large_blocks()
            step(argument)
        return _large_blocks() - before
    finally:
        tracemalloc.stop()


def _large_blocks() -> int:
    gc.collect()
    return sum(trace.size for trace in tracemalloc.take_snapshot().traces if trace.size >= SMALLEST)


def blocks_grown(run: Callable[[], object], *, warm_up: Callable[[], object]) -> int:
    """Run `warm_up`, then `run`; return how many more objects, small ones too, are held after the latter."""
    warm_up()
    gc.collect()
    before = sys.getallocatedblocks()
    run()
    gc.collect()
    return sys.getallocatedblocks() - before
