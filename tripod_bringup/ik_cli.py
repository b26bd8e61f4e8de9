"""Options and help of inverse kinematics: `reach`, `ik`."""

import math
import sys
from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup.accuracy_option import Accuracy, Budget, Study
from tripod_bringup.node_command import NODES, NodeCommand, run_node_command
from tripod_bringup.options import (
    Json,
    Overrides,
    Quiet,
    SceneArgument,
    SceneName,
    SceneNodeSettings,
    SceneWords,
    Subnet,
    examples,
    given_options,
    metres,
    within,
)

commands = typer.Typer()

SLIDE = within(0, 0.1, unit="m", such_as="35mm")
"""Check of a slide; scenes have closer bounds of their own."""

_TORQUE = within(0, unit="N m", such_as="0.3", above=True)


def _positive_or_infinite(value: float) -> float:
    return value if value == math.inf else float(_TORQUE(value))


Slide = Annotated[
    float,
    typer.Option(parser=metres, metavar="LENGTH", help="Inward slide \\[m], or as 35mm.", callback=SLIDE),
]


@commands.command(
    epilog=examples(
        "tripod reach",
        "tripod reach tripod --out reach.csv --plot reach.png",
        "tripod reach --slide 0.03 --count 7 --torque-max 0.12 --json",
        "tripod reach cross --samples 500",
    )
)
def reach(
    scene: SceneArgument = "tripod",
    *,
    set_: Overrides = None,
    slide: Slide = 0.035,
    low: Annotated[float | None, typer.Option(help="Smallest angle \\[rad]; the scene's by default.")] = None,
    high: Annotated[
        float | None, typer.Option(help="Largest angle \\[rad]; by default where the strips are stretched.")
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(
            help="Angles of each servo to try: a grid. By default 11, of four servos 7.",
            callback=within(2, 101, such_as="11"),
        ),
    ] = None,
    samples: Annotated[
        int | None,
        typer.Option(
            help="Quasi-random samples of the angles to try instead of a grid; of more than four servos 2048 by "
            "default.",
            callback=within(1, 1_000_000, such_as="2048"),
        ),
    ] = None,
    torque_max: Annotated[
        float,
        typer.Option(
            help="Largest torque of a servo \\[N m].",
            callback=within(0, unit="N m", such_as="0.17", above=True),
        ),
    ] = 0.17,
    out: Annotated[Path | None, typer.Option(help="Write every pose to this CSV file.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw it into this .png, .svg or .pdf file.")] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compute the workspace of the effector.

    Prints the positions, heights and tilts that it can reach, and the torque that is left there.
    """
    from tripod_bringup.reach_command import reach_command  # noqa: PLC0415

    raise typer.Exit(
        reach_command(
            scene,
            overrides=set_ or [],
            slide=slide,
            low=low,
            high=high,
            count=count,
            samples=samples,
            torque_max=torque_max,
            out=out,
            plot=plot,
            as_json=json,
            quiet=quiet,
        )
    )


IK_HELP = (
    "Find the commands of servos and other actuators for a target, or run the ROS node for it.\n\n"
    "With --target it needs no ROS: it prints commands, what is still missing, torques and active limits. "
    "Exit codes: 0 reached, 1 not reached, 2 bad arguments. "
    "Without --target only the scene, --set and --subnet are allowed."
)


@commands.command("ik", cls=NodeCommand, help=IK_HELP, epilog=examples(*NODES["ik"].examples))
def ik(
    context: typer.Context,
    values: SceneWords = None,
    *,
    target: Annotated[
        str | None,
        typer.Option(
            metavar='"X Y Z"',
            help="Target of the effector \\[m], or as 5mm; after semicolons NAME = X Y Z of further places.",
        ),
    ] = None,
    goal: Annotated[
        str, typer.Option(help="What is asked for: position, orientation (tilt and height), or pose (both).")
    ] = "position",
    tilt: Annotated[
        str, typer.Option(metavar='"ROLL PITCH"', help="Tilt wanted \\[rad], or as 10deg.")
    ] = "0 0",
    scene: SceneName = "",
    set_: SceneNodeSettings = None,
    slide: Slide = 0.035,
    start: Annotated[
        str | None,
        typer.Option(
            metavar='"A B C"',
            help="Commands where the robot is: angles \\[rad] of servos, others in the unit of their range; by default "
            "those of the slide, or of the start.",
        ),
    ] = None,
    torque_max: Annotated[
        float,
        typer.Option(
            help="Largest torque of a servo \\[N m]; inf for no limit. Cables keep to their tension_max.",
            callback=_positive_or_infinite,
        ),
    ] = 0.3,
    box: Annotated[
        str | None,
        typer.Option(metavar='"X Y Z X Y Z"', help="Smallest and largest corner for the effector \\[m]."),
    ] = None,
    hard: Annotated[bool, typer.Option("--hard", help="Torque and box are hard limits, not soft.")] = False,
    posterior: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="What tripod identify --json printed: tells the pose's expected error, with 90 % bars. "
            "--scene is then what its --out wrote.",
        ),
    ] = None,
    accuracy: Accuracy = None,
    budget: Budget = None,
    study: Study = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object (with --target).")] = False,
    subnet: Subnet = False,
) -> None:
    """Run the node, or solve once; the help is `IK_HELP`."""
    from tripod_bringup.up_command import named_scene  # noqa: PLC0415

    known = {str(parameter.name) for parameter in context.command.params}
    given = given_options(context, known - {"values", "subnet", "set_", "scene"})
    try:
        named, words = named_scene(values or [], scene)
    except ValueError as error:
        print(f"tripod ik: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    if target is None and given:
        print(
            f"tripod ik: {given[0]} needs --target; the parameters of the node are set by --set NAME=VALUE",
            file=sys.stderr,
        )
        raise typer.Exit(2)
    if target is None:
        own = [f"scene={named}", *(set_ or [])] if named != "tripod" else set_ or []
        raise typer.Exit(run_node_command("ik", words, own, subnet=subnet, ros=context.obj))
    if words:
        print(
            f"tripod ik: {words[0]!r} is a parameter of the node; with --target give options",
            file=sys.stderr,
        )
        raise typer.Exit(2)
    from tripod_bringup.ik_command import solve_command  # noqa: PLC0415

    raise typer.Exit(
        solve_command(
            target,
            scene=named,
            overrides=set_ or [],
            goal=goal,
            tilt=tilt,
            slide=slide,
            start=start,
            torque_max=torque_max,
            hard=hard,
            box=box,
            posterior=posterior,
            accuracy=accuracy,
            budget=budget,
            study=study,
            as_json=json,
        )
    )
