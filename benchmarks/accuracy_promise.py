"""Whether `--accuracy` holds its promise: errors of the settings that it picks, in random cases that no study has seen.

A case is a pose and a load, or a motion from a random start (promise_cases.py); each is run with the settings for 10, 5
and 1 % and with a reference: the one that the case's kind names, else the cheapest point of the study that is surely
three times as exact as these and as what was picked, or the most exact there is. Where a kind names a coarser mesh,
too, it is Richardson's limit of both. `reference` is what that setting, without the limit, may err by the study. With
`--check N` the study's own finest setting runs N of the cases, too: `reference off by` is how far the reference is from
that at most. The error is measured as the study does it: the largest deviation over the case, over the travel (a
motion) or over the study's scale (poses). `factor` is what the error in the study would have to be multiplied by,
before what the study's reference may err is added, to hold 95 % of the cases: `margins` of
tripod_study/accuracy/choice.py have to be at least that. Where a study promises two quantities, both have to be within
what is asked, and the table has both.

    python benchmarks/accuracy_promise.py [--studies DIR] [--only tripod_dynamic] [--cases 200] [--keep cases.jsonl]

Margins must not be judged by the cases that they were chosen by: take other seeds then (`--first`). Cases that are in
the file of `--keep` are not run again, unless the code has changed. Ctrl-C ends a study; its rows are of the cases that
are done, and say how many these are. With `--write`, rows of studies that were not run stay.
"""

import argparse
import contextlib
import hashlib
import json
import sys
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from benchmarks import promise_cases
from benchmarks.doc_parts import DOCS
from benchmarks.promise_cases import KINDS, Kind, Rows
from benchmarks.promise_table import HEADS, PAGE, percent, table, written
from tripod_bringup.study_plans import plan
from tripod_sim import SceneError, Simulation, StepError, load_scene
from tripod_study.accuracy.choice import asked, pick
from tripod_study.accuracy.margins import margins
from tripod_study.accuracy.stored import StoredPoint, StoredStudy, read_study
from tripod_study.fingerprint import fingerprint

ROOT = Path(__file__).resolve().parents[1]

ACCURACIES = ("10%", "5%", "1%")

MORE_EXACT = 3.0
"""By how much a reference is more exact than the least accuracy and the settings that are picked."""

Settings = Mapping[str, Any]


class Runner:
    """Runs cases and keeps their rows in a file."""

    def __init__(self, study: StoredStudy, keep: Path | None) -> None:
        self.study, self._keep, self._kind = study, keep, KINDS[study.name]
        self._base = {k: v for k, v in study.base.items() if not k.startswith("servos.")}
        cases = hashlib.sha256(Path(promise_cases.__file__).read_bytes()).hexdigest()
        self._code = [fingerprint(plan(study.name, quick=False).module), cases]
        self._known: dict[str, list[list[float]] | None] = {}
        if keep and keep.exists():
            for line in keep.read_text(encoding="utf-8").splitlines():
                with contextlib.suppress(ValueError):  # the last line of a run that was killed
                    record = json.loads(line)
                    self._known[record["key"]] = record["rows"]

    def run(self, settings: Settings, seed: int) -> Rows | None:
        """Return the rows of a case; None if it could not be simulated."""
        text = json.dumps([self.study.name, self._code, self._base, dict(settings), seed], sort_keys=True)
        key = hashlib.sha256(text.encode()).hexdigest()
        if key not in self._known:
            start, case = time.thread_time(), self._kind.make(seed)
            words = [f"{field}={value}" for field, value in {**self._base, **settings}.items()]
            try:
                simulation = Simulation(load_scene(self.study.scene, [*words, *case.overrides]))
                rows = self._kind.rows(simulation, case).tolist()
            except StepError:
                rows = None
            self._known[key] = rows
            if self._keep:
                record = {"key": key, "rows": rows, "seed": seed, "cpu": time.thread_time() - start}
                with self._keep.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({**record, "settings": dict(settings)}) + "\n")
        rows = self._known[key]
        return None if rows is None else np.array(rows)


def error_of(rows: Rows, reference: Rows, scale: float | None) -> float:
    """Return the relative error of a case; `scale`: of poses [m], None for the case's own travel."""
    root = np.sqrt(rows.shape[1] / 3)
    norms = np.linalg.norm(rows - reference, axis=1).max() / root
    if scale is None:
        scale = max(np.linalg.norm(reference - row, axis=1).max() for row in reference) / root
    return float(norms / scale)


def errors_of(rows: Rows, reference: Rows, kind: Kind, scale: float | None) -> tuple[float, ...]:
    """Return the relative errors of a case: of what the study is about; of the pose, too, where rows are places."""
    if not kind.placed:
        return (error_of(rows, reference, scale),)
    move = error_of(rows - rows[0], reference - reference[0], scale)
    size = np.linalg.norm(reference, axis=1).max()
    return move, float(np.linalg.norm(rows - reference, axis=1).max() / size)


def reference_of(study: StoredStudy, rungs: Iterable[StoredPoint]) -> StoredPoint:
    """Return the point that cases are held against.

    Args:
        study: Whose settings are picked.
        rungs: Of the study's own reference, which may be none of its points.
    """
    if fine := KINDS[study.name].fine:
        fit = [p for p in (*study.points, *rungs) if fine.items() <= p.settings.items()]
        return min(fit, key=lambda p: (p.cpu, p.bound))
    least = min(float(asked(a)) for a in ACCURACIES)
    for accuracy in ACCURACIES:
        with contextlib.suppress(SceneError):
            least = min(least, pick(study, asked(accuracy), None).bound)
    exact = [p for p in study.points if MORE_EXACT * p.bound <= least]
    return min(exact, key=lambda p: p.cpu) if exact else min(study.points, key=lambda p: p.bound)


def rungs_of(table: Mapping[str, Any]) -> list[StoredPoint]:
    """Return the two finest rungs of a study's reference, coarse to fine; none where it is no setting of the scene.

    Their errors are at most what the reference's own is estimated at, by how it is made (see `study/plan.Reference`);
    what they cost is not told.
    """
    reference, fields = table["reference"], [knob["field"] for knob in table["knobs"]]
    own = reference["own_error"]
    return [
        StoredPoint({f: rung[f] for f in fields}, own, 2 * own, np.inf, None)
        for rung in reference["rungs"][-2:]
        if set(fields) <= rung.keys()
    ]


def measure(path: Path, seeds: range, keep: Path | None, check: int) -> tuple[list[list[str]], bool]:
    """Return a study's rows and whether Ctrl-C has cut them short."""
    study, table = read_study(path), json.loads(path.read_text(encoding="utf-8"))
    rungs = rungs_of(table)
    runner, fine = Runner(study, keep), reference_of(study, rungs)
    scale = table["quantities"][0]["scale"] if study.solves else None
    print(
        f"{study.name}: reference {dict(fine.settings)}, {percent(fine.bound)} %", file=sys.stderr, flush=True
    )
    picks: dict[str, StoredPoint] = {}
    refused: dict[str, str] = {}
    for accuracy in ACCURACIES:
        try:
            picks[accuracy] = pick(study, asked(accuracy), None)
        except SceneError as error:
            refused[accuracy] = str(error)
    errors: dict[str, list[tuple[float, ...]]] = {accuracy: [] for accuracy in picks}
    off: list[float] = []
    kind = KINDS[study.name]
    nothing = (np.inf,) * (2 if kind.placed else 1)
    missing, cut = 0, False
    try:
        for k, seed in enumerate(seeds):
            found = [runner.run(point.settings, seed) for point in picks.values()]
            reference = runner.run(fine.settings, seed)
            if kind.coarse and reference is not None:
                coarse = runner.run({**fine.settings, **kind.coarse}, seed)
                reference = None if coarse is None else reference + (reference - coarse) / 3
            if reference is None:  # no case
                missing += 1
                continue
            if rungs and k < check and (finest := runner.run(rungs[-1].settings, seed)) is not None:
                off.append(max(errors_of(reference, finest, kind, scale)))
            for accuracy, rows in zip(picks, found, strict=True):
                errors[accuracy].append(nothing if rows is None else errors_of(rows, reference, kind, scale))
            if sys.stderr.isatty():
                print(f"\r{study.name}: {k + 1}/{len(seeds)}", end="", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        cut = True
    print(
        f"{study.name}: {len(next(iter(errors.values()), []))} of {len(seeds)} cases, {missing} without a reference",
        file=sys.stderr,
        flush=True,
    )
    checked = f"{percent(max(off))} ({len(off)} cases)" if off else ""
    lines = []
    for accuracy in ACCURACIES:
        if accuracy in refused:
            lines.append([study.name, accuracy, refused[accuracy], *[""] * (len(HEADS) - 3)])
        elif errors[accuracy]:
            start = [
                study.name,
                accuracy,
                *_numbers(study, picks[accuracy], np.array(errors[accuracy]), accuracy),
            ]
            lines.append([*start, f"{seeds.start} to {seeds.stop - 1}", percent(fine.bound), checked])
    return lines if any(errors.values()) else [], cut


def _numbers(study: StoredStudy, point: StoredPoint, found: np.ndarray, accuracy: str) -> list[str]:
    """Return what a row says of a setting and its errors.

    Args:
        study, point: That the setting is of.
        found: Errors of all cases, of each quantity that is promised, shape (cases, quantities).
        accuracy: That was asked for: all quantities have to be within it.
    """
    high = np.quantile(found, 0.95, axis=0, method="higher")
    errors, bounds = np.array([(point.error, point.bound), *point.others]).T
    own = bounds - errors  # of the study's reference
    return [
        ", ".join(f"{k}={v}" for k, v in point.settings.items()),
        _percents(errors),
        _percents(own),
        str(len(found)),
        f"{100 * float((found <= asked(accuracy)).all(axis=1).mean()):.1f}",
        _percents(np.median(found, axis=0)),
        _percents(high),
        _percents(found.max(axis=0)),
        " and ".join(f"{max(0.0, factor):.2f}" for factor in (high - own) / errors),
        " and ".join(f"{m:g}" for m in margins(study.name, 1 + len(study.others))),
    ]


def _percents(errors: np.ndarray) -> str:
    return " and ".join(percent(float(e)) for e in errors)


def main() -> None:
    """Run the cases and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--studies", type=Path, default=ROOT / "tripod_study" / "studies", help="folder of JSON files"
    )
    parser.add_argument("--only", nargs="*", choices=list(KINDS), help="studies; all by default")
    parser.add_argument("--cases", type=int, default=200, help="of each study")
    parser.add_argument("--first", type=int, default=10_000, help="seed of the first case; the others follow")
    parser.add_argument(
        "--check", type=int, default=0, metavar="N", help="cases in which the reference is checked"
    )
    parser.add_argument(
        "--keep", type=Path, help="file in which cases are kept, to go on after an interruption"
    )
    parser.add_argument("--write", action="store_true", help=f"put the table into docs/{PAGE}")
    arguments = parser.parse_args()
    if arguments.cases < 1 or arguments.first < 0:
        parser.error("--cases must be at least 1 and --first at least 0")
    lines: list[list[str]] = []
    cut = False
    for name in arguments.only or KINDS:
        path = arguments.studies / f"{name}.json"
        if not path.exists():
            print(f"{name}: no study in {arguments.studies}", file=sys.stderr)
            continue
        seeds = range(arguments.first, arguments.first + arguments.cases)
        made, cut = measure(path, seeds, arguments.keep, arguments.check)
        lines += made
        if cut:
            break
    speed = f"1000 x 1000 float64 product here: {1e3 * calibration():.1f} ms."
    print("\n".join(table(lines, speed)))
    if arguments.write:
        page = DOCS / PAGE
        page.write_text(written(page.read_text(encoding="utf-8"), lines, speed), encoding="utf-8")
    sys.exit(130 if cut else 0)


if __name__ == "__main__":
    main()
