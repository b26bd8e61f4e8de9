"""Options and help of `tripod run` and `tripod show`."""

from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup.accuracy_option import Accuracy, Budget, Study
from tripod_bringup.colour_option import Colour
from tripod_bringup.options import (
    ActuatorScripts,
    Json,
    Overrides,
    Quiet,
    SceneArgument,
    ServoScript,
    SlideScript,
    ViewPort,
    examples,
    within,
)
from tripod_bringup.pictures import Gif, Html, Mp4, Pictures, Plot

commands = typer.Typer()


@commands.command(
    epilog=examples(
        "tripod run tripod",
        "tripod run pendulum --view",
        "tripod run tripod --verbose",
        "tripod run tripod --json",
        'tripod run tripod --duration 2 --servo "0:0,0,0; 1:-0.7854,-0.7854,-0.7854"',
        'tripod run tripod --servo "0:0,0,0; 2:-1.4965,-1.4965,-1.4965" --slide "0:0; 2:0.035" --out run.npz',
        "tripod run cloth --html cloth.html --plot cloth.png",
        "tripod run tripod --html run.html --colour von_mises",
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
            help="Simulated time \\[s]; by default until 1 s after the last servo time, else the scene's own.",
            callback=within(0, unit="s", such_as="2", above=True),
        ),
    ] = None,
    servo: ServoScript = None,
    slide: SlideScript = None,
    actuate: ActuatorScripts = None,
    set_: Overrides = None,
    view: Annotated[bool, typer.Option("--view", help="Show it on a page, while it runs and after.")] = False,
    view_port: ViewPort = None,
    html: Html = None,
    plot: Plot = None,
    gif: Gif = None,
    mp4: Mp4 = None,
    colour: Colour = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.npz", help="Write every step as arrays, for NumPy and `tripod show`."),
    ] = None,
    forces: Annotated[
        bool, typer.Option("--forces", help="Record and show the forces on the bodies as arrows.")
    ] = False,
    accuracy: Accuracy = None,
    budget: Budget = None,
    study: Study = None,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print everything about the run.")] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Simulate a scene; --view shows it in the browser.

    Exit codes: 0 done, 1 the motion broke off or grew without bounds, 2 bad input.
    """
    from tripod_bringup.run_command import run_scene  # noqa: PLC0415

    raise typer.Exit(
        run_scene(
            scene,
            duration=duration,
            servo=servo,
            slide=slide,
            actuate=actuate or (),
            overrides=set_ or [],
            out=out,
            forces=forces,
            pictures=Pictures(html=html, plot=plot, gif=gif, mp4=mp4),
            view=view,
            colour=colour,
            view_port=view_port,
            accuracy=accuracy,
            budget=budget,
            study=study,
            verbose=verbose,
            as_json=json,
            quiet=quiet,
        )
    )


@commands.command(
    epilog=examples("tripod show run.npz", "tripod show run.npz --html run.html --plot run.png --gif run.gif")
)
def show(
    file: Annotated[Path, typer.Argument(metavar="FILE.npz", help="Run that `tripod run --out` saved.")],
    *,
    html: Html = None,
    plot: Plot = None,
    gif: Gif = None,
    mp4: Mp4 = None,
    colour: Colour = None,
    view_port: ViewPort = None,
) -> None:
    """Show a saved run in the browser, or write it as a film."""
    from tripod_bringup.show_command import show_command  # noqa: PLC0415

    raise typer.Exit(show_command(file, Pictures(html=html, plot=plot, gif=gif, mp4=mp4), view_port, colour))
