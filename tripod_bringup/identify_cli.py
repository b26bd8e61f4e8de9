"""Options and help of what holds a scene against measured data: `score`, `identify`."""

from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup.options import Json, Overrides, Quiet, SceneArgument, examples

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

Report = Annotated[Path | None, typer.Option(metavar="FILE.html", help="Write a report with pictures.")]

Plot = Annotated[Path | None, typer.Option(metavar="FILE.png", help="Write the picture alone.")]


@commands.command(
    epilog=examples(
        "tripod score tripod poses.csv",
        "tripod score robot.toml recordings/NAME --align translation --report score.html",
        'tripod score examples/silicone_beam.toml beam.csv --point "tip1=tip:0.036,0.015,0.1" --align translation',
    )
)
def score(
    scene: SceneArgument,
    data: Data,
    *,
    align: Align = "none",
    set_: Overrides = None,
    point: Points = None,
    rename: Renames = None,
    poses: Poses = False,
    report: Report = None,
    plot: Plot = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Tell how far a scene is from measured data; nothing is fitted."""
    from tripod_bringup.score_command import score_command  # noqa: PLC0415

    raise typer.Exit(
        score_command(
            scene,
            data,
            align=align,
            overrides=set_ or [],
            points=point or [],
            renames=rename or [],
            poses=poses,
            report=report,
            plot=plot,
            as_json=json,
            quiet=quiet,
        )
    )
