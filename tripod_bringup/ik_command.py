"""`tripod ik --target`: one inverse kinematics without ROS, from the command line to `tripod_ik` and back to people."""

import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tripod_bringup.compiling import compiling_told
from tripod_bringup.long_work import interruptible, loading
from tripod_bringup.run_command import BAD_ARGUMENTS, FAILED, plain, print_rows

if TYPE_CHECKING:
    from tripod_sim.scene import Scene

MISSED = 1
"""Exit code where the target was not reached."""

BRANCH = 1e-4
"""Two equilibria at the same angles are farther apart [m]; the slide of a posterior may differ by as much."""

LINE = 60
"""Width of the line that tells the progress."""


def overwrite(text: str) -> None:
    """Overwrite the line on stderr that tells what goes on; without a text leave it empty."""
    print(f"\r{text:<{LINE}}", end="" if text else "\r", file=sys.stderr, flush=True)


def show_progress(count: int, missing: float) -> None:
    """Show how many linearisations a search has made, and the least that was missing so far [m]."""
    overwrite(f"{count} linearisations, {1e3 * missing:.3f} mm left")


def solve_command(
    target: str,
    *,
    scene: str,
    overrides: list[str],
    goal: str,
    tilt: str,
    slide: float,
    start: str | None,
    torque_max: float,
    hard: bool,
    box: str | None,
    posterior: Path | None,
    accuracy: str | None,
    budget: str | None,
    study: Path | None,
    as_json: bool,
) -> int:
    """Solve, print and return the exit code: 0 reached, 1 not reached, 2 bad arguments."""
    with loading("tripod ik"):
        from tripod_bringup.accuracy_option import chosen, wished  # noqa: PLC0415 - not needed for the help
        from tripod_identify.errors import DataError  # noqa: PLC0415 - not needed for the help
        from tripod_ik.accuracy import choose_model  # noqa: PLC0415
        from tripod_ik.errors import IkError  # noqa: PLC0415
        from tripod_ik.solve_once import solve_once  # noqa: PLC0415
        from tripod_ik.tracker_settings import Goal  # noqa: PLC0415
        from tripod_sim.errors import SceneError, StepError  # noqa: PLC0415
        from tripod_sim.scene.file import load_scene, naming_file  # noqa: PLC0415
        from tripod_sim.tables.short_forms import joints_of  # noqa: PLC0415

    shown = sys.stderr.isatty()
    try:
        if shown:
            overwrite("building the model ...")
        if goal not in {str(g) for g in Goal}:
            raise IkError(f"--goal is {goal!r}; allowed: {', '.join(Goal)}")
        first, more = targets(target)
        corners = numbers("--box", box, 6, "m") if box is not None else None
        choose = partial(choose_model, goal=Goal(goal), slide=slide)
        if choice := chosen(scene, wished(accuracy, budget), overrides, study, choose):
            overrides = list(choice.overrides)
            if not as_json:
                print(choice.sentence, file=sys.stderr)
        description = load_scene(scene, overrides)
        joints = joints_of(description)
        units = [a.unit for a in joints.actuators] if joints else ["rad"] * 3
        begin = None if start is None else numbers("--start", start, len(units), units)
        with (
            interruptible("tripod ik"),
            compiling_told("tripod ik", overwrite if shown else None),
            naming_file(scene, overrides),
        ):
            result = solve_once(
                description,
                numbers("--target", first, 3, "m"),
                more=more,
                tilt=numbers("--tilt", tilt, 2, "rad"),
                goal=Goal(goal),
                slide=slide,
                start=begin,
                torque_max=torque_max,
                hard=hard,
                box=None if corners is None else (corners[:3], corners[3:]),  # type: ignore[arg-type]
                progress=show_progress if shown else None,
            )
        if posterior is not None:
            result |= expected_error(description, posterior, result, slide)
        if choice:
            result["accuracy"] = asdict(choice)
    except (IkError, SceneError, DataError) as error:
        print("tripod ik: " + " ".join(str(error).split()), file=sys.stderr)
        return BAD_ARGUMENTS
    except StepError as error:
        print("tripod ik: " + " ".join(str(error).split()), file=sys.stderr)
        return FAILED
    if as_json:
        print(json.dumps(plain(result)))
    else:
        print_rows(solution_rows(result))
    return 0 if result["reached"] else MISSED


def expected_error(scene: "Scene", path: Path, result: Mapping[str, Any], slide: float) -> dict[str, Any]:
    """Return what the posterior in a file foretells of the error of a solution, as `expected_error`.

    It has the arrays of `tripod_identify.intervals.Bars` for that pose: x, y, z [m] and rotation [rad].

    Raises:
        DataError: the file, or it does not belong to the scene, or the pose is one that is not reached from rest.
        SceneError, StepError: another mesh cannot be had.
    """
    import numpy as np  # noqa: PLC0415 - not needed for the help

    from tripod_identify.errors import DataError  # noqa: PLC0415
    from tripod_identify.intervals import pose_bars, read_posterior  # noqa: PLC0415

    found = pose_bars(scene, read_posterior(path), np.array([result["angles"]]), np.array([slide]))
    apart = float(np.abs(found.poses[0, :3] - result["position"]).max())
    if apart > BRANCH:
        raise DataError(
            "--posterior: starting from the undeformed body these angles lead to another pose, "
            f"{1000.0 * apart:.2f} mm away, so the error of this one is not known; choose another target"
        )
    parts = ("mesh", "steps", "by_values", "by_mesh", "half")
    return {"expected_error": {name: getattr(found, name)[0].tolist() for name in parts}}


def targets(text: str) -> tuple[str, dict[str, list[float]]]:
    """Return the target of the effector as it is written, and those of further places [m]: "0 0 1; middle = 0 0 2".

    Raises:
        IkError: what follows a semicolon is no place with its target.
    """
    from tripod_ik.errors import IkError  # noqa: PLC0415

    first, *others = text.split(";")
    more = {}
    for other in others:
        name, equals, place = other.partition("=")
        if not equals:
            raise IkError(
                f"--target has {other.strip()!r} after a semicolon; write NAME = X Y Z, of [[effector.more]]"
            )
        more[name.strip()] = numbers(f"--target {name.strip()}", place, 3, "m")
    return first, more


def numbers(option: str, text: str, count: int, unit: str | Sequence[str]) -> list[float]:
    """Return `count` numbers in SI of `text`, separated by spaces or commas, that are in `unit`, one for all or one for
    each, or say theirs.

    Raises:
        IkError: they are not that many finite numbers; names the option.
    """
    from tripod_ik.errors import IkError  # noqa: PLC0415
    from tripod_sim.tables.fields import units_of, with_unit  # noqa: PLC0415

    words = text.replace(",", " ").split()
    units = [unit] * count if isinstance(unit, str) else list(unit)
    try:
        values = [with_unit(word, own) for word, own in zip(words, units, strict=True)]
    except ValueError:
        values = []
    if len(words) != count or len(values) != count or not all(map(math.isfinite, values)):
        known = dict.fromkeys(name for own in units for name in units_of(own))
        raise IkError(
            f"{option} is {text!r}; it must be {count} finite numbers in {', '.join(dict.fromkeys(units))}, or with "
            f"their unit ({', '.join(known)}), such as {' '.join(['0.01'] * count)!r}"
        )
    return values


def solution_rows(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what is printed for people: names and texts."""
    from tripod_study.summary.errors import error_words  # noqa: PLC0415 - not needed for the help

    x, y, z = (1e3 * v for v in result["position"])
    missing = []
    for name, value in result["residuals"].items():
        what, _, unit = name.partition(" ")
        shown = f"{1e3 * value:.3f} mm" if unit == "[m]" else f"{math.degrees(value):.3f} degrees"
        missing.append(f"{what} {shown}")
    outcome = result["outcome"] + (f": {result['reason']}" if result["reason"] else "")
    servos = set(result["units"]) == {"rad"}
    angles, error = result["angles"], result.get("mesh_error")
    commands = [
        ("angles", ", ".join(f"{a:.4f}" for a in angles) + " rad"),
        ("", ", ".join(f"{math.degrees(a):.2f}" for a in angles) + " degrees"),
    ]
    if not servos:
        named = zip(result["names"], angles, result["units"], strict=True)
        commands = [("commands", ", ".join(f"{name} {value:.4g} {unit}" for name, value, unit in named))]
    return [
        ("outcome", outcome),
        *commands,
        ("effector", ", ".join(f"{v:z.3f}" for v in (x, y, z)) + " mm"),
        *(
            (name, ", ".join(f"{1e3 * v:z.3f}" for v in place) + " mm")
            for name, place in result["places"].items()
        ),
        *(
            []
            if result["roll"] is None
            else [
                (
                    "roll, pitch",
                    f"{math.degrees(result['roll']):z.2f}, {math.degrees(result['pitch']):z.2f} degrees",
                )
            ]
        ),
        ("still missing", ", ".join(missing)),
        *([("error", f"{error_words(error['distance'])} (estimated)")] if error else []),
        *bar_rows(result.get("expected_error")),
        effort_row(result),
        ("active limits", ", ".join(result["active_limits"]) or "none"),
        *(
            [("path", f"through {stops} other pose{'s' if stops > 1 else ''}: --json has them")]
            if (stops := len(result["path"]) - 1)
            else []
        ),
        ("solved in", f"{result['seconds']:.2g} s, {result['iterations']} linearisations"),
    ]


def effort_row(result: Mapping[str, Any]) -> tuple[str, str]:
    """Return name and text of what the actuators do whose position is commanded: torques and tensions."""
    if set(result["units"]) == {"rad"}:
        return "torques", ", ".join(f"{t:.4f}" for t in result["torques"]) + " N m"
    effort = {"rad": "N m", "m": "N"}
    found = zip(result["names"], result["torques"], result["units"], strict=True)
    return "efforts", ", ".join(
        f"{name} {value:.4g} {effort[unit]}" for name, value, unit in found if unit in effort
    ) or "none"


def bar_rows(found: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    """Return what is printed of the expected error of a pose: its shift with 90 % bars, and what makes these."""
    if found is None:
        return []

    def triple(values: Any, sign: str = "") -> str:
        return ", ".join(f"{1e3 * v:{sign}.3f}" for v in values[:3])

    known = math.isfinite(found["mesh"][0])
    shift = [m + s for m, s in zip(found["mesh"], found["steps"], strict=True)] if known else [0.0] * 6
    turned = ", ".join(
        f"{math.degrees(a):+.2f} ± {math.degrees(b):.2f}"
        for a, b in zip(shift[3:], found["half"][3:], strict=True)
    )
    placed = ", ".join(
        f"{1e3 * a:+.3f} ± {1e3 * b:.3f}" for a, b in zip(shift[:3], found["half"][:3], strict=True)
    )
    mesh = f"mesh {triple(found['mesh'], '+')}, steps {triple(found['steps'], '+')}; " if known else ""
    unknown = (
        f"what is unknown of mesh and steps {triple(found['by_mesh'])}"
        if known
        else "mesh and steps not known"
    )
    return [
        ("expected error", f"{placed} mm (90 %)"),
        ("", f"{turned} degrees"),
        ("of it", f"{mesh}± values {triple(found['by_values'])}, {unknown} mm"),
    ]
