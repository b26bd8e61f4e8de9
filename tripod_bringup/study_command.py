"""`tripod study`: what accuracy costs in time, and the course report's tables, on the screen and in files."""

import csv
import json
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tripod_bringup.long_work import loading
from tripod_bringup.run_command import BAD_ARGUMENTS, FAILED, plain
from tripod_bringup.study_plans import PLANS, REPORTS, names, plan, report
from tripod_host.output import OutputError
from tripod_host.stop import first
from tripod_host.writing import check_place, replaced_text

if TYPE_CHECKING:
    from tripod_bringup.study_run import Executor
    from tripod_study.plan import Plan

INTERRUPTED = "tripod study: interrupted; what is done is kept in {out}, the same command goes on"
WISHES = ("5%", "10%", "reference")
"""Accuracies that the command after a study may ask for, the most useful first."""

PARTS = ("both", "accuracy", "report")


@dataclass(frozen=True)
class Changes:
    """What the options of a run change of a scene that is studied: see `run`."""

    overrides: Sequence[str] = ()
    servo: str | None = None
    slide: str | None = None
    duration: float | None = None
    accuracy: str | None = None
    study: Path | None = None

    def first(self) -> str:
        """Return the first option that is given; empty for none."""
        names = ("--set", "--servo", "--slide", "--duration", "--accuracy", "--study")
        values = (self.overrides or None, self.servo, self.slide, self.duration, self.accuracy, self.study)
        return next((name for name, value in zip(names, values, strict=True) if value is not None), "")

    def motion(self) -> list[str]:
        """Return the options that move the scene, as they are typed."""
        values = {"--servo": self.servo, "--slide": self.slide, "--duration": self.duration}
        return [f"{name}={value}" for name, value in values.items() if value is not None]

    def wish(self) -> list[str]:
        """Return the options that choose a setting, as they are typed."""
        values = {"--accuracy": self.accuracy, "--study": self.study}
        return [f"{name}={value}" for name, value in values.items() if value is not None]


def study_command(
    scene: str,
    *,
    changes: Changes = Changes(),
    every: bool,
    part: str,
    knobs: Sequence[str],
    quick: bool,
    jobs: int,
    scheduler: str | None,
    out: Path,
    fresh: bool,
    seed: int,
    full: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Run studies and print them; return the exit code.

    0 done; 1 a study has no reference, so no errors; 2 bad arguments; 130 stopped by Ctrl-C, to be resumed.
    """
    from tripod_bringup.study_cluster import ClusterError  # noqa: PLC0415 - not needed for the help
    from tripod_bringup.study_store import StoreBusyError  # noqa: PLC0415
    from tripod_sim.errors import SceneError  # noqa: PLC0415

    shown = not quiet and sys.stderr.isatty()
    printed: dict[str, Any] = {}
    try:
        reports, plans = _chosen(scene, changes, every=every, part=part, knobs=knobs, quick=quick)
        out.mkdir(parents=True, exist_ok=True)
        with first(lambda: print(INTERRUPTED.format(out=out), file=sys.stderr)):
            for name in reports:
                printed["report"] = print_report(
                    name, out, full=full, fresh=fresh, shown=shown, text=not as_json
                )
            execute = _executor(scheduler, jobs) if plans else None
            for made in plans:
                assert execute
                result, files = accuracy(made, execute, out, fresh=fresh, seed=seed, shown=shown)
                printed.setdefault("accuracy", {})[made.name] = result
                if not as_json:
                    from tripod_bringup.study_files import table  # noqa: PLC0415

                    print(table(result), end="\n\n")
    except (SceneError, ClusterError, StoreBusyError) as error:
        print("tripod study: " + " ".join(str(error).split()), file=sys.stderr)
        return BAD_ARGUMENTS
    except OutputError:  # of standard output: that is no fault of --out
        raise
    except OSError as error:
        path = str(error.filename or out)
        print(f"tripod study: --out: {path!r} cannot be written: {error.strerror or error}", file=sys.stderr)
        return BAD_ARGUMENTS
    if as_json:
        print(json.dumps(plain(printed)))
    elif plans and not quiet:
        made_of = ", ".join(str(out / made.name) for made in plans)
        print(
            f"files: {made_of}: {', '.join(path.suffix for path in files)}; points: .jsonl", file=sys.stderr
        )
    lacking = [name for name, found in printed.get("accuracy", {}).items() if not found["front"]]
    for name in lacking:
        reference = printed["accuracy"][name]["reference"] or {"message": "nothing was measured"}
        print(f"tripod study: {name}: no errors: {reference['message']}", file=sys.stderr)
    if plans and not as_json and not quiet:
        words = next_command(scene or plans[0].scene, plans[0], changes, out)
        print(f"next: {shlex.join(words)}", file=sys.stderr)
    return FAILED if lacking else 0


def next_command(scene: str, made: "Plan", changes: Changes, out: Path) -> list[str]:
    """Return the command that runs a studied scene as the study advises; as it is, where no accuracy was reached.

    `scene` is as the user named it. The accuracy is the first of `WISHES` that the study offers a setting for.
    """
    from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help
    from tripod_sim.scene.file import words_of  # noqa: PLC0415
    from tripod_study.accuracy.choice import choose  # noqa: PLC0415

    own = bool(made.studied)  # of a scene that no study comes with
    overrides = changes.overrides if own else words_of(made.base)
    name, file = scene if own else made.scene, out / f"{made.name}.json"
    run = [
        "tripod",
        "run",
        name,
        *(word for each in overrides for word in ("--set", each)),
        *changes.motion(),
    ]
    if changes.accuracy:  # the study is of the setting that this takes
        return [*run, *changes.wish()]
    for wish in WISHES:
        try:
            choose(name, wish, overrides, study=file, speed=lambda: None)
        except SceneError:
            continue
        return [*run, "--accuracy", wish, "--study", str(file)]
    return run


def _chosen(
    scene: str, changes: Changes, *, every: bool, part: str, knobs: Sequence[str], quick: bool
) -> tuple[list[str], list["Plan"]]:
    """Return the reports and the studies that are asked for. Raises SceneError."""
    from tripod_sim.errors import SceneError  # noqa: PLC0415
    from tripod_sim.scene.file import scene_names  # noqa: PLC0415

    if part not in PARTS:
        raise SceneError(f"--part is {part!r}; allowed: {', '.join(PARTS)}")
    if every == bool(scene):
        raise SceneError(f"give one scene or --all; scenes: {', '.join(PLANS)}, tripod")
    changed = changes.first()
    if changed and (every or part == "report" or scene in PLANS.keys() - scene_names()):
        what = "--all" if every else "--part report" if part == "report" else f"study {scene}"
        raise SceneError(
            f"{changed} changes a scene, and {what} has motions of its own: name the scene, or leave it out"
        )
    if part == "report" and not every and scene not in REPORTS:
        raise SceneError(f"there is no report of {scene!r}; reports: {', '.join(REPORTS)}")
    if scene and (changed or not names(scene)):
        made = plan_of_scene(scene, changes, quick=quick)
        return [], [replace(made, points=made.only(knobs))] if knobs else [made]
    reports = [scene] if scene in REPORTS and (part == "report" or (part == "both" and not quick)) else []
    if every and part == "report":
        reports = list(REPORTS)
    if part == "report" and knobs:
        raise SceneError(
            f"--knobs {','.join(knobs)} chooses settings of the accuracy study, which --part report does "
            "not run: leave one out"
        )
    if part == "report":
        return reports, []
    plans = [plan(name, quick=quick) for name in (PLANS if every else names(scene))]
    return reports, [_limited(made, plans, knobs) for made in plans] if knobs else plans


def plan_of_scene(scene: str, changes: Changes, *, quick: bool) -> "Plan":
    """Return the study of any scene, with what the options change. Raises SceneError."""
    from tripod_bringup.accuracy_option import chosen  # noqa: PLC0415 - not needed for the help
    from tripod_sim.errors import SceneError  # noqa: PLC0415
    from tripod_sim.scene.file import naming_file, scene_names  # noqa: PLC0415

    with loading("tripod study"):
        from tripod_study import any_scene  # noqa: PLC0415 - heavy

    if not scene.endswith(".toml") and scene not in scene_names():
        known = ", ".join([*PLANS, "tripod"])
        raise SceneError(
            f"study {scene!r} is unknown; studies: {known}; any other scene: {', '.join(scene_names())}, or the path "
            "of a .toml file"
        )
    choice = chosen(scene, changes.accuracy, changes.overrides, changes.study)
    overrides = choice.overrides if choice else changes.overrides
    if choice:
        print(f"tripod study: {choice.sentence}", file=sys.stderr)
    subject = any_scene.Subject(scene, overrides, changes.servo, changes.slide, changes.duration)
    with loading("tripod study", "choosing settings"), naming_file(scene, overrides):
        return any_scene.plan(subject, quick=quick)


def _limited(made: "Plan", plans: Sequence["Plan"], knobs: Sequence[str]) -> "Plan":
    """Return a study with the points that vary `knobs` alone; of several studies each takes those that it has."""
    from tripod_sim.errors import SceneError  # noqa: PLC0415

    known = {k.name for p in plans for k in p.knobs}
    for name in knobs:
        if name not in known:
            raise SceneError(f"knob {name!r} is unknown; knobs: {', '.join(sorted(known))}")
    own = [name for name in knobs if name in {k.name for k in made.knobs}]
    return replace(made, points=made.only(own)) if own else made


def _executor(scheduler: str | None, jobs: int) -> "Executor":
    if scheduler is not None:
        from tripod_bringup.study_cluster import cluster  # noqa: PLC0415

        return cluster(scheduler)
    from tripod_bringup.study_run import local  # noqa: PLC0415

    return local(jobs)


def accuracy(
    made: "Plan", execute: "Executor", out: Path, *, fresh: bool, seed: int, shown: bool
) -> tuple[dict[str, Any], list[Path]]:
    """Run a study of accuracy, write its files; return its result and them. Raises OSError."""
    from tripod_bringup.study_files import write_files  # noqa: PLC0415
    from tripod_bringup.study_run import outdated, run_plan  # noqa: PLC0415
    from tripod_bringup.study_store import Store  # noqa: PLC0415
    from tripod_study.result import assemble  # noqa: PLC0415

    with Store(out / f"{made.name}.jsonl", fresh=fresh) as store:
        if count := outdated(made, store):
            print(
                f"tripod study: {made.name}: points in {out} of other code: {count}; they are measured again",
                file=sys.stderr,
            )
        with bar(made.name, shown=shown) as progress:
            records = run_plan(made, store, execute, seed=seed, progress=progress)
    result = assemble(made, records, _version())
    return result, write_files(result, out)


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415

    try:
        return version("tripod")
    except PackageNotFoundError:
        return "not installed"


def print_report(name: str, out: Path, *, full: bool, fresh: bool, shown: bool, text: bool) -> dict[str, Any]:
    """Run the course report's variations of a scene, print and write their table and return it. Raises OSError.

    Rows that are done are kept and not measured again, unless `fresh` or by other code.
    """
    from tripod_bringup.study_store import Store  # noqa: PLC0415 - not needed for the help
    from tripod_study.fingerprint import fingerprint  # noqa: PLC0415

    made, code = report(name, full=full), fingerprint(REPORTS[name])
    columns = {column.key for column in made.columns}
    path = out / f"{name}_report.csv"
    check_place(path)  # before the work, not after it
    rows: list[dict[str, Any]] = []
    with (
        Store(out / f"{name}_report.jsonl", fresh=fresh) as store,
        bar(f"{name} report", shown=shown) as progress,
    ):
        for case in made.cases:
            key = f"{code} {made.key(case)}"
            kept = store.records.get(key, {}).get("row")
            if not (isinstance(kept, dict) and columns <= kept.keys()):  # none, or a damaged one
                store.add(key, {"row": plain(made.row(case))})
            rows.append(store.records[key]["row"])
            if progress:
                progress(len(rows), len(made.cases))
    with replaced_text(path) as file:
        writer = csv.DictWriter(file, [column.key for column in made.columns])
        writer.writeheader()
        writer.writerows(rows)
    if text:
        cells = [[column.title for column in made.columns]]
        cells += [[column.cell(row) for column in made.columns] for row in rows]
        widths = [max(len(line[i]) for line in cells) for i in range(len(made.columns))]
        print(made.title)
        for line in cells:
            print("  ".join(word.ljust(width) for word, width in zip(line, widths, strict=True)).rstrip())
        print()
    return {"study": name, "title": made.title, "rows": rows}


@contextmanager
def bar(name: str, *, shown: bool) -> Iterator[Callable[[int, int], None] | None]:
    """Yield what draws how many of how many points are done, on standard error; None where nothing is shown."""
    if not shown:
        yield None
        return
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with (
        first(lambda: console.show_cursor(True)),
        Progress(*columns, console=console, transient=True) as progress,
    ):
        task = progress.add_task(name, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)
