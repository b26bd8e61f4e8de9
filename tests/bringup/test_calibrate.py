"""`tripod calibrate` with keys from a list and a board in memory."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.bringup.console import Script
from tests.messages import assert_names, names
from tripod_bringup.calibrate_command import (
    BAD_ARGUMENTS,
    PATIENCE,
    TICK,
    CalibrateSession,
    calibrate,
    calibrate_command,
    calibrating_sessions,
)
from tripod_driver.calibration import Calibration, ServoCalibration, WinchCalibration
from tripod_driver.calibration_file import calibration_text, read_calibration
from tripod_driver.calibrator import (
    FINE,
    HOLD,
    PULSE_PAUSE,
    PULSE_SPEED,
    PULSE_STEP,
    SPEED,
    Calibrator,
    help_text,
)
from tripod_driver.framed import VERSION
from tripod_driver.ports.mock import Fault, MockPort
from tripod_driver.ports.mock_board import MockBoard
from tripod_teleop.terminal import TerminalError

UP, DOWN = b"\x1b[A", b"\x1b[B"


class Bench:
    def __init__(
        self,
        tmp_path: Path,
        keys: dict[float, bytes],
        *,
        known: Calibration | None = None,
        protocol: str = "framed",
        pulse_range: tuple[int, int] = (5440, 24000),
        **board,
    ) -> None:
        known = Calibration() if known is None else known
        self.console = Script(keys)
        self.board = MockBoard(self.console.clock, **board)
        self.board.pulse_range = pulse_range
        self.port = MockPort(self.board)
        self.file = tmp_path / "calibration.yaml"
        sessions = calibrating_sessions(protocol, known)
        self.session = CalibrateSession(self.port, sessions, known, self.file, self.console)

    def run(self) -> int:
        return calibrate(self.session, self.console.clock, self.console.sleep)

    @property
    def shafts(self) -> np.ndarray:
        """Shaft angles of all pulses that the board got [rad], shape (n, 3)."""
        return (np.array(self.board.history) / 10 - 544) / 1856 * math.pi


def held(key: bytes, begin: float, duration: float) -> dict[float, bytes]:
    """A key held down: pressed again every 50 ms."""
    return {begin + 0.05 * k: key for k in range(round(duration / 0.05))}


def test_nothing_moves_before_g_and_then_one_shaft_at_a_time_slowly(tmp_path: Path) -> None:
    keys = {0.2: UP, 0.5: b"g", **held(DOWN, 1.0, 2.0), 4.0: b"2", **held(DOWN, 4.1, 1.0), 6.0: b"q"}
    bench = Bench(tmp_path, keys)
    assert bench.run() == 0
    assert any(names(line, "nothing moves", "g begins") for line in bench.console.lines)
    way = bench.shafts
    assert way[0] == pytest.approx([math.pi] * 3, abs=1e-3)
    steps = np.abs(np.diff(way, axis=0))
    end = int(way[:, 2].argmin())  # then q: they park
    assert ((steps[:end] > 1e-9).sum(axis=1) <= 1).all()
    assert steps.max() <= SPEED * 0.03 + 1e-3
    went = SPEED * (2.0 - 0.05 + HOLD)
    assert way[end] == pytest.approx(
        [math.pi - went, math.pi, math.pi - SPEED * (1.0 - 0.05 + HOLD)], abs=5e-3
    )
    assert not bench.port.is_open


@pytest.mark.parametrize("key", [b" ", b"x", b"1"])
def test_space_and_any_other_key_stop_at_once(tmp_path: Path, key: bytes) -> None:
    bench = Bench(
        tmp_path,
        {0.2: b"g", **held(DOWN, 0.5, 1.0), 1.3: key, 3.0: b"q"} | {1.31 + 0.05 * k: b"" for k in range(8)},
    )
    bench.console.keys = {at: k for at, k in bench.console.keys.items() if not (k == DOWN and at > 1.3)}
    bench.run()
    assert bench.shafts[:, 0].min() == pytest.approx(math.pi - SPEED * 0.8, abs=SPEED * 3 * TICK + 2e-3)


def test_what_the_keys_mark_is_written_and_read_back(tmp_path: Path) -> None:
    keys = {
        0.2: b"g",
        **{0.5 + 0.02 * k: b"-" for k in range(40)},  # servo 0 by 20 degrees
        2.0: b"z",
        **{2.1 + 0.02 * k: b"-" for k in range(100)},  # by 50 more
        5.0: b"[",
        5.1: b"w",
        5.2: b"q",
    }
    bench = Bench(tmp_path, keys)
    assert bench.run() == 0
    assert_names(bench.console.said[-2], bench.file, f"tripod driver --set calibration={bench.file}")
    found = read_calibration(bench.file)
    assert found.servos[0].offset == pytest.approx(math.radians(160), abs=1e-5)
    assert found.servos[0].safe_range == pytest.approx((-math.radians(50), math.radians(20)), abs=1e-5)
    assert found.servos[1:] == read_calibration(bench.file).servos[1:]
    assert found.servos[1].safe_range == (-2.1, 0.0)


def test_q_asks_before_it_throws_away_what_was_found(tmp_path: Path) -> None:
    bench = Bench(tmp_path, {0.2: b"g", 0.4: b"-", 0.6: b"z", 0.8: b"q", 1.0: b"q"})
    assert bench.run() == 0
    assert any(names(line, "not written", "w writes", "q again") for line in bench.console.lines)
    assert not bench.file.exists()


# the end ------------------------------------------------------------------------------------------------------


def test_who_leaves_lets_the_servos_go_slowly_to_where_the_piece_is_flat(tmp_path: Path) -> None:
    turned = {0.5 + 0.02 * k: b"-" for k in range(40)}  # servo 0 by 20 degrees, which is flat
    keys = {0.2: b"g", **turned, 2.0: b"z", **held(DOWN, 2.1, 2.0), 5.0: b"w", 5.1: b"q"}
    bench = Bench(tmp_path, keys)
    assert bench.run() == 0
    assert_names(bench.console.said[-1], "parked")
    flat = read_calibration(bench.file).servos[0].offset
    assert flat == pytest.approx(math.radians(160), abs=1e-5)
    assert bench.shafts[:, 0].min() < flat - 0.4
    assert bench.shafts[-1] == pytest.approx([flat, math.pi, math.pi], abs=1e-3)
    back = bench.shafts[bench.shafts[:, 0].argmin() :]
    assert np.abs(np.diff(back, axis=0)).max() <= SPEED * 0.03 + 1e-3
    assert not bench.port.is_open


@pytest.mark.parametrize("again", [False, True])
def test_ctrl_c_parks_and_a_second_one_ends_at_once(tmp_path: Path, again: bool) -> None:
    bench = Bench(tmp_path, {0.2: b"g", **held(DOWN, 0.5, 2.0)})

    def stopped() -> int:
        return (bench.console.now > 3.0) + (again and bench.console.now > 3.1)

    assert calibrate(bench.session, bench.console.clock, bench.console.sleep, stopped) == 0
    parked = bench.shafts[-1] == pytest.approx([math.pi] * 3, abs=1e-3)
    assert parked == (not again)
    assert bench.console.now < 3.2 or not again
    assert not bench.port.is_open


def test_a_terminal_that_is_gone_parks_the_servos(tmp_path: Path, capsys) -> None:
    bench = Bench(tmp_path, {0.2: b"g", **held(DOWN, 0.5, 2.0)})
    read = bench.console.read

    def lost() -> bytes:
        if bench.console.now > 3.0:
            raise TerminalError("gone")
        return read()

    bench.console.read = lost
    assert bench.run() == 1
    assert capsys.readouterr().err == "tripod calibrate: gone\n"
    assert bench.shafts[:, 0].min() < math.pi - 0.4
    assert bench.shafts[-1] == pytest.approx([math.pi] * 3, abs=1e-3)
    assert not bench.port.is_open


def test_ctrl_c_before_anything_moved_ends_at_once(tmp_path: Path) -> None:
    bench = Bench(tmp_path, {0.5: b"?"})
    stopped = lambda: int(bench.console.now > 1.0)  # noqa: E731
    assert calibrate(bench.session, bench.console.clock, bench.console.sleep, stopped) == 0
    assert "\n".join(bench.console.said).count(help_text(3)) == 2
    assert_names(bench.console.said[-1], "nothing", "moved")
    assert not bench.board.history
    assert not bench.port.is_open


def test_a_key_stops_the_servos_on_their_way_to_the_end(tmp_path: Path) -> None:
    keys = {0.2: b"g", **held(DOWN, 0.5, 2.0), 3.0: b"q", 4.0: b" ", 9.0: b"q"}
    bench = Bench(tmp_path, keys)
    sleep, seen = bench.console.sleep, dict[int, float]()

    def look(duration: float) -> None:
        sleep(duration)
        if bench.board.history:
            seen[int(bench.console.now)] = bench.shafts[-1, 0]

    assert calibrate(bench.session, bench.console.clock, look) == 0
    assert seen[3] < seen[5] == seen[8] < math.pi - 0.1
    assert bench.shafts[-1, 0] == pytest.approx(math.pi, abs=1e-3)


def test_without_a_key_for_long_the_servos_park_and_what_was_found_is_kept(tmp_path: Path) -> None:
    late = 2.0 + PATIENCE
    keys = {0.2: b"g", 0.5: b"-", 0.6: b"z", **held(DOWN, 1.0, 1.0), late + 10: b"w", late + 11: b"q"}
    bench = Bench(tmp_path, keys)
    bench.console.patience = late + 30.0
    sleep, parked = bench.console.sleep, list[float]()

    def look(duration: float) -> None:
        sleep(duration)
        if late + 5.0 < bench.console.now < late + 10.0:
            parked.append(bench.shafts[-1, 0])

    assert calibrate(bench.session, bench.console.clock, look) == 0
    assert any(names(said, "no key", "5 minutes", "servos", "kept") for said in bench.console.said)
    flat = read_calibration(bench.file).servos[0].offset
    assert flat < math.pi - 0.5 * FINE
    assert parked == pytest.approx([flat] * len(parked), abs=1e-3)


def test_a_board_that_must_not_be_driven_ends_it_with_the_reason(tmp_path: Path) -> None:
    bench = Bench(tmp_path, {}, version=9)
    assert bench.run() == 1
    assert_names(bench.console.said[-1], "firmware", "version 9", VERSION, "update")


def test_a_lost_board_is_told_and_comes_back_without_a_jump(tmp_path: Path) -> None:
    bench = Bench(tmp_path, {0.2: b"g", **held(DOWN, 0.5, 0.5), 6.0: b"q"})
    sleep = bench.console.sleep

    def step(duration: float) -> None:
        sleep(duration)
        bench.port.fault = Fault.UNPLUGGED if 2.0 < bench.console.now < 3.0 else None

    calibrate(bench.session, bench.console.clock, step)
    assert any(names(line, "disconnected", "mock", "lost") for line in bench.console.lines)
    assert np.abs(np.diff(bench.shafts, axis=0)).max() <= SPEED * 0.03 + 1e-3


# the pulse range ----------------------------------------------------------------------------------------------

WIDE = {"pulse_range": (5000, 25000)}


def test_the_pulse_range_is_found_slowly_and_written(tmp_path: Path) -> None:
    presses = {1.5 + 0.2 * k: b"+" for k in range(8)}  # 40 us beyond the range known
    keys = {
        0.2: b"g",
        1.0: b"p",
        **presses,
        3.5: b"]",
        3.6: b"p",
        **held(DOWN, 4.0, 2.0),
        7.0: b"w",
        7.1: b"q",
    }
    bench = Bench(tmp_path, keys, **WIDE)
    assert bench.run() == 0
    pulses = np.array(bench.board.history) / 10
    assert pulses[:, 0].max() == 2440 and (pulses[:, 1:] == 2400).all()
    assert np.abs(np.diff(pulses[:, 0])).max() <= SPEED * 1896 / math.pi * 0.03 + 0.5
    found = read_calibration(bench.file).servos
    assert found[0].pulse_range == (544.0, 2440.0)
    assert found[1] == found[2] and found[1].pulse_range == (544.0, 2400.0)
    # what was known before stays where it is
    assert found[0].pulse(0.0) == pytest.approx(2400, abs=0.01)
    assert found[0].pulse(found[0].safe_range[0]) == pytest.approx(ServoCalibration().pulse(-2.1), abs=0.01)
    assert any(names(line, "180 degrees", "2440 us") for line in bench.console.lines)


def test_a_held_key_moves_slowly_stops_at_the_range_known_and_with_space(tmp_path: Path) -> None:
    keys = {0.2: b"g", 1.0: b"p", **held(DOWN, 1.5, 2.0), 3.45: b" ", **held(UP, 5.0, 4.0), 10.0: b"q"}
    bench = Bench(tmp_path, keys, **WIDE)
    bench.run()
    pulses = np.array(bench.board.history)[:, 0] / 10
    assert pulses.min() == pytest.approx(2400 - PULSE_SPEED * 1.95, abs=3 * PULSE_SPEED * TICK)
    assert np.abs(np.diff(pulses)).max() <= PULSE_SPEED * 0.03 + 0.5
    assert pulses[-1] == pulses.max() == 2400


@pytest.mark.parametrize(("key", "end"), [(b"+", 2450.0), (b"-", 700.0)])
def test_no_pulse_is_ever_beyond_what_the_board_tells(tmp_path: Path, key: bytes, end: float) -> None:
    near = Calibration(
        (ServoCalibration(offset=math.pi / 2, pulse_range=(720.0, 2430.0), safe_range=(-1, 1)),) * 3
    )
    go = {1.2 + 0.02 * k: UP if key == b"+" else DOWN for k in range(1200)}
    press = {26.0 + 0.02 * k: key for k in range(300)}
    bench = Bench(
        tmp_path, {0.2: b"g", 1.0: b"p", **go, **press, 33.0: b"q"}, known=near, pulse_range=(7000, 24500)
    )
    assert bench.run() == 0  # the mock would have refused it, which ends in a fault
    pulses = np.array(bench.board.history)[:, 0] / 10
    assert (pulses.max() if key == b"+" else pulses.min()) == end
    assert np.abs(np.diff(pulses)).max() <= PULSE_STEP
    which = "no longer pulse" if key == b"+" else "no shorter pulse"
    assert any(names(line, "board", which) for line in bench.console.lines)


def test_a_board_that_tells_no_range_lets_none_be_found(tmp_path: Path) -> None:
    bench = Bench(tmp_path, {0.2: b"p", 1.0: b"g", 2.0: b"p", 2.5: b"+", 4.0: b"q"}, protocol="legacy")
    bench.port.board = None
    bench.run()
    assert any(names(line, "nothing moves", "g begins") for line in bench.console.lines)
    assert any(names(line, "refused", "board", "protocol framed") for line in bench.console.lines)
    assert not bench.session.calibrator.finds_range


def test_a_board_with_a_smaller_range_than_the_known_one_is_refused_unmoved(tmp_path: Path) -> None:
    bench = Bench(tmp_path, {0.2: b"g", 1.0: b"p"}, pulse_range=(6000, 24000))
    assert bench.run() == 1
    assert_names(bench.console.said[-1], "servo_0", "544.0 us", "0 rad", "600 to 2400 us")
    assert bench.board.history == []


def test_a_board_that_comes_back_with_a_smaller_range_makes_no_pulse_beyond_it(tmp_path: Path) -> None:
    presses = {1.5 + 0.2 * k: b"+" for k in range(8)}
    bench = Bench(tmp_path, {0.2: b"g", 1.0: b"p", **presses}, **WIDE)
    before: list[object] = []

    def step(duration: float) -> None:
        bench.console.sleep(duration)
        bench.port.fault = Fault.UNPLUGGED if 4.0 < bench.console.now < 4.5 else None
        if bench.port.fault:
            bench.board.pulse_range = (5440, 24200)
            before[:] = bench.board.history

    assert calibrate(bench.session, bench.console.clock, step) == 1
    assert_names(bench.console.said[-1], "board refuses", "servo_0", "range", "tripod flash")
    assert bench.board.history == before


# the rule -----------------------------------------------------------------------------------------------------


def make(known: Calibration | None = None) -> Calibrator:
    return Calibrator(Calibration() if known is None else known, (500.0,) * 3, (2500.0,) * 3)


def test_a_reversed_servo_turns_the_other_way_for_the_same_key() -> None:
    rule = make(Calibration((ServoCalibration(offset=1.0, direction=1, safe_range=(-0.5, 0.5)),) * 3))
    rule.press("+", 0.0)
    assert rule.shafts[0] == pytest.approx(1.0 + FINE)
    rule.press("r", 0.0)
    rule.press("+", 0.0)
    assert rule.shafts[0] == pytest.approx(1.0)
    assert rule.calibration().servos[0].direction == -1
    assert rule.calibration().servos[0].safe_range == pytest.approx((-0.5, 0.5))


def test_ends_beyond_each_other_are_refused() -> None:
    rule = make(Calibration((ServoCalibration(offset=1.0, safe_range=(-0.5, 0.5)),) * 3))
    for _ in range(100):
        rule.press("+", 0.0)
    before = rule.calibration()
    rule.press("[", 0.0)
    assert_names(rule.notice, "refused", "other end")
    assert rule.calibration() == before and not rule.changed


def test_shafts_stay_within_their_reach() -> None:
    rule = Calibrator(Calibration(), (1000.0,) * 3, (2000.0,) * 3)
    assert rule.pulses == [2000.0] * 3
    for _ in range(300):
        rule.press("-", 0.0)
    assert rule.pulses == [1000.0, 2000.0, 2000.0]
    rule = make()
    for _ in range(100):
        rule.press("+", 0.0)
    assert rule.pulses[0] == 2400.0


def test_no_key_moves_a_shaft_to_a_pulse_that_the_board_does_not_make() -> None:
    for finds_range in (False, True):
        rule, now = make(), 0.0
        rule.board((1000.0, 2300.0))
        if finds_range:
            rule.press("p", 0.0)
        for key, end in (("-", 1000.0), ("down", 1000.0), ("+", 2300.0), ("up", 2300.0)):
            for _ in range(400):
                now += 0.15
                rule.press(key, now)
            assert rule.pulses[0] == end


def test_a_pulse_range_that_is_no_calibration_is_refused_and_changes_nothing() -> None:
    rule = make()
    rule.board((500.0, 2500.0))
    rule.press("p", 0.0)
    before = rule.calibration()
    rule.press("[", 0.0)  # 0 degrees where 180 are
    assert_names(rule.notice, "refused", "pulse_range[1]", "2400 us", "pulse_range[0] + 200", "2600 us")
    assert rule.calibration() == before and not rule.changed
    assert not rule.press("z", 0.0)  # means nothing in this step
    assert rule.calibration() == before


def test_a_shorter_range_keeps_what_was_found_within_it_and_never_widens_what_is_safe() -> None:
    rule = make()
    rule.board((500.0, 2500.0))
    rule.press("p", 0.0)
    for k in range(20):
        rule.press("-", PULSE_PAUSE * k + 1e-6 * k)
    assert rule.pulses[0] == pytest.approx(2300.0)
    rule.press("]", 10.0)
    servo = rule.calibration().servos[0]
    assert servo.pulse_range == pytest.approx((544.0, 2300.0))
    safe = sorted(servo.pulse(angle) for angle in servo.safe_range)
    assert safe == pytest.approx([ServoCalibration().pulse(-2.1), 2300.0])
    assert rule.changed


def test_a_key_that_repeats_fast_steps_slowly_and_another_servo_ends_the_step() -> None:
    rule = make()
    rule.board((500.0, 2500.0))
    rule.press("p", 0.0)
    for k in range(1001):
        rule.press("-", 0.001 * k)
    assert 2400.0 - PULSE_STEP * (1.0 / PULSE_PAUSE + 1) - 1e-9 <= rule.pulses[0] < 2400.0 - 8 * PULSE_STEP
    rule.press("1", 2.0)
    assert not rule.finds_range
    place = rule.pulses[0]
    rule.press("p", 2.0)
    rule.press("-", 3.0)
    assert rule.pulses[0] == place and rule.pulses[1] == 2395.0


def test_leaving_the_step_beyond_the_range_found_moves_nothing_outward() -> None:
    rule = make()
    rule.board((500.0, 2500.0))
    rule.press("p", 0.0)
    for k in range(4):
        rule.press("+", 1.0 + k)
    rule.press("p", 6.0)
    assert rule.pulses[0] == 2420.0
    rule.press("+", 7.0)
    assert rule.pulses[0] == 2420.0
    rule.press("z", 8.0)
    assert_names(rule.notice, "refused", "offset", "rad")
    rule.press("-", 9.0)
    assert rule.pulses[0] == pytest.approx(2420.0 - FINE * 1856 / math.pi)


# the command --------------------------------------------------------------------------------------------------


def test_what_cannot_begin_is_told_in_one_line(tmp_path: Path, capsys, monkeypatch) -> None:
    def attempt(port: str = "mock", file: Path = tmp_path / "c.yaml", protocol: str = "framed") -> str:
        assert calibrate_command(port, file, protocol=protocol, baud=0, boot_time=0.0) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1 and said.startswith("tripod calibrate: ")
        return said

    assert_names(attempt(port="ttyUSB0"), "port 'ttyUSB0'", "mock, pty, auto", "/dev/ttyACM0")
    assert_names(attempt(protocol="x"), "protocol 'x'", "framed", "legacy", "ascii")
    bad = tmp_path / "bad.yaml"
    bad.write_text("servos: 3")
    assert_names(attempt(file=bad), "bad.yaml", "servos is 3", "table")
    monkeypatch.setattr("sys.stdin", None)
    assert_names(attempt(), "needs", "terminal")


def test_a_file_of_winches_is_refused_and_kept(tmp_path: Path, capsys) -> None:
    file = tmp_path / "robot.yaml"
    text = calibration_text(Calibration((), {"left": WinchCalibration()}))
    file.write_text(text)
    assert calibrate_command("mock", file, protocol="framed", baud=0, boot_time=0.0) == BAD_ARGUMENTS
    assert_names(capsys.readouterr().err, "tripod calibrate", str(file), "left", "drum")
    assert file.read_text() == text
