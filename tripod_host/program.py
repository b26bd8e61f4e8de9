"""What every program of the suite runs in: signals, streams, threads, and failures of the machine in one line."""

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tripod_host.failures import ELSEWHERE, failure_words
from tripod_host.output import named_output
from tripod_host.stop import end_at_once

FAILED = 1
BROKEN_PIPE = 141
"""As a shell tells the end of a program whose reader left."""

SINGLE = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Set to 1 before NumPy is imported, they hold linear algebra to one thread: matrices are small here, and threads wait
for each other at full load."""

ENVIRONMENT = {**dict.fromkeys(SINGLE, "1"), "NUMBA_OPT": "2"}
"""What holds where the environment says nothing else: one thread, and compiled loops as level 2 of the compiler makes
them. They are as fast as those of Numba's own level 3 and take less time to compile.
"""


def set_environment() -> None:
    """Set what `ENVIRONMENT` has, unless the environment says otherwise."""
    for variable, value in ENVIRONMENT.items():
        os.environ.setdefault(variable, value)


@contextmanager
def program(name: str) -> Iterator[None]:
    """Run the main function of the program `name`; the block ends by SystemExit or returns.

    It has the environment of `set_environment`.

    Raises:
        SystemExit: with code 1 and one line where standard output is closed or full, the current directory is gone, a
            file cannot be opened, compiled loops cannot be kept, a library cannot be loaded, or memory is short; with
            141 and none where the reader of standard output left.
    """
    end_at_once()
    open_streams(name)
    set_environment()
    check_directory(name)
    output, written = sys.stdout, os.fstat(1)
    try:
        try:
            yield
        finally:
            sys.stdout.flush()
    except SystemExit:
        if sys.stdout is not output or not os.path.samestat(written, os.fstat(1)):
            # Click has put another stream in its place, or Rich /dev/null, and told by a code of its own
            sys.exit(BROKEN_PIPE)
        raise
    except OSError as error:
        _give_up_output()
        if error.errno == errno.EPIPE:
            sys.exit(BROKEN_PIPE)
        print(f"{name}: {failure_words(error)}", file=sys.stderr)
        sys.exit(FAILED)
    except RuntimeError as error:
        words = failure_words(error)
        if ELSEWHERE not in words:
            raise
        print(f"{name}: {words}", file=sys.stderr)
        sys.exit(FAILED)
    except (ImportError, MemoryError) as error:
        print(f"{name}: {failure_words(error) or 'there is not enough memory'}", file=sys.stderr)
        sys.exit(FAILED)


def open_streams(name: str) -> None:
    """Make standard input, output and error usable; with none to write to, end with one line.

    A stream that is closed would else be the next file that is opened, and that file get what is printed.
    """
    closed = [fd for fd in range(3) if not _is_open(fd)]
    for fd in closed:  # in order, so that each gets its own number
        os.open(os.devnull, os.O_RDWR)
        os.set_inheritable(fd, True)
    if 0 in closed:
        sys.stdin = io.TextIOWrapper(io.FileIO(0, closefd=False), encoding="utf-8")
    if 2 in closed:
        sys.stderr = io.TextIOWrapper(io.FileIO(2, "w", closefd=False), encoding="utf-8", write_through=True)
    if 1 in closed:
        print(
            f"{name}: standard output is closed; redirect it to a file, such as > /dev/null", file=sys.stderr
        )
        sys.exit(FAILED)
    if isinstance(sys.stdout, io.TextIOWrapper):  # names and signs that the locale lacks are written as \x..
        sys.stdout = named_output(sys.stdout)
    if isinstance(sys.stderr, io.TextIOWrapper):
        sys.stderr.reconfigure(errors="backslashreplace")


def check_directory(name: str) -> None:
    """End with one line where the current directory is gone: names of files lead nowhere, and libraries complain."""
    try:
        Path.cwd()
    except OSError as error:
        print(
            f"{name}: the current directory was removed ({failure_words(error)}); change to another one "
            "with cd",
            file=sys.stderr,
        )
        sys.exit(FAILED)


def _is_open(fd: int) -> bool:
    try:
        os.fstat(fd)
    except OSError:
        return False
    return True


def _give_up_output() -> None:
    """Throw away what standard output still holds: the interpreter would try again to write it, and complain."""
    with suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.close(null)
        sys.stdout.flush()
