"""How many files this process may have open: sockets, pipes, shared memory; libraries fail oddly where they cannot."""

import resource

LEAST = 64
"""What a node with its middleware and a page needs, with room."""


class OpenFilesError(RuntimeError):
    """Too few files may be open; the message says what to do."""


def check_open_files() -> None:
    """Raise the limit to LEAST where that is allowed. Raises OpenFilesError where it is not."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY or soft >= LEAST:
        return
    if hard != resource.RLIM_INFINITY and hard < LEAST:
        raise OpenFilesError(
            f"only {hard} files may be open at a time, but {LEAST} are needed; type: ulimit -n {LEAST}"
        )
    resource.setrlimit(resource.RLIMIT_NOFILE, (LEAST, hard))
