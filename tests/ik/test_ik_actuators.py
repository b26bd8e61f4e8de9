"""Inverse kinematics of cables, chambers, forces and servos, and of effectors that are no discs."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares

from benchmarks.ik_actuators import MET, measure, scene_of
from tests.messages import assert_names, raises_naming
from tripod_ik.errors import IkError
from tripod_ik.model import StaticModel, linear_state
from tripod_ik.problem import LEAST_STEP, LONGEST_RELAXATION, build_ik, least_energy, overshoots, seen_turning
from tripod_ik.solve_once import solve_once
from tripod_ik.state import LinearState
from tripod_ik.tasks import PositionTask
from tripod_ik.tracker import Activity, Tracker
from tripod_ik.tracker_settings import Goal, TrackerSettings
from tripod_sim import Simulation, load_scene
from tripod_sim.errors import SceneError, StepError
from tripod_sim.tables.short_forms import joints_of

FINGER = "examples/tendon_finger.toml"
TIP = 'effector={set="tip"}'
STILL = ("motion=off", "inertia=off", "damping=off")


@pytest.mark.parametrize("effector", [TIP, "effector={point=[0.1, 0.01, 0.0075]}"])
def test_an_observed_effector_adds_nothing_and_has_the_slope_of_its_place(effector: str) -> None:
    words = [*STILL, "solver.tolerance=1e-9"]
    plain, seen = Simulation(load_scene(FINGER, words)), Simulation(load_scene(FINGER, [*words, effector]))
    ends = []
    for pull in (0.00499, 0.005, 0.00501):
        for simulation in (plain, seen):
            simulation.step(np.array([pull, 0.0]))
        np.testing.assert_array_equal(plain.positions, seen.positions)
        assert seen.effector
        ends.append(seen.effector.position)
        if pull == 0.005:
            found = seen.compliance()
    assert plain.effector is None and seen.effector
    assert seen.effector.quaternion.tolist() == [0, 0, 0, 1]
    if "set" in effector:
        np.testing.assert_allclose(seen.effector.position, seen.markers[0], atol=1e-15)
    slope = (ends[2] - ends[0]) / 2e-5
    np.testing.assert_allclose(found.jacobian[:3, 0], slope, rtol=1e-4, atol=1e-5 * np.abs(slope).max())
    assert not found.w[3:6].any()


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (['effector={set="tip", point=[0, 0, 0]}'], ("effector", "point", "set")),
        (["effector={point=[1, 0, 0]}"], ("effector.point 0", "(1, 0, 0) m")),
        (['effector={set="nose"}'], ("effector.set", "nose")),
    ],
)
def test_effectors_that_cannot_be_are_refused(words: list[str], names: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *names):
        Simulation(load_scene(FINGER, words))


def test_a_point_has_no_orientation() -> None:
    with raises_naming(IkError, "orientation", "tendon_finger"):
        solve_once(load_scene(FINGER, [TIP]), [0.09, 0.01, 0.0], goal=Goal.ORIENTATION, slide=0.0)


def test_a_slack_cable_is_pulled_taut(tmp_path: Path) -> None:
    """Its slope is 0 where it hangs, so that nothing else would make it move."""
    scene = load_scene(FINGER, [*STILL, TIP, "gravity=off", "cable.0.slack=2mm"])
    model = StaticModel(scene)
    assert model.state().angles * model.spans == pytest.approx([0.002], rel=1e-9)
    assert model.state().efforts == pytest.approx([0.0], abs=1e-9)
    goal = model.move(np.array([0.007]) / model.spans).equilibrium
    found = solve_once(scene, goal.tolist(), slide=0.0, tolerance=MET)
    assert found["reached"] and found["angles"] == pytest.approx([0.007], abs=1e-7)
    assert (found["names"], found["units"]) == (["tendon"], ["m"])


def test_a_finger_that_swings_with_a_slack_cable_tells_where_it_rests() -> None:
    """The tangent counts the cable as taut; at rest it hangs slack, so it may not hold the finger at its length."""
    scene = load_scene(FINGER, ["motion=off", TIP])
    simulation, model = Simulation(scene), StaticModel(scene)
    rest = model.move(np.zeros(1))
    assert rest.efforts == pytest.approx([0.0], abs=1e-12) and rest.angles[0] * model.spans[0] > 1e-3
    for step in range(60):
        simulation.step(np.array([0.015 if step < 20 else 0.0, 0.0]))
        if step % 4 == 0:
            found = simulation.compliance()
    told = found.position + found.equilibrium_offset[:3]
    assert np.linalg.norm(found.position - rest.equilibrium) > 1e-3
    np.testing.assert_allclose(told, rest.equilibrium, atol=1e-6)
    np.testing.assert_allclose(found.angles, rest.angles * model.spans, atol=1e-6)
    assert found.efforts == pytest.approx([0.0], abs=1e-9)


def test_a_cable_is_not_asked_to_push() -> None:
    scene = load_scene(FINGER, [*STILL, TIP, "gravity=off"])
    found = solve_once(scene, [0.09, 0.01, 0.03], slide=0.0)
    assert found["outcome"].startswith("closest") and found["active_limits"] == ["tendon length min"]
    assert found["torques"] == pytest.approx([0.0], abs=1e-6)


def test_a_drive_by_displacement_pushes_and_pulls() -> None:
    jaw = 'force=[{name="jaw", set="tip", direction=[0,0,1], command="displacement", range=[-0.03, 0.03]}]'
    scene = load_scene(FINGER, [*STILL, TIP, "gravity=off", "cable=[]", jaw])
    for place in (-0.012, 0.012):
        model = StaticModel(scene)
        goal = model.move(np.array([place]) / model.spans).equilibrium
        found = solve_once(scene, goal.tolist(), slide=0.0, tolerance=MET)
        assert found["reached"] and found["angles"] == pytest.approx([place], abs=1e-7)
        assert np.sign(found["torques"]) == np.sign(place) and abs(found["torques"][0]) > 0.01
        assert (found["names"], found["units"]) == (["jaw"], ["m"])


def test_tension_keeps_to_its_limit() -> None:
    scene = load_scene(FINGER, [*STILL, TIP, "gravity=off", "cable.0.tension_max=2.0"])
    model = StaticModel(replace(scene))
    goal = model.move(np.array([0.02]) / model.spans).equilibrium
    found = solve_once(scene, goal.tolist(), slide=0.0, hard=True)
    assert found["active_limits"] == ["tendon tension"]
    assert found["torques"] == pytest.approx([2.0], rel=1e-3)


def test_a_body_that_buckles_ahead_is_not_called_out_of_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load_scene(FINGER, [*STILL, TIP, "gravity=off"])
    move = StaticModel.move

    def buckles(model: StaticModel, angles: np.ndarray) -> LinearState:
        if angles[0] > 0.2:
            raise StepError("no equilibrium near 0.2")
        return move(model, angles)

    goal = StaticModel(scene).move(np.array([0.4])).equilibrium.tolist()
    monkeypatch.setattr(StaticModel, "move", buckles)
    found = solve_once(scene, goal, slide=0.0)
    assert found["outcome"].startswith("stopped") and not found["reached"]
    assert_names(found["reason"], "0.2")


TWO = [*STILL, 'effector={set="tip", more=[{name="middle", point=[0.0, 0.0, -0.0975], weight=0.5}]}']


@pytest.mark.parametrize("reachable", [True, False])
def test_two_places_of_the_trunk_are_as_close_to_their_targets_as_scipy_brings_them(reachable: bool) -> None:
    scene = load_scene("trunk", TWO)
    model = StaticModel(scene)

    def rest(commands: list[float] | np.ndarray) -> LinearState:
        before, state = np.array(commanded), None
        for part in (0.25, 0.5, 0.75, 1.0):  # one far move is more than statics can solve
            state = model.move(before + part * (np.asarray(commands, float) - before))
        commanded[:] = commands
        assert state
        return state

    commanded = np.zeros(8)
    tip = rest([0.6, 0.1, 0, 0.2, 0, 0, 0.3, 0]).equilibrium
    if not reachable:
        rest([0.1, 0, 0.5, 0.6, 0, 0.3, 0, 0.1])
    middle = model.state().place("middle")[0] + (not reachable) * np.array([0.02, -0.01, 0.0])
    found = solve_once(scene, tip.tolist(), more={"middle": middle.tolist()}, slide=0.0, tolerance=MET)
    if reachable:
        assert found["reached"] and found["residuals"]["middle [m]"] < MET
        return

    def missing(commands: np.ndarray) -> np.ndarray:
        state = rest(commands)
        return np.append(state.equilibrium - tip, 0.5 * (state.place("middle")[0] - middle))

    def slope(commands: np.ndarray) -> np.ndarray:
        state = rest(commands)
        return np.vstack([state.jacobian[:3], 0.5 * state.place("middle")[1]])

    ends = []
    for start in (0.5 * np.array(found["angles"]) / model.spans, np.array(found["angles"]) / model.spans):
        model.go_home()
        commanded[:] = 0.0
        options = {"bounds": (0.0, 1.5), "xtol": 1e-12, "ftol": 1e-13, "gtol": 1e-13}
        ends.append(float(np.linalg.norm(least_squares(missing, start, slope, **options).fun)))
    assert found["outcome"].startswith("closest")
    assert found["error"] == pytest.approx(ends[1], rel=1e-6)
    assert found["error"] <= ends[0]
    parts = found["residuals"]["position [m]"], 0.5 * found["residuals"]["middle [m]"]
    assert found["error"] == pytest.approx(np.hypot(*parts), rel=1e-9)


def test_the_slope_of_a_further_place_is_that_of_differences() -> None:
    model = StaticModel(
        load_scene("cross", ["mesh.level=1", "effector.more=[{name='rim', point=[0.02, 0, 0.0]}]"])
    )
    start = model.state()
    for joint in range(4):
        ends = []
        for turn in (-1e-3, 1e-3):
            model.go_home()
            ends.append(model.move(start.angles + turn * np.eye(4)[joint]).place("rim")[0])
        np.testing.assert_allclose(
            (ends[1] - ends[0]) / 2e-3, start.place("rim")[1][:, joint], rtol=2e-3, atol=2e-6
        )


@pytest.mark.parametrize(
    ("words", "more", "names"),
    [
        (TWO, {"nose": [0.0, 0.0, -0.1]}, ("'nose'", "effector.more", "middle")),
        ([*STILL, 'effector={set="tip", more=[{name="a"}]}'], {}, ("effector.more.0", "point", "set")),
        ([*STILL, 'effector={set="tip", more=[{name="", set="tip"}]}'], {}, ("effector.more.0.name", "''")),
    ],
)
def test_targets_of_places_that_are_not_there_are_refused(
    words: list[str], more: dict[str, list[float]], names: tuple[str, ...]
) -> None:
    with raises_naming((IkError, SceneError), *names):
        solve_once(load_scene("trunk", words), [0.0, 0.0, -0.19], more=more, slide=0.0)


def test_actuators_that_the_goal_leaves_free_take_the_least_energy(tmp_path: Path) -> None:
    """Four cables, three coordinates: along the free combination the energy is least where the search ends."""
    scene = scene_of("cables", tmp_path)
    model = StaticModel(scene)
    goal = model.move(np.array([0.3, 0.1, 0.25, 0.2])).equilibrium
    found = solve_once(scene, goal.tolist(), slide=0.0, tolerance=MET)
    assert found["reached"]
    state = model.move(np.array(found["angles"]) / model.spans)
    assert np.linalg.norm(state.equilibrium - goal) < MET

    def stored(commands: np.ndarray) -> float:
        model.move(commands)
        energies = model.simulation.energies()
        return energies.strain + energies.gravity

    free = np.linalg.svd(state.jacobian[:3])[2][3]
    best, ends = stored(state.angles), []
    for step in (0.05, -0.05):
        with_goal = state.angles + step * free
        there = model.move(with_goal)
        mended = with_goal + np.linalg.pinv(there.jacobian[:3]) @ (goal - there.equilibrium)
        ends.append(stored(mended))
    assert min(ends) > best - 1e-9


def test_the_step_to_the_least_energy_moves_no_task(tmp_path: Path) -> None:
    state = StaticModel(scene_of("tensions", tmp_path)).move(np.array([0.5, 0.6, 0.5, 0.7]))
    J = state.jacobian[:3]
    step = least_energy(state, J, -np.ones(4), np.ones(4))
    assert np.linalg.norm(step) > 1e-3
    assert np.linalg.norm(J @ step) < 1e-9
    problem = build_ik(state, [PositionTask(state.equilibrium)], relax=LONGEST_RELAXATION)
    assert np.abs(problem.q).max() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cables", "tensions", "chambers", "mixed"])
def test_random_targets_are_met(tmp_path: Path, name: str) -> None:
    found = measure(scene_of(name, tmp_path), 8, 1)
    assert found["met"] >= 7 and found["ours_met"] >= found["scipy_met"]
    assert all(outcome.startswith(("closest", "stopped")) for outcome in found["outcomes"])
    assert found["kkt"] < 1e-6


TRUNK = (  # where programs have nearly parallel limits, and where the least energy is at a kink
    (0.0214, 0.9427, 1.1895, 0.7695, 1.0888, 0.3396, 0.2978, 0.5447),
    (0.0378, 0.5583, 0.0455, 0.1843, 1.4507, 0.9866, 0.6423, 0.7856),
)


@pytest.mark.slow
@pytest.mark.parametrize("commands", TRUNK)
def test_the_trunk_reaches_where_it_rests_at_other_commands(commands: tuple[float, ...]) -> None:
    scene = load_scene("trunk", STILL)
    goal = StaticModel(scene).move(np.array(commands)).equilibrium
    found = solve_once(scene, goal.tolist(), slide=0.0, torque_max=np.inf, tolerance=MET)
    assert found["reached"] and found["error"] < MET


def test_a_relaxation_overshoots_if_it_was_made_and_turns_back() -> None:
    def program(angles: float, relaxation: float) -> SimpleNamespace:
        return SimpleNamespace(
            state=SimpleNamespace(angles=np.array([angles, 0.0])), relaxation=np.array([relaxation, 0.0])
        )

    start = program(0.0, 0.3)
    for moved, then, expected in (
        (0.3, -0.2, True),
        (0.3, 0.2, False),
        (0.0, -0.2, False),
        (-0.3, -0.2, False),
    ):
        assert overshoots(start, program(moved, then)) is expected  # type: ignore[arg-type]


def test_a_short_step_over_which_a_body_swings_does_not_tell_how_the_jacobian_turns() -> None:
    """Damping that grew with 1 / step would make each step shorter than the one before."""
    J = np.ones((6, 1))
    before = SimpleNamespace(held=True, angles=np.zeros(1), jacobian=J)
    for step, counts in ((0.1, 0.1), (1e-7, LEAST_STEP)):
        after = SimpleNamespace(held=True, angles=np.array([step]), jacobian=1.2 * J)
        assert seen_turning(before, after) == pytest.approx(1 / 6 / counts)  # type: ignore[arg-type]


@pytest.mark.slow
def test_the_tracker_says_closest_only_where_it_comes_no_closer() -> None:
    """Two targets in turn, the first out of reach: a finger that swings, told of every 0.3 s."""
    scene = load_scene("finger_cable", ["motion=off"])
    joints = joints_of(scene)
    assert joints
    simulation, tracker = Simulation(scene), Tracker(TrackerSettings())
    tracker.resize(2, 2)
    commands = joints.start[:-1].copy()
    rest = StaticModel(scene)
    goal = rest.move(np.array([7e-3, 9e-3]) / rest.spans).equilibrium
    for target, updates in ((np.array([0.07, 0.002, -0.03]), 30), (goal, 60)):
        tracker.target = target
        steps = []
        for _ in range(updates):
            step = tracker.update(linear_state(simulation.compliance(), joints), simulation.state.time)
            steps.append(step)
            for _ in range(30):
                most = (joints.high - joints.low) * scene.dt
                commands += np.clip(step.result.command * joints.spans - commands, -most, most)
                simulation.step(np.array([*commands, 0.0]))
        if target is goal:
            arrived = next(k for k, step in enumerate(steps) if step.error < 1e-4)
            assert all(step.activity is Activity.TRACKING for step in steps[: arrived + 1])
            assert steps[-1].error < 1e-4
        else:
            assert steps[0].activity is Activity.TRACKING
            assert steps[-1].activity is Activity.CLOSEST and steps[-1].error > 5e-3
