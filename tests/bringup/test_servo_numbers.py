"""Every command with robots of four and five servos: the number is the scene's, or the calibration's, not three."""

import csv
import json
import signal
import xml.etree.ElementTree as ET
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from typer.testing import CliRunner

from tests.bringup.console import Script
from tests.bringup.processes import DEADLINE, play_to_simulator
from tests.domains import own_domain
from tests.messages import assert_names, names
from tests.scenes import FIVE_LEGS
from tripod_bringup import cli
from tripod_bringup.calibrate_command import (
    CalibrateSession,
    calibrate,
    calibrating_sessions,
    known_calibration,
)
from tripod_bringup.measuring import HeightSensor, MeasureSession
from tripod_driver.calibration import Calibration, CalibrationError, ServoCalibration
from tripod_driver.calibration_file import read_calibration
from tripod_driver.choose_session import choose_sessions
from tripod_driver.ports.mock import MockPort
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.protocol import AngleMapping
from tripod_graph import names as topics
from tripod_graph.command import CommandLimits
from tripod_graph.names import WORKING_ANGLE, joint_names, servo_names
from tripod_ik.model import StaticModel
from tripod_sim import load_scene
from tripod_teleop.drive import Drive
from tripod_teleop.keys import KEYS, Act
from tripod_teleop.operate import TAKEOVER, Operator

UP = b"\x1b[A"
DOWN = b"\x1b[B"


@dataclass(frozen=True)
class Robot:
    """A scene, what it takes to be quick, and its number of servos."""

    scene: str
    overrides: tuple[str, ...]
    servos: int

    @property
    def words(self) -> list[str]:
        """The scene and its overrides as words of a command."""
        return [self.scene, *(word for change in self.overrides for word in ("--set", change))]


ROBOTS = {4: Robot("cross", ("mesh.level=1",), 4), 5: Robot(FIVE_LEGS, (), 5)}


@pytest.fixture(params=sorted(ROBOTS))
def robot(request: pytest.FixtureRequest) -> Robot:
    return ROBOTS[request.param]


def tripod(*words: str) -> str:
    """Return what a command prints; it must end well."""
    result = CliRunner().invoke(cli.app, list(words))
    assert result.exit_code == 0, result.output
    return result.stdout


def test_run_and_show_have_an_angle_and_a_torque_for_each_servo(robot: Robot, tmp_path: Path) -> None:
    angles = [round(-0.2 - 0.05 * k, 3) for k in range(robot.servos)]
    motion = f"0: {','.join(['0'] * robot.servos)}; 0.2: {','.join(map(str, angles))}"
    file, plot, page = (tmp_path / f"run.{end}" for end in ("npz", "png", "html"))
    run = json.loads(
        tripod("run", *robot.words, "--servo", motion, "--duration", "0.3", "--out", str(file), "--json")
    )
    assert run["angles"] == pytest.approx(angles)
    assert len(run["torques"]) == robot.servos
    assert np.abs(run["torques"]).min() > 1e-3
    tripod("show", str(file), "--plot", str(plot), "--html", str(page))
    assert plot.stat().st_size > 10_000
    assert page.stat().st_size > 10_000


def test_explain_and_print_describe_all_servos(robot: Robot) -> None:
    told = json.loads(tripod("explain", *robot.words, "--no-costs", "--json", "-q"))
    assert told["scene"] == load_scene(robot.scene).name
    joints = {
        joint.get("name") for joint in ET.fromstring(tripod("print", "urdf", *robot.words)).iter("joint")
    }
    assert {name for name in joints if name.startswith("servo_")} == set(servo_names(robot.servos))
    assert f"count = {robot.servos}" in tripod("print", "scene", robot.scene)


def test_inverse_kinematics_and_workspace_have_all_servos(robot: Robot, tmp_path: Path) -> None:
    found = json.loads(tripod("ik", *robot.words, "--target", "2mm -1mm -6.5mm", "--json"))
    assert found["reached"]
    assert len(found["angles"]) == len(found["torques"]) == robot.servos
    model = StaticModel(load_scene(robot.scene, list(robot.overrides)))
    there = model.move(np.array(found["angles"])).equilibrium
    assert there == pytest.approx([0.002, -0.001, -0.0065], abs=2e-6)
    table, plot = tmp_path / "reach.csv", tmp_path / "reach.png"
    words = ["--low", "-1.7", "--high", "-1.3", "--samples", "6", "--out", str(table), "--plot", str(plot)]
    text = tripod("reach", *robot.words, *words)
    assert_names(text, "6 quasi-random samples", f"{2**robot.servos} corners", "--samples")
    with table.open() as file:
        head, *rows = csv.reader(file)
    assert head[: robot.servos + 3] == [
        *(f"{n} [rad]" for n in servo_names(robot.servos)),
        "x [m]",
        "y [m]",
        "z [m]",
    ]
    assert 2**robot.servos <= len(rows) <= 2**robot.servos + 7
    assert plot.stat().st_size > 10_000


def test_a_path_is_played(robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text("time,tilt_x,tilt_y\n0,0,0\n0.1,0.02,0\n0.3,0,0\n")
    scene, *overrides = robot.words
    told = json.loads(tripod("play", str(path), "--scene", scene, *overrides, "--json"))
    assert told["key_points"] == 3
    assert len(told["angles"]) == robot.servos
    assert told["effector"]["position"][:2] == pytest.approx([0, 0], abs=1e-4)


@pytest.mark.slow
def test_a_maze_is_won(robot: Robot) -> None:
    count, angles = robot.servos, [WORKING_ANGLE] * robot.servos
    changes = (f"mesh.legs={count}", f"servos.count={count}", f"servos.angles={angles}", "mesh.level=1")
    words = [word for change in changes for word in ("--set", change)]
    assert json.loads(tripod("play", "first", *words, "--json", "-q"))["solved"] == 1


class Keys(Script):
    """A console at a mock board of some servos."""

    def __init__(self, keys: dict[float, bytes], servos: int) -> None:
        super().__init__(keys)
        self.board = MockBoard(self.clock, servos=servos)
        self.port = MockPort(self.board)


@pytest.mark.parametrize("count", [1, 2, 4, 5, 6])
def test_every_servo_is_calibrated_by_hand(count: int, tmp_path: Path) -> None:
    last, file = count - 1, tmp_path / "calibration.yaml"
    steps = {1.0 + 0.02 * k: b"-" for k in range(40)}
    keys = Keys(
        {0.2: b"g", 0.5: f"{last}".encode(), **steps, 3.0: b"z", 3.1: b"w", 3.2: b"?", 3.4: b"q"}, count
    )
    known = known_calibration(file, count)
    session = CalibrateSession(keys.port, calibrating_sessions("framed", known), known, file, keys)
    assert calibrate(session, keys.clock, keys.sleep) == 0
    moved = np.ptp(np.array(keys.board.history), axis=0)
    assert moved[last] > 1000
    assert (moved[:last] == 0).all()
    found = read_calibration(file)
    assert len(found.servos) == count
    assert [servo.offset for servo in found.servos[:last]] == [pytest.approx(np.pi, abs=1e-5)] * last
    assert found.servos[last].offset == pytest.approx(np.pi - np.radians(20), abs=1e-5)
    assert any(names(line, f"servo_{last}:") for line in keys.lines)
    assert known_calibration(file, None) == found
    with pytest.raises(CalibrationError) as refused:
        known_calibration(file, count + 1)
    assert_names(refused.value, f"{count} servos", f"--servos is {count + 1}")


def test_a_digit_beyond_the_servos_does_nothing(tmp_path: Path) -> None:
    keys = Keys({0.2: b"g", 0.5: b"4", 1.0: b"q"}, 4)
    known = known_calibration(tmp_path / "none.yaml", 4)
    calibrate(
        CalibrateSession(keys.port, calibrating_sessions("framed", known), known, tmp_path / "c.yaml", keys),
        keys.clock,
        keys.sleep,
    )
    assert any(names(line, "4 does nothing here") for line in keys.lines)


def test_poses_are_measured_with_all_servos(robot: Robot, tmp_path: Path) -> None:
    known = Calibration((ServoCalibration(),) * robot.servos)
    tour = np.array([[-0.3 - 0.1 * k] * robot.servos for k in range(2)]) - 0.05 * np.arange(robot.servos)
    keys = Keys({0.3: b"g", **{10.0 * k: b"-7\r" for k in range(1, 6)}}, robot.servos)
    kept: list[tuple[int, tuple[float, ...]]] = []
    sessions = choose_sessions("framed", AngleMapping.ROUNDED, known)
    session = MeasureSession(
        keys.port, sessions, known, tour, HeightSensor(), lambda k, found: kept.append((k, found)), keys
    )
    assert calibrate(session, keys.clock, keys.sleep) == 0
    assert kept == [(0, (-7.0,)), (1, (-7.0,))]
    way = np.array([known.angles([p / 10 for p in pulses]) for pulses in keys.board.history])
    for pose in tour:
        assert np.abs(way - pose).max(axis=1).min() < 2e-3


def test_zeros_of_all_servos_are_identified(robot: Robot, tmp_path: Path) -> None:
    """Poses that the model made, with arms that stand beyond the command by known angles."""
    zeros = 0.04 * np.cos(2.0 * np.arange(robot.servos))
    model = StaticModel(load_scene(robot.scene, list(robot.overrides)))
    rng, data = np.random.default_rng(1), tmp_path / "poses.csv"
    with data.open("w") as file:
        writer = csv.writer(file)
        angles = [f"servo_{i}_rad" for i in range(robot.servos)]
        places = [f"effector.{axis}_mm" for axis in "xyz"]
        writer.writerow([*angles, "slide_mm", *places])
        for _ in range(14):
            command = WORKING_ANGLE + rng.uniform(-0.2, 0.2, robot.servos)
            place = 1e3 * model.move(command + zeros).equilibrium + rng.normal(0, 0.02, 3)
            writer.writerow([*command.round(6), 35, *place.round(4)])
            model.go_home()
    at_slide = [*robot.words, "--set", "servos.slide=0.035"]
    score = json.loads(tripod("identify", robot.scene, str(data), *at_slide[1:], "--score", "--json", "-q"))
    assert score["distance"]["rms"] > 3e-4
    out = tmp_path / "found.toml"
    words = ["--fit", "servos.zero", "--no-mesh", "--no-propose", "--out", str(out), "--json", "-q"]
    found = json.loads(tripod("identify", robot.scene, str(data), *at_slide[1:], *words))
    assert found["after"]["distance"]["rms"] < 0.1 * score["distance"]["rms"]
    zero = [found["found"][f"servos.zero.{i}"]["value"] for i in range(robot.servos)]
    assert zero == pytest.approx(zeros.tolist(), abs=0.01)
    np.testing.assert_allclose(load_scene(out).servos.angles, [0.0] * robot.servos)


def test_keys_steer_every_servo(robot: Robot) -> None:
    made = Operator("/teleop#1", Drive(CommandLimits(count=robot.servos), speed=0.5, hold=0.2, pose_time=3.0))
    joints = (*(-0.3,) * robot.servos, 0.0)
    made.act(Act.TELEOP, joints, 100.0, 0.0)
    made.setpoint(joints, TAKEOVER)
    last = robot.servos - 1
    made.act(KEYS[str(last)], joints, 100.0, 1.0)
    made.act(KEYS["-"], joints, 100.0, 1.0)
    moved = np.array(made.setpoint(joints, 1.1)) - joints
    assert np.flatnonzero(np.abs(moved) > 1e-6).tolist() == [last]
    made.act(KEYS[str(last + 1)], joints, 100.0, 2.0)
    assert_names(made.notice, f"servo_{last + 1}", f"{robot.servos} servos")


@pytest.fixture(scope="module", params=[5, pytest.param(4, marks=pytest.mark.slow)])
def recorded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Path]:
    """Return a robot and the recording of its demo: simulator, inverse kinematics, driver on the mock port and page."""
    pytest.importorskip("tripod_msgs", reason="the messages are not built: run `make setup`")
    from tests.bringup.test_whole_chain import free_port, start
    from tests.view.fake_browser import FakeBrowser

    robot, directory = ROBOTS[request.param], tmp_path_factory.mktemp("chain")
    words = [*robot.words, "--demo", "--duration", "4", "--record", "bags", "--view-port", str(free_port())]
    with own_domain() as domain:
        process = start(*words, directory=directory, domain=domain)
        try:
            url = next(line.split()[1] for line in process.stdout if line.startswith("page http"))
            with FakeBrowser(url) as browser:
                # until it has heard of the robot it shows three
                browser.wait(lambda: len(browser.values.get("range") or []) == robot.servos)
            _, err = process.communicate(timeout=3 * DEADLINE)
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
                process.communicate(timeout=DEADLINE)
    assert process.returncode in (0, 1), err  # 1: a busy machine lags behind its targets
    return robot, next((directory / "bags").glob("*/*.mcap"))


@pytest.mark.ros
def test_all_nodes_have_all_servos(recorded: tuple[Robot, Path]) -> None:
    robot, file = recorded
    servos, joints = list(servo_names(robot.servos)), list(joint_names(robot.servos))
    heard = defaultdict(list)
    with AnyReader([file.parent]) as reader:
        for connection, _, raw in reader.messages():
            heard[connection.topic].append(reader.deserialize(raw, connection.msgtype))
    for topic in (topics.SIM_JOINT_STATES, topics.ROBOT_JOINT_STATES):
        assert heard[f"/{topic}"][-1].name[: robot.servos] == servos
    assert all(len(message.position) == robot.servos + 1 for message in heard[f"/{topics.SIM_JOINT_STATES}"])
    commands = heard[f"/{topics.JOINT_TRAJECTORY}"]
    assert {len(message.points[0].positions) for message in commands} <= {robot.servos, robot.servos + 1}
    assert all(message.joint_names == joints[: len(message.joint_names)] for message in commands)
    assert heard[f"/{topics.COMPLIANCE}"][-1].joint_names == servos
    tracked = [message for message in heard[f"/{topics.IK_STATUS}"] if message.state == 1]
    assert tracked, {message.state for message in heard[f"/{topics.IK_STATUS}"]}
    sent = np.array([message.sent for message in heard[f"/{topics.ROBOT_STATUS}"]])
    assert sent.shape[1] in (robot.servos, robot.servos + 1)
    known = sent[
        np.isfinite(sent[:, : robot.servos]).all(axis=1)
    ]  # before the board is there nothing is sent
    assert (np.ptp(known[:, : robot.servos], axis=0) > 1.0).all(), "every servo went into the working pose"


@pytest.mark.ros
def test_a_recording_is_read_drawn_and_played_again(recorded: tuple[Robot, Path], tmp_path: Path) -> None:
    robot, file = recorded
    assert json.loads(tripod("bag", "info", str(file), "--json"))
    plot, page, table = (tmp_path / f"bag.{end}" for end in ("png", "html", "csv"))
    tripod("bag", "plot", str(file), str(plot))
    tripod("bag", "html", str(file), str(page))
    tripod("bag", "export", str(file), str(table))
    assert min(plot.stat().st_size, page.stat().st_size) > 10_000
    with table.open() as text:
        head = next(csv.reader(text))
    for topic in (topics.SIM_JOINT_STATES, topics.ROBOT_JOINT_STATES):
        found = [name for name in head if name.startswith(f"{topic}.position.servo_")]
        assert found == [f"{topic}.position.{name}" for name in servo_names(robot.servos)]
    assert_names(play_to_simulator(file), "steps made again", "bit for bit")
