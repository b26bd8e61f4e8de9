"""Output files: whole or not at all, in place of regular files only, never through or over anything else."""

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory
from typing import BinaryIO, TextIO

from tripod_host import stop
from tripod_host.failures import reason
from tripod_host.reading import kind


def check_place(path: str | Path) -> None:
    """Raise OSError unless `path` could be written now; call it before work whose result shall go there."""
    fd, part = _created(Path(path))
    os.close(fd)
    part.unlink()


@contextmanager
def replaced(path: str | Path) -> Iterator[BinaryIO]:
    """Yield a new file that takes the place of `path` when the block ends, and leaves no trace if it fails.

    The new file has a name of its own in the same directory, which nobody else has, and is on the disk before it is
    renamed. What it replaces must be a regular file, whose permissions it keeps: no device, link or directory.

    Raises:
        OSError: there is no such directory, no permission, no space, or something else than a file at `path`.
    """
    path = Path(path)
    fd, part = _created(path)
    with stop.first(lambda: part.unlink(missing_ok=True)), _named(path, part):
        try:
            with os.fdopen(fd, "wb") as file:
                yield file
                file.flush()
                _like_the_old(file.fileno(), _old(path))
                os.fsync(file.fileno())
            _old(path)  # looked at again: work may lie between
            part.replace(path)
        except BaseException:
            with suppress(OSError):  # its directory has gone, and it with that
                part.unlink()
            raise
    sync_directory(path.parent)


@contextmanager
def replaced_text(path: str | Path) -> Iterator[TextIO]:
    """Yield what `replaced` does as UTF-8 text, line ends as they are written."""
    with replaced(path) as file:
        text = TextIOWrapper(file, encoding="utf-8", newline="")
        yield text
        text.flush()
        text.detach()


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Yield a new folder that is removed when the block ends, also by a signal."""
    with TemporaryDirectory(prefix="tripod-") as name, stop.first(lambda: rmtree(name, ignore_errors=True)):
        yield Path(name)


def sync_directory(directory: Path) -> None:
    """Make the names of new files in `directory` survive a loss of power, where the file system can."""
    with suppress(OSError):
        fd = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(fd)
        finally:
            os.close(fd)


def _created(path: Path) -> tuple[int, Path]:
    """Return an open new file in the directory of `path`, and its name."""
    _old(path)
    part = path.with_name(f".tripod-{secrets.token_hex(8)}.part")
    with _named(path, part):
        fd = os.open(part, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
    return fd, part


@contextmanager
def _named(path: Path, part: Path) -> Iterator[None]:
    """Let what goes wrong with the file `part` name the one that was asked for."""
    try:
        yield
    except OSError as error:
        if error.filename not in (None, str(part), part):
            raise
        gone = isinstance(error, FileNotFoundError) and not path.parent.is_dir()
        why = f"there is no directory {path.parent}" if gone else reason(error)
        raise OSError(error.errno, why, str(path)) from None


def _old(path: Path) -> os.stat_result | None:
    """Return what is at `path`, None for nothing; raises OSError unless it may be replaced."""
    try:
        found = path.lstat()
    except FileNotFoundError:
        return None
    except ValueError as error:  # what Python itself refuses to look for
        raise OSError(errno.EINVAL, str(error), str(path)) from None
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "it is a directory", str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, f"it is {kind(found.st_mode)}; only a file is replaced", str(path))
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    return found


def _like_the_old(fd: int, old: os.stat_result | None) -> None:
    if old is None:
        return
    with suppress(PermissionError):  # the group of another user's file: the new one is one's own
        os.fchown(fd, old.st_uid, old.st_gid)
    os.fchmod(fd, stat.S_IMODE(old.st_mode) & 0o777)
