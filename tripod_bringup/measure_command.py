"""`tripod calibrate --identify`: measures poses of the robot, and finds its calibration and its scene from them."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tripod_bringup.calibrate_command import (
    BAD_ARGUMENTS,
    FAILED,
    INTERRUPTED,
    calibrate,
    servo_calibration,
)
from tripod_bringup.compiling import compiling_told
from tripod_bringup.identify_command import identified, tell_found
from tripod_bringup.measuring import HeightSensor, ImuSensor, MarkerSensor, MeasureSession, Sensor, reach
from tripod_bringup.pose_file import PoseFile
from tripod_bringup.run_command import progress_bar
from tripod_driver.calibration import Calibration, CalibrationError
from tripod_driver.calibration_file import calibration_text
from tripod_driver.choose_session import choose_sessions
from tripod_driver.ports.choose import choose_port
from tripod_driver.protocol import AngleMapping
from tripod_graph.names import servo_names
from tripod_host.stop import taken
from tripod_host.writing import check_place, replaced_text
from tripod_identify.errors import DataError, FitError
from tripod_teleop.terminal import Terminal, TerminalError

if TYPE_CHECKING:
    from tripod_identify.identify import Identified
    from tripod_sim.scene import Scene

FARTHEST: Final = 0.35
"""A zero beyond it [rad] is no horn that is a tooth off, and is not written."""


def measure_command(
    sensor: str,
    port: str,
    file: Path,
    *,
    protocol: str,
    baud: int,
    boot_time: float,
    scene: str,
    overrides: list[str],
    slide: float | None,
    poses: int,
    data: Path | None,
    out: Path | None,
    report: Path | None,
    camera: str,
    side: float,
    lens: Path | None,
) -> int:
    """Measure in this terminal, identify and write; return the exit code."""
    from tripod_identify.pictures import check_matplotlib  # noqa: PLC0415 - not needed for the help
    from tripod_identify.safe_poses import LOOKS, allowed, telling_poses  # noqa: PLC0415
    from tripod_sim.errors import SceneError, StepError  # noqa: PLC0415
    from tripod_sim.scene.file import load_scene  # noqa: PLC0415

    try:
        if sensor not in LOOKS:
            raise DataError(f"--identify is {sensor!r}; allowed: {', '.join(LOOKS)}")
        known = servo_calibration(file)
        data = data or file.with_name(f"{file.stem}_poses.csv")
        out = out or file.with_name(f"{file.stem}_scene.toml")
        if report is not None:
            check_matplotlib()
        for result in (file, out, report):
            if result is not None:
                check_place(result)
        description = load_scene(scene, [*overrides, *([] if slide is None else [f"servos.slide={slide!r}"])])
        sessions = choose_sessions(protocol, AngleMapping.ROUNDED, known)
        lower, upper = reach(sessions, known)
        look = _sensor(sensor, camera, side, lens)
        if not data.exists():  # nothing is measured yet: told before poses are chosen, which takes seconds
            allowed(description, lower.tolist(), upper.tolist(), poses)
            Terminal(program="it")
        shown = sys.stderr.isatty()
        with progress_bar(shown=shown) as bar, compiling_told("tripod calibrate", bar.say if bar else None):
            tour = telling_poses(description, LOOKS[sensor], lower.tolist(), upper.tolist(), poses, bar)
        kept = PoseFile(data, tour, LOOKS[sensor].columns, _made(description, known))
        left = [k for k in range(len(tour)) if k not in kept.done]
        if left:
            place = choose_port(port, baud=baud or sessions[0].baud, boot_time=boot_time, write_timeout=0.05)
            terminal = Terminal(program="it")
            with terminal, taken() as asked:
                terminal.enter()
                session = MeasureSession(
                    place, sessions, known, tour[left], look, lambda k, found: kept.keep(left[k], found), terminal
                )  # fmt: skip
                code = calibrate(session, stopped=lambda: asked.count)
            if session.left or code:
                print(
                    f"tripod calibrate: {len(kept.done)} of {len(tour)} poses are in {data}; the same command "
                    "continues"
                )
                return code or (INTERRUPTED if asked.count else 0)
        return evaluate(description, kept.path, sensor, known, file=file, out=out, report=report)
    except (CalibrationError, DataError, SceneError, TerminalError, ValueError) as error:
        return _complain(str(error), BAD_ARGUMENTS)
    except OSError as error:
        return _complain(f"{error.filename or ''}: {error.strerror or error}".lstrip(": "), BAD_ARGUMENTS)
    except (FitError, StepError) as error:
        return _complain(str(error), FAILED)


def evaluate(
    scene: "Scene", data: Path, sensor: str, known: Calibration, *, file: Path, out: Path, report: Path | None
) -> int:
    """Identify from measured poses, and write calibration, scene and report; return the exit code.

    Raises DataError, FitError, SceneError, StepError, CalibrationError, OSError.
    """
    from tripod_identify.fit import Prior  # noqa: PLC0415 - not needed for the help
    from tripod_identify.identify import Wanted  # noqa: PLC0415
    from tripod_identify.identify_report import identify_report, scene_text  # noqa: PLC0415
    from tripod_identify.measured import read_csv  # noqa: PLC0415
    from tripod_identify.observe import sources_of  # noqa: PLC0415
    from tripod_identify.safe_poses import LOOKS, RULER  # noqa: PLC0415

    measured = read_csv(data, scene, sources_of(scene, ()), {})
    look = LOOKS[sensor]
    assert scene.servos
    priors = {"servos.slide": Prior(scene.servos.slide, RULER)}
    wanted = Wanted(look.names, look.align, priors, propose=False)
    result = identified(scene, measured, (), wanted, program="tripod calibrate", quiet=False)
    tell_found(result, calibrated=True)
    for note in result.notes:
        print(f"tripod calibrate: note: {note}", file=sys.stderr)
    command = shlex.join(["tripod", *sys.argv[1:]])
    if report is not None:
        with replaced_text(report) as page:
            page.write(identify_report(f"{scene.name} from {data.name}", command, measured, result))
    calibration = known.turned(zeros_of(result))
    with replaced_text(out) as text:
        text.write(scene_text(result, command, calibrated=True))
    with replaced_text(file) as text:
        text.write(calibration_text(calibration))
    for name, old, new in zip(servo_names(len(known.servos)), known.servos, calibration.servos, strict=True):
        print(f"{name}: offset {old.offset:.4f} before, {new.offset:.4f} rad now")
    print(f"written: {file}, {out}{f', {report}' if report else ''}")
    print(f"use them: tripod up {out} --port auto --set driver.calibration={file}")
    return 0


def zeros_of(result: "Identified") -> list[float]:
    """Return by how much each arm stands beyond the command [rad], 0 where the data do not tell.

    Raises FitError where they must not be believed.
    """
    if not result.left.explained:
        raise FitError(
            "the model does not explain these poses, so the calibration was not changed; were servos "
            "exchanged, or are the slide or signs wrong?"
        )
    found = {f.parameter.name: f.true for f in result.found}
    names = [f"servos.zero.{i}" for i in range(len(result.told.zero))]
    if not set(names) & set(found):
        raise FitError(
            "these poses do not determine the zero of any servo, so the calibration was not changed. Are "
            "their units and signs right? Else measure more poses (--poses), or more accurately"
        )
    zeros = [found.get(name, 0.0) for name in names]
    for i, zero in enumerate(zeros):
        if abs(zero) > FARTHEST:
            raise FitError(
                f"the zero of servo_{i} would be off by {zero:+.2f} rad, more than {FARTHEST} rad, so the "
                "calibration was not changed; first mark flat by hand: tripod calibrate"
            )
    return zeros


def _made(scene: "Scene", known: Calibration) -> str:
    """Return what the measured poses are of, one line."""
    assert scene.servos
    servos = ", ".join(f"{servo.offset:.6f} {servo.direction:+d}" for servo in known.servos)
    return (
        f"scene {scene.name}, slide {scene.servos.slide:.6f} m, servos' offsets [rad] and directions {servos}"
    )


def _sensor(sensor: str, camera: str, side: float, lens: Path | None) -> Sensor:
    """Return what measures. Raises DataError where it cannot."""
    if sensor == "heights":
        return HeightSensor()
    if sensor == "imu":
        return ImuSensor()
    if lens is None:
        raise DataError(
            "--identify marker needs --lens FILE, as `ros2 run camera_calibration cameracalibrator` writes it"
        )
    from tripod_identify.lens import read_lens  # noqa: PLC0415 - only with a camera

    found = read_lens(lens)
    try:
        from tripod_bringup.camera import camera_images  # noqa: PLC0415
        from tripod_identify.marker import MarkerFinder  # noqa: PLC0415
    except ImportError:
        raise DataError("--identify marker needs OpenCV; to install: pip install 'tripod[camera]'") from None
    return MarkerSensor(MarkerFinder(found, side), camera_images(camera, found.size))


def _complain(said: str, code: int) -> int:
    print("tripod calibrate: " + " ".join(said.split()), file=sys.stderr)
    return code
