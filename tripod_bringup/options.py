"""Options that several subcommands of `tripod` have, and how their examples are shown."""

from typing import Annotated

import typer

SceneName = Annotated[str, typer.Option(help="Name of a scene, or path of a scene file.")]

SceneArgument = Annotated[str, typer.Argument(help="Name of a scene, or path of a scene file.")]

Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Set a field of the scene; repeatable."),
]

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")]

Subnet = Annotated[bool, typer.Option("--subnet", help="Let ROS discovery leave this machine.")]


def examples(*lines: str) -> str:
    """Return the epilogue of a help page: one example a line."""
    return "Examples:\n" + "\n".join(f"[dim]$[/] {line}" for line in lines)
