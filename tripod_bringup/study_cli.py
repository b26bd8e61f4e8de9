"""Options and help of `tripod study`."""

from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup.accuracy_option import Accuracy, Study
from tripod_bringup.options import Json, Overrides, ServoScript, SlideScript, examples, some_scenes, within
from tripod_bringup.study_plans import PLANS
from tripod_host.threads import processors

commands = typer.Typer()

HELP = (
    "Measure error against computing time at many settings.\n\n"
    "Each setting is compared with a converged reference. "
    "Prints the error of each setting beside its CPU time, which settings no other beats (*), the cheapest within 10, "
    "5, 1 and 0.1 %, and how far the reference itself can be trusted. Writes <study>.json, .csv and .png into --out. "
    "Points that are done are kept there: a study that was stopped, by Ctrl-C or worse, goes on where it was. What "
    "other code than this measured is measured again.\n\n"
    f"Studies with questions of their own: {', '.join(PLANS)}; tripod stands for both of its. For pendulum and drape "
    "the tables of the course report (what is stable, what tunnels) come first, unless --part or --quick leaves them "
    "out.\n\n"
    "Any other scene, your own too, and any that --set, --servo, --slide, --duration or --accuracy change, is studied "
    "as it is: its steps, schemes, elements and refined meshes against the finest that ten minutes allow; name its "
    ".json by --study and --accuracy picks from it.\n\n"
    "Exit codes: 0 done, 1 no reference, 2 bad arguments, 130 interrupted."
)
EXAMPLES = (
    "tripod study tripod_static",
    "tripod study pendulum --part report",
    "tripod study tripod_dynamic --knobs scheme,dt",
    "tripod study cloth --quick --json",
    "tripod study my_scene.toml --set material.young=1e5 --quick",
    'tripod study tripod --servo "0:0,0,0; 0.5:-0.5,0,0" --duration 0.6',
    "tripod study --all --jobs 4 --out studies",
    "tripod study silicone --scheduler tcp://127.0.0.1:8786",
)


def some_studies(incomplete: str) -> list[str]:
    """Return the studies and scenes that begin so: for the completion of shells."""
    return sorted({*(name for name in PLANS if name.startswith(incomplete)), *some_scenes(incomplete)})


@commands.command(help=HELP, epilog=examples(*EXAMPLES))
def study(
    scene: Annotated[
        str,
        typer.Argument(
            help="Name of a study or scene, or path of a scene file.",
            show_default=False,
            autocompletion=some_studies,
        ),
    ] = "",
    *,
    set_: Overrides = None,
    servo: ServoScript = None,
    slide: SlideScript = None,
    duration: Annotated[
        float | None,
        typer.Option(
            help="Of the motion \\[s]; the scene's own by default.",
            callback=within(0, unit="s", such_as="0.6", above=True),
        ),
    ] = None,
    accuracy: Accuracy = None,
    study_: Study = None,
    every: Annotated[bool, typer.Option("--all", help="All studies of accuracy.")] = False,
    part: Annotated[str, typer.Option(help="accuracy, report (the course report's table) or both.")] = "both",
    knobs: Annotated[
        str, typer.Option(metavar="A,B", help="Vary these knobs alone, the others as in the scene.")
    ] = "",
    quick: Annotated[bool, typer.Option("--quick", help="Few points, a coarser reference: seconds.")] = False,
    jobs: Annotated[
        int | None,
        typer.Option(
            help="Points at a time; by default one a processor.", callback=within(1, 1024, such_as="4")
        ),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="Run on the Dask cluster of this scheduler.")
    ] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where files and finished points go.")] = Path(
        "studies"
    ),
    fresh: Annotated[bool, typer.Option("--fresh", help="Measure again what is there.")] = False,
    seed: Annotated[
        int, typer.Option(help="Of the order in which points are run.", callback=within(0, such_as="1"))
    ] = 0,
    full: Annotated[
        bool, typer.Option("--full", help="Report: all combinations of the values, not one varied at a time.")
    ] = False,
    json: Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar.")] = False,
) -> None:
    """Run studies; the help is `HELP`."""
    from tripod_bringup.study_command import Changes, study_command  # noqa: PLC0415

    raise typer.Exit(
        study_command(
            scene,
            changes=Changes(set_ or [], servo, slide, duration, accuracy, study_),
            every=every,
            part=part,
            knobs=[word.strip() for word in knobs.split(",") if word.strip()],
            quick=quick,
            jobs=jobs or processors(),
            scheduler=scheduler,
            out=out,
            fresh=fresh,
            seed=seed,
            full=full,
            as_json=json,
            quiet=quiet,
        )
    )
