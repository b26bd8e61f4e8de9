"""`tripod explain`: what a scene costs on this machine, as tables or JSON."""

import json
import math
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tripod_bringup.long_work import interruptible, loading
from tripod_bringup.options import Json, Overrides, examples, within
from tripod_bringup.run_command import BAD_ARGUMENTS, FAILED, plain

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from tripod_study.explain.linear import LinearUse
    from tripod_study.explain.report import Explanation, Progress
    from tripod_study.spatial_error import SpatialError

HELP = (
    "Show what a step of a scene costs, by stages and effects.\n\n"
    "The step is a typical one: half way through the scene, while its servos turn. Exit codes: 0, or 2 for a bad scene "
    "or option, 1 where a step cannot be made."
)


commands = typer.Typer()


@commands.command(
    help=HELP,
    epilog=examples(
        "tripod explain tripod",
        "tripod explain maze --set mesh.level=1",
        "tripod explain drape --at 1.5 --no-costs",
        "tripod explain pendulum --json",
        "tripod explain tripod --error",
    ),
)
def explain(
    scene: Annotated[str, typer.Argument(help="Name of a shipped scene, or path of a scene file.")],
    *,
    set_: Overrides = None,
    at: Annotated[
        float | None,
        typer.Option(
            help="Simulated time of the steps that are timed \\[s].",
            callback=within(0, unit="s", such_as="1.5"),
        ),
    ] = None,
    costs: Annotated[
        bool, typer.Option("--costs/--no-costs", help="Measure what absent effects would cost.")
    ] = True,
    error: Annotated[
        bool, typer.Option("--error", help="Estimate the error of the mesh instead of those costs.")
    ] = False,
    json: Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress note.")] = False,
) -> None:
    """Show what a scene costs here; the help is `HELP`."""
    raise typer.Exit(
        explain_command(
            scene, overrides=set_ or [], at=at, costs=costs, error=error, as_json=json, quiet=quiet
        )
    )


def explain_command(
    scene: str,
    *,
    overrides: list[str],
    at: float | None,
    costs: bool,
    error: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Measure, print and return the exit code: 0, 2 bad arguments, 1 a step cannot be made."""
    with loading("tripod explain", shown=not quiet):
        from tripod_sim.errors import SceneError, StepError  # noqa: PLC0415 - not needed for the help
        from tripod_sim.scene.file import load_scene  # noqa: PLC0415
        from tripod_study.explain.report import explain  # noqa: PLC0415

    estimated: SpatialError | None = None
    try:
        with (
            interruptible("tripod explain"),
            progress_note(shown=not quiet) as progress,
        ):
            if error:  # first: what has no static state is told at once
                from tripod_study.spatial_error import spatial_error  # noqa: PLC0415 - only where it is asked for

                if progress:
                    progress(0.0, "solving on a finer mesh")
                estimated = spatial_error(load_scene(scene, overrides))
            found = explain(scene, overrides, at=at, costs=costs and not error, progress=progress)
    except (SceneError, StepError) as problem:
        print("tripod explain: " + " ".join(str(problem).split()), file=sys.stderr)
        return BAD_ARGUMENTS if isinstance(problem, SceneError) else FAILED
    if as_json:
        table = as_table(found)
        if estimated:
            table["spatial_error"] = asdict(estimated)
        print(json.dumps(plain(table)))
        return 0
    show(found)
    if estimated:
        for line in error_lines(estimated):
            print(line)
    return 0


@contextmanager
def progress_note(*, shown: bool) -> "Iterator[Progress | None]":
    """Yield what shows the fraction done and what comes next on standard error; None where nothing is shown.

    On a terminal it is a bar, else a line for whatever comes next.
    """
    if not shown:
        yield None
        return
    if not sys.stderr.isatty():
        yield lambda _, text: print(f"tripod explain: {text}", file=sys.stderr, flush=True) if text else None
        return
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn  # noqa: PLC0415

    columns = (BarColumn(), TaskProgressColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("building the scene", total=1.0)
        yield lambda done, text: bar.update(task, completed=done, description=text)


def as_table(found: "Explanation") -> dict[str, Any]:
    """Return all that was measured as JSON has it: times in s, memory in bytes."""
    table = asdict(found)
    scene = found.scene
    table["scene"] = scene.name
    table["dt"] = scene.dt
    for stage in table["stages"]:
        stage["share"] = stage["seconds"] / found.step.mean
    table["memory"] = {"parts": found.memory, "total": sum(found.memory.values())}
    return table


def show(found: "Explanation") -> None:
    """Print everything for people."""
    from rich.console import Console  # noqa: PLC0415
    from rich.markup import escape  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    console = Console(highlight=False)

    def say(text: str) -> None:
        console.print(text, soft_wrap=True)

    scene, step, size = found.scene, found.step, found.size
    factor = scene.dt / step.mean if step.mean > 0 else math.inf
    say(
        f"[bold]{escape(scene.name)}[/]: a step of {1e3 * scene.dt:g} ms takes {_micro(step.mean)} µs (noise "
        f"{_micro(step.noise)} µs), {factor:.3g} times real time; {found.count} steps from "
        f"{found.first:.3g} s on"
    )
    if found.looped is not None:
        say(
            f"many steps in one call: {_micro(found.looped)} µs each, {scene.dt / found.looped:.3g} times real time"
        )
    table = _columns("stage", "µs", "%", "calls", table=Table)
    for stage in found.stages:
        calls = "" if stage.calls is None else f"{stage.calls:.3g}"
        seconds = max(stage.seconds, 0.0)  # what is left to the last one may be less than nothing by noise
        table.add_row(stage.name, _micro(seconds), f"{100 * seconds / step.mean:.1f}", calls)
    table.add_row("[bold]step[/]", _micro(step.mean), "100.0", "")
    console.print(table)
    say(
        f"{size.unknowns} unknowns, {size.nodes} nodes, {size.elements} elements"
        + (f", {size.nonzeros} nonzeros of the Hessian's upper triangle" if size.nonzeros else "")
        + (f", {size.factor_entries} of its factor" if size.factor_entries else "")
        + f"; built in {found.build:.3g} s"
    )
    if found.linear:
        say(escape(linear_line(found.linear)))
    table = _columns("memory", "kB", table=Table)
    for part, count in found.memory.items():
        table.add_row(part, f"{count / 1e3:.1f}")
    table.add_row("[bold]all arrays[/]", f"{sum(found.memory.values()) / 1e3:.1f}")
    console.print(table)
    for note in found.notes:
        say(f"note: {escape(note)}")
    say(f"effects: {', '.join(found.named) or 'none'}")
    _show_absent(found, console, Table)


def linear_line(use: "LinearUse") -> str:
    """Return for people which linear solver is used and why, with its memory and its work in a step."""
    kind = "conjugate gradients" if use.solver == "cg" else f"direct ({use.solver})"
    entries = (
        f"; L {'would have' if use.iterations else 'has'} {_two(use.entries)} entries" if use.entries else ""
    )
    work = f"{use.solutions:.3g} solutions"
    if use.iterations:
        work += f" of {use.iterations / use.solutions:.0f} iterations each"
    return (
        f"linear solver: {kind}, {1e-6 * use.memory:.3g} MB{entries}; {use.why}. A step takes {work} and "
        f"{use.hessians:.3g} new Hessians" + (f"; {use.reuse}" if use.reuse else "")
    )


def _two(count: int) -> str:
    """Return a count with two digits and its power of ten in words."""
    return f"{count / 1e6:.2g} million" if count >= 1e6 else f"{float(f'{count:.2g}'):.0f}"


def error_lines(found: "SpatialError") -> list[str]:
    """Return the estimated error of a mesh for people: exact minus computed, in the static state at the start."""
    lines = [
        f"error of the mesh, estimated by one twice as fine ({found.unknowns[0]} and {found.unknowns[1]} unknowns), "
        "in the pose of rest that the start leads to:"
    ]
    if found.effector is not None and found.position is not None:
        lines.append(
            f"  effector  {_three(found.effector, 1e3)} mm, computed {_three(found.position, 1e3)} mm"
        )
    most = f" of a displacement of up to {1e3 * found.moved:.3g} mm"
    lines.append(f"  largest   {1e3 * found.largest:.3g} mm, at node {found.node},{most}")
    lines.append(
        f"  strain energy  {1e3 * found.strain:.3g} mJ, computed {1e3 * found.strain_computed:.4g} mJ"
    )
    if len(found.efforts):
        lines.append(
            f"  torques   {_three(found.efforts, 1)} N m, computed {_three(found.efforts_computed, 1)} N m"
        )
    return lines


def _three(values: Iterable[float], scale: float) -> str:
    return ", ".join(f"{scale * v:.3g}" for v in values)


def _show_absent(found: "Explanation", console: "Console", kind: "type[Table]") -> None:
    """Print what is switched off and what it would cost."""
    from rich.markup import escape  # noqa: PLC0415

    if not found.absent:
        return
    table = _columns("switched off", "µs more", "switched on by --set", table=kind)
    table.columns[2].justify, table.columns[2].overflow = "left", "fold"
    for cost in found.absent:
        if cost.seconds is None:
            table.add_row(cost.effect, "-", escape(cost.why_not))
        else:
            shown = _micro(cost.seconds) if cost.measured else f"below {_micro(cost.noise)}"
            besides = f"; {cost.besides}" if cost.besides else ""
            table.add_row(cost.effect, shown, escape(" ".join(cost.words) + besides))
    console.print(table)


def _columns(*heads: str, table: "type[Table]") -> "Table":
    made = table(box=None, pad_edge=False)
    for k, head in enumerate(heads):
        made.add_column(head, justify="right" if k else "left", no_wrap=k < 2)
    return made


def _micro(seconds: float) -> str:
    return f"{1e6 * seconds:.1f}" if abs(seconds) < 1e-3 else f"{1e6 * seconds:.0f}"
