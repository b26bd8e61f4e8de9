"""Options and help of `tripod play`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup.node_command import RosCommand
from tripod_bringup.options import Json, Overrides, Quiet, SceneName, Subnet, examples, given_options, within

commands = typer.Typer()

PATH_FILES = (".csv", ".json")
"""Suffixes of path files; anything else is a maze."""

MAZE_OPTIONS = ("seed", "games", "noise", "delay", "limit")
PATH_OPTIONS = ("speed",)


@commands.command(
    cls=RosCommand,
    epilog=examples(
        "tripod play",
        "tripod play holes --seed 3",
        "tripod play random:7 --games 20 --json",
        "tripod play docs/tilts.csv --speed 4",
        "tripod play labyrinth --live",
    ),
)
def play(
    context: typer.Context,
    what: Annotated[
        str,
        typer.Argument(
            metavar="[MAZE or FILE]",
            help="A maze: its name, random:SEED, or a .txt file; by default that of the scene. Or a path file, .csv or "
            ".json: time and tilt_x, tilt_y (or tilt_x, tilt_z, or x, y, z).",
        ),
    ] = "",
    *,
    scene: SceneName = "maze",
    set_: Overrides = None,
    seed: Annotated[
        int,
        typer.Option(help="Maze: seed of the noise in the first game.", callback=within(0, such_as="1")),
    ] = 0,
    games: Annotated[
        int,
        typer.Option(
            help="Maze: number of games; each has the next seed.", callback=within(1, 10_000, such_as="20")
        ),
    ] = 1,
    noise: Annotated[
        float,
        typer.Option(
            help="Maze: noise of the ball's measured position \\[m].",
            callback=within(0, 1, unit="m", such_as="0.0003"),
        ),
    ] = 3e-4,
    delay: Annotated[
        float,
        typer.Option(
            help="Maze: delay of the ball's measured position \\[s].",
            callback=within(0, 1, unit="s", such_as="0.05"),
        ),
    ] = 0.05,
    limit: Annotated[
        float,
        typer.Option(
            help="Maze: time after which a game counts as lost \\[s].",
            callback=within(0, 1e6, unit="s", such_as="120"),
        ),
    ] = 120.0,
    speed: Annotated[
        float,
        typer.Option(
            help="Path: largest speed of the servos \\[rad/s]; faster stretches are slowed down.",
            callback=within(0, unit="rad/s", such_as="6", above=True),
        ),
    ] = 6.0,
    live: Annotated[
        bool,
        typer.Option(
            "--live",
            help="Play on the running robot or simulator: start `tripod up maze --set ik.goal=orientation` first, then "
            "press a in `tripod teleop`.",
        ),
    ] = False,
    subnet: Subnet = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Roll the ball through a maze, or play a table of tilts.

    Exit codes: 0 done, 1 a game is lost or the motion broke off, 2 bad input.
    """
    from tripod_bringup.play_command import path_command, solve_command  # noqa: PLC0415

    is_path = Path(what).suffix.lower() in PATH_FILES
    kind, other = ("path file", MAZE_OPTIONS) if is_path else ("maze", PATH_OPTIONS)
    if foreign := given_options(context, other):
        where = "a maze" if is_path else "a path file (.csv or .json)"
        print(f"tripod play: {foreign[0]} is for {where}, not for a {kind}; leave it out", file=sys.stderr)
        raise typer.Exit(2)
    if is_path:
        raise typer.Exit(
            path_command(
                Path(what), scene=scene, overrides=set_ or [], speed=speed, live=live, subnet=subnet, ros=context.obj,
                as_json=json, quiet=quiet,
            )
        )  # fmt: skip
    raise typer.Exit(
        solve_command(
            what, scene=scene, overrides=set_ or [], seed=seed, games=games, noise=noise, delay=delay, limit=limit,
            live=live, subnet=subnet, ros=context.obj, as_json=json, quiet=quiet,
        )
    )  # fmt: skip
