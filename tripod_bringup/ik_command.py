"""`tripod ik --target`: one inverse kinematics without ROS, from the command line to `tripod_ik` and back to people."""

import json
import math
import sys
from collections.abc import Mapping
from typing import Any

from tripod_bringup.run_command import BAD_ARGUMENTS, FAILED, plain

MISSED = 1
"""Exit code where the target was not reached."""

LINE = 60
"""Width of the line that tells the progress."""


def show_progress(count: int, missing: float) -> None:
    """Overwrite the line on stderr that tells how far the search is."""
    print(
        f"\r{f'{count} linearisations, {1e3 * missing:.3f} mm left':<{LINE}}",
        end="",
        file=sys.stderr,
        flush=True,
    )


def solve_command(
    target: str,
    *,
    scene: str,
    overrides: list[str],
    goal: str,
    tilt: str,
    slide: float,
    start: str | None,
    torque_max: float | None,
    hard: bool,
    box: str | None,
    any_branch: bool,
    as_json: bool,
) -> int:
    """Solve, print and return the exit code: 0 reached, 1 not reached, 2 bad arguments."""
    from tripod_ik.errors import IkError  # noqa: PLC0415 - not needed for the help
    from tripod_ik.once import solve_once  # noqa: PLC0415
    from tripod_ik.tracker_settings import Goal  # noqa: PLC0415
    from tripod_sim.errors import SceneError, StepError  # noqa: PLC0415
    from tripod_sim.scene_file import load_scene  # noqa: PLC0415

    try:
        if goal not in {str(g) for g in Goal}:
            raise IkError(f"--goal is {goal!r}; allowed: {', '.join(Goal)}")
        corners = numbers("--box", box, 6, "m") if box is not None else None
        result = solve_once(
            load_scene(scene, overrides),
            numbers("--target", target, 3, "m"),
            tilt=numbers("--tilt", tilt, 2, "rad"),
            goal=Goal(goal),
            slide=slide,
            start=None if start is None else numbers("--start", start, 3, "rad"),
            torque_max=math.inf if torque_max is None else torque_max,
            hard=hard,
            box=None if corners is None else (corners[:3], corners[3:]),  # type: ignore[arg-type]
            any_branch=any_branch,
            progress=show_progress if sys.stderr.isatty() else None,
        )
    except (IkError, SceneError) as error:
        print("tripod ik: " + " ".join(str(error).split()), file=sys.stderr)
        return BAD_ARGUMENTS
    except StepError as error:
        print("tripod ik: " + " ".join(str(error).split()), file=sys.stderr)
        return FAILED
    finally:
        if sys.stderr.isatty():
            print(f"\r{'':<{LINE}}\r", end="", file=sys.stderr, flush=True)
    if as_json:
        print(json.dumps(plain(result)))
    else:
        rows = solution_rows(result)
        width = max(len(name) for name, _ in rows)
        for name, text in rows:
            print(f"{name:<{width}}  {text}")
    return 0 if result["reached"] else MISSED


def numbers(option: str, text: str, count: int, unit: str) -> list[float]:
    """Return `count` numbers in SI of `text`, separated by spaces or commas, that are in `unit` or say theirs.

    Raises:
        IkError: they are not that many finite numbers; names the option.
    """
    from tripod_ik.errors import IkError  # noqa: PLC0415
    from tripod_sim.tables.fields import with_unit  # noqa: PLC0415

    words = text.replace(",", " ").split()
    try:
        values = [with_unit(word, unit) for word in words]
    except ValueError:
        values = []
    if len(words) != count or len(values) != count or not all(map(math.isfinite, values)):
        raise IkError(
            f"{option} is {text!r}; it must be {count} finite numbers, such as {' '.join(['0.01'] * count)!r}"
        )
    return values


def solution_rows(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what is printed for people: names and texts."""
    from tripod_sim.figures.errors import error_words  # noqa: PLC0415 - not needed for the help

    x, y, z = (1e3 * v for v in result["position"])
    missing = []
    for name, value in result["residuals"].items():
        what, _, unit = name.partition(" ")
        shown = f"{1e3 * value:.4f} mm" if unit == "[m]" else f"{math.degrees(value):.4f} degrees"
        missing.append(f"{what} {shown}")
    outcome = result["outcome"] + (f": {result['reason']}" if result["reason"] else "")
    angles, error = result["angles"], result.get("mesh_error")
    return [
        ("outcome", outcome),
        ("angles", ", ".join(f"{a:.5f}" for a in angles) + " rad"),
        ("", ", ".join(f"{math.degrees(a):.2f}" for a in angles) + " degrees"),
        ("effector", f"{x:.3f}, {y:.3f}, {z:.3f} mm"),
        ("roll, pitch", f"{math.degrees(result['roll']):.2f}, {math.degrees(result['pitch']):.2f} degrees"),
        ("residual", ", ".join(missing)),
        *([("error", f"{error_words(error['distance'])} (estimated)")] if error else []),
        ("torques", ", ".join(f"{t:.4f}" for t in result["torques"]) + " N m"),
        ("active limits", ", ".join(result["active_limits"]) or "none"),
        *([] if result["straight_way"] else [("way", "the straight one from the start passes a hard limit")]),
        ("optimality", f"{result['kkt']:.1e} rad"),
        ("solved by", f"{result['iterations']} linearisations in {1e3 * result['seconds']:.0f} ms"),
    ]
