"""The files of a study of accuracy: JSON, CSV, picture; and its table for the screen."""

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tripod_host.writing import replaced_text

Result = Mapping[str, Any]


def write_files(result: Result, folder: Path) -> list[Path]:
    """Write `<study>.json`, `.csv` and, where matplotlib is installed, `.png`; return their paths."""
    name = folder / result["study"]
    written = [name.with_suffix(".json"), name.with_suffix(".csv")]
    with replaced_text(written[0]) as file:
        file.write(json.dumps(result, indent=1, allow_nan=False) + "\n")
    write_csv(result, written[1])
    try:
        from tripod_bringup.study_plot import draw  # noqa: PLC0415

        draw(result, name.with_suffix(".png"))
    except ModuleNotFoundError:
        return written
    return [*written, name.with_suffix(".png")]


def write_csv(result: Result, path: Path) -> None:
    """Write one row a point, SI units, errors relative and absolute; the accuracies that it is fastest for in one."""
    fields = [knob["field"] for knob in result["knobs"]]
    quantities = [(q["name"], q["unit"]) for q in result["quantities"]]
    plain = (
        "status",
        "message",
        "unknowns",
        "error",
        "own_error",
        "bound",
        "below",
        "cpu",
        "cpu_median",
        "repeats",
    )
    with replaced_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        errors = [word for name, unit in quantities for word in (f"{name} [{unit}]", f"{name}, relative")]
        writer.writerow(["label", *fields, *plain, "on_front", "fastest_within", *errors])
        for i, point in enumerate(result["points"]):
            cells = [point["label"], *(point["settings"][f] for f in fields), *(point[key] for key in plain)]
            levels = [level for level, best in result["cheapest"].items() if best == i]
            cells += [point["on_front"], "; ".join(levels)]
            for name, _ in quantities:
                error = point["errors"].get(name, {})
                cells += [error.get("absolute"), error.get("relative")]
            writer.writerow(cells)


def error_text(point: Result) -> str:
    """Return a point's error in percent; `<` where the reference is not worth more."""
    if point["error"] is None:
        return "-"
    if point["below"]:
        return f"< {200 * point['own_error']:.2g}"
    return f"{100 * point['error']:.3g}"


def bound_text(point: Result) -> str:
    """Return in percent how large a point's error may be, with the error of the reference itself."""
    return "-" if point["bound"] is None else f"{100 * point['bound']:.3g}"


def seconds(value: float | None) -> str:
    """Return a CPU time for the table."""
    return "-" if value is None else f"{value:.3g}"


def table(result: Result) -> str:
    """Return the study for people: its points by cost, the front marked, what is cheapest, orders, advice."""
    from tripod_study.advice import short  # noqa: PLC0415 - not needed for the help

    rows = sorted(result["points"], key=lambda p: (p["cpu"] is None, p["cpu"] or 0.0))
    cells = [["", "setting", "unknowns", "error [%]", "up to", f"CPU [{result['cpu']}]", "median", ""]]
    for p in rows:
        name = short(p["settings"], result) + (f" ({p['label']})" if p["label"] else "")
        note = p["message"] if p["status"] == "ok" else f"{p['status']}: {p['message']}"
        cells.append(
            [
                "*" if p["on_front"] else "", name, str(p["unknowns"] or "-"), error_text(p), bound_text(p),
                seconds(p["cpu"]), seconds(p["cpu_median"]), note,
            ]
        )  # fmt: skip
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
    lines = [result["title"] + (" (quick)" if result["quick"] else "")]
    lines += ["  ".join(t.ljust(w) for t, w in zip(row, widths, strict=True)).rstrip() for row in cells]
    return "\n".join([*lines, *_tail(result)])


def _tail(result: Result) -> list[str]:
    """Return what follows the table."""
    reference, first = result["reference"], result["quantities"][0]
    own = reference and reference["own_error"]
    lines = [
        f"error: {first['what']}; *: no other point is better in both",
        "up to: error and the reference's own error together",
    ]
    if own is not None:
        lines.append(
            f"reference: {_words(reference['settings'])}; its own error, estimated: {100 * own:.2g} % "
            f"({own * reference['scale']:.2g} {first['unit']} of {reference['scale']:.3g})"
        )
    else:
        lines.append(reference["message"] if reference else "no reference")
    for family in result["orders"]:
        shown = {k: v for k, v in family["settings"].items() if _varies(result, k)}
        lines.append(f"order in {result['order_knob']}: {family['order']:.2f}  {_words(shown)}")
    return [*lines, *([f"note: {result['note']}"] if result["note"] else []), *result["advice"]]


def _varies(result: Result, field: str) -> bool:
    return any(knob["field"] == field and len(knob["values"]) > 1 for knob in result["knobs"])


def _words(settings: Result) -> str:
    return ", ".join(
        f"{field.rpartition('.')[2]} {value:g}"
        if isinstance(value, float)
        else f"{field.rpartition('.')[2]} {value}"
        for field, value in settings.items()
    )
