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


MOST_POINTS = 10_000
"""Of a line through points."""


def read_points(path: Path, name: str) -> list[list[float]]:
    """Return the points of a text file: x, y, z a line, by commas or blanks; `#` begins a comment.

    Raises SceneError where it cannot be read or has something else; the message begins with `name` and has the line.
    """
    points = list[list[float]]()
    for number, line in numbered_lines(path, f"{name}: {str(path)!r}"):
        where = f"{name}: {str(path)!r}, line {number}"
        if tokens := line.split(b"#")[0].replace(b",", b" ").split():
            if len(tokens) != 3:
                raise SceneError(f"{where}: {len(tokens)} values; give x, y and z in metres")
            points.append(to_coordinates(tokens, where))
        if len(points) > MOST_POINTS:
            raise SceneError(f"{where}: more than {MOST_POINTS} points; give fewer")
    if not points:
        raise SceneError(f"{name}: {str(path)!r} has no points; give x, y, z in metres, a point a line")
    return points


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
