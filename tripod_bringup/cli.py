"""The `tripod` command: its subcommands; what they do is imported when they run."""

from typing import Annotated

import typer

from tripod_bringup import (
    bag_cli,
    explain_command,
    identify_cli,
    ik_cli,
    mesh_command,
    play_cli,
    print_cli,
    robot_cli,
    run_cli,
    study_cli,
    up_cli,
)
from tripod_bringup.command_groups import CommandGroups
from tripod_bringup.options import examples
from tripod_host.program import program

app = typer.Typer(
    name="tripod",
    cls=CommandGroups,
    help="Simulate, drive and record the Tripod soft robot.",
    epilog=examples("tripod doctor", "tripod run tripod --view", "tripod up --demo"),
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415

        try:
            print(f"tripod {version('tripod')}")
        except PackageNotFoundError:
            print("tripod (not installed)")
        raise typer.Exit


@app.callback()
def root(
    *,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Simulate, drive and record the Tripod soft robot."""


for _part in (
    bag_cli,
    explain_command,
    identify_cli,
    ik_cli,
    mesh_command,
    play_cli,
    robot_cli,
    run_cli,
    study_cli,
    up_cli,
):
    app.add_typer(_part.commands)
app.add_typer(bag_cli.bag, name="bag")
app.add_typer(print_cli.commands, name="print")


def main() -> None:
    """Run the command line; ends by SystemExit with the exit code."""
    with program("tripod"):
        app(prog_name="tripod")


if __name__ == "__main__":
    main()
