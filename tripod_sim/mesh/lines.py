"""Lines of a text file of unknown origin, with bounded memory."""

import math
from collections.abc import Iterator
from pathlib import Path

from tripod_host.reading import open_file
from tripod_sim.errors import SceneError, shown

MAX_BYTES = 200_000_000
"""A mesh file larger than this is refused unread."""

MOST_TRIANGLES = 20_000_000
"""Triangles of a surface: a face of two bytes a word becomes 24 bytes a triangle."""

LONGEST_LINE = 65536
"""Bytes of a line; longer ones are refused."""


def numbered_lines(path: Path, name: str) -> Iterator[tuple[int, bytes]]:
    """Yield each line of a file with its number, from 1.

    Args:
        path: The file.
        name: What messages call it.

    Raises:
        SceneError: the file cannot be read, or a line is too long.
    """
    try:
        with open_file(path, MAX_BYTES) as file:
            number = 0
            while line := file.readline(LONGEST_LINE + 1):
                number += 1
                if len(line) > LONGEST_LINE:
                    raise SceneError(
                        f"{name}, line {number}: longer than {LONGEST_LINE} bytes; is it a text file?"
                    )
                yield number, line
    except OSError as error:
        raise SceneError(f"{name} cannot be read: {error.strerror or error}") from None


def check_count(triangles: int, most: int, name: str) -> None:
    """Raise SceneError if a surface has more triangles than there may be; `name`: what messages call the file."""
    if triangles > most:
        raise SceneError(
            f"{name}: the surface has more than {most} triangles, the largest number allowed; reduce it "
            "first, for instance with a decimation filter"
        )


def word(token: bytes) -> str:
    """Return a token for a message: printable, on one line, quoted, not longer than `errors.LONGEST`."""
    return shown(token[:200].decode("ascii", errors="replace"))


def to_coordinates(tokens: list[bytes], where: str) -> list[float]:
    """Return tokens as finite numbers. Raises SceneError, which begins with `where`."""
    found = []
    for token in tokens:
        try:
            value = float(token)
        except ValueError:
            raise SceneError(f"{where}: {word(token)} is not a coordinate") from None
        if not math.isfinite(value):
            raise SceneError(f"{where}: coordinate {word(token)} is not finite")
        found.append(value)
    return found


def to_integer(token: bytes, where: str, what: str) -> int:
    """Return a token as an integer of at most 18 digits; messages begin with `where` and say that it is not `what`.

    Raises:
        SceneError: it is not.
    """
    digits = token[1:] if token[:1] in (b"-", b"+") else token
    if not digits.isdigit() or len(digits) > 18:
        raise SceneError(f"{where}: {word(token)} is not {what}")
    return int(token)
