"""`tripod identify --score`: from the command line to `tripod_identify` and back."""

import json
import math
import shlex
import sys
from pathlib import Path

from tripod_bringup.long_work import interruptible, loading
from tripod_bringup.measured_data import opened
from tripod_bringup.run_command import BAD_ARGUMENTS, FAILED, plain, progress_bar
from tripod_host.writing import replaced, replaced_text


def score_command(
    scene: str,
    data: Path,
    *,
    align: str,
    overrides: list[str],
    points: list[str],
    renames: list[str],
    poses: bool,
    report: Path | None,
    plot: Path | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Score, print, write and return the exit code: 2 bad input, 1 a pose or motion could not be computed."""
    with loading("tripod identify", shown=not quiet):
        from tripod_identify.errors import DataError  # noqa: PLC0415 - not needed for the help
        from tripod_identify.lack_of_fit import what_is_left  # noqa: PLC0415
        from tripod_identify.model import plainly, predict  # noqa: PLC0415
        from tripod_identify.pictures import check_matplotlib  # noqa: PLC0415
        from tripod_identify.score import score  # noqa: PLC0415
        from tripod_identify.score_report import HEAD, alignment_line, left_rows, score_report, score_rows  # noqa: PLC0415  # noqa: PLC0415
        from tripod_record.errors import RecordError  # noqa: PLC0415
        from tripod_sim.errors import SceneError, StepError  # noqa: PLC0415

    try:
        if report is not None or plot is not None:
            check_matplotlib()
        description, glued, measured = opened(
            scene, data, align=align, overrides=overrides, points=points, renames=renames, poses=poses,
            places=(report, plot),
        )  # fmt: skip
        with (
            interruptible("tripod identify", report, plot),
            progress_bar("building the scene", shown=not quiet and sys.stderr.isatty()) as progress,
        ):
            predicted = predict(plainly(description), measured, glued, progress)
        found = score(predicted, measured, align)
        left = what_is_left(found.residuals, measured, description)
        notes = [*measured.notes, *([left.note] if left.note else [])]
        if report is not None or plot is not None:
            command = shlex.join(["tripod", *sys.argv[1:]])
            title = f"{description.name} against {data.name}"
            text, picture = score_report(title, command, measured, found, left, align, notes)
            if report is not None:
                with replaced_text(report) as page:
                    page.write(text)
            if plot is not None:
                with replaced(plot) as file:
                    file.write(picture)
    except (DataError, RecordError, SceneError) as error:
        print("tripod identify: " + " ".join(str(error).split()), file=sys.stderr)
        return BAD_ARGUMENTS
    except OSError as error:
        print(f"tripod identify: {error.filename} cannot be written: {error.strerror}", file=sys.stderr)
        return BAD_ARGUMENTS
    except StepError as error:
        print("tripod identify: " + " ".join(str(error).split()), file=sys.stderr)
        return FAILED
    for note in notes:
        print(f"tripod identify: note: {note}", file=sys.stderr)
    if as_json:
        numbers = {**found.as_json(), "rest": left.as_json()}
        print(json.dumps(plain({"scene": description.name, "rows": len(measured.values), **numbers})))
    elif not quiet:
        print_table(HEAD, score_rows(found))
        print()
        print_table(("what is left", "rms"), left_rows(left, angle=not found.distance))
        print()
        explained = (
            f"; {100 * found.explained:.2f} % of the variance explained"
            if math.isfinite(found.explained)
            else ""
        )
        print(f"{len(measured.values)} rows; {alignment_line(found, align)}{explained}")
    return 0


def print_table(head: "tuple[str, ...] | list[str]", rows: list[list[str]]) -> None:
    """Print rows in columns, the first to the left."""
    table = [list(head), *rows]
    widths = [max(len(row[i]) for row in table) for i in range(len(head))]
    for row in table:
        first = row[0].ljust(widths[0])
        print(
            "  ".join([first, *(cell.rjust(w) for cell, w in zip(row[1:], widths[1:], strict=True))]).rstrip()
        )
