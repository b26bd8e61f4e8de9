"""`tripod reach`: the reachable workspace as a table, a file and a picture."""

import csv
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tripod_bringup.long_work import interruptible, loading
from tripod_bringup.run_command import BAD_ARGUMENTS, FAILED, plain, progress_bar
from tripod_host.writing import check_place, replaced_text

if TYPE_CHECKING:
    from tripod_ik.reach import Layer, Reach


def reach_command(
    scene: str,
    *,
    overrides: list[str],
    slide: float,
    low: float | None,
    high: float | None,
    count: int | None,
    samples: int | None,
    torque_max: float,
    out: Path | None,
    plot: Path | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Compute, print, write and return the exit code: 0, 2 bad arguments, 1 nothing could be computed."""
    with loading("tripod reach", shown=not quiet):
        from tripod_ik.errors import IkError  # noqa: PLC0415 - not needed for the help
        from tripod_ik.model import StaticModel  # noqa: PLC0415
        from tripod_ik.reach import default_range, reach  # noqa: PLC0415
        from tripod_ik.solvable import not_servos  # noqa: PLC0415
        from tripod_sim.errors import SceneError, StepError  # noqa: PLC0415
        from tripod_sim.scene.file import load_scene, naming_file  # noqa: PLC0415

    try:
        for path in (out, plot):  # before the work, not after it
            if path is not None:
                check_place(path)
        if plot is not None:
            check_plot(plot)
        with (
            interruptible("tripod reach", out, plot),
            progress_bar("building the model", shown=not quiet and sys.stderr.isatty()) as progress,
        ):
            with naming_file(scene, overrides):
                described = load_scene(scene, overrides)
                if reason := not_servos(described, "tripod reach"):
                    raise IkError(reason)
                model = StaticModel(described, slide)
            least, most = default_range(model)
            least, most = least if low is None else low, most if high is None else high
            if progress:
                progress.say("")
            found = reach(
                model, least, most, count=count, samples=samples, torque_max=torque_max, progress=progress
            )
        if out is not None:
            write_table(found, out)
        if plot is not None:
            from tripod_bringup.reach_plot import draw  # noqa: PLC0415

            draw(found, plot, f"{scene}, slide {1e3 * slide:g} mm, angles {least:g} to {most:g} rad")
    except (IkError, SceneError) as error:
        print("tripod reach: " + " ".join(str(error).split()), file=sys.stderr)
        return BAD_ARGUMENTS
    except OSError as error:
        print(f"tripod reach: {error.filename} cannot be written: {error.strerror}", file=sys.stderr)
        return BAD_ARGUMENTS
    except StepError as error:
        print("tripod reach: " + " ".join(str(error).split()), file=sys.stderr)
        return FAILED
    if as_json:
        print(json.dumps(plain(summary(found))))
    elif not quiet:
        print(summary_text(found, torque_max))
    return 0


def check_plot(path: Path) -> None:
    """Raise IkError unless a picture can be drawn into `path`."""
    from tripod_ik.errors import IkError  # noqa: PLC0415

    if path.suffix.lower() not in {".png", ".svg", ".pdf"}:
        raise IkError(f"--plot is {str(path)!r}; it must end in .png, .svg or .pdf")
    try:
        import matplotlib  # noqa: F401, PLC0415
    except ImportError:
        raise IkError(
            "--plot needs matplotlib: pip install matplotlib, or leave it out: --out keeps the numbers"
        ) from None


def write_table(found: "Reach", out: Path) -> None:
    """Write the poses as CSV, one row each, SI units."""
    from tripod_ik.reach import columns  # noqa: PLC0415

    with replaced_text(out) as file:
        writer = csv.writer(file)
        writer.writerow(columns(found.servos))
        writer.writerows([f"{value:.9g}" for value in row] for row in found.table.tolist())


def summary(found: "Reach") -> dict[str, Any]:
    """Return counts and layers, SI units."""
    layers = [{**layer.__dict__} for layer in found.layers()]
    return {
        "poses": len(found.table),
        "bearable": len(found.bearable),
        "samples": found.samples,
        "spacing": found.spacing,
        "tried": found.tried,
        "folded": found.folded,
        "snapped": found.snapped,
        "failed": found.failed,
        "layers": layers,
    }


def summary_text(found: "Reach", torque_max: float) -> str:
    """Return the table for people."""
    lines = [
        f"{len(found.table)} poses of {found.tried} are on the branch of the working pose "
        f"({found.folded} beyond a fold, {found.snapped} beyond a snap, {found.failed} without equilibrium); "
        f"{len(found.bearable)} of them below {torque_max:g} N m",
        *_spacing_text(found),
        "",
        "height [mm]      poses  radius [mm]        tilt [degrees]     torque margin [N m]",
        "                        all round, most    all round, most    least, most",
    ]
    lines += [_layer_text(layer) for layer in found.layers()]
    return "\n".join(lines)


def _spacing_text(found: "Reach") -> list[str]:
    """Return how dense the poses are, and what that means for the volume."""
    lines = []
    if found.samples:
        lines.append(
            f"the poses are {found.samples} quasi-random samples of the angles and the {2**found.servos} corners of "
            "their range, no grid"
        )
    if math.isfinite(found.spacing):
        more = "--samples" if found.samples else "--count"
        lines.append(
            f"95 % of the positions have another within {1e3 * found.spacing:.2g} mm: the border of the workspace, and "
            f"so its volume, is known no better (finer: {more})"
        )
    return lines


def _layer_text(layer: "Layer") -> str:
    heights = f"{1e3 * layer.low:6.1f} .. {1e3 * layer.high:5.1f}"
    radius = f"{1e3 * layer.radius:9.1f}, {1e3 * layer.farthest:5.1f}"
    tilt = f"{math.degrees(layer.tilt):9.1f}, {math.degrees(layer.steepest):5.1f}"
    return (
        f"{heights}  {layer.poses:6d}  {radius:<17}  {tilt:<17}  {layer.margin[0]:.3f}, {layer.margin[1]:.3f}"
    )
