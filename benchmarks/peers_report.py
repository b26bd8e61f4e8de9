"""The page docs/peers.md and its picture, from the rows that `peers.py` has found."""

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import peers
from benchmarks.doc_parts import folded, table_lines
from benchmarks.peers_notes import NOTES

WITHIN = 5.0
"""Error at which simulators are compared in the short table [%]."""

QUIET = 1.6
"""Load above which times are called provisional."""

MARKERS = {"tripod": "o", "MuJoCo": "s", "Newton": "^", "PyBullet": "D"}

TITLES = {
    "cantilever rest": "Cantilever: deflection at rest",
    "cantilever swing": "Cantilever: first swing after release",
    "y L1": "Y-piece, L1: sag of the disc by weight",
    "y L2": "Y-piece, L2: all ends turned by -45 degrees",
    "cloth": "Cloth: hung at two corners, first second",
}

BODIES = {
    "cantilever rest": "Bar 100 x 20 x 20 mm, E = 250 kPa, nu = 0.3 (0.45 would lock the linear tetrahedra that most "
    "peers have), 40 g; one end held; mean deflection of the four corners of the other end at rest. Error in percent "
    "of it.",
    "cantilever swing": "The same bar is straight and at rest at first, undamped; height of the tip every 10 ms for "
    "0.25 s (one swing lasts 0.2 s). Largest error in percent of the largest deflection.",
    "y L1": "The silicone Y of the Tripod, E = 250 kPa, nu = 0.45, 32 g, ends held beyond 45 mm, rigid disc in its "
    "centre; height of the disc at rest. Error in percent of it.",
    "y L2": "The same with its ends turned about the servo axes. Error in percent of the disc's travel from L1.",
    "cloth": "The scene `cloth`: 20 x 20 nodes of 1 g, 1482 springs that are slack when compressed. Root mean square "
    "error of the nodes' positions, the largest of 20 samples, in percent of the edge (1 m).",
}

HEAD = """# Other simulators

We ran the same five problems in Tripod, MuJoCo, Newton and PyBullet and compared each result with one reference.
A dot in the picture is one setting of one simulator: further down is more accurate, further left is faster.
The table shows what an error of 5 % costs in each simulator, where it can be reached.

![error over computing time of four simulators](images/peers.png)

{table}

CPU time of one processor core: of a simulated second in motion, else of the whole solve.
"Not reached" names the smallest error that we found with that simulator.

How we measured:

- At rest, Tripod solves for equilibrium directly. The others simulate 0.6 s of damped motion until it has died out.
- Building the model and compiling are not counted, except where a note says so.
- Each simulator runs with what its manual or examples advise for deformable bodies, at several resolutions or steps.
- Errors below the uncertainty of the reference (grey in the picture) have no meaning.
- SOFA is missing because it has no wheels for Python 3.11. Its step times on the Tripod are in [how fast](speed.md).
- Genesis is missing because it needs PyTorch and is made for GPUs. Newton, here on the CPU, is made for GPUs as well.
- To repeat: `pip install 'tripod[peers]'`, then `python benchmarks/peers.py`. The rows are in [peers.json](peers.json).
"""


def cell(value: float | None, digits: int = 3) -> str:
    """Return a number for the table, `-` where there is none."""
    return "-" if value is None else f"{value:.{digits}g}"


def cost(row: Any) -> float | None:
    """Return CPU seconds per simulated second, or to the answer for cases at rest."""
    if row.cpu is None:
        return None
    return row.cpu / row.simulated if row.simulated and row.case in ("cantilever swing", "cloth") else row.cpu


def pareto(rows: list[Any]) -> list[Any]:
    """Return the rows that no other beats in both error and cost, cheapest first."""
    found: list[Any] = []
    for row in sorted((r for r in rows if r.error is not None), key=lambda r: (cost(r), r.error)):
        if not found or row.error < found[-1].error:
            found.append(row)
    return found


def table(rows: list[Any], case: str) -> list[str]:
    """Return the rows of a case as a Markdown table; those on the front are bold."""
    unit = "CPU s / simulated s" if case in ("cantilever swing", "cloth") else "CPU s to rest"
    lines = [f"| simulator | setting | unknowns | error [%] | {unit} | note |", "|---|---|---|---|---|---|"]
    front = pareto(rows)
    for row in sorted(rows, key=lambda r: list(peers.PEERS).index(r.peer)):
        numbers = [cell(row.error), cell(cost(row))]
        if row in front:
            numbers = [f"**{n}**" for n in numbers]
        lines.append(
            f"| {row.peer} | {row.setting or '-'} | {row.unknowns or '-'} | {' | '.join(numbers)} | {row.note} |"
        )
    return lines


def notes(case: str) -> list[str]:
    """Return what each simulator could not express, or does otherwise."""
    return [f"- {peer}: {NOTES[peer][case]}." for peer in peers.PEERS if case in NOTES.get(peer, {})]


def losses(rows: list[Any], case: str, uncertainty: float) -> str:
    """Return in one sentence who is on the front, and where a peer beats every setting of ours."""
    front = pareto(rows)
    if not front:
        return "No results."
    names = list(dict.fromkeys(row.peer for row in front))
    text = f"Best settings (bold): {', '.join(names)}."
    own = [r for r in rows if r.peer == "tripod" and r.error is not None]
    for row in front:
        if row.peer == "tripod" or not own:
            continue
        as_good = [r for r in own if r.error <= max(row.error, uncertainty)]
        if not as_good:
            text += f" {row.peer} ({row.setting}) reaches {row.error:.2g} %, which none of our settings does."
        else:
            ratio = min(cost(r) for r in as_good) / cost(row)
            text += f" At {row.error:.2g} % {row.peer} is {ratio:.2g} times as fast as our cheapest setting as good."
    beaten = [
        r.setting
        for r in own
        if any(
            p.peer != "tripod" and p.error < r.error and cost(p) < cost(r)
            for p in rows
            if p.error is not None
        )
    ]
    if beaten:
        text += f" Settings of ours that a peer beats in both error and time: {'; '.join(beaten)}."
    return text


def short(rows: list[Any]) -> list[str]:
    """Return what an error of `WITHIN` costs in each simulator, as a Markdown table."""
    return table_lines(
        ("problem", *peers.PEERS),
        [(title, *(_within(rows, case, peer) for peer in peers.PEERS)) for case, title in TITLES.items()],
    )


def _within(rows: list[Any], case: str, peer: str) -> str:
    """Return the least cost of an error of `WITHIN`, or that it is not reached."""
    own = [r for r in rows if (r.case, r.peer) == (case, peer) and r.error is not None]
    if not own:
        return "no result"
    good = [cost(r) for r in own if r.error <= WITHIN]
    return f"{min(good):.2g} s" if good else f"not reached ({float(f'{min(r.error for r in own):.2g}'):g} %)"


def text(found: dict) -> str:
    """Return the page."""
    rows = found["rows"]
    measured = [r for r in rows if r.calibration]
    product = 1e3 * float(np.median([r.calibration for r in measured])) if measured else float("nan")
    loads = [r.load if r.load is not None else np.inf for r in measured]
    busy = float(np.median(loads)) > QUIET if loads else False
    versions = {r.peer: r.version for r in rows if r.version}
    lines = [
        HEAD.format(table="\n".join(short(rows))),
        f"A 1000 x 1000 float64 product took {product:.1f} ms on one thread beside the runs (median). Versions: "
        + ", ".join(f"{peer} {version}" for peer, version in versions.items())
        + "."
        + (" **The machine was busy: errors count, times are provisional.**" if busy else ""),
        "",
        "All results:",
    ]
    for case in peers.CASES:
        own = [r for r in rows if r.case == case]
        if not own:
            continue
        reference = found["references"].get(case)
        section = [BODIES[case], ""]
        if reference:
            section += [
                f"Reference: {reference['source']}; its uncertainty: {reference['uncertainty']:.2g} %.",
                "",
                losses(own, case, reference["uncertainty"]),
                "",
            ]
        lines += ["", *folded(TITLES[case], [*section, *table(own, case), "", *notes(case)])]
    return "\n".join(lines) + "\n"


def draw(found: dict, path: Path) -> None:
    """Draw error over computing time, a panel for each case."""
    import matplotlib as mpl  # noqa: PLC0415 - only for the picture

    mpl.use("Agg")
    import matplotlib.pyplot as plt  # noqa: PLC0415

    figure, panels = plt.subplots(2, 3, figsize=(13, 7.6), layout="constrained")
    colours = plt.get_cmap("tab10")
    for ax, case in zip(panels.flat, peers.CASES, strict=False):
        rows = [r for r in found["rows"] if r.case == case and r.error is not None]
        for i, peer in enumerate(peers.PEERS):
            own = [r for r in rows if r.peer == peer]
            ax.loglog(
                [cost(r) for r in own], [max(r.error, 1e-4) for r in own], MARKERS[peer], ms=6, color=colours(i),
                label=f"{peer} ({len(own)})" if own else None, mec="white", mew=0.5,
            )  # fmt: skip
        front = pareto(rows)
        ax.loglog(
            [cost(r) for r in front],
            [max(r.error, 1e-4) for r in front],
            color="0.5",
            lw=1,
            ls="--",
            zorder=0,
        )
        if (reference := found["references"].get(case)) and rows:
            low = min([ax.get_ylim()[0], reference["uncertainty"] / 2])
            ax.axhspan(low, reference["uncertainty"], color="0.92", lw=0, zorder=-1)
            ax.set_ylim(bottom=low)
        ax.set_title(TITLES[case], fontsize=10)
        motion = case in ("cantilever swing", "cloth")
        ax.set_xlabel(
            "computing time of a simulated second [s]" if motion else "computing time of a solve [s]",
            fontsize=9,
        )
        if motion:
            ax.axvline(1.0, color="0.4", lw=1, ls="--", zorder=-1)
            ax.annotate(
                "real time",
                (1.0, 0.98),
                xycoords=("data", "axes fraction"),
                rotation=90,
                fontsize=8,
                va="top",
            )
        ax.set_ylabel("error [%]", fontsize=9)
        ax.grid(alpha=0.3)
    last = panels.flat[len(peers.CASES)]
    last.axis("off")
    for i, peer in enumerate(peers.PEERS):
        last.plot([], [], MARKERS[peer], color=colours(i), label=peer)
    last.plot(
        [], [], color="0.5", ls="--", lw=1, label="best settings: no other is both faster and more accurate"
    )
    last.fill_between([], [], [], color="0.92", label="smaller than the error of the reference")
    last.legend(loc="center", frameon=False)
    figure.savefig(path, dpi=90)
    plt.close(figure)
