"""Errors of what is read and asked for here."""


class DataError(ValueError):
    """Measured data, or what is to be fitted to them, that is refused; the message names the column, row or value."""


class FitError(RuntimeError):
    """A fit that found no values; the message says why."""
