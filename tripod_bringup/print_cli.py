"""Options and help of `tripod print`."""

from typing import Annotated

import typer

from tripod_bringup.options import Overrides, SceneArgument, examples, some_scenes

commands = typer.Typer(help="Print a scene, maze, robot or parameter file as text.", no_args_is_help=True)


@commands.command(
    epilog=examples(
        "tripod print scene", "tripod print scene tripod", "tripod print scene maze > my_scene.toml"
    )
)
def scene(
    name: Annotated[
        str,
        typer.Argument(help="Scene to print.", show_default=False, autocompletion=some_scenes),
    ] = "",
    *,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the scenes that come with tripod, or print the file of one."""
    from tripod_bringup.print_command import list_scenes, print_scene  # noqa: PLC0415

    if name:
        raise typer.Exit(print_scene(name, as_json=json))
    list_scenes(as_json=json)


@commands.command(
    epilog=examples(
        "tripod print maze", "tripod print maze holes", "tripod print maze random:7:9x5 > my_maze.txt"
    )
)
def maze(
    source: Annotated[
        str,
        typer.Argument(
            help="Name of a maze, random:SEED, random:SEED:COLUMNSxROWS, or path of a .txt file.",
            show_default=False,
        ),
    ] = "",
) -> None:
    """List the mazes that come with tripod, or print one as text."""
    from tripod_bringup.print_command import print_maze  # noqa: PLC0415

    raise typer.Exit(print_maze(source))


@commands.command(
    epilog=examples("tripod print urdf > tripod.urdf", "tripod print urdf maze --set maze.source=holes")
)
def urdf(scene: SceneArgument = "tripod", *, set_: Overrides = None) -> None:
    """Print the robot of a scene as URDF: servos, slide, effector, plate, ball."""
    from tripod_bringup.print_command import print_urdf  # noqa: PLC0415

    raise typer.Exit(print_urdf(scene, set_ or []))


@commands.command(epilog=examples("tripod print parameters > tripod.yaml", "tripod print parameters driver"))
def parameters(
    nodes: Annotated[
        list[str] | None, typer.Argument(metavar="[NODE]...", help="Nodes; all of them by default.")
    ] = None,
) -> None:
    """Print the parameters of the ROS nodes, with their meaning, as a parameter file of ROS."""
    from tripod_bringup.parameters_command import parameters_command  # noqa: PLC0415

    raise typer.Exit(parameters_command(nodes or []))
