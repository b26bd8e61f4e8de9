"""The error that this package raises."""


class IkError(ValueError):
    """An input that is refused; the message names it, its value and what is allowed."""
