"""A film as a GIF or MP4, by ffmpeg."""

import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tripod_host.writing import replaced
from tripod_view.player.film import Film, FilmError
from tripod_view.player.picture import Painter

RATES = {".gif": 25, ".mp4": 50}
"""Pictures a second of each kind; a GIF's last a whole number of hundredths of a second."""

SIZES = {".gif": (480, 360), ".mp4": (800, 600)}

MOST_PICTURES = 6000

WAYS = {
    ".gif": ("-vf", "split[a][b];[a]palettegen[p];[b][p]paletteuse=dither=bayer:bayer_scale=4", "-loop", "0"),
    ".mp4": ("-c:v", "libx264", "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "+faststart"),
}  # fmt: skip
"""How ffmpeg writes each kind."""


class NoFfmpegError(RuntimeError):
    """There is no ffmpeg."""


def find_ffmpeg() -> str:
    """Return the path of ffmpeg. Raises NoFfmpegError, which tells how to install it."""
    if found := shutil.which("ffmpeg"):
        return found
    raise NoFfmpegError(
        "ffmpeg, which makes GIF and video, is not installed: sudo apt-get install ffmpeg; --html "
        "works without it"
    )


def write_video(film: Film, path: Path, progress: Callable[[float], None] | None = None) -> None:
    """Write `film` in real time, as GIF or MP4 by the suffix of `path`.

    Raises:
        NoFfmpegError: there is no ffmpeg.
        FilmError: the film is too long, or ffmpeg failed.
        OSError: `path` cannot be written.
    """
    kind = path.suffix.lower()
    rate, painter = RATES[kind], Painter(film, SIZES[kind])
    wanted = np.arange(film.times[0], film.times[-1] + 1e-9, 1 / rate)
    if len(wanted) > MOST_PICTURES:
        raise FilmError(
            f"{kind[1:]}: {len(wanted)} pictures are needed, and at most {MOST_PICTURES} can be drawn: "
            "shorten --duration"
        )
    shown = np.clip(np.searchsorted(film.times, wanted + 1e-9, side="right") - 1, 0, None)
    width, height = painter.size
    with tempfile.TemporaryDirectory(prefix="tripod-") as folder:
        made = Path(folder) / f"film{kind}"
        words = [
            find_ffmpeg(), "-v", "error", "-nostdin", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24",
            "-s", f"{width}x{height}", "-r", str(rate), "-i", "-", *WAYS[kind], str(made),
        ]  # fmt: skip
        with tempfile.TemporaryFile() as said:
            process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said)
            assert process.stdin
            try:
                last, pixels = -1, b""
                for n, k in enumerate(shown.tolist()):
                    if k != last:
                        last, pixels = k, painter.picture(k).tobytes()
                    process.stdin.write(pixels)
                    if progress:
                        progress((n + 1) / len(shown))
                process.stdin.close()
            except BrokenPipeError:
                pass  # its own words tell more
            finally:
                code = process.wait()
            said.seek(0)
            words_of = said.read(2000).decode("utf-8", "replace").strip().partition("\n")[0]
        if code:
            raise FilmError(f"ffmpeg ended with code {code}: {words_of or 'it said nothing'}")
        with made.open("rb") as source, replaced(path) as file:
            shutil.copyfileobj(source, file)
