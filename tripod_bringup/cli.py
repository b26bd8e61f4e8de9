"""The `tripod` command: options and help of every subcommand; what they do is imported when they run."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup import bag_cli, explain_command, identify_cli, ik_cli, play_cli, robot_cli, study_cli
from tripod_bringup.accuracy_option import Accuracy, Budget, Study
from tripod_bringup.node_command import NODES, NodeCommand, NodeInfo, run_node_command
from tripod_bringup.options import (
    MOCK,
    Json,
    Overrides,
    Quiet,
    SceneArgument,
    SceneName,
    ServoScript,
    SlideScript,
    Subnet,
    examples,
    some_ports,
    some_scenes,
)
from tripod_bringup.pictures import Gif, Html, Mp4, Pictures, Plot
from tripod_host.program import program

app = typer.Typer(
    name="tripod",
    help="Simulate, drive and record the Tripod soft robot.",
    epilog="Begin with `tripod doctor`, then `tripod up --demo`.",
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
)
app.add_typer(bag_cli.bag, name="bag")


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415

        try:
            print(f"tripod {version('tripod')}")
        except PackageNotFoundError:
            print("tripod (not installed)")
        raise typer.Exit


UP_HELP = (
    "Start simulator, inverse kinematics, page and driver, and watch over them.\n\n"
    "Ctrl-C stops all in order: the driver parks the servos, the recording is closed last. "
    "A second Ctrl-C kills.\n\n"
    "Exit codes: 0 stopped as asked; 1 this process itself failed; 2 bad arguments; 3 another `tripod up` "
    "runs on this ROS domain in the same namespace; 10 sim, 11 ik, 12 driver, 13 view, 14 record ended by itself "
    "or could not stop in order (12 too: no robot answered in all of --duration or the demo); "
    "20 the demo's chain did not run; 130 killed by a second Ctrl-C."
)


@app.callback()
def root(
    *,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Simulate, drive and record the Tripod soft robot."""


@app.command(
    epilog=examples(
        "tripod run tripod --json",
        'tripod run tripod --duration 2 --servo "0:0,0,0; 1:-0.7854,-0.7854,-0.7854"',
        'tripod run tripod --servo "0:0,0,0; 2:-1.4965,-1.4965,-1.4965" --slide "0:0; 2:0.035" --out run.npz',
        "tripod run pendulum --view",
        "tripod run cloth --html cloth.html --plot cloth.png",
        "tripod run silicone --set material.young=3e5",
        "tripod run tripod --set dt=auto --set time_error.tolerance=1e-5 --set inertia.scheme=tr_bdf2",
        "tripod run tripod --accuracy 5%",
        "tripod run tripod --budget 20%",
    )
)
def run(
    scene: SceneArgument,
    *,
    duration: Annotated[
        float | None,
        typer.Option(
            help="Simulated time \\[s]; by default until 1 s after the last servo time, else the scene's own."
        ),
    ] = None,
    servo: ServoScript = None,
    slide: SlideScript = None,
    set_: Overrides = None,
    view: Annotated[bool, typer.Option("--view", help="Show it on a page, while it runs and after.")] = False,
    html: Html = None,
    plot: Plot = None,
    gif: Gif = None,
    mp4: Mp4 = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.npz", help="Write every step as arrays, for NumPy and `tripod show`."),
    ] = None,
    accuracy: Accuracy = None,
    budget: Budget = None,
    study: Study = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Simulate a scene, as fast as it goes, without ROS."""
    from tripod_bringup.run_command import run_scene  # noqa: PLC0415

    raise typer.Exit(
        run_scene(
            scene,
            duration=duration,
            servo=servo,
            slide=slide,
            overrides=set_ or [],
            out=out,
            pictures=Pictures(html=html, plot=plot, gif=gif, mp4=mp4),
            view=view,
            accuracy=accuracy,
            budget=budget,
            study=study,
            as_json=json,
            quiet=quiet,
        )
    )


@app.command(
    epilog=examples("tripod show run.npz", "tripod show run.npz --html run.html --plot run.png --gif run.gif")
)
def show(
    file: Annotated[Path, typer.Argument(metavar="FILE.npz", help="A recording, from `tripod run --out`.")],
    *,
    html: Html = None,
    plot: Plot = None,
    gif: Gif = None,
    mp4: Mp4 = None,
) -> None:
    """Show a recorded run on a page, until Ctrl-C, or write it as files."""
    from tripod_bringup.show_command import show_command  # noqa: PLC0415

    raise typer.Exit(show_command(file, Pictures(html=html, plot=plot, gif=gif, mp4=mp4)))


app.add_typer(explain_command.commands)


app.command("study", help=study_cli.HELP, epilog=examples(*study_cli.EXAMPLES))(study_cli.study)


@app.command(epilog=examples("tripod scenes", "tripod scenes tripod", "tripod scenes maze > my.toml"))
def scenes(
    name: Annotated[
        str,
        typer.Argument(
            help="Print this one, with its comments.", show_default=False, autocompletion=some_scenes
        ),
    ] = "",
    *,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the scenes that come with tripod, or print one to change."""
    from tripod_bringup.scenes_command import list_scenes, print_scene  # noqa: PLC0415

    if name:
        raise typer.Exit(print_scene(name, as_json=json))
    list_scenes(as_json=json)


@app.command(
    help=UP_HELP,
    epilog=examples(
        "tripod up",
        "tripod up maze --set ball.friction=0.2",
        "tripod up --port auto --record recordings",
        "tripod up --demo --duration 20",
        'tripod up --servo "0:0,0,0; 2:-0.7854,-0.7854,-0.7854" --record recordings',
        "tripod up --no-view driver.angle_max:=0.3",
        "tripod up --namespace left sim.frame_prefix:=left/",
    ),
)
def up(
    values: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENE] [NODE.NAME:=VALUE]...",
            help="The scene, then more parameters, of sim, ik, driver, view, record.",
            autocompletion=some_scenes,
        ),
    ] = None,
    *,
    scene: SceneName = "",
    set_: Overrides = None,
    servo: ServoScript = None,
    slide: SlideScript = None,
    port: Annotated[
        str,
        typer.Option(help="Serial port of the servos, as for `tripod driver`.", autocompletion=some_ports),
    ] = MOCK,
    record: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Record everything into a new file here.")
    ] = None,
    view: Annotated[bool, typer.Option("--view/--no-view", help="Serve the page.")] = True,
    view_port: Annotated[
        int | None, typer.Option(min=1, max=65535, help="Port of the page on this machine.")
    ] = None,
    demo: Annotated[bool, typer.Option("--demo", help="Follow a circle; records into ./recordings.")] = False,
    namespace: Annotated[
        str, typer.Option(metavar="NAME", help="Of all nodes: two robots in one domain have two.")
    ] = "",
    duration: Annotated[
        float | None,
        typer.Option(
            min=0.0, help="Stop after so many seconds (with --demo: of targets); until Ctrl-C by default."
        ),
    ] = None,
    accuracy: Accuracy = None,
    budget: Budget = None,
    study: Study = None,
    subnet: Subnet = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Show all that the nodes log.")] = False,
) -> None:
    """Start the whole chain; the help is `UP_HELP`."""
    from tripod_bringup.up_command import up_command  # noqa: PLC0415

    raise typer.Exit(
        up_command(
            values or [],
            scene=scene,
            overrides=set_ or [],
            servo=servo,
            slide=slide,
            port=port,
            record=record,
            view=view,
            view_port=view_port,
            demo=demo,
            namespace=namespace,
            duration=duration,
            accuracy=accuracy,
            budget=budget,
            study=study,
            subnet=subnet,
            verbose=verbose,
        )
    )


def _add_node_command(name: str, node: NodeInfo) -> None:
    def command(
        context: typer.Context,
        values: Annotated[
            list[str] | None, typer.Argument(metavar="NAME:=VALUE", help="Parameters; see the table below.")
        ] = None,
        *,
        subnet: Subnet = False,
    ) -> None:
        raise typer.Exit(run_node_command(name, values or [], subnet=subnet, ros=context.obj))

    app.command(name, cls=NodeCommand, help=node.help, epilog=examples(*node.examples))(command)


@app.command(cls=NodeCommand, help=NODES["sim"].help, epilog=examples(*NODES["sim"].examples))
def sim(
    context: typer.Context,
    values: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENE] [NAME:=VALUE]...",
            help="The scene, then parameters; see the table below.",
            autocompletion=some_scenes,
        ),
    ] = None,
    *,
    set_: Overrides = None,
    accuracy: Accuracy = None,
    budget: Budget = None,
    study: Study = None,
    servo: ServoScript = None,
    slide: SlideScript = None,
    subnet: Subnet = False,
) -> None:
    """Run the simulator as a ROS node."""
    from tripod_bringup.accuracy_option import wished  # noqa: PLC0415
    from tripod_bringup.compiling import compiling_told  # noqa: PLC0415
    from tripod_bringup.up_command import sim_companion, sim_words  # noqa: PLC0415

    try:
        words = sim_words(values or [], set_ or [], wished(accuracy, budget), study)
        beside = sim_companion(words, servo, slide)
    except ValueError as error:
        print(f"tripod sim: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    with compiling_told("tripod sim"):
        raise typer.Exit(run_node_command("sim", words, subnet=subnet, ros=context.obj, beside=beside))


@app.command(epilog=examples("tripod urdf > tripod.urdf", "tripod urdf maze --set maze.source=holes"))
def urdf(scene: SceneArgument = "tripod", *, set_: Overrides = None) -> None:
    """Print the robot of a scene as URDF: servos, slide, effector, plate, ball."""
    from tripod_bringup.run_command import print_urdf  # noqa: PLC0415

    raise typer.Exit(print_urdf(scene, set_ or []))


@app.command(epilog=examples("tripod parameters > tripod.yaml", "tripod parameters driver"))
def parameters(
    nodes: Annotated[list[str] | None, typer.Argument(metavar="NODE", help="All nodes by default.")] = None,
) -> None:
    """Print the parameters of the nodes as a parameter file of ROS, with their meanings."""
    from tripod_bringup.parameters_command import parameters_command  # noqa: PLC0415

    raise typer.Exit(parameters_command(nodes or []))


app.add_typer(robot_cli.commands)
app.add_typer(ik_cli.commands)
app.add_typer(identify_cli.commands)
app.add_typer(play_cli.commands)
app.add_typer(bag_cli.commands)

for _name, _node in NODES.items():
    if _name not in ("ik", "record", "sim"):  # which have options besides
        _add_node_command(_name, _node)


def main() -> None:
    """Run the command line; ends by SystemExit with the exit code."""
    with program("tripod"):
        app(prog_name="tripod")


if __name__ == "__main__":
    main()
