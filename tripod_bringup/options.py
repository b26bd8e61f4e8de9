"""Options that several subcommands of `tripod` have, and how their examples are shown."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

MOCK = "mock"
"""The port of `tripod up` unless it is told another: no board is needed."""


class To(StrEnum):
    """Where a recording is played to."""

    SIM = "sim"
    ROBOT = "robot"
    TOPICS = "topics"


def some_scenes(incomplete: str) -> list[str]:
    """Return the scenes that begin so: for the completion of shells."""
    from tripod_sim.scene_file import scene_names  # noqa: PLC0415 - only while a line is completed

    return [name for name in scene_names() if name.startswith(incomplete)]


def some_fields(incomplete: str) -> list[str]:
    """Return the fields of scenes that begin so, `table.field=`."""
    from tripod_sim.scene_file import field_names  # noqa: PLC0415

    return [f"{name}=" for name in field_names() if name.startswith(incomplete)]


def some_ports(incomplete: str) -> list[str]:
    """Return the serial ports of this machine that begin so, and what else a port may be."""
    from tripod_driver.ports.boards import serial_ports  # noqa: PLC0415

    return [
        name for name in ("auto", MOCK, *(p.device for p in serial_ports())) if name.startswith(incomplete)
    ]


def some_recordings(incomplete: str) -> list[str]:
    """Return the recordings here and in ./recordings that begin so."""
    places = (Path(), Path("recordings"))
    found = [path for place in places for path in sorted(place.glob("*")) if is_recording(path)]
    return [str(path) for path in found if str(path).startswith(incomplete)]


def metres(text: str | float) -> float:
    """Return a length [m] that may say its unit, as 35mm. Raises typer.BadParameter."""
    from tripod_sim.tables.fields import units_of, with_unit  # noqa: PLC0415 - not needed for the help

    if not isinstance(text, str):  # the default
        return text
    try:
        return with_unit(text, "m")
    except ValueError:
        raise typer.BadParameter(f"{text!r} is no length in {' or '.join(units_of('m'))}") from None


def is_recording(path: Path) -> bool:
    """Whether `path` looks like a recording: a file, or the directory of one."""
    return path.suffix == ".mcap" or (path / "metadata.yaml").is_file()


SceneName = Annotated[
    str, typer.Option(help="Name of a scene, or path of a scene file.", autocompletion=some_scenes)
]

SceneArgument = Annotated[
    str, typer.Argument(help="Name of a scene, or path of a scene file.", autocompletion=some_scenes)
]

Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help="Set a field of the scene, in SI or as 100kPa; repeatable.",
        autocompletion=some_fields,
    ),
]

ServoScript = Annotated[
    str | None, typer.Option(help='Servo angles \\[rad], or as -85deg: "time:a,b,c; time:a,b,c".')
]

SlideScript = Annotated[
    str | None, typer.Option(help='Inward slide \\[m], or as 35mm: a number, or "time:value; ...".')
]

Recording = Annotated[
    Path,
    typer.Argument(help="An .mcap file, or the directory of a recording.", autocompletion=some_recordings),
]

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")]

Report = Annotated[Path | None, typer.Option(metavar="FILE.html", help="Write a report with pictures.")]

Subnet = Annotated[bool, typer.Option("--subnet", help="Let ROS discovery leave this machine.")]


def examples(*lines: str) -> str:
    """Return the epilogue of a help page: one example a line."""
    return "Examples:\n" + "\n".join(f"[dim]$[/] {line}" for line in lines)
