"""Options that several subcommands of `tripod` have, and how their examples are shown."""

import math
from collections.abc import Callable, Iterable
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

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
    from tripod_sim.scene.file import scene_names  # noqa: PLC0415 - only while a line is completed

    return [name for name in scene_names() if name.startswith(incomplete)]


def some_fields(incomplete: str) -> list[str]:
    """Return the fields of scenes that begin so, `table.field=`."""
    from tripod_sim.scene.file import field_names  # noqa: PLC0415

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


def within(
    low: float, high: float = math.inf, *, unit: str = "", such_as: str, above: bool = False
) -> Callable[[Any], Any]:
    """Return the check of an option whose value has bounds: it returns the value, or raises typer.BadParameter.

    Args:
        low: Smallest value.
        high: Largest value; infinity: any finite one.
        unit: Of the bounds; empty: none.
        such_as: A value to try, as it is typed.
        above: Whether `low` itself is not allowed.
    """
    of = f" {unit}" if unit else ""
    if math.isinf(high):
        allowed = f"{'above' if above else 'at least'} {low:.10g}{of} and finite"
    else:
        allowed = f"above {low:.10g}, up to {high:.10g}{of}" if above else f"{low:.10g} to {high:.10g}{of}"

    def check(value: Any) -> Any:
        if value is None:
            return value
        if not low <= value <= high or (above and value == low) or math.isinf(value):
            raise typer.BadParameter(
                f"{value:.10g}{of} is out of range; allowed is {allowed}, such as {such_as}"
            )
        return value

    return check


def given_options(context: typer.Context, names: Iterable[str]) -> list[str]:
    """Return those of the options with the parameter names `names` that the command line gives, as they are typed."""
    wanted = set(names)
    return [
        parameter.opts[0]
        for parameter in context.command.params
        if parameter.name in wanted
        and (source := context.get_parameter_source(str(parameter.name)))
        and source.name == "COMMANDLINE"
    ]


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
        metavar="NAME=VALUE",
        help="Set a field of the scene, in SI units or as 100kPa; repeatable.",
        autocompletion=some_fields,
    ),
]

NodeSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Set a parameter of the node, see the table below; repeatable."
    ),
]

SceneNodeSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Set a parameter of the node, see the table below, or a field of the scene; repeatable.",
        autocompletion=some_fields,
    ),
]

SceneWords = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[SCENE]",
        help="Name of a scene, or path of a scene file; tripod by default.",
        autocompletion=some_scenes,
    ),
]
"""The scene, then parameters of a node as they were set before `--set`."""

OldSettings = Annotated[list[str] | None, typer.Argument(metavar="NAME:=VALUE", hidden=True)]
"""Parameters of a node as they were set before `--set`."""

ViewPort = Annotated[
    int | None,
    typer.Option(
        help="Port of the page on this machine; by default a free one.",
        callback=within(1, 65535, such_as="8080"),
    ),
]

ServoScript = Annotated[
    str | None, typer.Option(help='Servo angles \\[rad], or as -85deg: "time:a,b,c; time:a,b,c".')
]

SlideScript = Annotated[
    str | None, typer.Option(help='Inward slide \\[m], or as 35mm: a number, or "time:value; ...".')
]

ActuatorScripts = Annotated[
    list[str] | None,
    typer.Option(
        "--actuate",
        metavar="NAME=SCRIPT",
        help='Another actuator over time: "tendon=0:0; 1:0.01". Once for each.',
    ),
]

LAST = "last"
"""Word for the newest recording."""


def recording(text: str | Path) -> Path:
    """Return the path of a recording; `LAST` is the newest one in ./recordings. Raises typer.BadParameter."""
    path = Path(text)
    if str(text) != LAST or path.exists():
        return path
    found = [one for one in Path("recordings").glob("*") if is_recording(one)]
    if not found:
        raise typer.BadParameter("no recording in ./recordings; make one: tripod up --record recordings")
    return max(found, key=lambda one: one.stat().st_mtime)


Recording = Annotated[
    Path,
    typer.Argument(
        metavar="RECORDING",
        help="An .mcap file, the directory of a recording, or last: the newest in ./recordings.",
        parser=recording,
        autocompletion=some_recordings,
    ),
]

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")]

Report = Annotated[Path | None, typer.Option(metavar="FILE.html", help="Write a report with pictures.")]

Subnet = Annotated[bool, typer.Option("--subnet", help="Let ROS discovery leave this machine.")]


def examples(*lines: str) -> str:
    """Return the epilogue of a help page: one example a line."""
    return "Examples:\n" + "\n".join(f"[dim]$[/] {line}" for line in lines)
