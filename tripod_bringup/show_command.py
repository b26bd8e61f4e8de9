"""`tripod show`: a recording of a run as a page or as files."""

import sys
from pathlib import Path

from tripod_bringup.colour_option import ColourError, colours_of_recording
from tripod_bringup.long_work import interruptible, loading
from tripod_bringup.pictures import PictureError, Pictures, check_colour, serve_arrays

BAD_ARGUMENTS = 2


def show_command(
    file: Path, pictures: Pictures, view_port: int | None = None, colour: str | None = None
) -> int:
    """Write the pictures that are asked for; with none serve the page until Ctrl-C. Return the exit code."""
    with loading("tripod show"):
        from tripod_bringup.run_command import progress_bar  # noqa: PLC0415 - not needed for the help
        from tripod_sim.errors import SceneError  # noqa: PLC0415
        from tripod_view.player.film import FilmError  # noqa: PLC0415
        from tripod_view.player.run_file import read_run  # noqa: PLC0415

    try:
        pictures.check()
        check_colour(colour, pictures, view=not pictures.wanted)
        arrays = read_run(file)
        colours = colours_of_recording(arrays, colour)
        if not pictures.wanted:
            serve_arrays(arrays, "tripod show", view_port, colours)
            return 0
        with (
            interruptible("tripod show", *pictures.wanted.values()),
            progress_bar("writing", shown=sys.stderr.isatty()) as progress,
        ):
            for path in pictures.write(arrays, progress, colours):
                print(f"{path}  {path.stat().st_size / 1e6:.2f} MB")
    except OSError as error:
        return _complain(f"{str(file)!r} cannot be read: {error.strerror or error}")
    except (FilmError, PictureError, ColourError, SceneError) as error:
        return _complain(str(error))
    return 0


def _complain(words: str) -> int:
    print(f"tripod show: {words}", file=sys.stderr)
    return BAD_ARGUMENTS
