"""`tripod calibrate --identify` on a robot that is simulated: its board in memory, its poses from the scene."""

import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import tripod_bringup.measure_command as measure_module
import tripod_bringup.measuring as measuring_module
from tests.bringup.console import Script
from tests.messages import assert_names, line_naming, names, raises_naming
from tests.scenes import SHARP
from tripod_bringup.calibrate_command import PATIENCE, calibrate
from tripod_bringup.measure_command import evaluate, measure_command, zeros_of
from tripod_bringup.measuring import KEYS, HeightSensor, ImuSensor, MarkerSensor, MeasureSession, reach
from tripod_bringup.pose_file import PoseFile
from tripod_driver.calibration import Calibration, CalibrationError, ServoCalibration
from tripod_driver.calibration_file import calibration_text, read_calibration
from tripod_driver.choose_session import choose_sessions
from tripod_driver.imu import ImuReading
from tripod_driver.ports.mock import MockPort
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.pose_player import SETTLE, SPEED, Phase, PosePlayer
from tripod_driver.protocol import WORKSHOP, AngleMapping
from tripod_identify.csv_columns import Channel
from tripod_identify.errors import DataError, FitError
from tripod_identify.measured import Measured
from tripod_identify.model import plainly, predict
from tripod_identify.safe_poses import FEWEST, LOOKS, MARGIN, telling_poses
from tripod_sim import load_scene

KNOWN = Calibration((ServoCalibration(2.8, 1), ServoCalibration(0.3, -1), ServoCalibration(2.9, 1)))
KNOWN = Calibration(tuple(replace(s, safe_range=(-1.9, 0.1)) for s in KNOWN.servos))
ZEROS = np.array([0.05, -0.03, 0.02])
SCENE = load_scene(SHARP, ("servos.slide=0.02",))
COARSE = load_scene(SHARP, ("servos.slide=0.02", "mesh.level=1"))
COLUMNS = LOOKS["heights"].columns
HEIGHT = (Channel("effector", 2),)
POSES = 12


@pytest.fixture(scope="module")
def tour() -> np.ndarray:
    return telling_poses(COARSE, LOOKS["heights"], KNOWN.lower, KNOWN.upper, POSES)


class Human(Script):
    """A console with somebody before it, who presses g, then types the height that the robot has."""

    patience = 300.0

    def __init__(self, keys: dict[float, bytes] | None = None) -> None:
        super().__init__({0.3: b"g"} if keys is None else keys)
        self.heights: list[str] = []
        self.typed = 0

    def show(self, line: str) -> None:
        super().show(line)
        if names(line, "[mm]", "Enter") and self.typed < len(self.heights):
            self.keys[self.now] = f"{self.heights[self.typed]}\r".encode()
            self.typed += 1


class Bench:
    def __init__(self, tour: np.ndarray, sensor, path: Path, keys: dict[float, bytes] | None = None) -> None:
        self.human = Human(keys)
        self.board = MockBoard(self.human.clock)
        self.port = MockPort(self.board)
        self.file = PoseFile(path / "poses.csv", tour, COLUMNS, "a robot")
        sessions = choose_sessions("framed", AngleMapping.ROUNDED, KNOWN)
        self.session = MeasureSession(self.port, sessions, KNOWN, tour, sensor, self.file.keep, self.human)

    def run(self, stopped=lambda: 0) -> int:
        return calibrate(self.session, self.human.clock, self.human.sleep, stopped)

    @property
    def way(self) -> np.ndarray:
        """Joint angles of all pulses that the board got [rad], shape (n, 3)."""
        return np.array([KNOWN.angles([p / 10 for p in pulses]) for pulses in self.board.history])


def seen(angles: np.ndarray, channels=HEIGHT, zeros=ZEROS) -> np.ndarray:
    """What the robot shows, whose arms stand `zeros` beyond the command [m, rad]."""
    data = Measured(None, angles, None, channels, np.zeros((len(angles), len(channels))))
    return predict(replace(plainly(SCENE), zero=zeros), data, ())


def test_poses_are_within_both_ranges(tour: np.ndarray) -> None:
    assert tour.shape == (POSES, 3)
    assert tour.min() >= -1.9 + MARGIN - 1e-12
    assert tour.max() <= 0.1 - MARGIN + 1e-12
    common = tour.mean(axis=1)
    assert np.ptp(common) > 1.0
    assert np.abs(tour - common[:, None]).max() > 0.2
    assert common.max() < -0.3, "strips that are pushed inwards while they are flat buckle up or down"


@pytest.mark.slow
def test_poses_are_always_the_same(tour: np.ndarray) -> None:
    again = telling_poses(COARSE, LOOKS["heights"], KNOWN.lower, KNOWN.upper, POSES)
    np.testing.assert_array_equal(again, tour)


@pytest.mark.parametrize(
    ("lower", "upper", "count", "named"),
    [
        ([-2.1] * 3, [0.0] * 3, FEWEST - 1, ("--poses", 7, "8 to 200")),
        ([-2.1] * 2, [0.0] * 2, 10, (f"scene '{SCENE.name}'", "3 servos", "calibration", 2)),
        ([-2.1, -0.1, -2.1], [0.0] * 3, 10, ("servo_1", "-0.1 to 0 rad", f"{2 * MARGIN:g} rad")),
    ],
)
def test_poses_that_cannot_be_are_refused(lower: list, upper: list, count: int, named: tuple) -> None:
    with raises_naming(DataError, *named):
        telling_poses(COARSE, LOOKS["heights"], lower, upper, count)


def test_the_player_goes_slowly_waits_and_parks() -> None:
    player = PosePlayer(np.array([[-0.5, 0.2]]), [0.0, 0.0], [0.0, 0.0])
    now, phases, before = 0.0, [], player.angles
    while player.phase is not Phase.STANDING:
        angles = player.advance(now, arrived=True)
        assert np.abs(angles - before).max() <= SPEED * 0.01 + 1e-9
        before, now = angles, now + 0.01
        phases.append(player.phase)
    assert phases.index(Phase.SETTLING) * 0.01 == pytest.approx(1.0, abs=0.03)
    assert phases.count(Phase.SETTLING) * 0.01 == pytest.approx(SETTLE, abs=0.03)
    player.advance(now, arrived=False)
    assert player.phase is Phase.GOING  # pushed
    player.hold()
    player.next()
    assert player.phase is Phase.PARKING
    for _ in range(100):
        now += 0.01
        np.testing.assert_array_equal(player.advance(now, arrived=True), before)
    player.go_on()
    player.advance(now + 5.0, arrived=True)
    assert np.abs(player.angles - before).max() <= SPEED * 0.05 + 1e-9  # a late tick makes no jump


def test_typed_heights_give_the_calibration_that_the_robot_has(
    tour: np.ndarray, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bench = Bench(tour, HeightSensor(), tmp_path)
    table = 62.0  # heights are taken from the table
    noise = np.random.default_rng(4).normal(0, 0.1, len(tour))
    bench.human.heights = [f"{table + 1e3 * z + e:.1f}" for z, e in zip(seen(tour)[:, 0], noise, strict=True)]
    assert bench.run() == 0
    assert_names(bench.human.said[-1], "parked")
    assert not bench.port.is_open
    way = bench.way
    assert np.abs(np.diff(way, axis=0)).max() <= 2 * SPEED * 0.03 + 2e-3
    for pose in tour:
        assert np.abs(way - pose).max(axis=1).min() < 1e-3
    np.testing.assert_allclose(way[-1], 0.0, atol=1e-3)
    assert bench.file.done == set(range(POSES))
    where = {"file": tmp_path / "robot.yaml", "out": tmp_path / "robot.toml", "report": None}
    assert evaluate(SCENE, bench.file.path, "heights", KNOWN, **where) == 0
    said, scene = capsys.readouterr().out, (tmp_path / "robot.toml").read_text()
    assert_names(said, "servos.zero.0")
    told = line_naming(said + scene, "servo_1")  # once: nothing more is to be done to its offset
    assert_names(told, "offset", "0.3000", "rad")
    assert min(float(number) for number in re.findall(r"0\.\d{4}", told)) == pytest.approx(0.27, abs=0.02)
    found = read_calibration(tmp_path / "robot.yaml")
    for own, old, zero in zip(found.servos, KNOWN.servos, ZEROS, strict=True):
        # the pulse that the arm needs for an angle: less what it stands beyond the command
        assert own.pulse(-1.0) == pytest.approx(old.pulse(-1.0 - zero), abs=8.0)
        assert own.pulse(own.safe_range[0]) == pytest.approx(old.pulse(old.safe_range[0]), abs=0.1)
    assert load_scene(tmp_path / "robot.toml").servos.slide == pytest.approx(0.02, abs=1e-3)


def test_what_was_measured_is_kept_and_gone_on_with(tour: np.ndarray, tmp_path: Path) -> None:
    bench = Bench(tour, HeightSensor(), tmp_path)
    bench.human.heights = ["1", "", "3.5"]
    bench.human.keys[60.0] = b"q"
    assert bench.run() == 0
    assert bench.session.left
    np.testing.assert_allclose(bench.way[-1], 0.0, atol=1e-3)
    lines = bench.file.path.read_text().splitlines()
    assert lines[0] == "# a robot"
    assert [line.split(",")[-1] for line in lines[1:]] == ["effector.z_mm", "1.0000", "", "3.5000"]
    again = PoseFile(bench.file.path, tour, COLUMNS, "a robot")
    assert again.done == {0, 1, 2}
    again.keep(3, (7.0,))
    assert bench.file.path.read_text().splitlines()[:5] == lines
    with raises_naming(DataError, bench.file.path, "another robot", "--data"):
        PoseFile(bench.file.path, tour, COLUMNS, "another robot")
    with raises_naming(DataError, bench.file.path, "not one of these", "--data"):
        PoseFile(bench.file.path, tour + 0.01, COLUMNS, "a robot")


@pytest.mark.parametrize("protocol", WORKSHOP)
def test_the_workshops_packets_carry_every_pose(tmp_path: Path, protocol: str) -> None:
    known = Calibration(
        (ServoCalibration(2.9, 1, safe_range=(-2.0, 0.1)),) * 3
    )  # more than whole degrees reach
    sessions = choose_sessions(protocol, AngleMapping.ROUNDED, known)
    lower, upper = reach(sessions, known)
    assert lower.min() > -2.0
    poses = np.array([lower, upper])
    human, kept = Human({2.5: b"g"}), []
    human.heights = ["1", "2"]
    session = MeasureSession(
        MockPort(), sessions, known, poses, HeightSensor(), lambda *row: kept.append(row), human
    )
    assert calibrate(session, human.clock, human.sleep) == 0
    assert kept == [(0, (1.0,)), (1, (2.0,))]


def test_space_stops_and_g_goes_on(tour: np.ndarray, tmp_path: Path) -> None:
    bench = Bench(
        tour[4:5], HeightSensor(), tmp_path, {0.2: b"x", 0.25: b"?", 0.3: b"g", 1.0: b" ", 3.0: b"g"}
    )
    bench.human.heights = ["1"]
    assert bench.run() == 0
    assert any(names(line, "x does nothing", "? shows") for line in bench.human.lines)
    assert "\n".join(bench.human.said).count(KEYS) == 2
    assert any(names(line, "stopped", "g goes on") for line in bench.human.lines)
    moved = np.abs(np.diff(bench.way, axis=0)).max(axis=1)
    assert moved.max() <= 2 * SPEED * 0.03 + 2e-3


def test_a_robot_that_nobody_looks_after_parks(
    tour: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert PATIENCE == 300.0
    monkeypatch.setattr(measuring_module, "PATIENCE", 120.0)
    bench = Bench(tour[8:], HeightSensor(), tmp_path)
    bench.human.patience = 220.0
    assert bench.run() == 0
    assert any(names(said, "no key", "2 minutes", "servos") for said in bench.human.said)
    assert 120.0 < bench.human.now < 140.0
    np.testing.assert_allclose(bench.way[-1], 0.0, atol=1e-3)


def test_a_height_that_is_mistyped_is_asked_for_again(tour: np.ndarray, tmp_path: Path) -> None:
    bench = Bench(tour[8:9], HeightSensor(), tmp_path)
    bench.human.heights = ["1..2", "-123456", "12"]
    assert bench.run() == 0
    for text in ("1..2", "-123456"):
        assert any(names(line, text, "not a height", "up to 1000") for line in bench.human.lines)
    assert bench.file.path.read_text().splitlines()[2:] == [
        ",".join([*(f"{angle:.6f}" for angle in tour[8]), "12.0000"])
    ]


def test_poses_that_cannot_be_kept_park_the_servos(tour: np.ndarray, tmp_path: Path) -> None:
    place = tmp_path / "stick"
    place.mkdir()
    bench = Bench(tour, HeightSensor(), place)
    bench.human.heights = ["1"]
    place.rmdir()
    assert bench.run() == 1
    *_, why, end = bench.human.said
    assert_names(why, "tripod calibrate: ", bench.file.path, f"no directory {place}")
    np.testing.assert_allclose(bench.way[-1], 0.0, atol=1e-3)
    assert_names(end, "parked")


def test_nothing_moves_before_g(tour: np.ndarray, tmp_path: Path) -> None:
    bench = Bench(tour, HeightSensor(), tmp_path, {2.0: b"q"})
    assert bench.run() == 0
    assert not bench.board.history
    assert_names(bench.human.said[-1], "nothing", "moved")


def test_ctrl_c_parks_and_a_second_one_ends(tour: np.ndarray, tmp_path: Path) -> None:
    bench = Bench(tour[5:], HeightSensor(), tmp_path)
    assert bench.run(lambda: int(bench.human.now > 3.0)) == 0
    np.testing.assert_allclose(bench.way[-1], 0.0, atol=1e-3)
    other = Bench(tour[5:], HeightSensor(), tmp_path)
    assert other.run(lambda: 2 * int(other.human.now > 3.0)) == 0
    assert np.abs(other.way[-1]).max() > 0.5
    assert not other.port.is_open


def test_an_imu_is_read_and_a_silent_one_is_told(tour: np.ndarray, tmp_path: Path) -> None:
    bench = Bench(tour[:2], ImuSensor(), tmp_path)
    bench.run()
    assert bench.session.code == 1
    silent = ("board", "0 IMU readings", "5 s", "--identify heights")
    assert any(names(line, *silent) for line in bench.human.said)
    np.testing.assert_allclose(bench.way[-1], 0.0, atol=1e-3)
    sensor, line = ImuSensor(), bench.session._link.session
    sensor.begin(10.0)
    line.readings = [ImuReading(0.5, 0.5, 9.9)]  # from the way
    assert sensor.poll(10.0, line) is None
    for k in range(ImuSensor.wanted):
        line.readings.append(ImuReading(0.1, 0.0 if k % 3 else 0.05, 10.1 + k))
        found = sensor.poll(10.1 + k / 10, line)
    assert found == pytest.approx((math.degrees(0.1), 0.0), abs=0.05)


class Finder:
    number = 0

    def __init__(self, places: list) -> None:
        self.places = places

    def find(self, image):
        return self.places.pop(0) if self.places else None


def test_a_marker_is_seen_hidden_and_never_seen() -> None:
    taken = []
    sensor = MarkerSensor(Finder([np.array([0.001, 0.002, 0.3])] * 12), lambda: taken.append(1))
    sensor.begin(0.0)
    found = [sensor.poll(0.01 * k, None) for k in range(MarkerSensor.wanted)]
    assert found[-1] == pytest.approx((1.0, 2.0, 300.0))
    assert not any(found[:-1])
    sensor.begin(1.0)
    assert [sensor.poll(now, None) for now in (1.0, 1.1, 2.0)] == [None] * 3
    assert all(map(math.isnan, sensor.poll(7.0, None)))
    with raises_naming(DataError, "camera", "no marker", "4x4_50", "number 0", "1 images"):
        never = MarkerSensor(Finder([]), lambda: None)
        never.begin(0.0)
        never.poll(6.0, None)


def test_what_must_not_be_believed_is_not_written(
    tour: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def doubted(result: object) -> list[float]:
        raise FitError("no")

    monkeypatch.setattr(measure_module, "identified", lambda *_, **__: SimpleNamespace(notes=()))
    monkeypatch.setattr(measure_module, "tell_found", lambda *_, **__: None)
    monkeypatch.setattr(measure_module, "zeros_of", doubted)
    file = PoseFile(tmp_path / "poses.csv", tour, COLUMNS, "a robot")
    for k in range(len(tour)):
        file.keep(k, (float(k),))
    where = {"file": tmp_path / "robot.yaml", "out": tmp_path / "robot.toml", "report": None}
    with pytest.raises(FitError):
        evaluate(SCENE, file.path, "heights", KNOWN, **where)
    assert [path.name for path in tmp_path.iterdir()] == ["poses.csv"]


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"sensor": "ruler"}, ("--identify", "'ruler'", "heights, imu, marker")),
        ({"file": Path("none.yaml")}, ("none.yaml", "No such file", "tripod calibrate")),
        ({"sensor": "marker"}, ("--identify marker", "--lens FILE")),
        ({"scene": "pendulum"}, ("scene 'pendulum'", "0 servos", "calibration", 3)),
        ({"slide": 0.3}, ("servos.slide", "0.3 m", "0 to 0.04 m")),
        ({"out": Path("/nowhere/x.toml")}, ("no directory /nowhere",)),
        ({"overrides": ["mesh.level=1"]}, ("needs", "terminal")),
    ],
)
def test_what_is_wrong_is_told_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changed: dict, named: tuple
) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(calibration_text(KNOWN))
    usual = {
        "sensor": "heights", "port": "mock", "file": file, "protocol": "framed", "baud": 0, "boot_time": 2.0,
        "scene": SHARP, "overrides": [], "slide": None, "poses": 8, "data": None, "out": None, "report": None,
        "camera": "0", "side": 0.02, "lens": None,
    }  # fmt: skip
    assert measure_command(**usual | changed) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("tripod calibrate: ")
    assert_names(lines[0].removeprefix("tripod calibrate: "), *named)
    assert file.read_text() == calibration_text(KNOWN)
    assert not list(tmp_path.glob("*.csv"))


def test_a_zero_that_no_horn_has_is_not_written() -> None:
    with raises_naming(CalibrationError, "servo_0", "offset", "3.2 rad", "one tooth"):
        Calibration((ServoCalibration(3.1, 1, safe_range=(-2.0, 0.0)),) * 3).turned([-0.1, 0.0, 0.0])


@pytest.mark.parametrize(
    ("zeros", "explained", "named"),
    [
        ({0: 0.1, 2: -0.2}, False, ("model", "not explain")),
        ({}, True, ("zero of any servo", "--poses")),
        ({1: -0.36}, True, ("servo_1", "-0.36 rad", "0.35 rad", "tripod calibrate")),
    ],
)
def test_zeros_that_must_not_be_believed(zeros: dict, explained: bool, named: tuple) -> None:
    zero_of = {i: SimpleNamespace(name=f"servos.zero.{i}") for i in range(3)}
    result = SimpleNamespace(
        left=SimpleNamespace(explained=explained),
        found=[SimpleNamespace(parameter=zero_of[i], true=zero) for i, zero in zeros.items()],
        told=SimpleNamespace(zero=np.zeros(3)),
    )
    with raises_naming(FitError, *named, "calibration was not changed"):
        zeros_of(result)
    if zeros and not explained:
        result.left.explained = True
        assert zeros_of(result) == [0.1, 0.0, -0.2]
