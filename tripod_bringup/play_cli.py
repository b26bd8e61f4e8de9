"""Options and help of play: `path`, `solve`, `maze`."""

from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup.node_command import RosCommand
from tripod_bringup.options import Json, Overrides, Quiet, SceneName, Subnet, examples

commands = typer.Typer()


@commands.command(
    cls=RosCommand,
    epilog=examples(
        "tripod path tilts.csv", "tripod path tilts.json --speed 4", "tripod path tilts.csv --live"
    ),
)
def path(
    context: typer.Context,
    file: Annotated[
        Path, typer.Argument(help="CSV or JSON: time and tilt_x, tilt_y (or tilt_x, tilt_z, or x, y, z).")
    ],
    *,
    scene: SceneName = "maze",
    set_: Overrides = None,
    speed: Annotated[
        float,
        typer.Option(help="Speed that the servos can keep \\[rad/s]; faster stretches are slowed down."),
    ] = 6.0,
    live: Annotated[
        bool,
        typer.Option(
            "--live",
            help="Play it in the graph: `tripod up ik.goal:=orientation` must run, the robot stand where it can tilt.",
        ),
    ] = False,
    subnet: Subnet = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Play a path file through inverse kinematics, and say where the servos are too slow for it."""
    from tripod_bringup.play_command import path_command  # noqa: PLC0415

    raise typer.Exit(
        path_command(
            file, scene=scene, overrides=set_ or [], speed=speed, live=live, subnet=subnet, ros=context.obj,
            as_json=json, quiet=quiet,
        )
    )  # fmt: skip


@commands.command(
    cls=RosCommand,
    epilog=examples(
        "tripod solve",
        "tripod solve holes --seed 3",
        "tripod solve random:7 --games 20 --json",
        "tripod solve labyrinth --live",
    ),
)
def solve(
    context: typer.Context,
    maze: Annotated[
        str,
        typer.Argument(
            help="Name of a maze, random:SEED, or the path of a .txt file; the scene's own by default."
        ),
    ] = "",
    *,
    scene: SceneName = "maze",
    set_: Overrides = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the noise of the first game.")] = 0,
    games: Annotated[int, typer.Option(min=1, max=10_000, help="How many, with one seed more each.")] = 1,
    noise: Annotated[float, typer.Option(help="Of the ball's seen position \\[m].")] = 3e-4,
    delay: Annotated[float, typer.Option(help="Of the ball's seen position \\[s].")] = 0.05,
    limit: Annotated[float, typer.Option(help="Time after which a game is given up \\[s].")] = 120.0,
    live: Annotated[
        bool,
        typer.Option(
            "--live",
            help="Solve in the graph: `tripod up --scene maze ik.goal:=orientation` must run, the robot in its working "
            "pose (key a of `tripod teleop`).",
        ),
    ] = False,
    subnet: Subnet = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Roll the ball through the maze without a hand; exit code 1 if a game is not won."""
    from tripod_bringup.play_command import solve_command  # noqa: PLC0415

    raise typer.Exit(
        solve_command(
            maze, scene=scene, overrides=set_ or [], seed=seed, games=games, noise=noise, delay=delay, limit=limit,
            live=live, subnet=subnet, ros=context.obj, as_json=json, quiet=quiet,
        )
    )  # fmt: skip


@commands.command(epilog=examples("tripod maze", "tripod maze holes", "tripod maze random:7:9x5 > my.txt"))
def maze(
    source: Annotated[
        str, typer.Argument(help="Name of a maze, random:SEED or random:SEED:COLUMNSxROWS.")
    ] = "",
) -> None:
    """Print a maze as text, to play or to change; without an argument the names of the shipped ones."""
    from tripod_bringup.play_command import maze_command  # noqa: PLC0415

    raise typer.Exit(maze_command(source))
