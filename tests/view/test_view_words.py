"""What the page says of the states of the other nodes."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.messages import assert_names, names
from tripod_graph.authority import OperatorAuthority
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
    authority = OperatorAuthority("/view#1")
    authority.tracker.hear(Decision(mode, source), 100.0, 0.0)
    authority.tracker.lapse(now)
    return words.mode_line(authority)


@pytest.mark.parametrize(
    ("line", "light", "named"),
    [
        (words.sim_line(sim()), Light.GOOD, ("real time", "1.00 x", "0.50 of 2 ms")),
        (words.sim_line(sim(real_time_factor=0.62)), Light.WATCH, ("slower", "0.62 x", "0.50 of 2 ms")),
        (words.sim_line(sim(real_time_factor=float("nan"))), Light.WATCH, ("slower", "nan x")),
        (words.sim_line(sim(real_time_factor=0.5), 0.5), Light.GOOD, ("chosen 0.5 x", "0.50 x")),
        (words.sim_line(sim(real_time_factor=0.3), 0.5), Light.WATCH, ("slower", "chosen 0.5 x", "0.30 x")),
        (words.sim_line(sim(real_time_factor=1.3), 2.0), Light.WATCH, ("slower", "chosen 2 x", "1.30 x")),
        (words.sim_line(sim(real_time_factor=0.3), 0.0), Light.GOOD, ("0.30 x",)),
        (words.sim_line(sim(state=1)), Light.WATCH, ("paused",)),
        (words.sim_line(sim(state=2)), Light.WATCH, ("holds", "commands")),
        (words.sim_line(sim(state=3)), Light.GOOD, ("parked", "commands")),
        (words.sim_line(sim(state=4, message="node 7 inverted")), Light.BAD, ("failed", "node 7 inverted")),
        (words.sim_line(sim(state=77)), Light.BAD, ("unknown", 77)),
        (words.ik_line(ik(state=0)), Light.OFF, ("idle",)),
        (words.ik_line(ik()), Light.GOOD, ("following", "0.12 mm")),
        (
            words.ik_line(ik(effector_mesh_error=9.04e-5)),
            Light.GOOD,
            ("0.12 mm", "mesh 0.09 mm", "estimated"),
        ),
        (
            words.ik_line(ik(state=2, error=0.003, active_limits=["servo_0 angle max"])),
            Light.WATCH,
            ("out of reach", "3.00 mm", "servo_0 angle max"),
        ),
        (words.ik_line(ik(state=3)), Light.WATCH, ("no fresh data", "simulator")),
        (words.ik_line(ik(state=4, solver_status="infeasible")), Light.BAD, ("solver", "infeasible")),
        (words.ik_line(ik(state=5, error=2e-3)), Light.WATCH, ("closer pose", "2.00 mm")),
        (
            words.robot_line(robot(port="/dev/ttyACM0")),
            Light.GOOD,
            ("follows commands", "/dev/ttyACM0", "12 packets"),
        ),
        (words.robot_line(robot()), Light.OFF, ("no robot",)),
        (
            words.robot_line(robot(state=0, message="no port found")),
            Light.OFF,
            ("not connected", "no port found"),
        ),
        (words.robot_line(robot(state=6, message="x")), Light.BAD, ("fault", "x")),
        (mode_line(Mode.TELEOP, "/view#1"), Light.GOOD, ("sliders",)),
        (mode_line(Mode.TELEOP, "/teleop#1"), Light.GOOD, ("keyboard",)),
        (mode_line(Mode.STOP, ""), Light.OFF, ("nobody",)),
        (mode_line(Mode.STOP, "/teleop#1"), Light.BAD, ("all commands off", "park")),
        (mode_line(Mode.IK, "/path#2", 2.0), Light.BAD, ("path", "silent", "park")),
    ],
)
def test_states_in_plain_words(line: Line, light: Light, named: tuple[object, ...]) -> None:
    assert line.light is light
    assert_names(line.text, *named)


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
        assert names(line(make(state=77)).text, 77)  # one without words is shown by its number
        for value in states.values():
            assert not names(line(make(state=value)).text, value)


@pytest.mark.parametrize(
    ("age", "named"),
    [(None, ("not heard",)), (words.SILENT + 0.1, ("silent", "2 s")), (61.0, ("silent", "61 s"))],
)
def test_silence_is_said(age: float | None, named: tuple[str, ...]) -> None:
    line = words.silence("Robot", age)
    assert line is not None
    assert line.who == "Robot"
    assert_names(line.text, *named)


def test_of_a_node_that_is_heard_no_silence_is_said() -> None:
    assert words.silence("Robot", 0.2) is None


@pytest.mark.parametrize(
    ("age", "mode", "light", "named"),
    [
        (None, Mode.TELEOP, Light.OFF, ("off", "not IK")),
        (9.0, Mode.STOP, Light.OFF, ("off", "not IK")),
        (None, Mode.IK, Light.BAD, ("not answer",)),
        (9.0, Mode.IK, Light.BAD, ("silent", "9 s")),
    ],
)
def test_inverse_kinematics_is_silent_by_right_outside_its_mode(
    age: float | None, mode: Mode, light: Light, named: tuple[str, ...]
) -> None:
    line = words.ik_silence(age, mode)
    assert line is not None
    assert line.light is light
    assert_names(line.text, *named)
    assert words.ik_silence(0.1, Mode.IK) is None


def test_target_and_effector_in_millimetres() -> None:
    lines = words.target_lines(np.array([0.001, -0.00001, -0.008]), np.array([0.001, 0.00299, -0.004]))
    target, effector, distance = (line.text for line in lines)
    assert_names(target, "x 1.0", "y 0.0", "z -8.0 mm")
    assert_names(effector, "x 1.0", "y 3.0", "z -4.0 mm")
    assert_names(distance, "5.00 mm")
    unknown = words.target_lines(None, None)
    assert len(unknown) == 2
    assert all(names(line.text, "not known") for line in unknown)


@pytest.mark.parametrize(
    ("arguments", "light", "named"),
    [
        ((1, 30.0, (0, ""), (0, "")), Light.GOOD, ("30 pictures/s", "1 browser")),
        ((2, 29.6, (0, ""), (0, "")), Light.GOOD, ("30 pictures/s", "2 browsers")),
        ((1, 0.0, (4, "node 1: nan"), (0, "")), Light.WATCH, ("4 body states", "node 1: nan")),
        ((1, 0.0, (0, ""), (3, "sim/mesh: x")), Light.WATCH, ("3 messages", "sim/mesh: x")),
    ],
)
def test_the_page_reports_what_it_skipped(arguments: tuple, light: Light, named: tuple[str, ...]) -> None:
    line = words.page_line(*arguments)
    assert line.light is light
    assert_names(line.text, *named)


LOAD, HALF, PUSH = "load [N]", "load, half of 90 % [N]", "push along x and y [N]"
ERROR, HALF_ERROR = "expected error [m]", "expected error, half of 90 % [m]"


@pytest.mark.parametrize(
    ("values", "light", "who", "named"),
    [
        ({LOAD: "0.1962", HALF: "0.00981"}, Light.GOOD, "Load", ("20.0 ± 1.0 g",)),
        ({LOAD: "-0.002", HALF: "0.00981"}, Light.GOOD, "Load", ("-0.2 ± 1.0 g",)),
        ({LOAD: "-0.2", HALF: "0.01"}, Light.WATCH, "Load", ("up", "0.200 ± 0.010 N", "touched")),
        (
            {LOAD: "0.05", HALF: "0.01", PUSH: "0.1 -0.203"},
            Light.WATCH,
            "Load",
            ("x +0.100", "y -0.203", "z -0.050 N", "touched"),
        ),
        ({LOAD: "not told", HALF: "not told"}, Light.OFF, "Load", ("not told",)),
        (
            {ERROR: "0.0001 -2e-05 0.00031", HALF_ERROR: "5e-5 6e-5 2e-4"},
            Light.GOOD,
            "Expected error",
            ("x +0.10 ± 0.05", "y -0.02 ± 0.06", "z +0.31 ± 0.20 mm", "90 %"),
        ),
        ({ERROR: "not told: it moves"}, Light.OFF, "Expected error", ("not told: it moves",)),
        ({ERROR: "nan 0 0", HALF_ERROR: "1 1 1"}, Light.OFF, "Expected error", ("nan 0 0",)),
    ],
)
def test_load_and_expected_error_are_told(
    values: dict[str, str], light: Light, who: str, named: tuple[str, ...]
) -> None:
    (line,) = words.ik_value_lines(values)
    assert (line.light, line.who) == (light, who)
    assert_names(line.text, *named)


def test_of_load_and_error_nothing_is_said_where_nobody_asks() -> None:
    assert words.ik_value_lines({"state": "IDLE"}) == []
