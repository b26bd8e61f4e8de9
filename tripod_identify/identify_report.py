"""What was identified: rows for people, the report, the scene as a file."""

import math

import numpy as np

from tripod_identify.csv_columns import COMMANDED, UNITS
from tripod_identify.identify import Found, Identified
from tripod_identify.measured import Measured
from tripod_identify.page import Page
from tripod_identify.parameters import GAIN, ZERO
from tripod_identify.pictures import curves
from tripod_identify.score import Score
from tripod_identify.score_report import HEAD, left_rows, spread_cells
from tripod_sim.scene.file import scene_to_toml
from tripod_sim.tables.short_forms import joints_of

FOUND_HEAD = ("value", "found", "90 % by noise", "mesh adds", "steps add", "without both", "90 %", "unit")

SHOWN = {"rad": (math.degrees(1), "degrees"), "m": (1e3, "mm"), "s": (1e3, "ms")}
"""How units are shown."""


def _shown(found: Found) -> tuple[float, str]:
    return SHOWN.get(found.parameter.unit, (1.0, found.parameter.unit))


def found_rows(result: Identified) -> list[list[str]]:
    """Return a row for each value that was found, under `FOUND_HEAD`."""
    rows = []
    for f in result.found:
        size, unit = _shown(f)

        def n(value: float, size: float = size) -> str:
            return f"{size * value:.5g}"

        rows.append(
            [
                f.parameter.name, n(f.value), f"{n(f.low)} to {n(f.high)}", n(f.mesh) if result.mesh else "?",
                n(f.step) if result.step else "-", n(f.true), f"{n(f.true_low)} to {n(f.true_high)}", unit,
            ]
        )  # fmt: skip
    return rows


def score_rows(result: Identified) -> list[list[str]]:
    """Return the errors before and after, of fitted and of held-out rows, under `score_report.HEAD`."""
    rows: list[list[str]] = []
    named = (
        ("before", result.before), ("after", result.after),
        ("held out, before", result.held_before), ("held out, after", result.held_after),
    )  # fmt: skip
    for name, score in named:
        rows += _rows(name, score)
    return rows


def _rows(name: str, score: Score | None) -> list[list[str]]:
    rows = []
    if score and score.distance:
        rows.append([f"{name}: place [mm]", *spread_cells(score.distance, angle=False)])
    if score and score.angle:
        rows.append([f"{name}: rotation [degrees]", *spread_cells(score.angle, angle=True)])
    return rows


def rest_rows(result: Identified) -> list[list[str]]:
    """Return what the rest is made of: name and size."""
    size, unit = (1e3, "mm") if result.after.distance else (math.degrees(1), "degrees")
    rows = left_rows(result.left, angle=not result.after.distance)
    if result.mesh:
        rows.append(["the mesh makes", f"{size * result.mesh.size:.4f} {unit} (at {result.mesh.rows} rows)"])
    if result.step:
        rows.append(["the time steps make", f"{size * result.step.size:.4f} {unit}"])
    rows.append(["the values' uncertainty makes", f"{size * result.parameters:.4f} {unit}"])
    return rows


def untold_lines(result: Identified) -> list[str]:
    """Return a sentence for each value that the data do not tell."""
    return [
        (
            f"{u.parameter.name} cannot be found from these data ({u.why}); it stays at "
            f"{u.parameter.value:g} {u.parameter.unit}"
        ).rstrip()
        for u in result.untold
    ]


def proposal_lines(result: Identified) -> list[str]:
    """Return a sentence for each pose that would tell most."""
    lines = []
    for i, p in enumerate(result.proposals, 1):
        servos = len(result.told.zero)
        said = [f"servos {', '.join(f'{a:.3f}' for a in p.joints[:servos])} rad"] if servos else []
        joints = joints_of(result.told.scene)
        for joint, value in zip(joints.others if joints else (), p.joints[servos:-1], strict=True):
            unit = COMMANDED[joint.unit][1]
            said.append(f"{joint.name} {value / UNITS[unit][1]:.4g} {unit}")
        if servos:
            said.append(f"slide {1e3 * p.joints[-1]:.1f} mm")
        gain = 100 * (1 - float(np.min(p.half)))
        lines.append(f"pose {i}: {', '.join(said)}; the interval of one value then is {gain:.0f} % shorter")
    return lines


def calibration_lines(result: Identified) -> list[str]:
    """Return how the servos' calibration changes."""
    told, names = result.told, {f.parameter.name for f in result.found}
    lines = []
    for i, (zero, gain) in enumerate(zip(told.zero, told.gain, strict=True)):
        if f"{ZERO}.{i}" in names:
            lines.append(
                f"servo_{i}: its arm stands {math.degrees(zero):+.3f} degrees beyond the command; in robot.yaml take "
                f"{zero:+.5f} rad times its direction off its offset"
            )
        if f"{GAIN}.{i}" in names:
            lines.append(f"servo_{i}: it turns by {gain:.5f} of the command")
    return lines


def scene_text(result: Identified, command: str, *, calibrated: bool = False) -> str:
    """Return the scene with what was found, as TOML; `calibrated`: the servos' calibration has its part already."""
    lines = ["# Identified by", f"#   {command}", "# 90 % intervals by noise alone:"]
    for f in result.found:
        lines.append(
            f"#   {f.parameter.name} = {f.value:.6g} ({f.low:.6g} to {f.high:.6g}) {f.parameter.unit}".rstrip()
        )
    calibration = [] if calibrated else calibration_lines(result)
    lines += [f"# {line}" for line in (*untold_lines(result), *calibration, *result.notes)]
    return "\n".join([*lines, "", scene_to_toml(result.told.scene)])


def identify_report(title: str, command: str, measured: Measured, result: Identified) -> str:
    """Return the report as HTML."""
    page = Page(title)
    page.code(command)
    for note in (*result.notes, *untold_lines(result)):
        page.warn(note)
    page.heading("Values")
    page.table(FOUND_HEAD, found_rows(result))
    page.say(
        "“Found” makes this scene, on its own mesh and with its own steps, fit best. “Without both” is what the "
        "same data say where mesh and steps have no error, as far as meshes with halved edges and with other elements "
        "tell: the value of the material and the robot. Its interval takes what these change as errors that all rows "
        "share."
    )
    if any(f.profile for f in result.found):
        rows = []
        for f in result.found:
            size, unit = _shown(f)
            if f.profile:
                rows.append(
                    [f.parameter.name, f"{size * f.profile[0]:.5g} to {size * f.profile[1]:.5g}", unit]
                )
        page.table(("value", "90 % by its profile", "unit"), rows)
    for line in calibration_lines(result):
        page.say(line)
    page.heading("Errors")
    page.table(HEAD, score_rows(result))
    page.picture(
        curves(measured, result.every, "after", left_out=result.held_out),
        "measured and predicted numbers, after",
    )
    page.heading("What is left")
    page.table(("", "root mean square"), rest_rows(result))
    page.heading("How well the data tell the values")
    page.say(f"Condition of the scaled Jacobian: {result.fit.condition:.3g}. Correlations:")
    names = [p.name for p in result.fit.wanted]
    page.table(
        ("", *names),
        [[n, *(f"{c:.2f}" for c in row)] for n, row in zip(names, result.fit.correlations, strict=True)],
    )
    if result.proposals:
        page.heading("Poses that would tell most")
        for line in proposal_lines(result):
            page.say(line)
    return page.text
