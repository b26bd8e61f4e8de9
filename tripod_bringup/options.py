"""Options that several subcommands of `tripod` have, and how their examples are shown."""

from typing import Annotated

import typer


def some_scenes(incomplete: str) -> list[str]:
    """Return the scenes that begin so: for the completion of shells."""
    from tripod_sim.scene_file import scene_names  # noqa: PLC0415 - only while a line is completed

    return [name for name in scene_names() if name.startswith(incomplete)]


def some_fields(incomplete: str) -> list[str]:
    """Return the fields of scenes that begin so, `table.field=`."""
    from tripod_sim.scene_file import field_names  # noqa: PLC0415

    return [f"{name}=" for name in field_names() if name.startswith(incomplete)]


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
        help="Set a field of the scene; repeatable.",
        autocompletion=some_fields,
    ),
]

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")]

Subnet = Annotated[bool, typer.Option("--subnet", help="Let ROS discovery leave this machine.")]


def examples(*lines: str) -> str:
    """Return the epilogue of a help page: one example a line."""
    return "Examples:\n" + "\n".join(f"[dim]$[/] {line}" for line in lines)
