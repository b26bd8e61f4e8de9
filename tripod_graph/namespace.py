"""Namespaces of ROS: a whole robot is in one. Pure."""

import re
from typing import Final

LONGEST: Final = 100
"""Characters of a namespace: with what stands behind it a name of ROS has 245 at most."""


class NamespaceError(ValueError):
    """A text that is no namespace; the message says what is allowed."""


def full_namespace(name: str) -> str:
    """Return a namespace with its leading slash. Raises NamespaceError.

    >>> full_namespace("left"), full_namespace("/left/arm"), full_namespace("")
    ('/left', '/left/arm', '/')
    """
    full = "/" + name.removeprefix("/")
    if len(full) > LONGEST or not re.fullmatch(r"/|(/[A-Za-z_][A-Za-z0-9_]*)+", full):
        raise NamespaceError(
            f"namespace {name!r:.80} is not valid; allowed: names of letters, digits and _ that do not "
            f"begin with a digit, joined by /, at most {LONGEST} characters"
        )
    return full
