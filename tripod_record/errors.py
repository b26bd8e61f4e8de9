"""What this package refuses."""


class RecordError(ValueError):
    """A directory, file, name or type that cannot be used; the message names it and says what to do."""


class FileLostError(RecordError):
    """Another program has deleted, moved, replaced or changed a file that is being written.

    The message continues a sentence that begins with its path.
    """
