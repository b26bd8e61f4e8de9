"""Options and help of `tripod up` and of the nodes that have no other options than `--set`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup.accuracy_option import Accuracy, Budget, Study
from tripod_bringup.node_command import (
    NODES,
    NodeCommand,
    name_new_form,
    parameter_table,
    run_node_command,
    split_settings,
)
from tripod_bringup.options import (
    MOCK,
    ActuatorScripts,
    NodeSettings,
    OldSettings,
    SceneName,
    SceneNodeSettings,
    SceneWords,
    ServoScript,
    SlideScript,
    Subnet,
    ViewPort,
    examples,
    some_fields,
    some_ports,
    some_scenes,
    within,
)

commands = typer.Typer()

UP_HELP = (
    "Start simulator, inverse kinematics, driver and page together.\n\n"
    "Ctrl-C stops all in order: the driver parks the servos, the recording is closed last. "
    "A second Ctrl-C kills.\n\n"
    "Exit codes: 0 stopped as asked; 1 this process itself failed; 2 bad arguments; 3 another `tripod up` "
    "runs on this ROS domain in the same namespace; 10 sim, 11 ik, 12 driver, 13 view, 14 record ended by itself "
    "or could not stop in order (12 too: no robot answered in all of --duration or the demo); "
    "20 the demo's chain did not run; 130 killed by a second Ctrl-C."
)


@commands.command(
    help=UP_HELP,
    epilog=examples(
        "tripod up",
        "tripod up maze --set ball.friction=0.2",
        "tripod up --port auto --record recordings",
        "tripod up --demo --duration 20",
        'tripod up --servo "0:0,0,0; 2:-0.7854,-0.7854,-0.7854" --record recordings',
        "tripod up --no-view --set driver.angle_max=0.3",
        "tripod up --namespace left --set sim.frame_prefix=left/",
    ),
)
def up(
    values: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENE]",
            help="Name of a scene, or path of a scene file; tripod by default.",
            autocompletion=some_scenes,
        ),
    ] = None,
    *,
    scene: SceneName = "",
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Set a field of the scene, or NODE.NAME, a parameter of sim, ik, driver, view or record; repeatable.",
            autocompletion=some_fields,
        ),
    ] = None,
    servo: ServoScript = None,
    slide: SlideScript = None,
    actuate: ActuatorScripts = None,
    port: Annotated[
        str,
        typer.Option(help="Port of the servos: a device, auto, or mock.", autocompletion=some_ports),
    ] = MOCK,
    record: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Record everything into a new file here.")
    ] = None,
    view: Annotated[bool, typer.Option("--view/--no-view", help="Serve the page.")] = True,
    view_port: ViewPort = None,
    demo: Annotated[bool, typer.Option("--demo", help="Follow a circle; records into ./recordings.")] = False,
    namespace: Annotated[
        str, typer.Option(metavar="NAME", help="Of all nodes: two robots in one domain have two.")
    ] = "",
    duration: Annotated[
        float | None,
        typer.Option(
            help="Stop after so many seconds (with --demo: of targets); by default run until Ctrl-C.",
            callback=within(0, unit="s", such_as="20"),
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

    name_new_form("tripod up", values or [])
    raise typer.Exit(
        up_command(
            values or [],
            scene=scene,
            overrides=set_ or [],
            servo=servo,
            slide=slide,
            actuate=actuate or (),
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


def _add_node_command(name: str) -> None:
    def command(
        context: typer.Context,
        values: OldSettings = None,
        *,
        set_: NodeSettings = None,
        subnet: Subnet = False,
    ) -> None:
        raise typer.Exit(run_node_command(name, values or [], set_ or [], subnet=subnet, ros=context.obj))

    node = NODES[name]
    commands.command(name, cls=NodeCommand, help=node.help, epilog=examples(*node.examples))(command)


_add_node_command("driver")
_add_node_command("teleop")


@commands.command(cls=NodeCommand, help=NODES["view"].help, epilog=examples(*NODES["view"].examples))
def view(
    context: typer.Context,
    values: OldSettings = None,
    *,
    set_: NodeSettings = None,
    view_port: ViewPort = None,
    subnet: Subnet = False,
) -> None:
    """Serve the page."""
    settings = [*(set_ or []), *([] if view_port is None else [f"port={view_port}"])]
    raise typer.Exit(run_node_command("view", values or [], settings, subnet=subnet, ros=context.obj))


@commands.command(cls=NodeCommand, help=NODES["sim"].help, epilog=examples(*NODES["sim"].examples))
def sim(
    context: typer.Context,
    values: SceneWords = None,
    *,
    set_: SceneNodeSettings = None,
    accuracy: Accuracy = None,
    budget: Budget = None,
    study: Study = None,
    servo: ServoScript = None,
    slide: SlideScript = None,
    actuate: ActuatorScripts = None,
    subnet: Subnet = False,
) -> None:
    """Run the simulator as a ROS node."""
    from tripod_bringup.accuracy_option import wished  # noqa: PLC0415
    from tripod_bringup.compiling import compiling_told  # noqa: PLC0415
    from tripod_bringup.up_command import sim_companion, sim_words  # noqa: PLC0415

    name_new_form("tripod sim", values or [])
    try:
        names = [parameter.name for parameter in parameter_table("sim")] if set_ else []
        parameters, fields = split_settings(set_ or [], "sim", names)
        words = sim_words([*(values or []), *parameters], fields, wished(accuracy, budget), study)
        beside = sim_companion(words, servo, slide, actuate or ())
    except ValueError as error:
        print(f"tripod sim: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    with compiling_told("tripod sim"):
        raise typer.Exit(run_node_command("sim", words, subnet=subnet, ros=context.obj, beside=beside))
