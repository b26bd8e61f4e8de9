"""What the page says of the states of the other nodes."""

from types import SimpleNamespace

import numpy as np
import pytest

from tripod_graph.mandate import Mandate
from tripod_graph.mode import Decision, Mode
from tripod_view import words
from tripod_view.words import Light, Line


def sim(**values: object) -> SimpleNamespace:
    fields = {"state": 0, "message": "", "dt": 0.002, "real_time_factor": 1.0, "step_time_median": 0.0005}
    return SimpleNamespace(**(fields | values))


def ik(**values: object) -> SimpleNamespace:
    fields = {"state": 1, "message": "", "error": 0.00012, "active_limits": [], "solver_status": "solved"}
    return SimpleNamespace(**({"effector_mesh_error": -1.0} | fields | values))


def robot(**values: object) -> SimpleNamespace:
    return SimpleNamespace(**({"state": 3, "message": "", "port": "mock", "packets_sent": 12} | values))


def mode_line(mode: Mode, source: str, now: float = 0.0) -> Line:
    """Return what the page '/view#1' says after that decision, at `now` [s]."""
    mandate = Mandate("/view#1")
    mandate.tracker.hear(Decision(mode, source), 100.0, 0.0)
    mandate.tracker.lapse(now)
    return words.mode_line(mandate)


@pytest.mark.parametrize(
    ("line", "light", "text"),
    [
        (words.sim_line(sim()), Light.GOOD, "real time: 1.00 x, step 0.50 of 2 ms"),
        (words.sim_line(sim(real_time_factor=0.62)), Light.WATCH, "slower than real time: 0.62 x"),
        (words.sim_line(sim(real_time_factor=float("nan"))), Light.WATCH, "slower than real time"),
        (words.sim_line(sim(state=1)), Light.WATCH, "paused"),
        (words.sim_line(sim(state=2)), Light.WATCH, "holds"),
        (words.sim_line(sim(state=3)), Light.GOOD, "parked"),
        (words.sim_line(sim(state=4, message="node 7 inverted")), Light.BAD, "failed: node 7 inverted"),
        (words.sim_line(sim(state=77)), Light.BAD, "unknown state 77"),
        (words.ik_line(ik(state=0)), Light.OFF, "idle"),
        (words.ik_line(ik()), Light.GOOD, "following, 0.12 mm off"),
        (
            words.ik_line(ik(effector_mesh_error=9.04e-5)),
            Light.GOOD,
            "following, 0.12 mm off, mesh 0.09 mm (estimated)",
        ),
        (
            words.ik_line(ik(state=2, error=0.003, active_limits=["servo_0 angle max"])),
            Light.WATCH,
            "target out of reach: 3.00 mm off (at limit: servo_0 angle max)",
        ),
        (words.ik_line(ik(state=3)), Light.WATCH, "no fresh data"),
        (words.ik_line(ik(state=4, solver_status="infeasible")), Light.BAD, "solver failed: infeasible"),
        (
            words.robot_line(robot(port="/dev/ttyACM0")),
            Light.GOOD,
            "follows commands (/dev/ttyACM0, 12 packets)",
        ),
        (words.robot_line(robot()), Light.OFF, "no robot connected"),
        (
            words.robot_line(robot(state=0, message="no port: plug it in")),
            Light.OFF,
            "not connected: no port: plug it in",
        ),
        (words.robot_line(robot(state=6, message="x")), Light.BAD, "fault: x"),
        (mode_line(Mode.TELEOP, "/view#1"), Light.GOOD, "the sliders command"),
        (mode_line(Mode.TELEOP, "/teleop#1"), Light.GOOD, "the keyboard commands"),
        (mode_line(Mode.STOP, ""), Light.OFF, "nobody commands yet"),
        (mode_line(Mode.STOP, "/teleop#1"), Light.BAD, "all commands off"),
        (mode_line(Mode.IK, "/path#2", 2.0), Light.BAD, "path is silent: the servos hold, then park"),
    ],
)
def test_states_in_plain_words(line: Line, light: Light, text: str) -> None:
    assert line.light is light
    assert text in line.text


def test_every_state_of_every_message_has_words() -> None:
    msgs = pytest.importorskip("tripod_msgs.msg")
    for message, line, make in (
        (msgs.SimStatus, words.sim_line, sim),
        (msgs.IkStatus, words.ik_line, ik),
        (msgs.RobotStatus, words.robot_line, robot),
    ):
        constants = message.__class__.__prepare__(message.__name__, ())
        states = {k: v for k, v in constants.items() if k.isupper() and isinstance(v, int)}
        assert len(states) >= 5
        for value in states.values():
            assert "unknown" not in line(make(state=value)).text


@pytest.mark.parametrize(
    ("age", "text"),
    [(None, "not heard yet"), (0.2, None), (words.SILENT + 0.1, "silent for 2 s"), (61.0, "silent for 61 s")],
)
def test_silence_is_said(age: float | None, text: str | None) -> None:
    line = words.silence("Robot", age)
    assert (None if line is None else line.text) == text


@pytest.mark.parametrize(
    ("age", "mode", "text"),
    [
        (0.1, Mode.IK, None),
        (None, Mode.TELEOP, "off: the mode is not IK"),
        (9.0, Mode.STOP, "off: the mode is not IK"),
        (None, Mode.IK, "does not answer"),
        (9.0, Mode.IK, "silent for 9 s"),
    ],
)
def test_inverse_kinematics_is_silent_by_right_outside_its_mode(
    age: float | None, mode: Mode, text: str | None
) -> None:
    line = words.ik_silence(age, mode)
    assert (None if line is None else line.text) == text


def test_target_and_effector_in_millimetres() -> None:
    lines = words.target_lines(np.array([0.001, -0.00001, -0.008]), np.array([0.001, 0.00299, -0.004]))
    assert [line.text for line in lines] == ["x 1.0, y 0.0, z -8.0 mm", "x 1.0, y 3.0, z -4.0 mm", "5.00 mm"]
    assert [line.text for line in words.target_lines(None, None)] == ["not known yet", "not known yet"]


@pytest.mark.parametrize(
    ("arguments", "light", "text"),
    [
        ((1, 30.0, (0, ""), (0, "")), Light.GOOD, "30 pictures/s, 1 browser"),
        ((2, 29.6, (0, ""), (0, "")), Light.GOOD, "30 pictures/s, 2 browsers"),
        (
            (1, 0.0, (4, "node 1 is not finite"), (0, "")),
            Light.WATCH,
            "4 body states skipped (node 1 is not finite)",
        ),
        ((1, 0.0, (0, ""), (3, "sim/mesh: x")), Light.WATCH, "3 messages refused (sim/mesh: x)"),
    ],
)
def test_the_page_reports_what_it_skipped(arguments: tuple, light: Light, text: str) -> None:
    line = words.page_line(*arguments)
    assert line.light is light
    assert text in line.text


@pytest.mark.parametrize(
    ("values", "line"),
    [
        (
            {"load [N]": "0.1962", "load, half of 90 % [N]": "0.00981"},
            Line(Light.GOOD, "Load", "20.0 ± 1.0 g"),
        ),
        ({"load [N]": "-0.002", "load, half of 90 % [N]": "0.00981"}, Line(Light.GOOD, "Load", "-0.2 ± 1.0 g")),
        (
            {"load [N]": "-0.2", "load, half of 90 % [N]": "0.01"},
            Line(Light.WATCH, "Load", "pushed up by 0.200 ± 0.010 N: something is touched?"),
        ),
        (
            {"load [N]": "0.05", "load, half of 90 % [N]": "0.01", "push along x and y [N]": "0.1 -0.203"},
            Line(Light.WATCH, "Load", "pushed by x +0.100, y -0.203, z -0.050 N: something is touched?"),
        ),
        (
            {"load [N]": "not told", "load, half of 90 % [N]": "not told"},
            Line(Light.OFF, "Load", "not told"),
        ),
        (
            {"expected error [m]": "0.0001 -2e-05 0.00031", "expected error, half of 90 % [m]": "5e-5 6e-5 2e-4"},
            Line(Light.GOOD, "Expected error", "x +0.10 ± 0.05, y -0.02 ± 0.06, z +0.31 ± 0.20 mm (90 %)"),
        ),
        (
            {"expected error [m]": "not told: the robot moves"},
            Line(Light.OFF, "Expected error", "not told: the robot moves"),
        ),
        ({"expected error [m]": "nan 0 0", "expected error, half of 90 % [m]": "1 1 1"},
         Line(Light.OFF, "Expected error", "nan 0 0")),
    ],
)  # fmt: skip
def test_load_and_expected_error_are_told(values: dict[str, str], line: Line) -> None:
    assert words.ik_value_lines(values) == [line]


def test_of_load_and_error_nothing_is_said_where_nobody_asks() -> None:
    assert words.ik_value_lines({"state": "IDLE"}) == []
