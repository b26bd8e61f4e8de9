"""Standard output whose failures say that they are its own."""

import io
from typing import Any

from tripod_host.failures import reason


class OutputError(OSError):
    """Standard output cannot be written; it is named where another error names a file."""


class Output(io.FileIO):
    """What writes to standard output."""

    def __init__(self) -> None:
        """Write to descriptor 1; leave it open."""
        super().__init__(1, "w", closefd=False)

    def write(self, data: Any, /) -> int:
        """Write bytes, as many as are taken; return how many. Raises OutputError."""
        try:
            return super().write(data)
        except OSError as error:
            raise OutputError(error.errno, reason(error), "standard output") from None


def named_output(stream: io.TextIOWrapper) -> io.TextIOWrapper:
    """Return a stream that writes to standard output as `stream`, Python's own, does, and fails by OutputError."""
    stream.flush()
    raw = Output()
    unbuffered = stream.write_through  # by `python -u`
    return io.TextIOWrapper(
        raw if unbuffered else io.BufferedWriter(raw), encoding=stream.encoding, errors="backslashreplace",
        line_buffering=stream.line_buffering, write_through=unbuffered,
    )  # fmt: skip
