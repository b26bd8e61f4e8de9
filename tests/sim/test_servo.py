"""The servo effect: ramp, staircase, dead band, stall, and a coupling that is stable at every step."""

import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from tests.memory import kept
from tests.messages import assert_names, names, raises_naming
from tests.scenes import SHARP
from tripod_sim import SceneError, Simulation, StepError, load_scene
from tripod_sim.robot.servo import ServoMotion
from tripod_sim.tables.robot import ServoDynamics
from tripod_study.run import run

COARSE = ["mesh.level=1"]
REAL = [*COARSE, "servo_dynamics={}"]
S90 = ServoDynamics()
QUARTER = -np.pi / 4
WORKING = [-1.4965, -1.4965, -1.4965, 0.035]


def turn(dynamics: ServoDynamics, commands: np.ndarray, load: np.ndarray, dt: float) -> np.ndarray:
    """Angles of servos after each step under a constant torque on the body, from rest at 0; commands (steps, s)."""
    motion = ServoMotion(dynamics, len(load))
    angles = np.zeros(len(load))
    servos, found = motion.start(angles), []
    for command in commands:
        angles = motion.advance(servos, angles, command, load, dt)
        found.append(angles)
    return np.array(found)


# the rule -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dt", [0.001, 0.007, 0.02, 0.05])
@pytest.mark.parametrize("share", [-2.0, 0.0, 0.4, 0.9])
def test_a_step_is_answered_by_the_ramp_of_the_torque_speed_line(dt: float, share: float) -> None:
    """angle(t) = u0 (1 - L / T) t up to the edge of the dead band; a load that helps does not drive it faster."""
    for sign in (1, -1):
        found = turn(S90, np.full((60, 1), sign * 0.8), np.array([sign * share * S90.stall_torque]), dt)[:, 0]
        speed = S90.speed * min(1.0, 1 - share)
        ramp = np.minimum(speed * dt * np.arange(1, 61), 0.8 - S90.dead_band)
        np.testing.assert_allclose(found, sign * ramp, rtol=0, atol=1e-12)
        assert found[0] * sign > 0


def test_servos_with_different_loads_do_not_mix() -> None:
    load = np.array([0.0, 0.5, -0.3]) * S90.stall_torque
    found = turn(S90, np.full((5, 3), [1.0, 1.0, -1.0]), load, 0.002)
    np.testing.assert_allclose(found[-1], 0.01 * S90.speed * np.array([1.0, 0.5, -0.7]), rtol=1e-12)


@pytest.mark.parametrize("dt", [0.001, 0.003, 0.007])
def test_commands_are_seen_at_pulses_only(dt: float) -> None:
    """A fast servo without load stands on the command of the step in which the last pulse came: a 50 Hz staircase."""
    fast = replace(S90, speed=1000.0, dead_band=0.0)
    commands = np.linspace(0.1, 1.0, 90)[:, None]
    found = turn(fast, commands, np.zeros(1), dt)[:, 0]
    end = dt * np.arange(1, 91)
    arrived = np.array(
        [np.floor((t - 1e-9) / fast.refresh) * fast.refresh for t in end]
    )  # the pulse before the end
    seen = commands[np.minimum(np.floor(arrived / dt + 1e-6).astype(int), 89), 0]
    settled = end - arrived > 2e-3  # at 1000 rad/s the move itself takes under 1 ms
    np.testing.assert_allclose(found[settled], seen[settled], rtol=0, atol=1e-12)
    assert len(np.unique(found[settled].round(9))) == len(np.unique(arrived[settled].round(9)))


def test_a_command_within_the_dead_band_moves_nothing_and_one_just_outside_does() -> None:
    commands = np.array([[0.99, 1.01, -0.99, -1.01]]) * S90.dead_band
    found = turn(S90, np.repeat(commands, 40, axis=0), np.zeros(4), 0.005)[-1]
    np.testing.assert_allclose(found, [0, 0.01 * S90.dead_band, 0, -0.01 * S90.dead_band], rtol=0, atol=1e-15)


def test_at_and_beyond_the_stall_torque_the_gear_holds() -> None:
    load = np.array([1.0, 1.5, 3.0]) * S90.stall_torque
    found = turn(S90, np.full((40, 3), 1.0), load, 0.005)
    assert (found == 0).all()


def test_the_torque_at_which_it_counts_as_stalled() -> None:
    motion, angles = ServoMotion(S90, 3), np.zeros(3)
    servos = motion.start(angles)
    servos.pulse[:] = [0.3, -0.3, 0.0]
    t = S90.stall_torque
    assert [s.servo for s in motion.stalled(servos, angles, np.array([0.97, 0.97, 0.99]) * t)] == []
    both = motion.stalled(servos, angles, np.array([0.99, -0.99, -1.01]) * t)
    assert [s.servo for s in both] == [0, 1, 2]
    assert both[1].load == pytest.approx(0.99 * t)
    assert_names(both[1], "servo_1", "load", "0.168 N m", "stall torque", "0.170 N m", "0.300 rad")
    assert motion.stalled(servos, angles, np.array([-2.0, 2.0, 0.0]) * t) == ()  # loads that help


# in a simulation ------------------------------------------------------------------------------------------------


def follow(simulation: Simulation, goal: list[float], seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Angles and torques after each step, the slide reached in 0.3 s."""
    dt, angles, torques = simulation.scene.dt, [], []
    for k in range(round(seconds / dt)):
        simulation.step(np.array([*goal[:3], goal[3] * min(1.0, (k + 1) * dt / 0.3)]))
        angles.append(simulation.state.joints[:-1].copy())
        torques.append(simulation.efforts.copy())
    return np.array(angles), np.array(torques)


def test_without_load_the_robot_follows_the_ramp() -> None:
    """A piece a million times softer and lighter: 10.47 rad/s from the first step to the dead band."""
    soft = ["material.young=0.25", "material.mass=3.2e-8", "solver.tolerance=1e-10"]
    simulation = Simulation(load_scene(SHARP, [*REAL, *soft]))
    angles, _ = follow(simulation, [-0.5, -0.5, -0.5, 0.0], 0.1)
    ramp = np.minimum(S90.speed * 0.005 * np.arange(1, 21), 0.5 - S90.dead_band)
    np.testing.assert_allclose(angles, -np.tile(ramp[:, None], 3), atol=1e-4)


def test_it_moves_into_the_working_pose() -> None:
    simulation = Simulation(load_scene(SHARP, REAL))
    angles, torques = follow(simulation, WORKING, 0.8)
    np.testing.assert_allclose(angles[-1], -1.4965 + S90.dead_band, atol=1e-9)
    np.testing.assert_allclose(torques[-1], -0.14, atol=0.006)
    assert simulation.report.stalled == ()


SCHEMES = {
    "implicit Euler": [],
    "no damping": ["damping.stiffness=0.0"],
    "stiff damping": ["damping.stiffness=0.05"],
    "TR-BDF2": ["inertia.scheme=tr_bdf2"],
    "quasi-static": ["damping=off", "inertia=off"],
}


@pytest.mark.parametrize("dt", [0.001, 0.005, 0.02])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_it_stalls_where_the_load_is_the_stall_torque_at_any_step(dt: float, scheme: str) -> None:
    """L2 needs 0.5 N m: at every dt and scheme it rests at the same angle, at the stall torque, without chatter.

    With TR-BDF2, which takes least from a swing, the body swings on, and the gear holds where that lightens it.
    """
    swings = scheme == "TR-BDF2"
    near, most = (2.5e-3, 1.03) if swings else (1e-3, 1.02)
    simulation = Simulation(load_scene(SHARP, [*REAL, *SCHEMES[scheme], f"dt={dt}"]))
    angles, torques = follow(simulation, [QUARTER] * 3 + [0.0], 1.2 if scheme == "stiff damping" else 0.6)
    np.testing.assert_allclose(angles[-1], -0.1911, atol=near)
    np.testing.assert_allclose(torques[-1], -S90.stall_torque, rtol=0.01)
    assert (np.diff(angles[:, 0]) <= 1e-12).all()  # one way only
    assert np.abs(torques).max() < most * S90.stall_torque
    assert np.abs(np.diff(angles, axis=0)).max() <= S90.speed * dt * (1 + 1e-9)
    stalled = simulation.report.stalled
    assert [s.servo for s in stalled] == [0, 1, 2]
    assert stalled[0].load == pytest.approx(S90.stall_torque, rel=0.01)
    assert stalled[0].short == pytest.approx(QUARTER + 0.1911, abs=near)


def test_the_path_converges_with_the_step() -> None:
    """The angle 40 ms after a command, on the way: an error of the first order in dt."""
    reached = []
    for dt in (0.004, 0.002, 0.001, 0.0005):
        simulation = Simulation(load_scene(SHARP, [*REAL, f"dt={dt}", "inertia=off", "damping=off"]))
        reached.append(follow(simulation, [QUARTER, 0.0, 0.0, 0.0], 0.04)[0][-1, 0])
    steps = np.abs(np.diff(reached))
    assert steps[-1] > 1e-6
    assert np.log2(steps[:-1] / steps[1:]) == pytest.approx(1.0, abs=0.5)


def test_a_stall_is_in_the_summary_of_a_run() -> None:
    words = f"0:0,0,0; 0.01:{QUARTER},{QUARTER},0"
    summary = json.loads(json.dumps(run("tripod", servo=words, duration=0.5, overrides=REAL)))
    assert [s["servo"] for s in summary["stalled"]] == [0, 1]
    assert summary["stalled"][0]["stall_torque"] == S90.stall_torque
    assert 0.2 < summary["stalled_time"][0] < 0.5
    assert summary["stalled_time"][2] == 0
    ideal = run("tripod", servo=words, duration=0.02, overrides=COARSE)
    assert (ideal["stalled"], ideal["stalled_time"]) == ([], [0, 0, 0])


def test_no_command_keeps_the_last_one() -> None:
    a, b = (Simulation(load_scene(SHARP, REAL)) for _ in range(2))
    goal = np.array([-0.1, -0.12, 0.05, 0.0])
    for k in range(30):
        a.step(goal)
        b.step(goal if k == 0 else None)
    assert a.state.positions.tobytes() == b.state.positions.tobytes()
    np.testing.assert_array_equal(b.command, goal)
    assert abs(b.state.joints[0] - goal[0]) > 0.5 * S90.dead_band


def motion(simulation: Simulation, steps: int = 25) -> bytes:
    found = b""
    for k in range(steps):
        simulation.step(np.array([-0.02 * k, 0.01 * k, -0.015 * k, 0.0002 * k]))
        found += simulation.state.positions.tobytes() + simulation.efforts.tobytes()
    return found


def test_reset_brings_back_the_same_motion_from_the_middle_of_a_pulse() -> None:
    simulation = Simulation(load_scene(SHARP, [*REAL, "dt=0.003"]))
    first = motion(simulation)
    assert 0 < simulation.state.servos.clock < S90.refresh
    simulation.reset()
    assert simulation.state.servos.clock == S90.refresh
    assert not simulation.state.servos.speed.any()
    assert motion(simulation) == first
    assert motion(Simulation(load_scene(SHARP, [*REAL, "dt=0.003"]))) == first


def test_asking_for_the_compliance_changes_nothing() -> None:
    a, b = (Simulation(load_scene(SHARP, REAL)) for _ in range(2))
    for k in range(20):
        goal = np.array([-0.02 * k, 0.01 * k, 0.0, 0.0])
        a.step(goal)
        b.step(goal)
        np.testing.assert_array_equal(b.compliance().angles, b.state.joints[:-1])
    assert a.state.positions.tobytes() == b.state.positions.tobytes()
    assert a.state.servos.speed.tobytes() == b.state.servos.speed.tobytes()


def test_a_step_that_fails_leaves_the_servos_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation, other = (Simulation(load_scene(SHARP, REAL)) for _ in range(2))
    goal = np.array([-0.3, -0.3, 0.2, 0.0])
    for s in (simulation, other):
        for _ in range(5):
            s.step(goal)
    before = simulation.state.servos.copy()

    def fail(*_: object) -> None:
        raise StepError("element 3 is crushed")

    with monkeypatch.context() as patch:
        patch.setattr(simulation._stepper, "step", fail)
        with pytest.raises(StepError):
            simulation.step(-goal)
    for name in ("command", "pulse", "speed"):
        np.testing.assert_array_equal(getattr(simulation.state.servos, name), getattr(before, name))
    assert simulation.state.servos.clock == before.clock
    for s in (simulation, other):
        for _ in range(5):
            s.step(goal)
    assert simulation.state.positions.tobytes() == other.state.positions.tobytes()


# present and absent ---------------------------------------------------------------------------------------------


def test_added_and_removed_again_the_servos_are_ideal_bit_for_bit() -> None:
    def bits(overrides: list[str]) -> bytes:
        return motion(Simulation(load_scene(SHARP, [*COARSE, *overrides])))

    ideal = bits([])
    assert bits(["servo_dynamics={}"]) != ideal
    assert bits(["servo_dynamics={}", "servo_dynamics=off"]) == ideal


def test_absent_it_is_not_imported_and_holds_no_state() -> None:
    code = (
        "import sys; from tripod_sim import Simulation, load_scene;"
        "s = Simulation(load_scene('tripod', ['mesh.level=1', *sys.argv[1:]])); s.step();"
        "print('tripod_sim.robot.servo' in sys.modules, s.state.servos is None)"
    )
    for extra, expected in (([], "False True"), (["servo_dynamics={}"], "True False")):
        done = subprocess.run(
            [sys.executable, "-c", code, *extra], check=True, capture_output=True, text=True
        )
        assert done.stdout.strip() == expected


def test_a_steady_step_allocates_no_growing_memory() -> None:
    simulation = Simulation(load_scene(SHARP, REAL))
    goal = np.array([QUARTER, QUARTER, QUARTER, 0.0])
    assert kept(simulation.step, [goal] * 60) < 4_000


@pytest.mark.parametrize(
    ("word", "named"),
    [
        ("servo_dynamics.speed=0.0", ("servo_dynamics.speed", "0.0", "above 0 rad/s")),
        ("servo_dynamics.refresh=0.0", ("servo_dynamics.refresh", "0.0", "at least 0.0001 s")),
        ("servo_dynamics.dead_band=-0.1", ("servo_dynamics.dead_band", "-0.1", "at least 0 rad")),
        ("servo_dynamics.stall_torque=nan", ("servo_dynamics.stall_torque", "nan")),
        ("servos=off", ("servo_dynamics", "servos")),
    ],
)
def test_bad_values_are_refused_by_name(word: str, named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named):
        load_scene(SHARP, ["servo_dynamics={}", word])


# in the graph ---------------------------------------------------------------------------------------------------


@pytest.mark.ros
@pytest.mark.parametrize("real", [True, False])
def test_the_node_names_a_stalled_servo_in_status_and_diagnostics(domain: int, real: bool) -> None:
    """The servos start at -45 degrees, with 0.5 N m each: more than a real one holds."""
    rclpy = pytest.importorskip("rclpy")
    pytest.importorskip("tripod_msgs")
    from tripod_graph.diagnostics import Level
    from tripod_graph.run import ros_arguments
    from tripod_runtime.node import SimNode

    words = ["mesh.level=1", "clamp=off", f"servos.angles=[{QUARTER},{QUARTER},{QUARTER}]"]
    words += ["servo_dynamics={}"] if real else []
    rclpy.init(args=ros_arguments([f"set:={';'.join(words)}"]), domain_id=domain)
    try:
        node = SimNode()
        try:
            node._physics.pause(True, 60.0)
            assert node._physics.request_steps(3, 60.0) == 3
            message, (level, text, _) = node._status_message().message, node._report()
            stalled = [servo.servo for servo in node._physics.latest.report.stalled]
        finally:
            node.close()
            node.destroy_node()
    finally:
        rclpy.shutdown()
    assert stalled == ([0, 1, 2] if real else [])
    if real:
        for i in range(3):
            assert names(message, f"servo_{i}", "stalled")
            assert re.search(rf"servo_{i}\b[^;]*\b0\.5\d* N m", message)
        assert (level, text) == (Level.WARN, message)
    else:
        assert message == ""
        assert not names(text, "servo_0")
