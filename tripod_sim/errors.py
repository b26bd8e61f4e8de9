"""Errors of the simulator, and how their messages show a value."""

from typing import Any


class SceneError(ValueError):
    """A scene, mesh or command that is refused; the message names the field, its value and what is allowed."""


class Doubt(str):
    """A note on an input that is out of proportion: if a step cannot be solved, that is the likely cause."""


class UnsolvedError(RuntimeError):
    """Equations that could not be solved.

    Attributes:
        what: What failed, where.
        remedy: What to do about it, in words; empty where nobody knows. It ends the message.
    """

    def __init__(self, what: str, remedy: str = "") -> None:
        """As the attributes."""
        super().__init__(what)
        self.what, self.remedy = what, remedy

    def __str__(self) -> str:
        """Return the message."""
        return f"{self.what}; {self.remedy}" if self.remedy else self.what


class StepError(UnsolvedError):
    """A step that could not be saved; the simulation keeps the last good state. The message names what failed."""


LONGEST = 80
"""Characters of a value or name that a message shows."""


def shown(value: Any) -> str:
    """Return a value on one line, however long or deep it is, for a message.

    Of a long one the middle is left out: a path ends with what tells it from others.
    """
    try:
        text = repr(value)
    except (RecursionError, ValueError):  # nested too deeply; more digits than Python converts
        text = f"<{type(value).__name__}>"
    half = (LONGEST - 3) // 2
    return text if len(text) <= LONGEST else f"{text[:half]}...{text[-half:]}"
