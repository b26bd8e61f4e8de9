"""What docs/accuracy.md shows of the studies: what all cost (`accuracy_overview.py`); picture and table of each.

The studies are those that come with tripod, tripod_study/studies/*.json. The price of a scene's settings is in its
file, too, as a comment. `evidence.py` writes both.
"""

import json
import sys
import textwrap
from pathlib import Path
from typing import Any

from benchmarks import accuracy_overview
from benchmarks.doc_parts import folded
from tripod_bringup.study_files import error_text, seconds
from tripod_bringup.study_plans import PLANS, plan
from tripod_study.advice import knob_that_pays, short
from tripod_study.fingerprint import fingerprint

ROOT = Path(__file__).resolve().parents[1]
STUDIES = ROOT / "tripod_study" / "studies"

SCENES = ROOT / "tripod_sim" / "scenes"
MARK = "Accuracy:"
"""What the comment begins with that scene files have on the price of their settings."""


def studies() -> list[dict[str, Any]]:
    """Return the studies that come with tripod, in the order of `tripod study --all`."""
    paths = [STUDIES / f"{name}.json" for name in PLANS]
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths if path.exists()]


def take(folder: Path) -> list[str]:
    """Copy the studies of a folder into the package; return their names. Short forms are left where they are."""
    taken = []
    for name in PLANS:
        path = folder / f"{name}.json"
        if not path.exists():
            continue
        if json.loads(path.read_text(encoding="utf-8"))["quick"]:
            print(f"{path}: the short form of the study, left out", file=sys.stderr)
            continue
        STUDIES.mkdir(exist_ok=True)
        (STUDIES / path.name).write_bytes(path.read_bytes())
        taken.append(name)
    return taken


def section(result: dict[str, Any]) -> str:
    """Return a study as Markdown, folded."""
    first, reference = result["quantities"][0], result["reference"]
    advice = [*filter(None, [knob_that_pays(result), price(result)])]
    lines = [
        f"![error over computing time, {result['study']}](images/accuracy_{result['study']}.png)",
        "",
        wrapped(
            f"`tripod study {result['study']}`; error: {first['what']}. {own_error(reference, first)} {result['note']}"
        ),
        "",
        *[wrapped(sentence, "- ") for sentence in advice],
        *([""] if advice else []),
        *table(result),
    ]
    if result["orders"]:
        lines += ["", wrapped(orders(result))]
    failed = [p for p in result["points"] if p["status"] != "ok"]
    if failed:
        lines += [
            "",
            wrapped(
                f"Of {len(result['points'])} settings {len(failed)} gave no result, such as "
                f"{short(failed[0]['settings'], result)}: {failed[0]['status']}, {failed[0]['message']}."
            ),
        ]
    return "\n".join(folded(result["title"], lines))


def summary(found: list[dict[str, Any]]) -> str:
    """Return the cheapest setting of each study within each accuracy, folded."""
    names = [f"{level:g} %" for level in accuracy_overview.LEVELS]
    lines = ["| study | CPU | " + " | ".join(names) + " |", "|---|---|" + "---|" * len(names)]
    for result in found:
        prices = accuracy_overview.of_study(result).prices
        cells = [f"{p.setting}: {seconds(p.cost)}" if p and p.sure else "none surely" for p in prices]
        lines.append(f"| `{result['study']}` | {result['cpu']} | " + " | ".join(cells) + " |")
    return "\n".join(
        folded("The cheapest setting within each accuracy, and the CPU time that it takes", lines)
    )


def wrapped(text: str, bullet: str = "") -> str:
    """Return prose in lines of the documents' width."""
    filled = textwrap.fill(
        text.replace(" %", "\N{NO-BREAK SPACE}%"), 120, initial_indent=bullet, subsequent_indent=" " * len(bullet),
        break_on_hyphens=False, break_long_words=False,
    )  # fmt: skip
    return filled.replace("\N{NO-BREAK SPACE}", " ")


def own_error(reference: dict[str, Any] | None, quantity: dict[str, Any]) -> str:
    """Return in a sentence what the reference is worth."""
    if not reference or reference["own_error"] is None:
        return "There is no reference."
    size = f"{reference['scale']:.3g} {quantity['unit']}"
    return f"In percent of {size}. The error of the reference is estimated at {100 * reference['own_error']:.2g} %."


def table(result: dict[str, Any]) -> list[str]:
    """Return the best settings and those that have a name as a Markdown table, cheapest first."""
    rows = [p for p in result["points"] if p["on_front"] or (p["label"] and p["cpu"] is not None)]
    rows.sort(key=lambda p: p["cpu"])
    lines = [f"| setting | unknowns | error [%] | CPU [{result['cpu']}] | |", "|---|---|---|---|---|"]
    for p in rows:
        marks = [*(["best"] if p["on_front"] else []), *([p["label"]] if p["label"] else [])]
        lines.append(
            f"| {short(p['settings'], result)} | {p['unknowns']} | {errors(p, result)} "
            f"| {seconds(p['cpu'])} | {', '.join(marks)} |"
        )
    return lines


def errors(point: dict[str, Any], result: dict[str, Any]) -> str:
    """Return the errors of a point that are promised, in percent."""
    return ", ".join([error_text(point), *beside(point, result)])


def beside(point: dict[str, Any], result: dict[str, Any]) -> list[str]:
    """Return the errors of a point that are promised beside its own, in percent and with their names."""
    named = [q["name"] for q in result["quantities"] if q.get("promised")]
    return [f"{name} {100 * point['errors'][name]['relative']:.3g}" for name in named]


def price(result: dict[str, Any]) -> str:
    """Return in two sentences the default's error, and the better setting for its time, or what half of it costs.

    Off the front there is a setting that is more accurate and takes no longer.
    """
    points = result["points"]
    default = next((p for p in points if p["label"] == "the default" and p["error"] is not None), None)
    if default is None:
        return ""
    front = [points[i] for i in result["front"]]
    own = f"The default settings err by {errors(default, result)} %."
    if not default["on_front"]:
        best = min((p for p in front if p["cpu"] <= default["cpu"]), key=lambda p: p["error"])
        part = best["cpu"] / default["cpu"]
        words = f"{short(best['settings'], result)} errs by {errors(best, result)} %"
        return f"{own} A better choice takes {part:.2g} of their time: {words}."
    half = [p for p in front if p["error"] <= default["error"] / 2]
    if not half:
        return f"{own} Nothing as fast is better; no setting has half of that error."
    best = min(half, key=lambda p: p["cpu"])
    words = f"{short(best['settings'], result)}: {errors(best, result)} %"
    times = best["cpu"] / default["cpu"]
    return (
        f"{own} Nothing as fast is better; half of that error takes {times:.2g} times their time ({words})."
    )


def marked(result: dict[str, Any], text: str) -> str:
    """Return the text of a scene file with the price of its settings, in a comment above `dt`."""
    words = wrapped(f"{MARK} study {result['study']}, docs/accuracy.md. {price(result)}", "# ").split("\n")
    comment = "\n".join("# " + line.removeprefix("# ").lstrip() for line in words)
    head, _, rest = text.partition("\ndt = ")
    lines = head.split("\n")
    start = next((i for i, line in enumerate(lines) if line.startswith(f"# {MARK}")), len(lines))
    return "\n".join([*lines[:start], comment]) + f"\ndt = {rest}"


def orders(result: dict[str, Any]) -> str:
    """Return the fitted orders in a sentence, one for each value of the field that groups the points."""
    found: dict[str, list[float]] = {}
    for family in result["orders"]:
        newton = family["settings"].get("solver.mode", "newton") == "newton"
        if newton:
            found.setdefault(str(family["settings"][result["group"]]), []).append(family["order"])
    words = [f"{name} {sum(p) / len(p):.1f}" for name, p in found.items()]
    knob, quantity = result["order_knob"], result["order_quantity"]
    return f"Fitted order of convergence in {knob} (error of {quantity}): {', '.join(words)}."


def parts(found: list[dict[str, Any]]) -> dict[str, list[str]]:
    """Return the parts of the page that are made of the studies, by name."""
    calibrations = [r["machine"]["calibration"] for r in found if r["machine"]["calibration"]]
    speed = (
        f"{1e3 * min(calibrations):.0f} to {1e3 * max(calibrations):.0f} ms" if calibrations else "unknown"
    )
    head = (
        "CPU time of one thread, the least of the repetitions. A 1000 x 1000 float64 product took "
        f"{speed} beside the points."
    )
    sections = [wrapped(head), summary(found), *(section(result) for result in found)]
    return {"overview": overview(found), "studies": ["\n\n".join(sections)]}


def overview(found: list[dict[str, Any]]) -> list[str]:
    """Return what the document begins with, as Markdown."""
    rows = accuracy_overview.rows_of(found)
    note = wrapped(
        f"CPU time of one processor core. `-`: no setting of the study is so accurate. {accuracy_overview.unsure(rows)}"
    )
    return [*accuracy_overview.table(rows), "", note]


def default_text(found: list[dict[str, Any]]) -> str:
    """Return in a sentence what the default scene of the Tripod errs by, and costs."""
    moving = next(r for r in found if r["study"] == "tripod_dynamic")
    row = accuracy_overview.of_study(moving)
    error, _, cost = row.default.partition(", ")
    return wrapped(
        f"The default scene of the Tripod errs by {error} in a fast move, and a simulated second takes {cost} of one "
        "core."
    )


def scene_files(found: list[dict[str, Any]]) -> dict[Path, str]:
    """Return the files of the studied scenes with the price of their settings, by the study of a motion."""
    files = {SCENES / f"{r['scene']}.toml": r for r in found if r["cpu"] != "s per solve"}
    return {path: marked(r, path.read_text(encoding="utf-8")) for path, r in files.items()}


def old(found: list[dict[str, Any]]) -> list[str]:
    """Return in words which studies were measured with other code than this."""
    codes = {
        r["study"]: (r["versions"].get("code"), fingerprint(plan(r["study"], quick=False).module))
        for r in found
    }
    return [
        f"{name}: measured with code {code}, here it is {here}"
        for name, (code, here) in codes.items()
        if code != here
    ]
