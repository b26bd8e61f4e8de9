"""docs/robot.md tells what the code does: its example, its figures, its messages."""

import re
from pathlib import Path

import pytest

from tests.messages import line_naming
from tripod_driver import framed_session
from tripod_driver.calibration import Calibration, PressureCalibration, WinchCalibration
from tripod_driver.calibration_file import parse_calibration
from tripod_driver.calibrator import SPEED
from tripod_graph.cdr import MOST_POINTS
from tripod_graph.command import LATE
from tripod_graph.mode import LEASE

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "robot.md").read_text()
SOURCES = "".join(
    path.read_text()
    for part in ("tripod_driver", "tripod_graph")
    for path in sorted((ROOT / part).rglob("*.py"))
)
MESSAGES = re.findall(r"^\| `(.*?)` \| (?!`)", PAGE.partition("## What it says")[2], re.MULTILINE)


def test_the_example_is_the_calibration_of_a_servo_as_the_workshop_mounts_it() -> None:
    example, channels = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    wanted = {"left": WinchCalibration(), "right": WinchCalibration(), "air": PressureCalibration()}
    assert parse_calibration(channels) == Calibration((), wanted)
    for found, default in zip(parse_calibration(example).servos, Calibration().servos, strict=True):
        assert (found.direction, found.pulse_range) == (default.direction, default.pulse_range)
        assert (found.offset, *found.safe_range) == pytest.approx(
            (default.offset, *default.safe_range), abs=1e-6
        )


@pytest.mark.parametrize("message", MESSAGES)
def test_each_message_is_one_that_the_driver_says(message: str) -> None:
    for part in message.split("..."):
        assert part.strip() in SOURCES


def test_there_are_messages() -> None:
    assert len(MESSAGES) > 15


def test_the_figures_are_those_of_the_code() -> None:
    pytest.importorskip("rclpy")
    from tripod_driver.settings import PARAMETERS

    values = {parameter.name: parameter.default for parameter in PARAMETERS}
    for facts in (
        (f"{values['angle_speed']:g} rad/s", "`angle_speed`"),
        (f"{values['rate']:g} a second", f"{values['keep_alive']:g} s", "`rate`", "`keep_alive`"),
        (f"{values['timeout']:g} s", f"{values['park_after']:g} s", "`timeout`", "`park_after`"),
        ("lease", f"{LEASE:g} s", f"{values['park_after']:g} s", "`park_after`"),
        (f"{MOST_POINTS:,} points", f"{LATE:g} s"),
        (f"{values['park_time_max']:g} s", "`park_time_max`"),
        ("board silent", f"{framed_session.SILENCE:g} s", f"{values['retry_min']:g} s", "`retry_min`"),
        (f"{values['retry_max']:g} s", "`retry_max`"),
        (f"{SPEED:g} rad/s", "Up", "Down"),
    ):
        line_naming(PAGE, *facts)
