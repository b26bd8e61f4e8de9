"""`--view`, `--html`, `--plot`, `--gif`, `--mp4`: a run as pictures, the same for `tripod run` and `tripod show`."""

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tripod_bringup.colour_option import ColourError, Colours, chosen_colour, colours_of, names_mesh_error
from tripod_host import stop

if TYPE_CHECKING:
    from tripod_view.player.live import GrowingFilm
    from tripod_view.player.serve import FilmServer

Arrays = Mapping[str, Any]

Html = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.html", help="Write one page that plays the motion in any browser, without a network."
    ),
]
Plot = Annotated[
    Path | None, typer.Option(metavar="FILE.png", help="Draw angles, torques, effector, energies over time.")
]
Gif = Annotated[
    Path | None, typer.Option(metavar="FILE.gif", help="Write the motion as a GIF; needs ffmpeg.")
]
Mp4 = Annotated[
    Path | None, typer.Option(metavar="FILE.mp4", help="Write the motion as a video; needs ffmpeg.")
]

LOOK = 0.2
"""Between two looks whether the page is to be closed [s]."""


class PictureError(Exception):
    """A picture that is not made; the message names the option and why."""


@dataclass(frozen=True)
class Pictures:
    """Files to write of a run; None: not that one."""

    html: Path | None = None
    plot: Path | None = None
    gif: Path | None = None
    mp4: Path | None = None

    @property
    def wanted(self) -> dict[str, Path]:
        """Path by the name of its option, without those that are not wanted."""
        return {f.name: path for f in fields(self) if (path := getattr(self, f.name)) is not None}

    def check(self) -> None:
        """Raise PictureError unless each can be made: its suffix, its place, its program."""
        from tripod_host.writing import check_place  # noqa: PLC0415 - not needed for the help
        from tripod_view.player.video import NoFfmpegError, find_ffmpeg  # noqa: PLC0415

        for name, path in self.wanted.items():
            suffix = ".png" if name == "plot" else f".{name}"
            if path.suffix.lower() != suffix:
                raise PictureError(f"--{name} {str(path)!r} must end in {suffix}: that is what is written")
            try:
                check_place(path)
            except OSError as error:
                raise PictureError(_unwritable(name, path, error)) from None
        if self.plot:
            try:
                import matplotlib  # noqa: F401, PLC0415
            except ImportError:
                raise PictureError("--plot needs matplotlib: pip install matplotlib, or make setup") from None
        try:
            if self.gif or self.mp4:
                find_ffmpeg()
        except NoFfmpegError as error:
            raise PictureError(f"--{'gif' if self.gif else 'mp4'}: {error}") from None

    def write(
        self, arrays: Arrays, progress: Callable[[float], None] | None = None, colours: Colours | None = None
    ) -> list[Path]:
        """Write them of the arrays of a run; return their paths. Raises PictureError."""
        if not self.wanted:
            return []
        from tripod_view.player.film import FilmError  # noqa: PLC0415
        from tripod_view.player.of_run import film_of  # noqa: PLC0415

        colours = colours or Colours()
        try:
            film = film_of(arrays, fields=colours.fields, colouring=colours.colouring)
        except FilmError as error:
            raise PictureError(str(error)) from None
        name, path = "", Path()
        try:
            for name, path in self.wanted.items():
                if name == "html":
                    from tripod_view.player.html import write_html  # noqa: PLC0415

                    write_html(film, path)
                elif name == "plot":
                    from tripod_view.player.curves_plot import write_plot  # noqa: PLC0415

                    write_plot(film, path)
                else:
                    from tripod_view.player.video import write_video  # noqa: PLC0415

                    write_video(film, path, progress)
        except FilmError as error:
            raise PictureError(f"--{name}: {error}") from None
        except OSError as error:
            raise PictureError(_unwritable(name, path, error)) from None
        return list(self.wanted.values())


class ShownRun:
    """A run that is shown while it goes on, and whose pictures are written when it has ended, however that is.

    The block of its `with` ends, after the run, when the user asks for it, by Ctrl-C: until then the page is there.
    """

    def __init__(
        self,
        command: str,
        pictures: Pictures,
        *,
        view: bool,
        port: int | None = None,
        colour: str | None = None,
        out: Path | None = None,
    ) -> None:
        """`command`: its name in messages; `port`: of the page, None for a free one; `colour`: of `--colour`; `out`: of
        the recording.
        """
        self._command, self._pictures, self._view, self._port = command, pictures, view, port
        self._colour, self._colours, self._out = colour, Colours(), out
        self._recording: Any = None
        self._film: GrowingFilm | None = None
        self._server: FilmServer | None = None

    @property
    def wanted(self) -> bool:
        """Whether a recording of the run is needed."""
        return self._view or bool(self._pictures.wanted)

    def __enter__(self) -> "ShownRun":
        """Raise PictureError unless all that is wanted can be made."""
        self._pictures.check()
        recorded = self._out is not None and names_mesh_error(self._colour)
        check_colour(self._colour, self._pictures, view=self._view or recorded)
        return self

    def begin(self, recording: Any) -> None:
        """Take the recording of the run, which is about to begin: its page is there from now on.

        Raises PictureError: the bodies do not have the field of `--colour`.
        """
        self._recording = recording
        page = self._view or self._pictures.html is not None
        if page or self._colour is not None:
            try:
                self._colours = colours_of(
                    recording.fields(), self._colour, page=page, every=self._view,
                    mesh_error=recording.with_mesh_error,
                )  # fmt: skip
            except ColourError as error:
                raise PictureError(str(error)) from None
        stop.before(self._save)
        if self._view:
            from tripod_view.player.live import GrowingFilm  # noqa: PLC0415

            self._film = GrowingFilm(
                recording.arrays, recording.dt, self._colours.fields, self._colours.colouring
            )
            self._server = film_server(self._film.page, self._film.reel, self._port)
            print(f"{self._command}: watch it at {self._server.url}", file=sys.stderr, flush=True)

    def end(self, progress: Callable[[float], None] | None = None) -> list[Path]:
        """Write the pictures of the steps that were made; return their paths. Raises PictureError."""
        stop.no_more(self._save)
        if self._film:
            self._film.finish()
        made = self._recording and self._recording.count
        return self._pictures.write(self._recording.arrays(), progress, self._colours) if made else []

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Wait for the user, and close the page."""
        stop.no_more(self._save)
        if self._server:
            if kind is None:
                until_asked(self._command)
            self._server.close()

    def _save(self) -> None:
        """Write what is made in a moment: the process is about to end."""
        if self._recording.count:
            Pictures(html=self._pictures.html, plot=self._pictures.plot).write(self._recording.arrays())


def film_server(page: Callable[[], str], reel: Callable[[int], Any], port: int | None) -> "FilmServer":
    """Return the server of a page at a port, None for a free one. Raises PictureError where the port is taken."""
    from tripod_view.player.serve import FilmServer  # noqa: PLC0415 - not needed for the help

    try:
        return FilmServer(page, reel, port or 0)
    except OSError as error:
        why = error.strerror or error
        raise PictureError(
            f"--view-port {port} is not free ({why}); leave it out to take a free port"
        ) from None


def check_colour(colour: str | None, pictures: Pictures, *, view: bool) -> None:
    """Raise PictureError unless `--colour` names a field, and there is something to colour."""
    if colour is None:
        return
    try:
        chosen_colour(colour)
    except ColourError as error:
        raise PictureError(str(error)) from None
    if not (view or pictures.html or pictures.gif or pictures.mp4):
        raise PictureError(f"--colour {colour!r} colours nothing: add --view, --html, --gif or --mp4")
    if pictures.gif or pictures.mp4:
        try:
            import PIL  # noqa: F401, PLC0415
        except ImportError:
            raise PictureError(
                "--colour needs Pillow for its legend: pip install pillow, or make setup"
            ) from None


def serve_arrays(
    arrays: Arrays, command: str, port: int | None = None, colours: Colours | None = None
) -> None:
    """Serve the page of a finished run at a port, None for a free one, until Ctrl-C.

    Raises:
        FilmError, PictureError: there is nothing to show, or the port is taken.
    """
    from tripod_view.player.html import player_page  # noqa: PLC0415
    from tripod_view.player.of_run import film_of  # noqa: PLC0415
    from tripod_view.player.packing import reel, stage  # noqa: PLC0415

    colours = colours or Colours()
    film = film_of(arrays, fields=colours.fields, colouring=colours.colouring)
    page = player_page(stage(film), reel(film))
    server = film_server(lambda: page, lambda _: {"reel": None, "done": True}, port)
    print(f"{command}: watch it at {server.url}", file=sys.stderr, flush=True)
    try:
        until_asked(command)
    finally:
        server.close()


def until_asked(command: str) -> None:
    """Wait for Ctrl-C or SIGTERM."""
    with stop.taken() as asked:
        print(f"{command}: the page is there until Ctrl-C", file=sys.stderr, flush=True)
        while not asked.count:
            time.sleep(LOOK)


def _unwritable(name: str, path: Path, error: OSError) -> str:
    return f"--{name} {str(path)!r} cannot be written: {error.strerror or error}"
