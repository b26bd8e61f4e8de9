"""What a message must name (field, value, remedy), however its sentence is worded.

A test that quotes a sentence breaks when somebody improves it. A test that lists what the sentence must name breaks
when the information is lost. Every test of a message goes through this module.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

LONGEST_PHRASE = 4
"""Words of prose that a test may quote in a row: enough for a name, too few for a sentence."""

_ESCAPE = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
"""What a terminal takes for a colour or a mode, not for text."""

_COMMAND = re.compile(r"(?:sudo|tripod|ros2|make|pip|python3?|source|export) ")
_WORD = re.compile(r"(?<![\w./=-])[A-Za-z][a-z']*(?![\w/=_(-]|\.\w)")


def prose_words(text: str) -> int:
    """Return the number of words of prose in the wordiest line of `text`; a command to type has none.

    Words are letters only: fields (`mesh.level`), paths, options and numbers do not count.
    """
    lines = (line for line in text.splitlines() if not _COMMAND.match(line))
    return max((len(_WORD.findall(line)) for line in lines), default=0)


def names(text: object, *what: object) -> bool:
    """Return whether `text` names each of `what`; see `assert_names`."""
    return not _missing(text, what)


def assert_names(text: object, *what: object) -> None:
    """Assert that a message names each of `what`, in any order.

    Args:
        text: The message: a string, or an exception.
        what: Fields, values and remedies: strings or numbers. Upper and lower case and line breaks do not matter. A
            value is found as a whole: 2 is named by "2 of 3", not by "12" or "2.5".

    Raises:
        ValueError: if one of `what` is empty or longer than `LONGEST_PHRASE` words of prose.
    """
    missing = _missing(text, what)
    assert not missing, f"not named: {missing}; the message is:\n{text}"


@contextmanager
def raises_naming(
    error: type[BaseException] | tuple[type[BaseException], ...], *what: object
) -> Iterator[pytest.ExceptionInfo[BaseException]]:
    """Expect an exception whose message names each of `what`; see `assert_names`."""
    with pytest.raises(error) as caught:
        yield caught
    assert_names(caught.value, *what)


def lines_naming(text: str, *what: object) -> list[str]:
    """Return the lines of `text` that name each of `what`; see `assert_names`."""
    return [line for line in text.splitlines() if names(line, *what)]


def line_naming(text: str, *what: object) -> str:
    """Return the one line of `text` that names each of `what`; fail if none does, or several."""
    found = lines_naming(text, *what)
    assert len(found) == 1, f"{len(found)} lines name {what}; the text is:\n{text}"
    return found[0]


def _missing(text: object, what: tuple[object, ...]) -> list[str]:
    if not what:
        raise ValueError("no names given: every message would pass")
    flat = " ".join(_ESCAPE.sub("", str(text)).split()).casefold()
    return [name for name in map(str, what) if not re.search(_pattern(name), flat)]


def _pattern(name: str) -> str:
    flat = " ".join(name.split()).casefold()
    if not flat:
        raise ValueError("an empty name is in every message")
    if prose_words(name) > LONGEST_PHRASE:
        raise ValueError(f"{name!r} quotes a sentence; name the field, the value and the remedy instead")
    before = r"(?<!\w)(?<!\d\.)" if flat[0].isalnum() else ""
    after = r"(?!\w)(?!\.\d)" if flat[-1].isalnum() else ""
    return before + re.escape(flat) + after
