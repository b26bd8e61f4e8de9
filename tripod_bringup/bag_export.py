"""`tripod bag export`, `plot` and `html`: a recording as numbers, as curves, as a page."""

import csv
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tripod_bringup.bag_play import chosen, tell_unread
from tripod_bringup.long_work import interruptible
from tripod_bringup.run_command import BAD_ARGUMENTS, FAILED, Progress, progress_bar
from tripod_host.writing import check_place, replaced, replaced_text
from tripod_record.bag import Bag
from tripod_record.errors import RecordError
from tripod_record.info import printable
from tripod_record.segments import chosen_segment, log_times, read_segments, simulators
from tripod_record.table import Series, is_shown, read_series, table
from tripod_sim.errors import SceneError, StepError

FORMATS = (".csv", ".npz", ".parquet")


def export_command(file: Path, out: Path | None, topics: str, segment: int | None = None) -> int:
    """Write the numbers and return the exit code: 0, 1 of a damaged recording, 2 bad input.

    `out`: None takes a new .csv file in the working directory with the recording's name; so do the other commands.
    `segment`: only what belongs to that one.
    """
    out = out or unused_path(file, ".csv")

    def write() -> Bag:
        _check(out, FORMATS)
        if out.suffix.lower() == ".parquet":
            _check_parquet()
        with progress_bar(shown=sys.stderr.isatty()) as progress:
            _say(progress, f"reading {file.name}")
            bag = Bag(file)
            with bag.accounted():
                _restrict(bag, segment)
                series = read_series(bag, chosen(topics) if topics else is_shown, progress)
                _say(progress, f"writing {out.name}")
                writers = {".csv": write_csv, ".npz": write_npz, ".parquet": write_parquet}
                writers[out.suffix.lower()](series, out)
        return bag

    return _run("export", out, write)


def plot_command(file: Path, out: Path | None, segment: int | None = None) -> int:
    """Draw the curves and return the exit code: 0, 1 of a damaged recording, 2 bad input."""
    out = out or unused_path(file, ".png")

    def write() -> Bag:
        _check(out, (".png", ".svg", ".pdf"))
        from tripod_bringup.bag_plot import draw, joint_units  # noqa: PLC0415 - not needed for the help

        with progress_bar(shown=sys.stderr.isatty()) as progress:
            _say(progress, f"reading {file.name}")
            bag = Bag(file)
            with bag.accounted():
                _restrict(bag, segment)
                series = read_series(bag, progress=progress)
                _say(progress, f"writing {out.name}")
                draw(series, out, Path(bag.info.path).name, joint_units(bag))
        return bag

    return _run("plot", out, write)


def unused_path(recording: Path, suffix: str) -> Path:
    """Return a path in the working directory that does not exist: the recording's name with `suffix`, and a number."""
    stem = (recording.stem if recording.suffix == ".mcap" else recording.resolve().name) or "recording"
    path, number = Path(f"{stem}{suffix}"), 2
    while path.exists():
        path, number = Path(f"{stem}_{number}{suffix}"), number + 1
    return path


def _restrict(bag: Bag, segment: int | None) -> None:
    """Let a recording be read only as far as it belongs to a segment. Raises RecordError."""
    if segment is None:
        return
    found = [read_segments(bag, namespace) for namespace in simulators(bag)]
    if len(found) != 1:
        raise RecordError(
            f"{bag.info.path} contains {len(found)} simulators, and --segment applies to one; choose it "
            "with --topics"
        )
    bag.span = log_times(found[0], chosen_segment(bag, found[0], segment).number)


def _say(progress: Progress | None, text: str) -> None:
    if progress:
        progress.say(text)


def html_command(
    file: Path,
    out: Path | None,
    topics: str,
    segment: int | None = None,
    *,
    colour: str | None = None,
    forces: bool = False,
) -> int:
    """Write the page and return the exit code: 0, 1 damaged, or not the recorded session, 2 bad input.

    `colour`: of `--colour`; `forces`: whether it shows what acts on the bodies, in the steps that are made again.
    """
    out = out or unused_path(file, ".html")
    from tripod_bringup.bag_film import session_arrays  # noqa: PLC0415 - not needed for the help
    from tripod_bringup.bag_session import read_session  # noqa: PLC0415
    from tripod_bringup.colour_option import ColourError, colours_of, names_mesh_error  # noqa: PLC0415
    from tripod_bringup.pictures import PictureError, Pictures, check_colour  # noqa: PLC0415

    different: list[str] = []

    def write() -> Bag:
        pictures = Pictures(html=out)
        try:
            pictures.check()
            check_colour(colour, pictures, view=False)
            bag = Bag(file)
            with progress_bar(f"reading {file.name}", shown=sys.stderr.isatty()) as progress:
                with bag.accounted():
                    session = read_session("html", bag, chosen(topics), segment)
                    _say(progress, "building the scene")
                    resimulation = session.resimulation()
                mesh_error = names_mesh_error(colour)
                fields = resimulation.simulation.fields()
                colours = colours_of(fields, colour, page=True, mesh_error=mesh_error)
                _say(progress, "simulating again")
                arrays = session_arrays(
                    resimulation, session.segment, progress, forces=forces, mesh_error=mesh_error
                )
            if not pictures.write(arrays, colours=colours):
                raise RecordError(
                    f"{bag.info.path} contains no step that can be simulated again; was the simulator recorded "
                    "from its start?"
                )
        except (PictureError, ColourError) as error:
            raise RecordError(str(error)) from None
        if resimulation.outcome.different:
            different.append(resimulation.outcome.parted)
        return bag

    code = _run("html", out, write)
    if different:
        print(
            f"tripod bag html: the simulation differs from the recording, from {different[0]} on; was it "
            "recorded by this version, on this machine?",
            file=sys.stderr,
        )
        return FAILED
    return code


def write_csv(series: dict[str, Series], out: Path) -> None:
    """Write a table, an empty cell where there is no value yet."""
    columns = table(series)
    with replaced_text(out) as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        for row in zip(*(column.tolist() for column in columns.values()), strict=True):
            writer.writerow(["" if value != value else repr(value) for value in row])  # noqa: PLR0124 - NaN


def write_npz(series: dict[str, Series], out: Path) -> None:
    """Write each topic at its own times: arrays `TOPIC/time` and `TOPIC/FIELD`."""
    arrays: dict[str, Any] = {}
    for topic, one in series.items():
        arrays[f"{topic.lstrip('/')}/time"] = one.times
        arrays |= {f"{topic.lstrip('/')}/{name}": values for name, values in one.values.items()}
    if not arrays:
        table(series)  # which says so
    with replaced(out) as file:
        np.savez_compressed(file, **arrays)


def write_parquet(series: dict[str, Series], out: Path) -> None:
    """Write the table of `write_csv`, NaN where there is no value yet."""
    import pyarrow  # noqa: PLC0415 - an extra
    from pyarrow import parquet  # noqa: PLC0415

    columns = table(series)
    with replaced(out) as file:
        parquet.write_table(pyarrow.table(columns), file)


def _check(out: Path, suffixes: tuple[str, ...]) -> None:
    if out.suffix.lower() not in suffixes:
        raise RecordError(f"{out} must end in {', '.join(suffixes[:-1])} or {suffixes[-1]}")
    check_place(out)


def _check_parquet() -> None:
    try:
        import pyarrow  # noqa: F401, PLC0415
    except ImportError:
        raise RecordError("parquet needs pyarrow: pip install pyarrow; csv and npz need nothing") from None


def _run(name: str, out: Path, write: Callable[[], Bag]) -> int:
    try:
        with interruptible(f"tripod bag {name}", out):
            bag = write()
    except StepError as error:
        return _complain(name, error, FAILED)
    except (RecordError, SceneError, ImportError) as error:
        return _complain(name, error, BAD_ARGUMENTS)
    except OSError as error:
        return _complain(
            name, RecordError(f"{out} cannot be written: {error.strerror or error}"), BAD_ARGUMENTS
        )
    print(f"{out}  {out.stat().st_size / 1e6:.2f} MB")
    return tell_unread(name, bag)


def _complain(name: str, error: Exception, code: int) -> int:
    print(f"tripod bag {name}: " + printable(" ".join(str(error).split())), file=sys.stderr)
    return code
