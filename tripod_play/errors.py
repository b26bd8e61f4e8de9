"""Errors of what plays."""


class PlayError(ValueError):
    """A path, maze or setting that is refused; the message names the offender, its value and what is allowed."""
