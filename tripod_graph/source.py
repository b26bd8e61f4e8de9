"""Names of those who decide and command: a node's name and a suffix that no other process has."""

import secrets
from typing import Final

IK: Final = "ik"
"""What the names of inverse kinematics begin with, whatever their nodes are called."""


def new_source(role: str, namespace: str = "/") -> str:
    """Return a name for this process, e.g. '/teleop#3f9a61' for `role` 'teleop'."""
    return f"{namespace.rstrip('/')}/{role}#{secrets.token_hex(3)}"


def name_of(source: str) -> str:
    """Return what people call a source: its name without namespace and suffix."""
    return source.rpartition("/")[2].partition("#")[0]


def is_ik(source: str) -> bool:
    """Return whether `source` is the name of inverse kinematics."""
    return name_of(source) == IK
