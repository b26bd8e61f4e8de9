"""docs/accuracy.md from the studies: what all cost, one picture and one table (`accuracy_overview.py`); for each study
one picture, one table, its advice; the peers of `peers.py`.

The studies are those that come with tripod, tripod_sim/studies/*.json; what stands outside the marks in the document is
left as it is. The price of a scene's settings is in its file, too, as a comment.

    tripod study --all --out studies                      # measures: half an hour on two processors, a quiet machine
    python benchmarks/accuracy_docs.py --from studies     # takes them into the package, then renews the document
    python benchmarks/accuracy_docs.py                    # only the document and its pictures
    python benchmarks/accuracy_docs.py --check            # exit code 1 if the document is not of these studies; names
                                                          # those that other code than this has measured
"""

import argparse
import json
import sys
import textwrap
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks import accuracy_overview, accuracy_peers
from benchmarks.doc_parts import renewed
from tripod_bringup.study_files import error_text, seconds
from tripod_bringup.study_plans import PLANS
from tripod_bringup.study_plot import draw
from tripod_sim.study.advice import short
from tripod_sim.study.fingerprint import fingerprint

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT, IMAGES = ROOT / "docs" / "accuracy.md", ROOT / "docs" / "images"
STUDIES = ROOT / "tripod_sim" / "studies"

OVERVIEW = IMAGES / "accuracy.png"

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
    """Return a study as Markdown."""
    first, reference = result["quantities"][0], result["reference"]
    advice = [*result["advice"][1:], *filter(None, [price(result)])]
    lines = [
        f"### {result['title']}",
        "",
        f"![error over CPU time, {result['study']}](images/accuracy_{result['study']}.png)",
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
    return "\n".join(lines)


def summary(found: list[dict[str, Any]]) -> list[str]:
    """Return the cheapest setting of each study within each accuracy: what one comes to the page for."""
    names = [f"{level:g} %" for level in accuracy_overview.LEVELS]
    lines = ["| study | CPU | " + " | ".join(names) + " |", "|---|---|" + "---|" * len(names)]
    for result in found:
        prices = accuracy_overview.of_study(result).prices
        cells = [f"{p.setting}: {seconds(p.cost)}" if p and p.sure else "none surely" for p in prices]
        lines.append(f"| `{result['study']}` | {result['cpu']} | " + " | ".join(cells) + " |")
    return [
        "**The cheapest setting within each accuracy**, and the CPU time that it takes:",
        "\n".join(lines),
    ]


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
    return f"In percent of {size}; the reference's own error is estimated at {100 * reference['own_error']:.2g} %."


def table(result: dict[str, Any]) -> list[str]:
    """Return the front and the settings that have a name as a Markdown table, cheapest first."""
    rows = [p for p in result["points"] if p["on_front"] or (p["label"] and p["cpu"] is not None)]
    rows.sort(key=lambda p: p["cpu"])
    lines = [f"| setting | unknowns | error [%] | CPU [{result['cpu']}] | |", "|---|---|---|---|---|"]
    for p in rows:
        marks = [*(["front"] if p["on_front"] else []), *([p["label"]] if p["label"] else [])]
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
    """Return in a sentence what the default's error costs, or what it could be for the default's time.

    Off the front there is a setting that is more exact and takes no longer; on it, what half of the error takes is
    told.
    """
    points = result["points"]
    default = next((p for p in points if p["label"] == "the default" and p["error"] is not None), None)
    if default is None:
        return ""
    front = [points[i] for i in result["front"]]
    own = f"The default errs by {errors(default, result)} %"
    if not default["on_front"]:
        best = min((p for p in front if p["cpu"] <= default["cpu"]), key=lambda p: p["error"])
        part = best["cpu"] / default["cpu"]
        words = f"{short(best['settings'], result)} errs by {errors(best, result)} %"
        return f"{own}, the course's choice, not on the front: for {part:.2g} of its time {words}."
    half = [p for p in front if p["error"] <= default["error"] / 2]
    if not half:
        return f"{own} and is on the front; nothing errs by half of that."
    best = min(half, key=lambda p: p["cpu"])
    words = f"{short(best['settings'], result)}: {errors(best, result)} %"
    times = best["cpu"] / default["cpu"]
    return f"{own} and is on the front; half of its error takes {times:.2g} times its time ({words})."


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
    return (
        f"Fitted order in {result['order_knob']} (error of {result['order_quantity']}): {', '.join(words)}."
    )


def document(found: list[dict[str, Any]], text: str) -> str:
    """Return the document with its studies renewed."""
    calibrations = [r["machine"]["calibration"] for r in found if r["machine"]["calibration"]]
    speed = (
        f"{1e3 * min(calibrations):.0f} to {1e3 * max(calibrations):.0f} ms" if calibrations else "unknown"
    )
    head = (
        "Generated by `python benchmarks/accuracy_docs.py`. CPU time of one thread, the least of the repetitions; a "
        f"1000 x 1000 float64 product took {speed} beside the points."
    )
    parts = [wrapped(head), *summary(found), *(section(result) for result in found), accuracy_peers.section()]
    text = renewed(text, "overview", [overview(found)])
    return renewed(text, "studies", ["\n\n".join(parts)])


def overview(found: list[dict[str, Any]]) -> str:
    """Return what the document begins with, as Markdown."""
    rows = accuracy_overview.rows_of(found)
    notes = [
        "CPU time of one thread; the errors are of what each study below says, the largest of all that it promises; "
        "the cheapest setting in the study's own motions, named there: `--accuracy` keeps a margin for others, and so "
        "takes a dearer one. Of the other simulators, and of tripod beside them: from docs/peers.json, "
        "times scaled to the machine of the studies.",
        accuracy_overview.unsure(rows),
        accuracy_overview.missing(rows),
    ]
    picture = f"![what each accuracy costs, of each scene](images/{OVERVIEW.name})"
    return "\n\n".join(
        [picture, "\n".join(accuracy_overview.table(rows)), wrapped(" ".join(filter(None, notes)))]
    )


def scene_files(found: list[dict[str, Any]]) -> dict[Path, str]:
    """Return the files of the studied scenes with the price of their settings, by the study of a motion."""
    files = {SCENES / f"{r['scene']}.toml": r for r in found if r["cpu"] != "s per solve"}
    return {path: marked(r, path.read_text(encoding="utf-8")) for path, r in files.items()}


def main() -> None:
    """Renew the document."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--from", dest="source", type=Path, metavar="DIR", help="take the studies of this folder"
    )
    parser.add_argument("--check", action="store_true", help="write nothing")
    options = parser.parse_args()
    if options.source and not options.check:
        print("taken:", ", ".join(take(options.source)) or "nothing")
    found, text = studies(), DOCUMENT.read_text(encoding="utf-8")
    made = document(found, text)
    if options.check:
        for result in found:
            code, here = result["versions"].get("code"), fingerprint(PLANS[result["study"]])
            if code != here:
                print(f"{result['study']}: measured with code {code}, here it is {here}", file=sys.stderr)
        old = [path for path, text in scene_files(found).items() if path.read_text(encoding="utf-8") != text]
        for path in old:
            print(f"{path.name}: the price of its settings is not of these studies")
        sys.exit(made != text or bool(old))
    DOCUMENT.write_text(made, encoding="utf-8")
    for path, text in scene_files(found).items():
        path.write_text(text, encoding="utf-8")
    for result in found:
        draw(result, IMAGES / f"accuracy_{result['study']}.png")
    accuracy_overview.draw(accuracy_overview.rows_of(found), OVERVIEW)


if __name__ == "__main__":
    main()
