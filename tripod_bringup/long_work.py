"""What a command that takes long says: at once that it works, and at Ctrl-C what it has kept."""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeVar

from tripod_host.parent import die_with_parent
from tripod_host.stop import first

Found = TypeVar("Found")

PERIOD = 0.5
"""Between two reports of the time that work in another process has taken [s]."""

ERASE = "\r\x1b[2K"
"""Empties the line of a terminal."""


@contextmanager
def loading(command: str, work: str = "loading", *, shown: bool = True) -> Iterator[None]:
    """Show in a terminal what `command` does, as long as the block runs, which prints nothing itself."""
    if not (shown and sys.stderr.isatty()):
        yield
        return
    print(f"{command}: {work} ...", end="", file=sys.stderr, flush=True)
    try:
        with interruptible(command):
            yield
    finally:
        print(ERASE, end="", file=sys.stderr, flush=True)


@contextmanager
def interruptible(command: str, *files: Path | None) -> Iterator[None]:
    """Say, where a signal such as Ctrl-C ends the block, which of `files` the command has written."""
    start = time.time()

    def tell() -> None:
        line = f"{ERASE if sys.stderr.isatty() else ''}{command}: {kept_words(files, start)}\n"
        os.write(2, line.encode(errors="backslashreplace"))  # print may be at work just now

    with first(tell):
        yield


def kept_words(files: Sequence[Path | None], start: float) -> str:
    """Return what is kept of `files`: of those written since `start` [s], a time of the system's clock."""
    kept = [file for file in files if file and file.exists() and file.stat().st_mtime >= start - 0.01]
    return f"stopped; kept: {', '.join(map(str, kept))}" if kept else "stopped; nothing was written"


def in_process(say: Callable[[float], None], work: Callable[..., Found], *given: Any) -> Found:
    """Return what `work` returns, computed by another process while `say` is told the time that it has taken [s].

    A long compiled loop lets no other thread of its process run, so this one stays free to report. Whatever `work`
    raises is raised here. Arguments and result are pickled.

    Raises:
        MemoryError: the process was killed, most likely for want of memory.
    """
    context = get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_answer, args=(sender, os.getpid(), work, given))
    start = time.monotonic()
    say(0.0)
    process.start()
    sender.close()

    def end() -> None:
        process.kill()
        process.join()

    with first(end):
        try:
            while not receiver.poll(PERIOD):
                say(time.monotonic() - start)
            found: Found | Exception = receiver.recv()
        except EOFError:
            process.join()
            raise MemoryError(f"the process ended with code {process.exitcode}") from None
        finally:
            end()
    if isinstance(found, Exception):
        raise found
    return found


def _answer(sender: Connection, parent: int, work: Callable[..., object], given: tuple[Any, ...]) -> None:
    """Send what `work` returns or raises to the process `parent`."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C is reported by the parent alone
    die_with_parent(parent)
    try:
        found: object = work(*given)
    except Exception as error:  # noqa: BLE001 - raised again by the parent
        found = error
    sender.send(found)
