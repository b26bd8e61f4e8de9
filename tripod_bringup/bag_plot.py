"""The curves of a recording: angles, effector, ball, errors over time, as far as it holds them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tripod_graph.joint import SHOWN
from tripod_graph.names import SIM_STATUS, SLIDE, count_servos, servo_names
from tripod_host.writing import replaced
from tripod_record.bag import Bag
from tripod_record.errors import RecordError
from tripod_record.table import Series

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")

Curve = tuple[str, str, str, float]
"""Topic, field, style and factor to the unit of the panel."""

POSITIONS, EFFORTS = {"N": "m", "Pa": "m³"}, {"m": "N", "m³": "Pa"}
"""Units of position and effort by that of the command, where they are others."""

DEGREES, MILLIMETRES = 180 / np.pi, 1e3


def joint_units(bag: Bag) -> dict[str, str]:
    """Return the units of the commands by joint, as the first status of each simulator tells them."""
    topics = {t for t in bag.topics if t.endswith(f"/{SIM_STATUS}") and bag.can_decode(t)}
    found = dict[str, str]()
    for heard in bag.messages(topics.__contains__) if topics else ():
        topics.discard(heard.topic)
        message = bag.decoded(heard)
        found |= dict(zip(getattr(message, "joint_names", ()), getattr(message, "units", ()), strict=False))
        if not topics:
            break
    return found


def panels(
    series: dict[str, Series], units: Mapping[str, str] | None = None
) -> list[tuple[str, str, list[Curve]]]:
    """Return title, unit and curves of each panel that has any; `units`: of the commands of joints."""
    poses = [(f"position.{axis}", f"pose.position.{axis}") for axis in "xyz"]
    told = {name for found in series.values() for name in found.values}
    servos = servo_names(count_servos(n.removeprefix("position.") for n in told))
    joints = [f"position.{name}" for name in servos]
    others = sorted(
        {
            name
            for topic, found in series.items()
            if topic.endswith("/sim/joint_states")
            for name in found.values
            if name.startswith(("position.", "effort.")) and not name.rpartition(".")[2].isdigit()
        }
        - {f"{kind}.{name}" for kind in ("position", "effort") for name in (*servos, SLIDE)}
    )
    found = [
        (
            "servo angles: simulated; of the robot dashed",
            "degrees",
            [
                (t, f, s, DEGREES)
                for t, s in (("sim/joint_states", "-"), ("robot/joint_states", "--"))
                for f in joints
            ],
        ),
        *_of_others(others, units or {}),
        (
            "effector: simulated; target dashed, measured dotted",
            "mm",
            [
                (t, f, s, MILLIMETRES)
                for t, s in (("sim/effector_pose", "-"), ("target_pose", "--"), ("robot/effector_pose", ":"))
                for _, f in poses
            ],
        ),
        (
            "ball: simulated; seen dotted",
            "mm",
            [
                (t, f, s, MILLIMETRES)
                for t, s in (("sim/ball_pose", "-"), ("ball_pose", ":"))
                for _, f in poses
            ],
        ),
        (
            "errors: of inverse kinematics; of the time steps dashed, of the mesh dash-dotted",
            "mm",
            [
                ("ik/status", "error", "-", MILLIMETRES),
                ("ik/status", "residual", ":", MILLIMETRES),
                ("sim/status", "effector_time_error", "--", MILLIMETRES),
                ("sim/status", "effector_mesh_error", "-.", MILLIMETRES),
            ],
        ),
    ]
    there = {(topic, field) for topic in series for field in series[topic].values}
    return [
        (title, unit, kept)
        for title, unit, curves in found
        if (
            kept := [
                (t, *c[1:]) for c in curves for t in series if t.endswith(f"/{c[0]}") and (t, c[1]) in there
            ]
        )
    ]


def _of_others(fields: Sequence[str], units: Mapping[str, str]) -> list[tuple[str, str, list[Curve]]]:
    """Return a panel for each quantity of joints that are no servos; `fields`: as `position.left`."""
    found = dict[tuple[str, str], list[Curve]]()
    for field in fields:
        kind, _, name = field.partition(".")
        command = units.get(name, "")
        unit = (POSITIONS if kind == "position" else EFFORTS).get(command, command) or "SI"
        factor, shown = SHOWN.get(unit, (1.0, unit))
        title = f"{'commands to' if unit == command else 'return of'} cables, chambers and forces"
        found.setdefault((title if command else "other joints", shown), []).append(
            ("sim/joint_states", field, "-", factor)
        )
    return [(title, unit, curves) for (title, unit), curves in sorted(found.items())]


def draw(series: dict[str, Series], path: Path, title: str, units: Mapping[str, str] | None = None) -> None:
    """Draw the panels into `path`; see `panels`. Raises RecordError if there is nothing to draw, or no matplotlib."""
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - only where a picture is wanted
    except ImportError:
        raise RecordError("a plot needs matplotlib: pip install matplotlib, or make setup") from None
    shown = panels(series, units)
    if not shown:
        raise RecordError(
            "nothing to draw: the recording has no angles, poses or errors; `tripod bag info` lists its "
            "topics"
        )
    figure = Figure(figsize=(10, 0.6 + 2.4 * len(shown)), layout="constrained")
    for axes, (what, unit, curves) in zip(
        figure.subplots(len(shown), 1, squeeze=False, sharex=True)[:, 0], shown, strict=True
    ):
        _panel(axes, series, curves)
        axes.set(ylabel=f"[{unit}]")
        axes.set_title(what, fontsize="medium")
        axes.grid(visible=True, alpha=0.3)
    axes.set(xlabel="time [s]")
    figure.suptitle(title)
    with replaced(path) as file:
        figure.savefig(file, format=path.suffix[1:].lower(), dpi=110)


def _panel(axes: Any, series: dict[str, Series], curves: list[Curve]) -> None:
    for number, (topic, field, style, factor) in enumerate(curves):
        one = series[topic]
        values = one.values[field]
        if field.endswith(("time_error", "mesh_error")):
            values = np.where(values < 0, np.nan, values)  # not estimated
        last = field.rpartition(".")[2]
        place = "xyz".index(last) if last in "xyz" else int(last[-1]) if last[-1].isdigit() else number
        colour = COLOURS[place % len(COLOURS)]
        label = f"{topic.lstrip('/')} {last}"
        axes.plot(one.times, factor * values, style, color=colour, linewidth=0.9, label=label)
    axes.legend(fontsize="xx-small", ncols=3, loc="upper right")
