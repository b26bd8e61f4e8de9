"""Cables and chambers: the whole driver without ROS, a board in memory, and a clock."""

import random
from itertools import pairwise

import pytest

from tests.decisions import SOURCE, said
from tests.driver.bench import TICK, Clock
from tests.messages import assert_names, raises_naming
from tripod_driver.calibration import Calibration, PressureCalibration, ServoCalibration, WinchCalibration
from tripod_driver.calibration_file import calibration_text, parse_calibration
from tripod_driver.choose_session import choose_sessions, common_bounds
from tripod_driver.driver import Driver
from tripod_driver.framed_messages import ChannelFlags, ChannelKind
from tripod_driver.link import Link, LinkState
from tripod_driver.ports.mock import MockPort
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.protocol import AngleMapping
from tripod_driver.safety import Safety, State
from tripod_driver.settings import PARAMETERS, check, make_driver
from tripod_graph.command import CommandError, CommandLimits
from tripod_graph.joint import Joint
from tripod_graph.mode import Mode

LEFT, AIR = Joint("left", "m", 0.0, 0.03, 0.03), Joint("air", "Pa", 0.0, 20e3, 20e3)
STEP, COUNT = WinchCalibration().scale, PressureCalibration().scale
CHANNELS = {"left": WinchCalibration(), "air": PressureCalibration()}
KINDS = (ChannelKind.WINCH, ChannelKind.PRESSURE)


class Robot:
    """A driver of a cable and a chamber, and of servos, on a board in memory."""

    def __init__(self, *, servos: int = 0, homed: bool = True, board_servos: int | None = None, **channels):
        self.clock = Clock()
        count = servos if board_servos is None else board_servos
        self.board = MockBoard(self.clock, servos=count, channels=KINDS, homed=homed)
        self.winch, self.chamber = self.board.channels.all
        calibration = Calibration((ServoCalibration(),) * servos, {**CHANNELS, **channels})
        sessions = choose_sessions("framed", AngleMapping.ROUNDED, calibration)
        self.port = MockPort(self.board)
        self.link = Link(self.port, *sessions, retry_min=0.5, retry_max=2.0)
        limits = CommandLimits(count=servos, others=(LEFT, AIR), park_after=1.0)
        self.safety = Safety(limits, *common_bounds(sessions))
        self.driver = Driver(self.link, self.safety, period=0.0195)
        self.servos = servos
        self.sent: list[tuple[float, ...]] = []
        self.setpoints: list[tuple[int, ...]] = []
        self.driver.connect()
        self.safety.activate(self.clock.now)
        self.run(0.1)

    def run(self, duration: float, *goal: float) -> "Robot":
        """Let time pass; where there is a `goal`, it is commanded all the time."""
        for k in range(round(duration / TICK)):
            self.clock.now += TICK
            if goal and k % 4 == 0:
                self.goto(*goal)
            if self.driver.tick(self.clock.now):
                self.sent.append(self.driver.sent)
            self.setpoints.append(tuple(channel.setpoint for channel in self.board.channels.all))
        return self

    def mode(self, mode: Mode = Mode.TELEOP) -> "Robot":
        self.safety.control_mode(said(mode, self.clock.now), self.clock.now, self.clock.now)
        return self

    def goto(self, *goal: float, time: float = 0.05) -> str:
        *positions, pressure = goal
        names = [joint.name for joint in self.safety.joints]
        none = [0.0] * len(positions)
        return self.safety.trajectory(
            names, [time], [[*positions, 0.0]], self.clock.now, source=SOURCE, efforts=[[*none, pressure]]
        )


@pytest.fixture
def robot() -> Robot:
    return Robot().mode()


# motion -------------------------------------------------------------------------------------------------------


def test_lengths_and_pressures_reach_the_channels_at_a_limited_rate(robot: Robot) -> None:
    assert robot.link.state is LinkState.READY
    robot.run(2.0, 0.02, 10e3)
    assert robot.setpoints[-1] == (round(0.02 / STEP), round(10e3 / COUNT))
    assert robot.driver.sent == pytest.approx((0.02, 10e3), abs=0.51 * COUNT)
    assert robot.safety.state is State.ACTIVE
    for before, after in pairwise(robot.sent):
        assert abs(after[0] - before[0]) <= 0.03 * 0.02 + STEP
        assert abs(after[1] - before[1]) <= 20e3 * 0.02 + COUNT


def test_no_frame_counts_as_lost_on_a_good_line_however_late_the_computer_is() -> None:
    robot, late = Robot(), random.Random(0)
    for k in range(600):
        robot.clock.now += late.choice([0.002, 0.02, 0.05, 0.12, 0.25])
        if k > 300:
            robot.mode().goto(0.01, 5e3)
        robot.driver.tick(robot.clock.now)
    session = robot.link.session
    assert robot.link.state is LinkState.READY
    (lost,) = (count for name, count in session.diagnostics.items() if "frames lost" in name)
    assert lost == 0
    assert session.odd == ""


def test_a_robot_without_servos_is_driven_by_any_board_with_its_channels() -> None:
    robot = Robot(board_servos=2).mode().run(1.0, 0.01, 5e3)
    assert robot.setpoints[-1] == (round(0.01 / STEP), round(5e3 / COUNT))
    assert robot.board.history == []


def test_servos_and_channels_move_together() -> None:
    robot = Robot(servos=2).mode().run(2.5, -0.5, -0.2, 0.01, 5e3)
    assert robot.driver.sent == pytest.approx((-0.5, -0.2, 0.01, 5e3), abs=26.0)
    assert robot.driver.sent[:2] == pytest.approx((-0.5, -0.2), abs=2e-3)
    assert robot.link.session.angles_of_pulses(robot.board.pulses) == pytest.approx((-0.5, -0.2), abs=2e-3)
    assert robot.setpoints[-1] == (round(0.01 / STEP), round(5e3 / COUNT))


def test_calibration_places_the_zeros() -> None:
    winch, pressure = (
        WinchCalibration(radius=0.01, steps=200, zero=30),
        PressureCalibration(scale=100, zero=7),
    )
    robot = Robot(left=winch, air=pressure).mode().run(2.0, 0.02, 10e3)
    assert robot.setpoints[-1] == (30 + round(0.02 / winch.scale), 107)


def test_stop_holds_at_once_and_silence_parks(robot: Robot) -> None:
    robot.run(0.3, 0.03, 20e3).mode(Mode.STOP)
    at = robot.run(0.02).setpoints[-1]
    robot.run(0.8)
    assert robot.safety.state is State.HOLDING
    assert robot.setpoints[-1][0] > 0
    assert robot.setpoints[-1] == pytest.approx(at, abs=16)
    held = robot.setpoints[-1]
    assert robot.goto(0.03, 20e3) != ""
    robot.run(0.1)
    assert robot.setpoints[-1] == held
    robot.run(3.0)
    assert (robot.setpoints[-1], robot.safety.state) == ((0, 0), State.PARKED)


def test_a_driver_that_dies_lets_the_board_vent_and_the_next_goes_on_from_there(robot: Robot) -> None:
    robot.run(1.0, 0.01, 10e3)
    robot.clock.now += 0.7
    robot.board.write(b"")
    winch = robot.winch.setpoint
    assert (robot.chamber.setpoint, winch) == (0, round(0.01 / STEP))
    robot.setpoints.clear()
    robot.run(0.2)
    assert {pressure for _, pressure in robot.setpoints[-20:]} == {0}
    assert robot.safety.place[0] == pytest.approx(winch * STEP)
    assert robot.safety.place[1] <= 32 * COUNT
    assert_names(robot.driver.message, "watchdog", "pressures")
    robot.run(0.5, 0.01, 10e3)
    pressures = [pressure for _, pressure in robot.setpoints]
    assert pressures[-1] > 100
    assert max(b - a for a, b in pairwise(pressures)) <= 16  # of the board, in 20 ms


def test_a_slower_board_is_followed(robot: Robot, monkeypatch) -> None:
    monkeypatch.setattr("tripod_driver.ports.mock_channels.SLEW", dict.fromkeys(KINDS, 2))
    robot.run(0.5, 0.03, 20e3)
    robot.mode(Mode.STOP).run(0.04)
    at = robot.setpoints[-1]
    robot.run(0.5)
    assert robot.setpoints[-1] == pytest.approx(at, abs=10)


# homing -------------------------------------------------------------------------------------------------------


def test_nothing_moves_before_the_winch_is_homed() -> None:
    robot = Robot(homed=False).mode()
    assert robot.safety.state is State.READY
    assert not robot.safety.place_known
    assert_names(robot.driver.message, "left", "homed", "robot/home")
    assert_names(robot.goto(0.01, 5e3), "left", "homed")
    robot.run(0.5)
    assert set(robot.setpoints) == {(0, 0)}
    assert robot.sent == []


def test_homing_ends_at_the_switch_and_motion_begins_there() -> None:
    robot = Robot(homed=False).mode()
    assert robot.safety.home() == ""
    robot.run(0.4)
    assert_names(robot.driver.message, "homing left")
    assert robot.winch.flags is ChannelFlags.HOMING
    robot.run(1.0)
    assert robot.winch.flags is ChannelFlags.KNOWN
    assert (robot.driver.message, robot.safety.homing, robot.safety.place_known) == ("", False, True)
    robot.run(1.0, 0.01, 5e3)
    assert robot.setpoints[-1] == (round(0.01 / STEP), round(5e3 / COUNT))


@pytest.mark.parametrize("stop", ["mode", "service", "deactivated"])
def test_homing_ends_at_a_stop(stop: str) -> None:
    robot = Robot(homed=False).mode()
    robot.safety.home()
    robot.run(0.2)
    if stop == "mode":
        robot.mode(Mode.STOP)
    elif stop == "service":
        robot.safety.halt(robot.clock.now)
    else:
        robot.safety.deactivate()
    robot.run(0.01)
    assert robot.winch.flags is ChannelFlags(0)
    robot.run(2.0)
    assert robot.winch.flags is ChannelFlags(0)


def test_homing_needs_somebody_in_charge() -> None:
    robot = Robot(homed=False)
    assert_names(robot.safety.home(), "control mode", "STOP")
    robot.run(0.2)
    assert robot.winch.flags is ChannelFlags(0)


def test_a_switch_that_never_closes_ends_homing() -> None:
    robot = Robot(homed=False).mode()
    robot.winch.stuck = True
    robot.safety.home()
    robot.run(0.2)
    robot.winch.setpoint = 3  # near the end of the way
    robot.run(0.5)
    assert robot.winch.flags is ChannelFlags.HOME_FAILED
    assert not robot.safety.homing
    assert_names(robot.driver.message, "left", "home switch", "robot/home")
    robot.winch.stuck = False
    robot.safety.home()
    robot.run(1.5)
    assert robot.safety.place_known


def test_a_board_that_was_reset_must_be_homed_again(robot: Robot) -> None:
    robot.run(0.5, 0.02, 5e3)
    robot.winch._homed = False
    robot.board.restart()
    robot.run(0.5, 0.02, 5e3)
    assert set(robot.setpoints[-80:]) == {(0, 0)}
    assert_names(robot.driver.message, "left", "homed")


# cable and hose -----------------------------------------------------------------------------------------------


def test_a_cable_that_lost_its_tension_is_held_and_told(robot: Robot) -> None:
    robot.run(0.4, 0.03, 0.0)
    robot.winch.broken = True
    robot.goto(0.03, 0.0, time=2.0)
    robot.run(0.3)
    at = robot.winch.setpoint
    assert robot.safety.state is State.HOLDING
    assert_names(robot.driver.message, "left", "tension", "mm")
    robot.run(0.5, 0.03, 0.0)
    assert robot.winch.setpoint == at
    assert robot.driver.sent[0] == pytest.approx(at * STEP)
    robot.winch.broken = False
    robot.run(1.0, 0.005, 0.0)
    assert robot.winch.setpoint == round(0.005 / STEP)
    robot.run(1.0, 0.02, 0.0)
    assert robot.winch.setpoint == pytest.approx(0.02 / STEP, abs=1.5)


def test_a_leak_stops_the_rise_and_is_told(robot: Robot) -> None:
    robot.run(1.0, 0.0, 10e3)
    robot.chamber.broken = True
    robot.run(1.5, 0.0, 20e3)
    at = robot.chamber.setpoint
    robot.run(0.5, 0.0, 20e3)
    assert robot.chamber.setpoint == at <= 400
    assert_names(robot.driver.message, "air", "leaks", "kPa")
    assert robot.link.session.diagnostics["air measured [Pa]"] == "0"


# what does not fit --------------------------------------------------------------------------------------------


def session_of(board: MockBoard, **channels):
    calibration = Calibration((), {**CHANNELS, **channels})
    [session] = choose_sessions("framed", AngleMapping.ROUNDED, calibration)
    link = Link(MockPort(board), session, retry_min=0.5, retry_max=2.0)
    for k in range(20):
        link.poll(0.05 * k)
    return link


@pytest.mark.parametrize(
    ("kinds", "channels", "named"),
    [
        ((), {}, ("no channels", "left", "WINCH_COUNT")),
        ((ChannelKind.WINCH,), {}, ("1 channels", "robot 2")),
        ((ChannelKind.PRESSURE, ChannelKind.WINCH), {}, ("channel 0", "pressure", "left", "winch")),
        (KINDS, {"air": PressureCalibration(scale=10.0)}, ("air", "2000", "800", "8000 Pa", "safe_range")),
    ],
)
def test_a_board_with_other_channels_is_refused(kinds, channels, named) -> None:
    link = session_of(MockBoard(servos=1, channels=kinds), **channels)
    assert link.state is LinkState.FAULT
    assert_names(link.message, *named)


def values(**changes):
    return {p.name: p.default for p in PARAMETERS} | {"port": "mock", "servos": 0} | changes


@pytest.mark.parametrize(
    ("channels", "named"),
    [
        ("left m 0", ("channels", "left m 0 0.03")),
        ("left m 0.03 0", ("channels", "'left m 0.03 0'")),
        ("left m 0 nan", ("channels", "nan")),
        ("left m 0 1; left m 0 1", ("left", "twice")),
        ("servo_0 m 0 1", ("servo_0", "servo")),
        ("pull N 0 5", ("pull", "force", "Pa")),
        ("air Pa 0 1; left m 0 1", ("cable", "first")),
        ("; ".join(f"c{i} m 0 1" for i in range(8)), ("8 joints", "7")),
        ("", ("servos", "channels")),
    ],
)
def test_channels_that_no_board_has_are_refused(channels: str, named: tuple[str, ...]) -> None:
    with raises_naming(ValueError, *named):
        check(values(channels=channels))


def test_a_real_winch_needs_a_calibration(tmp_path) -> None:
    given = values(channels="left m 0 0.03", port="/dev/ttyACM0")
    with raises_naming(ValueError, "left", "calibration"):
        check(given)
    file = tmp_path / "robot.yaml"
    file.write_text(calibration_text(Calibration((), {"left": WinchCalibration(radius=0.007)})))
    check(given | {"calibration": str(file)})
    with raises_naming(ValueError, "right [m]", "left [m]", "channels"):
        check(given | {"calibration": str(file), "channels": "right m 0 0.03"})
    with raises_naming(ValueError, "legacy", "left", "framed"):
        check(given | {"calibration": str(file), "protocol": "legacy"})


def test_a_calibration_file_keeps_winches_and_pressures() -> None:
    made = Calibration(
        (ServoCalibration(offset=3.0),),
        {
            "a": WinchCalibration(1e-5, 32.0, 12.0, (0.0, 0.01)),
            "p": PressureCalibration(30.5, 4.0, (0.0, 9e3)),
        },
    )
    assert parse_calibration(calibration_text(made)) == made
    with raises_naming(ValueError, "winches.a.radius", "-1"):
        parse_calibration("winches: {a: {radius: -1}}")
    with raises_naming(ValueError, "winches.a", "diameter", "radius"):
        parse_calibration("winches: {a: {diameter: 1}}")
    with raises_naming(ValueError, "pressures.servo_0"):
        parse_calibration("pressures: {servo_0: {}}")
    with raises_naming(ValueError, "safe_range[0]", "set-point -1", "zero"):
        parse_calibration("pressures: {p: {scale: 100, safe_range: [-100, 100]}}")


def test_a_range_that_the_calibration_does_not_share_is_refused(tmp_path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(calibration_text(Calibration((), {"left": WinchCalibration(safe_range=(0.04, 0.05))})))
    with raises_naming(CommandError, "left", "0.04 to 0.05 m", "0 to 0.03 m"):
        make_driver(values(channels="left m 0 0.03", calibration=str(file)))
