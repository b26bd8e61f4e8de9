"""`tripod show`: a recording of a run as a page or as files."""

import sys
from pathlib import Path

from tripod_bringup.long_work import interruptible, loading
from tripod_bringup.pictures import PictureError, Pictures, serve_arrays

BAD_ARGUMENTS = 2


def show_command(file: Path, pictures: Pictures, view_port: int | None = None) -> int:
    """Write the pictures that are asked for; with none serve the page until Ctrl-C. Return the exit code."""
    with loading("tripod show"):
        from tripod_bringup.run_command import progress_bar  # noqa: PLC0415 - not needed for the help
        from tripod_view.player.film import FilmError  # noqa: PLC0415
        from tripod_view.player.run_file import read_run  # noqa: PLC0415

    try:
        pictures.check()
        arrays = read_run(file)
        if not pictures.wanted:
            serve_arrays(arrays, "tripod show", view_port)
            return 0
        with (
            interruptible("tripod show", *pictures.wanted.values()),
            progress_bar("writing", shown=sys.stderr.isatty()) as progress,
        ):
            for path in pictures.write(arrays, progress):
                print(f"{path}  {path.stat().st_size / 1e6:.2f} MB")
    except OSError as error:
        return _complain(f"{str(file)!r} cannot be read: {error.strerror or error}")
    except (FilmError, PictureError) as error:
        return _complain(str(error))
    return 0


def _complain(words: str) -> int:
    print(f"tripod show: {words}", file=sys.stderr)
    return BAD_ARGUMENTS
