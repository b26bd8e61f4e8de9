"""Options and help of what looks after the robot: `doctor`, `calibrate`, `flash`."""

from pathlib import Path
from typing import Annotated

import typer

from tripod_bringup.options import Overrides, Report, SceneName, examples, metres, some_ports

commands = typer.Typer()


@commands.command(
    epilog=examples(
        "tripod doctor", "tripod doctor --ask", "tripod doctor --json", "tripod doctor --record /data"
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
    """Check this machine and say what to do; exit code 1 if something must be done."""
    from tripod_bringup.doctor_command import doctor_command  # noqa: PLC0415

    raise typer.Exit(doctor_command(record, as_json=json, ask=ask))


@commands.command(
    epilog=examples(
        "tripod calibrate",
        "tripod calibrate robot.yaml --port /dev/ttyACM0",
        "tripod calibrate --protocol legacy",
        "tripod calibrate robot.yaml --identify heights --slide 23mm",
        "tripod calibrate robot.yaml --identify marker --camera 0 --lens ost.yaml --marker 20mm",
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
        int, typer.Option(min=0, max=4_000_000, help="Bits a second; 0: as the protocol has it.")
    ] = 0,
    boot_time: Annotated[
        float,
        typer.Option(min=0.0, max=30.0, help="Time that the board needs after its port was opened \\[s]."),
    ] = 2.0,
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
        ),
    ] = None,
    poses: Annotated[int, typer.Option(help="How many.")] = 20,
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
            parser=metres, metavar="LENGTH", help="Side of the marker's black square \\[m], or as 20mm."
        ),
    ] = 0.02,
    lens: Annotated[
        Path | None,
        typer.Option(metavar="FILE.yaml", help="The camera's lens, as ROS's camera_calibration writes it."),
    ] = None,
) -> None:
    """Find the calibration of the servos: by hand, keys turn one shaft at a time; or by measured poses (--identify)."""
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

    raise typer.Exit(calibrate_command(port, file, protocol=protocol, baud=baud, boot_time=boot_time))


@commands.command(
    epilog=examples(
        "make -C firmware && tripod flash", "tripod flash --port /dev/ttyACM0", "tripod flash --baud 57600"
    )
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
    baud: Annotated[int, typer.Option(min=1200, max=4_000_000, help="Speed of the boot loader.")] = 115200,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the command and do nothing.")] = False,
) -> None:
    """Write the firmware to the board, by avrdude; builds nothing."""
    from tripod_bringup.flash import flash_command  # noqa: PLC0415

    raise typer.Exit(flash_command(port, file, baud=baud, dry_run=dry_run))
