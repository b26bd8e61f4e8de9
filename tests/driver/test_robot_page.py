"""docs/robot.md tells what the code does: its example, its figures, its messages."""

import math
import re
from pathlib import Path

import pytest

from tripod_driver import framed_session
from tripod_driver.calibration import Calibration
from tripod_driver.calibration_file import parse_calibration
from tripod_driver.calibrator import SPEED
from tripod_graph.cdr import MOST_POINTS
from tripod_graph.command import LATE, CommandError, CommandFollower, CommandLimits
from tripod_graph.mode import LEASE
from tripod_graph.names import SERVOS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "robot.md").read_text()
SOURCES = "".join(
    path.read_text()
    for part in ("tripod_driver", "tripod_graph")
    for path in sorted((ROOT / part).rglob("*.py"))
)
MESSAGES = re.findall(r"^\| `(.*?)` \| (?!`)", PAGE, re.MULTILINE)
REFUSED = {
    "unknown joint": (["elbow", *SERVOS], [0.0], [[0.0] * 4]),
    "is missing": (SERVOS[:2], [0.0], [[0.0] * 2]),
    "named twice": ([*SERVOS, "servo_1"], [0.0], [[0.0] * 4]),
    "time of point": (SERVOS, [1.0, 0.5], [[0.0] * 3] * 2),
    "is nan": (SERVOS, [0.0], [[math.nan, 0.0, 0.0]]),
}
"""Commands that are refused, by a part of the reason."""


def test_the_example_is_the_calibration_of_a_servo_as_the_workshop_mounts_it() -> None:
    [example] = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
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


@pytest.mark.parametrize("part", REFUSED)
def test_refused_commands_are_told_as_the_page_says(part: str) -> None:
    with pytest.raises(CommandError, match=part) as refused:
        CommandFollower(CommandLimits()).check(*REFUSED[part])
    assert f"| `{refused.value}` |" in PAGE


def test_the_figures_are_those_of_the_code() -> None:
    pytest.importorskip("rclpy")
    from tripod_driver.settings import PARAMETERS

    values = {parameter.name: parameter.default for parameter in PARAMETERS}
    for text in (
        f"{values['angle_speed']:g} rad/s at the output",
        f"at most {values['rate']:g} a second; an unchanged one again after {values['keep_alive']:g} s",
        f"commands silent for {values['timeout']:g} s after their last point | hold; after {values['park_after']:g} s",
        f"not heard for its lease, {LEASE:g} s | hold, also in a long trajectory",
        f"at most {MOST_POINTS:,} points, refused unread; one that should have begun {LATE:g} s ago is refused",
        f"park within {values['park_time_max']:g} s",
        f"board silent for {framed_session.SILENCE:g} s | disconnect; try again after {values['retry_min']:g} s",
        f"up to {values['retry_max']:g} s",
        f"{SPEED:g} rad/s while Up or Down",
    ):
        assert text in PAGE
