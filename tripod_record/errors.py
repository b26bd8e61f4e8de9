"""What this package refuses."""


class RecordError(ValueError):
    """A directory, file, name or type that cannot be used; the message names it and says what to do."""
