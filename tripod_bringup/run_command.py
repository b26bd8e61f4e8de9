"""`tripod run`: from the command line to `tripod_sim` and back to people or JSON."""

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from tripod_bringup.colour_option import names_mesh_error
from tripod_bringup.compiling import compiling_told
from tripod_bringup.long_work import interruptible, loading
from tripod_bringup.pictures import PictureError, Pictures, ShownRun
from tripod_bringup.run_summary import result_rows, summary_rows
from tripod_host.failures import failure_words
from tripod_host.output import OutputError
from tripod_host.stop import first

FAILED = 1
BAD_ARGUMENTS = 2


class Progress:
    """A bar on standard error: called with the fraction done, 0 to 1."""

    def __init__(self, update: Callable[..., None]) -> None:
        self._update = update

    def __call__(self, done: float) -> None:
        """Draw the fraction done."""
        self._update(completed=done)

    def say(self, text: str) -> None:
        """Write a text beside the bar."""
        self._update(description=text, refresh=True)


def run_scene(
    scene: str,
    *,
    duration: float | None,
    servo: str | None,
    slide: str | None,
    actuate: Sequence[str] = (),
    overrides: list[str],
    out: Path | None,
    forces: bool = False,
    pictures: Pictures,
    view: bool,
    colour: str | None = None,
    accuracy: str | None = None,
    budget: str | None = None,
    study: Path | None = None,
    view_port: int | None = None,
    verbose: bool = False,
    as_json: bool,
    quiet: bool,
) -> int:
    """Simulate, print the result and return the exit code: 2 bad scene or option, 1 the motion broke off or grew.

    What users should know of the result comes on standard error, whatever is printed of it.
    """
    with loading("tripod run", shown=not quiet):
        from tripod_bringup.accuracy_option import chosen, own_study, wished  # noqa: PLC0415 - not needed for the help
        from tripod_sim.errors import SceneError, StepError  # noqa: PLC0415
        from tripod_study.run import run  # noqa: PLC0415

    try:
        if forces and not (out or view or pictures.html or pictures.gif or pictures.mp4):
            raise SceneError("--forces has nothing to show them; add --view, --html, --gif, --mp4 or --out")
        with (
            interruptible("tripod run", out, *pictures.wanted.values()),
            ShownRun("tripod run", pictures, view=view, port=view_port, colour=colour, out=out) as shown,
        ):
            choice = chosen(scene, wished(accuracy, budget), overrides, study)
            if choice:
                overrides = list(choice.overrides)
                if not (quiet or as_json):
                    print(choice.sentence, file=sys.stderr)
            source = study or own_study(scene, overrides)
            broken: StepError | None = None
            with (
                progress_bar(shown=not quiet and sys.stderr.isatty()) as progress,
                compiling_told("tripod run", progress.say if progress else None)
                if not quiet
                else nullcontext(),
            ):
                try:
                    result = run(
                        scene,
                        duration=duration,
                        servo=servo,
                        slide=slide,
                        actuate=actuate,
                        overrides=overrides,
                        out=out,
                        forces=forces,
                        mesh_error=names_mesh_error(colour),
                        recorded=shown.begin if shown.wanted else None,
                        progress=progress,
                        say=progress.say if progress else None,
                        noted=_tell_note,
                        study=source,
                    )
                except StepError as error:
                    broken = error
            with progress_bar(shown=shown.wanted and not quiet and sys.stderr.isatty()) as progress:
                written = shown.end(progress)
            if broken:
                return _complain(broken, FAILED)
            if choice:
                result["accuracy"] = asdict(choice)
                if study and "figures" in result:  # of a study that the scene does not come with
                    result["figures"]["accuracy"] = choice.told
            if files := [path for path in (out, *written) if path and path.exists()]:
                result["written"] = [{"file": str(path), "bytes": path.stat().st_size} for path in files]
            if as_json:
                print(json.dumps(plain(result)))
            elif not quiet:
                again = _again(scene, overrides, duration, servo, slide, actuate)
                result["study"] = str(source) if source else ""
                print_rows(result_rows(result) if verbose else summary_rows(result, again, view=view))
            return _exit_code(result)
    except OutputError:  # of standard output, which is no file of `written`
        raise
    except (SceneError, PictureError, OSError) as error:  # the last: a file to write
        return _complain(error, BAD_ARGUMENTS)


def print_rows(rows: Sequence[tuple[str, str]]) -> None:
    """Print names and texts in two columns."""
    width = max(len(name) for name, _ in rows)
    for name, text in rows:
        print(f"{name:<{width}}  {text}")


def _again(
    scene: str,
    overrides: Sequence[str],
    duration: float | None,
    servo: str | None,
    slide: str | None,
    actuate: Sequence[str],
) -> list[str]:
    """Return the words of the command that simulates the same motion."""
    options = {"--duration": duration, "--servo": servo, "--slide": slide}
    given = [str(word) for name, value in options.items() if value is not None for word in (name, value)]
    given += [word for text in actuate for word in ("--actuate", text)]
    return ["tripod", "run", scene, *(word for path in overrides for word in ("--set", path)), *given]


def _exit_code(result: dict[str, Any]) -> int:
    """Say if the motion grew without bounds; return the exit code."""
    if unstable := result.get("instability"):
        print(f"tripod run: {unstable}", file=sys.stderr)
        return FAILED
    return 0


def _tell_note(note: str) -> None:
    print(f"tripod run: note: {note}", file=sys.stderr)


def _complain(error: Exception, code: int) -> int:
    print(f"tripod run: {failure_words(error)}", file=sys.stderr)
    return code


@contextmanager
def progress_bar(text: str = "", *, shown: bool) -> Iterator[Progress | None]:
    """Yield what draws the fraction done (0 to 1) on standard error; None where nothing is shown.

    `text`: what stands beside the bar at first.
    """
    if not shown:
        yield None
        return
    from rich import progress as rich_progress  # noqa: PLC0415
    from rich.console import Console  # noqa: PLC0415

    columns = (
        rich_progress.BarColumn(),
        rich_progress.TaskProgressColumn(),
        rich_progress.TimeRemainingColumn(),
        rich_progress.TextColumn("{task.description}"),
    )
    console = Console(stderr=True)
    with (
        first(lambda: console.show_cursor(True)),
        rich_progress.Progress(*columns, console=console, transient=True) as bar,
    ):
        task = bar.add_task(text, total=1.0)
        yield Progress(partial(bar.update, task))


def plain(value: Any) -> Any:
    """Return `value` with arrays as lists, and what JSON lacks, NaN and infinity, as None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, Path) else value
