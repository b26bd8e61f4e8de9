"""Options and help of `tripod identify`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup.options import Json, Overrides, Quiet, Report, SceneArgument, examples, given_options

commands = typer.Typer()

Data = Annotated[
    Path,
    typer.Argument(
        metavar="DATA",
        help="Measured data: a .csv file whose columns have units (t_s, servo_0_rad, slide_mm, effector.x_mm, "
        "effector.rx_deg, SET.x_mm), or a recording.",
        show_default=False,
    ),
]

Align = Annotated[
    str, typer.Option(help="What may be between the frames: none, translation or rigid.", show_default=True)
]

Points = Annotated[
    list[str] | None,
    typer.Option(
        "--point",
        metavar="NAME=SET:X,Y,Z",
        help="A point [m] that moves with a set as if glued to it: columns NAME.x_mm are of it; repeatable.",
    ),
]

Renames = Annotated[
    list[str] | None,
    typer.Option(
        "--rename", metavar="OLD=NEW", help="Another name for columns, as measured=effector; repeatable."
    ),
]

Poses = Annotated[bool, typer.Option("--poses", help="Each row is a pose at rest, whatever its time.")]

Plot = Annotated[
    Path | None, typer.Option(metavar="FILE.png", help="With --score: write the picture of the comparison.")
]

FIT_OPTIONS = ("fit", "prior", "hold_out", "mesh", "profile", "propose", "candidates", "out")
"""What says nothing with `--score`."""


@commands.command(
    epilog=examples(
        "tripod identify tripod examples/poses.csv --score",
        "tripod identify tripod examples/poses.csv --fit servos.zero",
        "tripod identify tripod examples/poses.csv --fit servos.zero --out robot.toml --json > robot.json",
        "tripod identify tripod examples/poses.csv --fit material.young --align translation --hold-out 20% "
        "--report report.html",
        "tripod identify tripod examples/poses.csv --fit material.young --fit material.mass --prior "
        "material.mass=0.03~0.001",
    )
)
def identify(
    context: typer.Context,
    scene: SceneArgument,
    data: Data,
    *,
    score: Annotated[
        bool,
        typer.Option("--score", help="Fit nothing: print how far the scene is from the data."),
    ] = False,
    fit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="A numeric field of the scene (material.young, damping.stiffness, servos.slide, load.0.mass), or "
            "servos.zero, servos.gain, mount (point of the disc that is seen), frame (of the data), start (of a "
            "motion); of these also one, servos.zero.1. Repeatable.",
        ),
    ] = None,
    align: Align = "none",
    prior: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE~SD", help="What is known of a value before, in SI; repeatable."),
    ] = None,
    hold_out: Annotated[
        str, typer.Option(metavar="SHARE", help="Rows kept out of the fit: 20% or 0.2; of a motion the end.")
    ] = "0",
    set_: Overrides = None,
    point: Points = None,
    rename: Renames = None,
    poses: Poses = False,
    mesh: Annotated[
        bool, typer.Option("--mesh/--no-mesh", help="Estimate what mesh and steps make, by a finer mesh.")
    ] = True,
    profile: Annotated[
        bool, typer.Option("--profile", help="Intervals by profiles as well, which takes longer.")
    ] = False,
    propose: Annotated[
        bool, typer.Option("--propose/--no-propose", help="Name three poses that would tell most.")
    ] = True,
    candidates: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", help="Poses to choose from: servo_0_rad and so on, slide_mm."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Write the scene with the values found.")
    ] = None,
    report: Report = None,
    plot: Plot = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Fit a scene to measured data, or compare them (--score).

    Prints each value with its interval, and the values that the data do not determine.
    """
    foreign = given_options(context, FIT_OPTIONS if score else ("plot",))
    if foreign:
        remedy = (
            "is for a fit; leave it out, or leave out --score"
            if score
            else "needs --score; a fit draws its pictures into --report FILE.html"
        )
        print(f"tripod identify: {foreign[0]} {remedy}", file=sys.stderr)
        raise typer.Exit(2)
    if score:
        from tripod_bringup.score_command import score_command  # noqa: PLC0415

        raise typer.Exit(
            score_command(
                scene, data, align=align, overrides=set_ or [], points=point or [], renames=rename or [],
                poses=poses, report=report, plot=plot, as_json=json, quiet=quiet,
            )
        )  # fmt: skip
    from tripod_bringup.identify_command import identify_command  # noqa: PLC0415

    raise typer.Exit(
        identify_command(
            scene,
            data,
            fit=fit or [],
            align=align,
            priors=prior or [],
            hold_out=hold_out,
            overrides=set_ or [],
            points=point or [],
            renames=rename or [],
            poses=poses,
            mesh=mesh,
            profile=profile,
            propose=propose,
            candidates=candidates,
            out=out,
            report=report,
            as_json=json,
            quiet=quiet,
        )
    )
