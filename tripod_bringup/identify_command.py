"""`tripod identify`: from the command line to `tripod_identify` and back."""

import json
import math
import shlex
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from tripod_bringup.compiling import compiling_told
from tripod_bringup.long_work import interruptible, loading
from tripod_bringup.measured_data import opened
from tripod_bringup.run_command import BAD_ARGUMENTS, FAILED, plain, progress_bar
from tripod_bringup.score_command import print_table
from tripod_host.writing import replaced_text
from tripod_identify.errors import DataError, FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tripod_identify.fit import Prior
    from tripod_identify.identify import Identified, Wanted
    from tripod_identify.measured import Measured
    from tripod_identify.observe import Point
    from tripod_sim.scene import Scene


def identify_command(
    scene: str,
    data: Path,
    *,
    fit: list[str],
    align: str,
    priors: list[str],
    hold_out: str,
    overrides: list[str],
    points: list[str],
    renames: list[str],
    poses: bool,
    mesh: bool,
    profile: bool,
    propose: bool,
    candidates: Path | None,
    out: Path | None,
    report: Path | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Identify, print, write and return the exit code: 2 bad input, 1 nothing was found."""
    with loading("tripod identify", shown=not quiet):
        from tripod_identify.identify import Wanted  # noqa: PLC0415 - not needed for the help
        from tripod_identify.identify_report import identify_report, scene_text  # noqa: PLC0415
        from tripod_identify.pictures import check_matplotlib  # noqa: PLC0415
        from tripod_record.errors import RecordError  # noqa: PLC0415
        from tripod_sim.errors import SceneError, StepError  # noqa: PLC0415

    command = shlex.join(["tripod", *sys.argv[1:]])
    try:
        if out is not None and out.suffix != ".toml":
            raise DataError(f"--out is {str(out)!r}; it must end in .toml")
        if report is not None:
            check_matplotlib()
        description, glued, measured = opened(
            scene, data, align=align, overrides=overrides, points=points, renames=renames, poses=poses,
            places=(out, report),
        )  # fmt: skip
        wanted = Wanted(
            tuple(fit), align, dict(map(_prior, priors)), _share(hold_out), mesh, profile, propose
        )
        given = _candidates(candidates, description) if candidates else None
        title = f"{description.name} from {data.name}"
        try:
            result = identified(
                description, measured, glued, wanted, program="tripod identify", quiet=quiet, poses=given
            )
        except FitError as error:
            return _unfound(error, description, measured, glued, align, title, command, report)
        if out is not None:
            with replaced_text(out) as file:
                file.write(scene_text(result, command))
        if report is not None:
            with replaced_text(report) as page:
                page.write(identify_report(title, command, measured, result))
    except (DataError, RecordError, SceneError) as error:
        return _complain(error, BAD_ARGUMENTS)
    except OSError as error:
        return _complain(f"{error.filename} cannot be written: {error.strerror}", BAD_ARGUMENTS)
    except StepError as error:
        return _complain(error, FAILED)
    if as_json:
        print(json.dumps(plain({"scene": description.name, "rows": len(measured.values), **_plain(result)})))
    elif not quiet:
        tell_found(result)
    for note in result.notes:
        print(f"tripod identify: note: {note}", file=sys.stderr)
    return 0


def _unfound(
    error: FitError, scene: "Scene", measured: "Measured", points: "Sequence[Point]", align: str, title: str,
    command: str, report: Path | None,
) -> int:  # fmt: skip
    """Say why nothing was found, and in the report also how far the scene, as it is, is from the data.

    Returns the exit code; raises as `predict` does, and OSError.
    """
    from tripod_identify.lack_of_fit import what_is_left  # noqa: PLC0415 - not needed for the help
    from tripod_identify.model import plainly, predict  # noqa: PLC0415
    from tripod_identify.score import score  # noqa: PLC0415
    from tripod_identify.score_report import score_report  # noqa: PLC0415

    found = score(predict(plainly(scene), measured, points), measured, align)
    left = what_is_left(found.residuals, measured, scene)
    notes = [*measured.notes, *([left.note] if left.note else [])]
    if report is not None:
        text, _ = score_report(title, command, measured, found, left, align, [str(error), *notes])
        with replaced_text(report) as page:
            page.write(text)
    for note in notes:
        print(f"tripod identify: note: {note}", file=sys.stderr)
    return _complain(error, FAILED)


def _plain(result: "Identified") -> dict[str, object]:
    from tripod_identify.identify import as_json  # noqa: PLC0415

    return as_json(result)


def identified(
    scene: "Scene", measured: "Measured", points: "Sequence[Point]", wanted: "Wanted", *, program: str, quiet: bool,
    poses: "NDArray | None" = None,
) -> "Identified":  # fmt: skip
    """Return what `identify` finds, with its progress on standard error unless `quiet`; raises as it does."""
    from tripod_identify.identify import identify  # noqa: PLC0415 - not needed for the help

    with (
        interruptible(program),
        progress_bar("building the scene", shown=not quiet and sys.stderr.isatty()) as bar,
        compiling_told(program, bar.say if bar else None) if not quiet else nullcontext(),
    ):

        def say(line: str) -> None:
            if bar:
                bar.say(line)
            elif not quiet:
                print(f"{program}: {line}", file=sys.stderr)

        return identify(scene, measured, points, wanted, note=say, progress=bar, poses=poses)


def tell_found(result: "Identified", *, calibrated: bool = False) -> None:
    """Print what was found; `calibrated`: the servos' calibration gets its part from this program."""
    from tripod_identify.identify_report import (  # noqa: PLC0415
        FOUND_HEAD,
        calibration_lines,
        found_rows,
        proposal_lines,
        rest_rows,
        score_rows,
        untold_lines,
    )
    from tripod_identify.score_report import HEAD  # noqa: PLC0415

    print_table(FOUND_HEAD, found_rows(result))
    for line in (*untold_lines(result), *([] if calibrated else calibration_lines(result))):
        print(line)
    print()
    print_table(HEAD, score_rows(result))
    print()
    print_table(("what is left", "rms"), rest_rows(result))
    for line in proposal_lines(result):
        print(line)


def _prior(word: str) -> "tuple[str, Prior]":
    from tripod_identify.fit import Prior  # noqa: PLC0415

    name, _, rest = word.partition("=")
    value, _, sd = rest.partition("~")
    try:
        prior = Prior(float(value), float(sd))
    except ValueError:
        prior = Prior(math.nan, math.nan)
    if not (name and math.isfinite(prior.value) and prior.sd > 0 and math.isfinite(prior.sd)):
        raise DataError(
            f"--prior {word!r} is not of the form NAME=VALUE~SD, with SD above 0, such as "
            "material.mass=0.03~0.001"
        )
    return name.strip(), prior


def _share(text: str) -> float:
    try:
        share = float(text[:-1]) / 100 if text.endswith("%") else float(text)
    except ValueError:
        raise DataError(f"--hold-out is {text!r}; it must be a share such as 20% or 0.2") from None
    return share


def _candidates(path: Path, scene: "Scene") -> "NDArray":
    """Return the poses of a CSV file, shape (n, a + 1)."""
    from tripod_identify.measured import read_commands  # noqa: PLC0415

    return read_commands(path, scene)


def _complain(error: Exception | str, code: int) -> int:
    print("tripod identify: " + " ".join(str(error).split()), file=sys.stderr)
    return code
