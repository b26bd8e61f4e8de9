"""Options and help of `tripod bag`: what can be done with recordings."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup.colour_option import Colour
from tripod_bringup.long_work import loading
from tripod_bringup.node_command import NODES, NodeCommand, RosCommand, run_node_command
from tripod_bringup.options import NodeSettings, OldSettings, Recording, Subnet, To, examples, within

commands = typer.Typer()
bag = typer.Typer(help="Inspect, play and convert recordings.", no_args_is_help=True)

Topics = Annotated[
    list[str] | None, typer.Option(help="Names or patterns (*, ?), parted by spaces or commas; repeatable.")
]


Number = Annotated[
    int | None,
    typer.Option(
        "--segment",
        help="Only this part between restarts; `tripod bag info` lists them.",
        callback=within(1, such_as="1"),
    ),
]


@bag.command(
    epilog=examples(
        "tripod bag info last",
        "tripod bag info last --check --json",
    )
)
def info(
    file: Recording,
    *,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    check: Annotated[
        bool,
        typer.Option("--check", help="Read every message, believe no summary; 1 if anything is missing."),
    ] = False,
) -> None:
    """Tell what a recording holds: topics, types, counts, rates, time span."""
    with loading("tripod bag info"):
        from tripod_record.info import info_command  # noqa: PLC0415

    def reading() -> AbstractContextManager[None]:
        return loading("tripod bag info", f"reading {file.name}")

    raise typer.Exit(info_command(file, as_json=json, check=check, reading=reading))


@bag.command(
    cls=RosCommand,
    epilog=examples(
        "tripod bag play last",
        "tripod bag play last --to sim --rate inf",
        "tripod bag play last --to sim --segment 2",
        "tripod bag play last --to robot --start 2.5 --rate 0.5",
        "tripod bag play last --topics 'sim/* /tf'",
    ),
)
def play(
    context: typer.Context,
    file: Recording,
    *,
    to: Annotated[
        To,
        typer.Option(
            help="topics: publish what was recorded; sim: simulate it again, bit for bit; robot: follow its motion."
        ),
    ] = To.TOPICS,
    rate: Annotated[float, typer.Option(help="Recorded time over time; of sim also inf.")] = 1.0,
    start: Annotated[float, typer.Option(help="Where to begin \\[s].")] = 0.0,
    segment: Number = None,
    topics: Topics = None,
    subnet: Subnet = False,
) -> None:
    """Play a recording. In a terminal: space pauses, `.` steps, q ends.

    What commands (joint_trajectory, control_mode, target_pose, sim/request) is published only where --topics names it.
    """
    from tripod_bringup.bag_play import play_command  # noqa: PLC0415

    raise typer.Exit(
        play_command(
            file,
            to=to,
            rate=rate,
            start=start,
            topics=" ".join(topics or ()),
            segment=segment,
            subnet=subnet,
            ros=context.obj,
        )
    )


@bag.command(
    epilog=examples(
        "tripod bag export last angles.csv",
        "tripod bag export last all.npz --topics '/*'",
        "tripod bag export last table.parquet",
    )
)
def export(
    file: Recording,
    out: Annotated[
        Path | None, typer.Argument(help="A .csv, .npz or .parquet file; without: NAME.csv here.")
    ] = None,
    *,
    topics: Topics = None,
    segment: Number = None,
) -> None:
    """Write the numbers of a recording: joints, poses and statuses, or --topics, over time in s, SI units.

    csv and parquet: one table, at the times of all messages, with the newest value then. npz: each topic at its own
    times.
    """
    with loading("tripod bag export"):
        from tripod_bringup.bag_export import export_command  # noqa: PLC0415

    raise typer.Exit(export_command(file, out, " ".join(topics or ()), segment))


@bag.command(epilog=examples("tripod bag plot last curves.png"))
def plot(
    file: Recording,
    out: Annotated[
        Path | None, typer.Argument(help="A .png, .svg or .pdf file; without: NAME.png here.")
    ] = None,
    *,
    segment: Number = None,
) -> None:
    """Draw angles, effector, ball and errors of a recording."""
    with loading("tripod bag plot"):
        from tripod_bringup.bag_export import plot_command  # noqa: PLC0415

    raise typer.Exit(plot_command(file, out, segment))


@bag.command(epilog=examples("tripod bag html last session.html"))
def html(
    file: Recording,
    out: Annotated[
        Path | None, typer.Argument(help="The .html file to write; without: NAME.html here.")
    ] = None,
    *,
    topics: Topics = None,
    segment: Number = None,
    colour: Colour = None,
    forces: Annotated[
        bool, typer.Option("--forces", help="Show the forces on the bodies as arrows.")
    ] = False,
) -> None:
    """Write a page that plays the recorded simulation in 3-D, without a network: it is simulated again for it."""
    with loading("tripod bag html"):
        from tripod_bringup.bag_export import html_command  # noqa: PLC0415

    raise typer.Exit(html_command(file, out, " ".join(topics or ()), segment, colour=colour, forces=forces))


@commands.command(cls=NodeCommand, help=NODES["record"].help, epilog=examples(*NODES["record"].examples))
def record(
    context: typer.Context,
    values: OldSettings = None,
    *,
    set_: NodeSettings = None,
    topics: Topics = None,
    all_: Annotated[
        bool, typer.Option("--all", "-a", help="Record all there is, of every namespace, derived topics too.")
    ] = False,
    subnet: Subnet = False,
) -> None:
    """Run the recorder; the help is that of the node."""
    words = list(values or [])
    if all_ and topics:
        raise typer.BadParameter("--all and --topics exclude each other")
    if all_:
        words += ["topics:=/*", "exclude:=", "derived:=true"]
    elif topics:
        words.append(f"topics:={' '.join(topics)}")
    raise typer.Exit(run_node_command("record", words, set_ or [], subnet=subnet, ros=context.obj))
