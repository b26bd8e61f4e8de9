"""How often `dt = "auto"` keeps `time_error.accuracy`, on 60 random scenes of five kinds, and what it costs.

    python benchmarks/time_error_scenes.py            # 12 scenes of each kind; continues where it was stopped
    python benchmarks/time_error_scenes.py --report   # the tables of the results alone

Half of the scenes of each kind touch obstacles. Each is run at 10, 5, 2 and 1 %. The error, the reference and how far
the reference is known are those of `time_promise`; the reference is refined until it judges 1 %, at most to 256 steps
an interval. A scene whose reference does not judge 5 % is chaotic and is replaced. A run counts as kept or not only
where the reference judges its accuracy. Whether it promises its accuracy is read from its notes and reports.

The cost of a run is its CPU time over that of the cheapest fixed step of any scheme that keeps the accuracy.
"""

import json
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from benchmarks.contact_accuracy import LADDER, SCHEMES
from benchmarks.doc_parts import table_lines, write_part
from benchmarks.stored_rows import store, stored
from benchmarks.time_promise import (
    KNOWN,
    SHIPPED,
    Case,
    arguments,
    bar,
    between,
    block,
    error,
    head,
    net,
    obstacle,
    play,
    promises,
    reference,
    soft_head,
)
from tripod_sim import StepError, load_scene

ACCURACIES = (0.1, 0.05, 0.02, 0.01)

CHAOTIC = KNOWN * 0.05
"""Own error of the reference above which a scene is replaced."""

FINEST = 256
"""Most steps of the reference in an interval."""


def solids(rng: np.random.Generator, *, touching: bool) -> Case:
    """A soft bar, clamped at one end, swings, or swings down on a plate; a soft block falls on a plate."""
    stiffness = f"[damping]\nstiffness = {between(rng, 2e-4, 4e-3)}\n"
    if not touching:
        return Case(head(0.01) + stiffness + bar(rng), 25, 64, scheme="tr_bdf2")
    if rng.random() < 0.5:
        plate = obstacle("plate.obj", 1.0, (0.0, 0.0, -between(rng, 0.003, 0.02)))
        return Case(soft_head(rng) + bar(rng) + plate, 24, 64)
    size, gap = rng.uniform(0.03, 0.06, 3) * [1, 1, 0.7], between(rng, 0.002, 0.02)
    text = soft_head(rng) + block(
        [*(-size[:2] / 2), 5e-4 + gap], size.tolist(), (2, 2, 2), between(rng, 5e4, 5e5)
    )
    return Case(text + obstacle("plate.obj"), 24, 64)


def springs(rng: np.random.Generator, *, touching: bool) -> Case:
    """A net of springs that push when compressed hangs by two corners, or falls on a sphere."""
    case = net(rng, "push", touching=touching)
    return case if touching else replace(case, intervals=50, scheme="tr_bdf2")


def slack(rng: np.random.Generator, *, touching: bool) -> Case:
    """A net of springs that go slack hangs by two corners, or falls on a sphere."""
    case = net(rng, "slack", touching=touching)
    return case if touching else replace(case, intervals=50, scheme="tr_bdf2")


def mixed(rng: np.random.Generator, *, touching: bool) -> Case:
    """A bar is soft in one half and 10 to 100 times stiffer in the other, or a net in its cells and along its lines."""
    ratio = between(rng, 10, 100)
    if rng.random() < 0.5:
        case = solids(rng, touching=touching)
        young = float(case.text.split("young = ")[1].split()[0])
        nodes = np.array(json.loads(case.text.split("corners = ")[1].splitlines()[0]))
        middle = float(nodes[:, 0].mean())
        region = f'[[set]]\nname = "stiff"\nalong = [1, 0, 0]\nbelow = {middle}\n[[region]]\nset = "stiff"\n'
        return replace(case, text=f"{case.text}{region}young = {ratio * young}\n", tolerance=1e-6)
    case = springs(rng, touching=touching)
    soft = float(case.text.split("shear = ")[1].split()[0])
    stiff = case.text.split("stiffness = ")[1].split()[0]
    text = case.text.replace(f"stiffness = {stiff}", f"stiffness = {ratio * soft}", 1)
    return replace(case, text=text, tolerance=1e-7)


def sag(rng: np.random.Generator, *, touching: bool) -> Case:
    """A net is held by its four corners; a heavy node in its middle sags, on a plate if it touches."""
    size, mass = between(rng, 0.3, 0.6), between(rng, 1e-3, 4e-3)
    text = head(0.01, 2e-3 if touching else 0.0)
    text += (
        f'[springs]\nsource = "grid"\nnodes = 5\nsize = {size}\nnode_mass = {mass}\n'
        f"stiffness = {between(rng, 30, 200)}\nshear = {between(rng, 5, 30)}\ndamping = {between(rng, 0.01, 0.05)}\n"
        f'compressed = "{rng.choice(["push", "slack"])}"\nfixed_corners = [0, 1, 2, 3]\n'
        f'[[set]]\nname = "middle"\ncentre = [0, 0, 0]\nradius = {0.1 * size}\n'
        f'[[load]]\nset = "middle"\nmass = {between(rng, 20, 100) * mass}\nshare = "even"\n'
    )
    if touching:
        text += obstacle("plate.obj", 1.0, (0.0, 0.0, -between(rng, 0.05, 0.15) * size))
    return Case(text, 40, 64, scheme="bdf2" if touching else "tr_bdf2")


KINDS: dict[str, Callable[..., Case]] = {f.__name__: f for f in (solids, springs, slack, mixed, sag)}
"""By name."""


def drawn(kind: str, touching: bool, seed: int) -> Case:
    """Return a scene."""
    return KINDS[kind](np.random.default_rng([seed, int(touching), *kind.encode()]), touching=touching)


def refined(case: Case, folder: Path) -> tuple[np.ndarray, float]:
    """Return positions of a reference that judges the finest accuracy, if one can, and its own error.

    It is kept in `folder`, so that another estimator is measured in far less time.
    """
    name = sha256(repr(case).replace(str(SHIPPED), "").encode()).hexdigest()[:16]
    kept = folder / f"reference_{name}.npz"
    if kept.exists():
        with np.load(kept) as found:
            return found["exact"], float(found["own"])
    exact, own = reference(case, folder)
    while min(ACCURACIES) * KNOWN < own <= 8 * CHAOTIC and case.division < FINEST:
        case = replace(case, division=2 * case.division)
        exact, own = reference(case, folder)
    np.savez(kept, exact=exact, own=own)
    return exact, own


def automatic(case: Case, accuracy: float, exact: np.ndarray, folder: Path) -> dict[str, Any]:
    """Return what `dt = "auto"` makes of an accuracy, ready for JSON."""
    words = ("dt=auto", f"time_error.accuracy={accuracy!r}")
    play(replace(case, intervals=1), folder, *words)  # compiles
    begin = time.thread_time()
    rows, simulation = play(case, folder, *words)
    seconds, told = time.thread_time() - begin, simulation.report.time_error
    move = np.linalg.norm(exact - exact[0], axis=2).max()
    return {
        "error": error(rows, exact),
        "told": float(told.largest / move) if told else np.nan,
        "promised": promises(simulation),
        "seconds": seconds,
    }


def fixed(case: Case, exact: np.ndarray, folder: Path) -> list[dict[str, Any]]:
    """Return errors and CPU times of fixed steps of all schemes, each down to the finest accuracy."""
    (folder / "promise.toml").write_text(case.text)
    interval, rows, most = load_scene(folder / "promise.toml").dt, list[dict[str, Any]](), np.inf
    for scheme in SCHEMES:
        for division in LADDER:
            begin = time.thread_time()
            try:
                found = play(case, folder, f"inertia.scheme={scheme}", f"dt={interval / division!r}")[0]
            except StepError:
                continue
            rows.append({"scheme": scheme, "division": division, "seconds": time.thread_time() - begin})
            rows[-1]["error"] = error(found, exact)
            if rows[-1]["error"] <= min(ACCURACIES):
                most = min(most, rows[-1]["seconds"])
            if rows[-1]["seconds"] >= most:
                break
    return rows


def measure(kind: str, touching: bool, seed: int, folder: Path) -> dict[str, Any]:
    """Return what one scene makes of all accuracies, ready for JSON."""
    case = drawn(kind, touching, seed)
    row: dict[str, Any] = {"kind": kind, "touching": touching, "seed": seed}
    try:
        exact, row["own"] = refined(case, folder)
        if row["own"] > CHAOTIC:
            return row
        row["auto"] = {str(a): automatic(case, a, exact, folder) for a in ACCURACIES}
    except StepError as stopped:
        return row | {"stopped": str(stopped)}
    return row | {"fixed": fixed(case, exact, folder)}


def counts(row: dict[str, Any]) -> bool:
    """Return whether a scene was run: its reference judges, and no step failed."""
    return "auto" in row and "stopped" not in row


def cost(row: dict[str, Any], accuracy: float) -> float:
    """Return the CPU time over that of the cheapest fixed step that keeps the accuracy; NaN without one."""
    good = [f["seconds"] for f in row["fixed"] if f["error"] <= accuracy]
    return float(row["auto"][str(accuracy)]["seconds"] / min(good)) if good else np.nan


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the table of the page: of each kind, then of each accuracy."""
    heads = (
        "scenes", "runs", "replaced", "not promised [%]", "promised and judged", "of these kept [%]",
        "worst error over the accuracy", "cost, median", "cost, 90 %",
    )  # fmt: skip
    lines = []
    for kind, draw in KINDS.items():
        own = [row for row in rows if row["kind"] == kind]
        name = str(draw.__doc__).rstrip(".")
        lines.append((name, *_figures(own, ACCURACIES)))
    lines += [(f"all, {100 * a:g} %", *_figures(rows, (a,))) for a in ACCURACIES]
    lines.append(("all", *_figures(rows, ACCURACIES)))
    return table_lines(heads, lines)


def _figures(rows: Sequence[dict[str, Any]], accuracies: Iterable[float]) -> tuple[str, ...]:
    """Return the cells of a line after the first."""
    known = [(row, a) for a in accuracies for row in rows if counts(row)]
    runs = [(row["auto"][str(a)], row["own"] <= KNOWN * a, a) for row, a in known]
    given = [(run, a) for run, judged, a in runs if run["promised"] and judged]
    kept = sum(run["error"] <= a for run, a in given)
    silent = sum(not run["promised"] for run, _, _ in runs)
    costs = [c for row, a in known if np.isfinite(c := cost(row, a))]
    worst = []
    for promised in (True, False):
        errors = [run["error"] / a for run, judged, a in runs if judged and run["promised"] == promised]
        if errors:
            worst.append(f"{max(errors):.2g}{'' if promised else ' (not promised)'}")
    return (
        str(len(runs)),
        str(sum(not counts(row) for row in rows)),
        f"{100 * silent / len(runs):.0f}" if runs else "",
        str(len(given)),
        f"{100 * kept / len(given):.3g}" if given else "",
        ", ".join(worst),
        *(f"{np.quantile(costs, q):.2f}" if costs else "" for q in (0.5, 0.9)),
    )


def missing(rows: Sequence[dict[str, Any]], scenes: int) -> tuple[str, bool, int] | None:
    """Return kind, whether it touches, and number of the next scene to measure; None where all have enough."""
    todo = []
    for kind in KINDS:
        for touching in (False, True):
            own = [row for row in rows if (row["kind"], row["touching"]) == (kind, touching)]
            done, wanted = sum(map(counts, own)), (scenes + touching) // 2
            if done < wanted:
                todo.append((done, len(own), kind, touching))
    if not todo:
        return None
    _, number, kind, touching = min(todo)
    return kind, touching, number


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__, "kind", 202614000, "build/time_error_scenes/rows.jsonl")
    rows = stored(options.results)
    if not options.report:
        print(f"calibration: 1000 x 1000 product {1e3 * calibration():.1f} ms", flush=True)
        while found := missing(rows, options.scenes):
            kind, touching, number = found
            print(f"{kind} {number}, {'with' if touching else 'no'} contact:", end=" ", flush=True)
            begin = time.thread_time()
            rows.append(measure(kind, touching, options.seed + number, options.results.parent))
            store(options.results, rows[-1])
            print(_line(rows[-1]), f"{time.thread_time() - begin:.1f} s", flush=True)
    print("\n".join(["", *table(rows)]))
    if options.write:
        write_part("time_error.md", "sixty", table(rows))


def _line(row: dict[str, Any]) -> str:
    """Return what is printed of a scene once it is measured."""
    if not counts(row):
        return row.get("stopped") or f"chaotic, own error of the reference {row['own']:.2g};"
    runs = [f"{100 * float(a):g} % errs by {100 * run['error']:.2g} %" for a, run in row["auto"].items()]
    return f"own {row['own']:.1g}; {', '.join(runs)};"


if __name__ == "__main__":
    main()
