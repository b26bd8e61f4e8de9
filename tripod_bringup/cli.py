"""The `tripod` command: options and help of every subcommand; what they do is imported when they run."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup import explain_command, study_cli
from tripod_bringup.accuracy_option import Accuracy, Study
from tripod_bringup.node_command import NODES, NodeCommand, NodeInfo, run_node_command

app = typer.Typer(
    name="tripod",
    help="Simulate, drive and record the Tripod soft robot.",
    epilog="Begin with `tripod doctor`, then `tripod up --demo`.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
)
bag = typer.Typer(help="Look into recordings.", no_args_is_help=True)
app.add_typer(bag, name="bag")


def examples(*lines: str) -> str:
    """Return the epilogue of a help page: one example a line."""
    return "Examples:\n" + "\n".join(f"[dim]$[/] {line}" for line in lines)


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
    "runs on this ROS domain; 10 sim, 11 ik, 12 driver, 13 view, 14 record ended by itself or could not stop "
    "in order; 20 the demo's chain did not run; 130 killed by a second Ctrl-C."
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
        "tripod run silicone --set material.young=3e5",
        "tripod run tripod --set dt=auto --set time_error.tolerance=1e-5 --set inertia.scheme=tr_bdf2",
        "tripod run tripod --accuracy 5%",
    )
)
def run(
    scene: Annotated[str, typer.Argument(help="Name of a shipped scene, or path of a scene file.")],
    *,
    duration: Annotated[
        float | None, typer.Option(help="Simulated time \\[s]; the scene's own by default.")
    ] = None,
    servo: Annotated[str | None, typer.Option(help='Servo angles \\[rad]: "time:a,b,c; time:a,b,c".')] = None,
    slide: Annotated[
        str | None, typer.Option(help='Inward slide \\[m]: a number, or "time:value; ...".')
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Set a field of the scene; repeatable."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write the motion to this .npz file.")] = None,
    accuracy: Accuracy = None,
    study: Study = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")] = False,
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
            accuracy=accuracy,
            study=study,
            as_json=json,
            quiet=quiet,
        )
    )


explain_command.register(app, examples)


app.command("study", help=study_cli.HELP, epilog=examples(*study_cli.EXAMPLES))(study_cli.study)


@app.command(epilog=examples("tripod scenes", "tripod scenes --json"))
def scenes(*, json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False) -> None:
    """List the scenes that come with tripod."""
    from tripod_bringup.run_command import list_scenes  # noqa: PLC0415

    list_scenes(as_json=json)


@app.command(
    help=UP_HELP,
    epilog=examples(
        "tripod up",
        "tripod up --port auto --record recordings",
        "tripod up --demo --duration 20",
        "tripod up --no-view driver.angle_max:=0.3",
    ),
)
def up(
    values: Annotated[
        list[str] | None,
        typer.Argument(metavar="NODE.NAME:=VALUE", help="More parameters, of sim, ik, driver, view, record."),
    ] = None,
    *,
    scene: Annotated[str, typer.Option(help="Name of a scene, or path of a scene file.")] = "tripod",
    port: Annotated[str, typer.Option(help="Serial port of the servos, as for `tripod driver`.")] = "mock",
    record: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Record everything into a new file here.")
    ] = None,
    view: Annotated[bool, typer.Option("--view/--no-view", help="Serve the page.")] = True,
    view_port: Annotated[
        int | None, typer.Option(min=1, max=65535, help="Port of the page on this machine.")
    ] = None,
    demo: Annotated[bool, typer.Option("--demo", help="Follow a circle; records into ./recordings.")] = False,
    duration: Annotated[
        float | None,
        typer.Option(
            min=0.0, help="Stop after so many seconds (with --demo: of targets); until Ctrl-C by default."
        ),
    ] = None,
    accuracy: Accuracy = None,
    study: Study = None,
    subnet: Annotated[bool, typer.Option("--subnet", help="Let ROS discovery leave this machine.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Show all that the nodes log.")] = False,
) -> None:
    """Start the whole chain; the help is `UP_HELP`."""
    from tripod_bringup.up_command import up_command  # noqa: PLC0415

    raise typer.Exit(
        up_command(
            values or [],
            scene=scene,
            port=port,
            record=record,
            view=view,
            view_port=view_port,
            demo=demo,
            duration=duration,
            accuracy=accuracy,
            study=study,
            subnet=subnet,
            verbose=verbose,
        )
    )


@app.command(
    epilog=examples(
        "tripod doctor", "tripod doctor --ask", "tripod doctor --json", "tripod doctor --record /data"
    )
)
def doctor(
    *,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where recordings would go.")] = Path(
        "recordings"
    ),
    ask: Annotated[
        bool,
        typer.Option(
            "--ask",
            help="Ask each board for its firmware and time the answer. Opening a port resets most boards; with the "
            "workshop's firmware the servos may jump.",
        ),
    ] = False,
) -> None:
    """Check this machine and say what to do; exit code 1 if something must be done."""
    from tripod_bringup.doctor_command import doctor_command  # noqa: PLC0415

    raise typer.Exit(doctor_command(record, as_json=json, ask=ask))


@app.command(
    epilog=examples(
        "tripod calibrate",
        "tripod calibrate robot.yaml --port /dev/ttyACM0",
        "tripod calibrate --protocol legacy",
    )
)
def calibrate(
    file: Annotated[
        Path, typer.Argument(help="Calibration to write; where it exists, it is where to begin.")
    ] = Path("calibration.yaml"),
    *,
    port: Annotated[str, typer.Option(help="Where the servos are, as for `tripod driver`.")] = "auto",
    protocol: Annotated[
        str, typer.Option(help="framed, legacy or ascii, as for `tripod driver`.")
    ] = "framed",
    baud: Annotated[
        int, typer.Option(min=0, max=4_000_000, help="Bits a second; 0: as the protocol has it.")
    ] = 0,
    boot_time: Annotated[
        float,
        typer.Option(min=0.0, max=30.0, help="Time that the board needs after its port was opened \\[s]."),
    ] = 2.0,
) -> None:
    """Find the calibration of the servos by hand: keys turn one shaft at a time, slowly; space stops."""
    from tripod_bringup.calibrate_command import calibrate_command  # noqa: PLC0415

    raise typer.Exit(calibrate_command(port, file, protocol=protocol, baud=baud, boot_time=boot_time))


@app.command(
    epilog=examples(
        "make -C firmware && tripod flash", "tripod flash --port /dev/ttyACM0", "tripod flash --baud 57600"
    )
)
def flash(
    file: Annotated[
        Path | None, typer.Argument(help="A .hex or .elf file; by default what `make -C firmware` makes.")
    ] = None,
    *,
    port: Annotated[
        str, typer.Option(help="Path of the device; auto: the one port with a known board.")
    ] = "auto",
    baud: Annotated[int, typer.Option(min=1200, max=4_000_000, help="Speed of the boot loader.")] = 115200,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the command and do nothing.")] = False,
) -> None:
    """Write the firmware to the board, by avrdude; builds nothing."""
    from tripod_bringup.flash import flash_command  # noqa: PLC0415

    raise typer.Exit(flash_command(port, file, baud=baud, dry_run=dry_run))


@app.command(
    epilog=examples(
        "tripod path tilts.csv", "tripod path tilts.json --speed 4", "tripod path tilts.csv --live"
    )
)
def path(
    file: Annotated[
        Path, typer.Argument(help="CSV or JSON: time and tilt_x, tilt_y (or tilt_x, tilt_z, or x, y, z).")
    ],
    *,
    scene: Annotated[str, typer.Option(help="Name of a scene, or path of a scene file.")] = "maze",
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Set a field of the scene; repeatable."),
    ] = None,
    speed: Annotated[
        float,
        typer.Option(help="Speed that the servos can keep \\[rad/s]; faster stretches are slowed down."),
    ] = 6.0,
    live: Annotated[
        bool, typer.Option("--live", help="Play it in the graph: `tripod up ik.goal:=orientation` must run.")
    ] = False,
    subnet: Annotated[bool, typer.Option("--subnet", help="Let ROS discovery leave this machine.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")] = False,
) -> None:
    """Play a path file through inverse kinematics, and say where the servos are too slow for it."""
    from tripod_bringup.play_command import path_command  # noqa: PLC0415

    raise typer.Exit(
        path_command(
            file, scene=scene, overrides=set_ or [], speed=speed, live=live, subnet=subnet, as_json=json, quiet=quiet
        )
    )  # fmt: skip


@app.command(
    epilog=examples(
        "tripod solve",
        "tripod solve holes --seed 3",
        "tripod solve random:7 --games 20 --json",
        "tripod solve labyrinth --live",
    )
)
def solve(
    maze: Annotated[
        str,
        typer.Argument(
            help="Name of a maze, random:SEED, or the path of a .txt file; the scene's own by default."
        ),
    ] = "",
    *,
    scene: Annotated[str, typer.Option(help="Name of a scene, or path of a scene file.")] = "maze",
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Set a field of the scene; repeatable."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the noise of the first game.")] = 0,
    games: Annotated[int, typer.Option(min=1, max=10_000, help="How many, with one seed more each.")] = 1,
    noise: Annotated[float, typer.Option(help="Of the ball's seen position \\[m].")] = 3e-4,
    delay: Annotated[float, typer.Option(help="Of the ball's seen position \\[s].")] = 0.05,
    limit: Annotated[float, typer.Option(help="Time after which a game is given up \\[s].")] = 120.0,
    live: Annotated[
        bool,
        typer.Option(
            "--live", help="Solve in the graph: `tripod up --scene maze ik.goal:=orientation` must run."
        ),
    ] = False,
    subnet: Annotated[bool, typer.Option("--subnet", help="Let ROS discovery leave this machine.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")] = False,
) -> None:
    """Roll the ball through the maze without a hand; exit code 1 if a game is not won."""
    from tripod_bringup.play_command import solve_command  # noqa: PLC0415

    raise typer.Exit(
        solve_command(
            maze, scene=scene, overrides=set_ or [], seed=seed, games=games, noise=noise, delay=delay, limit=limit,
            live=live, subnet=subnet, as_json=json, quiet=quiet,
        )
    )  # fmt: skip


@app.command(epilog=examples("tripod maze", "tripod maze holes", "tripod maze random:7:9x5 > my.txt"))
def maze(
    source: Annotated[
        str, typer.Argument(help="Name of a maze, random:SEED or random:SEED:COLUMNSxROWS.")
    ] = "",
) -> None:
    """Print a maze as text, to play or to change; without an argument the names of the shipped ones."""
    from tripod_bringup.play_command import maze_command  # noqa: PLC0415

    raise typer.Exit(maze_command(source))


@bag.command(
    epilog=examples(
        "tripod bag info recordings/tripod_2030-01-31_12-00-00",
        "tripod bag info recording.mcap --check --json",
    )
)
def info(
    file: Annotated[Path, typer.Argument(help="An .mcap file, or the directory of a recording.")],
    *,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    check: Annotated[bool, typer.Option("--check", help="Read every message, believe no summary.")] = False,
) -> None:
    """Tell what a recording holds: topics, types, counts, rates, time span."""
    from tripod_record.info import info_command  # noqa: PLC0415

    raise typer.Exit(info_command(file, as_json=json, check=check))


@app.command(
    epilog=examples(
        "tripod reach",
        "tripod reach tripod --out reach.csv --plot reach.png",
        "tripod reach --slide 0.03 --count 7 --torque-max 0.12 --json",
    )
)
def reach(
    scene: Annotated[str, typer.Argument(help="Name of a scene, or path of a scene file.")] = "tripod",
    *,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Set a field of the scene; repeatable."),
    ] = None,
    slide: Annotated[float, typer.Option(help="Inward slide \\[m].")] = 0.035,
    low: Annotated[float | None, typer.Option(help="Smallest angle \\[rad]; the scene's by default.")] = None,
    high: Annotated[
        float | None, typer.Option(help="Largest angle \\[rad]; by default where the strips are stretched.")
    ] = None,
    count: Annotated[int, typer.Option(min=2, max=101, help="Angles of each servo to try.")] = 11,
    torque_max: Annotated[float, typer.Option(help="Torque that a servo can bear \\[N m].")] = 0.17,
    out: Annotated[Path | None, typer.Option(help="Write every pose to this CSV file.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw it into this .png, .svg or .pdf file.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")] = False,
) -> None:
    """Compute what the effector can reach: positions, heights, tilts, and what torque is left."""
    from tripod_bringup.reach_command import reach_command  # noqa: PLC0415

    raise typer.Exit(
        reach_command(
            scene,
            overrides=set_ or [],
            slide=slide,
            low=low,
            high=high,
            count=count,
            torque_max=torque_max,
            out=out,
            plot=plot,
            as_json=json,
            quiet=quiet,
        )
    )


IK_HELP = (
    "Run inverse kinematics: target poses in, servo angles out.\n\n"
    "With --target it solves once, without ROS, prints angles, residual, torques and active limits, and ends. "
    "Exit codes then: 0 reached, 1 not reached, 2 bad arguments. All other options belong to --target."
)


@app.command("ik", cls=NodeCommand, help=IK_HELP, epilog=examples(*NODES["ik"].examples))
def ik(
    values: Annotated[
        list[str] | None, typer.Argument(metavar="NAME:=VALUE", help="Parameters of the node; see below.")
    ] = None,
    *,
    target: Annotated[
        str | None, typer.Option(metavar='"X Y Z"', help="Where the effector is to be \\[m]: solve once.")
    ] = None,
    goal: Annotated[
        str, typer.Option(help="What is asked for: position, orientation (tilt and height), or pose (both).")
    ] = "position",
    tilt: Annotated[str, typer.Option(metavar='"ROLL PITCH"', help="Tilt wanted \\[rad].")] = "0 0",
    scene: Annotated[str, typer.Option(help="Name of a scene, or path of a scene file.")] = "tripod",
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Set a field of the scene; repeatable."),
    ] = None,
    slide: Annotated[float, typer.Option(help="Inward slide \\[m].")] = 0.035,
    start: Annotated[
        str | None,
        typer.Option(metavar='"A B C"', help="Angles \\[rad] whose branch is taken; the working pose."),
    ] = None,
    torque_max: Annotated[
        float | None, typer.Option(help="Largest torque of a servo \\[N m]; none by default.")
    ] = None,
    box: Annotated[
        str | None,
        typer.Option(metavar='"X Y Z X Y Z"', help="Smallest and largest corner for the effector \\[m]."),
    ] = None,
    hard: Annotated[bool, typer.Option("--hard", help="Torque and box are hard limits, not soft.")] = False,
    any_branch: Annotated[
        bool, typer.Option("--any-branch", help="A pose beyond a fold will do, too.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object (with --target).")] = False,
    subnet: Annotated[bool, typer.Option("--subnet", help="Let ROS discovery leave this machine.")] = False,
) -> None:
    """Run the node, or solve once; the help is `IK_HELP`."""
    if target is None:
        raise typer.Exit(run_node_command("ik", values or [], subnet=subnet))
    if values:
        print(
            f"tripod ik: {values[0]!r} is a parameter of the node; with --target give options",
            file=sys.stderr,
        )
        raise typer.Exit(2)
    from tripod_bringup.ik_command import solve_command  # noqa: PLC0415

    raise typer.Exit(
        solve_command(
            target,
            scene=scene,
            overrides=set_ or [],
            goal=goal,
            tilt=tilt,
            slide=slide,
            start=start,
            torque_max=torque_max,
            hard=hard,
            box=box,
            any_branch=any_branch,
            as_json=json,
        )
    )


def _add_node_command(name: str, node: NodeInfo) -> None:
    def command(
        values: Annotated[
            list[str] | None, typer.Argument(metavar="NAME:=VALUE", help="Parameters; see the table below.")
        ] = None,
        *,
        subnet: Annotated[
            bool, typer.Option("--subnet", help="Let ROS discovery leave this machine.")
        ] = False,
    ) -> None:
        raise typer.Exit(run_node_command(name, values or [], subnet=subnet))

    app.command(name, cls=NodeCommand, help=node.help, epilog=examples(*node.examples))(command)


for _name, _node in NODES.items():
    if _name != "ik":
        _add_node_command(_name, _node)


def main() -> None:
    """Run the command line, as the console script `tripod`; ends by SystemExit with the exit code."""
    try:
        app()
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
