"""Options and help of what looks after the robot: `doctor`, `calibrate`, `flash`."""

from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup.options import Overrides, Report, SceneName, examples, metres, some_ports, within

commands = typer.Typer()


@commands.command(
    epilog=examples(
        "tripod doctor", "tripod doctor --ask", "tripod doctor --json", "tripod doctor --record my_recordings"
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
    """Check this machine and say what to fix.

    Exit codes: 0 ready, 1 something must be fixed.
    """
    from tripod_bringup.doctor_command import doctor_command  # noqa: PLC0415

    raise typer.Exit(doctor_command(record, as_json=json, ask=ask))


@commands.command(
    epilog=examples(
        "tripod calibrate",
        "tripod calibrate robot.yaml --port /dev/ttyACM0",
        "tripod calibrate --protocol legacy",
        "tripod calibrate cross.yaml --servos 4",
        "tripod calibrate robot.yaml --identify heights --slide 23mm",
        "tripod calibrate robot.yaml --identify marker --camera 0 --marker 20mm",
    )
)
def calibrate(
    file: Annotated[
        Path, typer.Argument(help="Calibration to write; where it exists, it is where to begin.")
    ] = Path("calibration.yaml"),
    *,
    port: Annotated[
        str, typer.Option(help="Where the servos are, as for `tripod driver`.", autocompletion=some_ports)
    ] = "auto",
    protocol: Annotated[
        str, typer.Option(help="framed, legacy or ascii, as for `tripod driver`.")
    ] = "framed",
    baud: Annotated[
        int,
        typer.Option(
            help="Bits a second; 0: as the protocol has it.", callback=within(0, 4_000_000, such_as="115200")
        ),
    ] = 0,
    boot_time: Annotated[
        float,
        typer.Option(
            help="Time that the board needs after its port was opened \\[s].",
            callback=within(0, 30, unit="s", such_as="2"),
        ),
    ] = 2.0,
    servos: Annotated[
        int | None,
        typer.Option(
            help="Number of servos of the robot; by default that of the file, else three.",
            callback=within(1, 6, such_as="4"),
        ),
    ] = None,
    identify: Annotated[
        str | None,
        typer.Option(
            metavar="SENSOR",
            help="Go slowly to safe poses and measure each: heights that you type, imu, or marker (a camera that sees "
            "an ArUco marker, 4x4_50 number 0, on the disc); then find zeros, slide and modulus.",
        ),
    ] = None,
    scene: SceneName = "tripod",
    set_: Overrides = None,
    slide: Annotated[
        float | None,
        typer.Option(
            parser=metres,
            metavar="LENGTH",
            help="Where the slides stand \\[m], or as 23mm; by default the scene's.",
            callback=within(0, 0.1, unit="m", such_as="23mm"),
        ),
    ] = None,
    poses: Annotated[
        int, typer.Option(help="Number of poses to measure.", callback=within(1, 1000, such_as="20"))
    ] = 20,
    data: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", help="What is measured; gone on with. By default FILE_poses.csv."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Scene to write; by default FILE_scene.toml.")
    ] = None,
    report: Report = None,
    camera: Annotated[str, typer.Option(help="Number of the camera, or its device.")] = "0",
    marker: Annotated[
        float,
        typer.Option(
            parser=metres,
            metavar="LENGTH",
            help="Side of the marker's black square \\[m], or as 20mm.",
            callback=within(0, 1, unit="m", such_as="20mm", above=True),
        ),
    ] = 0.02,
    lens: Annotated[
        Path | None,
        typer.Option(metavar="FILE.yaml", help="The camera's lens, as ROS's camera_calibration writes it."),
    ] = None,
) -> None:
    """Calibrate the servos, by hand or from measured poses (--identify)."""
    if identify is not None:
        from tripod_bringup.measure_command import measure_command  # noqa: PLC0415

        raise typer.Exit(
            measure_command(
                identify,
                port,
                file,
                protocol=protocol,
                baud=baud,
                boot_time=boot_time,
                scene=scene,
                overrides=set_ or [],
                slide=slide,
                poses=poses,
                data=data,
                out=out,
                report=report,
                camera=camera,
                side=marker,
                lens=lens,
            )
        )
    from tripod_bringup.calibrate_command import calibrate_command  # noqa: PLC0415

    raise typer.Exit(
        calibrate_command(port, file, protocol=protocol, baud=baud, boot_time=boot_time, servos=servos)
    )


@commands.command(
    epilog=examples("tripod flash", "tripod flash --port /dev/ttyACM0", "tripod flash --baud 57600")
)
def flash(
    file: Annotated[
        Path | None, typer.Argument(help="A .hex or .elf file; by default what `make -C firmware` makes.")
    ] = None,
    *,
    port: Annotated[
        str,
        typer.Option(
            help="Path of the device; auto: the one port with a known board.", autocompletion=some_ports
        ),
    ] = "auto",
    baud: Annotated[
        int,
        typer.Option(
            help="Bits a second of the boot loader.", callback=within(1200, 4_000_000, such_as="57600")
        ),
    ] = 115200,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the command and do nothing.")] = False,
) -> None:
    """Write the firmware to the board, with avrdude.

    Build it first with `make firmware`.
    """
    from tripod_bringup.flash import flash_command  # noqa: PLC0415

    raise typer.Exit(flash_command(port, file, baud=baud, dry_run=dry_run))
