"""One-solve mode: one evaluation of the elements a step where its end is near enough, else Newton's method."""

from typing import Any

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.scenes import SHARP
from tests.sim.implicit_schemes import IMPLICIT, scheme_of
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.integrators.chord_predictor import ChordPredictor
from tripod_sim.integrators.one_solve import OneSolve

WORKING = ("servos.angles=[-1.4965, -1.4965, -1.4965]", "servos.slide=0.035")


def swing(t: float) -> np.ndarray:
    phase = 2 * np.pi * t / 2.0 + 2 * np.pi * np.arange(3) / 3
    return np.array([*(-1.4965 + 0.15 * min(t, 1.0) * np.sin(phase)), 0.035])


def run(scene: str, *overrides: str, steps: int = 60) -> tuple[np.ndarray, list[int], list[int]]:
    """Effector positions, linear solves and factorisations of each step."""
    simulation = Simulation(load_scene(scene, [*WORKING, *overrides]))
    positions, solves, renewals = [], [], []
    for k in range(steps):
        report = simulation.step(swing((k + 1) * simulation.scene.dt))
        positions.append(simulation.state.centres[0].copy())
        solves.append(report.iterations)
        renewals.append(report.factorisations)
    return np.array(positions), solves, renewals


@pytest.mark.parametrize("scene", [SHARP, "tripod_sofa"])
def test_smooth_motion_takes_one_evaluation_a_step_and_stays_close(scene: str) -> None:
    level = "mesh.level=1" if scene == SHARP else "mesh.level=5"
    exact, solves, _ = run(scene, level, "solver.mode=newton", "solver.tolerance=1e-8")
    assert min(solves[1:]) > 1
    simulation = Simulation(load_scene(scene, [*WORKING, level, "solver.mode=one_solve"]))
    asked, counted = simulation._system.elastic.add_gradients, []
    simulation._system.elastic.add_gradients = lambda *given: counted.append(1) or asked(*given)  # type: ignore[method-assign]
    quick, renewed = [], 0
    for k in range(60):
        renewed += simulation.step(swing((k + 1) * simulation.scene.dt)).factorisations
        quick.append(simulation.state.centres[0].copy())
    assert renewed == 0  # the factorisation made when the scene was built serves the whole motion
    assert len(counted) <= 62
    moved = np.ptp(exact, axis=0).max()
    assert moved > 3e-4
    assert np.abs(np.array(quick) - exact).max() < 0.002 * moved


def fast(t: float, size: float = 0.3, rate: float = 2.0) -> np.ndarray:
    """`size` [rad] at `rate` [Hz], the whole amplitude after 0.4 s."""
    phase = 2 * np.pi * (rate * t + np.arange(3) / 3)
    return np.array([*(-1.4965 + size * min(t / 0.4, 1.0) * np.sin(phase)), 0.035])


def test_commands_that_come_in_jumps_seldom_renew_the_tangent() -> None:
    """Servos that move in every fourth step alone, as by commands at 50 Hz: between them residuals seldom halve."""
    ends, renewed = [], 0
    for words in (["solver.mode=newton", "solver.tolerance=1e-7"], ["solver.mode=one_solve"]):
        simulation = Simulation(load_scene(SHARP, [*WORKING, "mesh.level=2", *words]))
        dt, found, renewed = simulation.scene.dt, [], 0
        for k in range(400):
            renewed += simulation.step(fast((k // 4 * 4 + 4) * dt, 0.15, 0.5)).factorisations
            found.append(simulation.state.centres[0].copy())
        ends.append(np.array(found))
    off = ends[1] - ends[0]
    assert 0 < renewed < 0.1 * len(off)
    assert np.sqrt(np.mean(np.sum(off**2, axis=1))) < 1e-5
    assert np.linalg.norm(off, axis=1).max() < 3e-5


@pytest.mark.parametrize(("scene", "level", "share"), [(SHARP, 2, 0.12), ("tripod_sofa", 5, 0.3)])
def test_a_fast_motion_leaves_the_effector_where_newton_puts_it(scene: str, level: int, share: float) -> None:
    """Ten micrometres root mean square are asked for; and no jumps where the tangent is renewed.

    That of `tripod_sofa` is five parts in six its damper's, of 50 ms, which turns and stretches with the elements.
    """
    ends, renewed = [], 0
    for words in (["solver.mode=newton", "solver.tolerance=1e-7"], ["solver.mode=one_solve"]):
        simulation = Simulation(load_scene(scene, [*WORKING, f"mesh.level={level}", *words]))
        dt, found, renewed = simulation.scene.dt, [], 0
        for k in range(round(1.0 / dt)):
            renewed += simulation.step(fast((k + 1) * dt)).factorisations
            found.append(simulation.state.centres[0].copy())
        ends.append(np.array(found))
    moved = np.linalg.norm(np.diff(ends[0], axis=0), axis=1)
    off = ends[1] - ends[0]
    assert moved.max() > 2.5e-4
    assert 0 < renewed < share * len(off)
    assert np.sqrt(np.mean(np.sum(off**2, axis=1))) < 1e-5
    assert np.linalg.norm(off, axis=1).max() < 3e-5
    assert np.linalg.norm(np.diff(off, axis=0), axis=1).max() < 3e-5


def test_what_is_taken_for_solved_is_what_an_evaluation_finds() -> None:
    """Forces, energy and torques at the end of a corrected step, told without its elements, and told by them."""
    simulation = Simulation(load_scene(SHARP, [*WORKING, "mesh.level=1", "solver.mode=one_solve"]))
    system, state = simulation._system, simulation.state
    for k in range(40):
        simulation.step(swing(0.005 * (k + 1)))
    assert system.knows(state)
    told = system._forces.copy(), system._elastic_energy, simulation.efforts.copy()
    evaluated = system._last[0].copy()
    system.forget()
    system.elastic.balance_modes()
    np.testing.assert_array_equal(evaluated, state.positions)
    system.assemble(state, project=False)  # condenses at the state itself
    system.evaluate(state)
    size = np.abs(system._forces).max()
    assert size > 0.05
    assert np.abs(told[0] - system._forces).max() < 1e-2 * size
    assert told[1] == pytest.approx(system._elastic_energy, rel=1e-5)
    np.testing.assert_allclose(told[2], system.efforts, atol=2e-3 * np.abs(system.efforts).max())


@pytest.mark.parametrize("scheme", IMPLICIT)
@pytest.mark.parametrize(("scene", "level", "bound"), [(SHARP, 1, 0.04), ("tripod_sofa", 5, 0.05)])
def test_a_slow_motion_is_not_held_behind(scene: str, level: int, bound: float, scheme: str) -> None:
    """What a kept tangent gets wrong does not add up: `bound` is in parts of what the effector moves in a step."""
    words = (f"mesh.level={level}", f"inertia.scheme={scheme}")
    steps = 200
    exact, _, _ = run(scene, *words, "solver.mode=newton", "solver.tolerance=1e-8", steps=steps)
    quick, solves, renewals = run(scene, *words, "solver.mode=one_solve", steps=steps)
    assert sum(renewals) <= (6 if scene == SHARP else 14)  # its tangent is mostly its damper's
    assert np.mean(solves) < 0.1 + 2 * len(scheme_of(scheme).stages(1.0, 1.0))
    moved = np.linalg.norm(np.diff(exact, axis=0), axis=1)[steps // 2 :]
    behind = np.linalg.norm(quick - exact, axis=1)[steps // 2 :]
    assert np.sqrt(np.mean(behind**2)) < bound * np.sqrt(np.mean(moved**2))


def test_nothing_is_missed_where_the_matrix_is_that_of_another_pose() -> None:
    """A body without inertia whose stiffness is not the one factored, pulled at a constant speed: it keeps up."""
    stiffness, factored, pull = np.diag([1.0, 2.0, 3.0]), np.diag([2.5, 2.0, 2.0]), np.array([1.0, -2.0, 0.5])
    lags = []
    for foreseen in (False, True):
        left_over, x = ChordPredictor(3), np.zeros(3)
        for k in range(1, 121):
            forecast = left_over.forecast(0.01) if foreseen else np.zeros(3)
            x -= np.linalg.solve(factored, stiffness @ (x - k * pull)) + forecast
            lag = k * pull - x
            missed = np.linalg.solve(factored, stiffness @ (x - k * pull))
            left_over.note(missed)
            x -= missed
        lags.append(lag)
    assert np.abs(lags[0]).max() > 0.5
    assert np.abs(lags[1]).max() < 1e-6


@pytest.mark.parametrize("ratio", [0.2, 0.5, 1.0, 1.5, 1.85])
def test_what_is_foreseen_makes_no_mode_unstable(ratio: float) -> None:
    """A step that is foreseen, evaluated and corrected with k0 for a spring of k is stable for k well below 2 k0."""
    left_over, x = ChordPredictor(1), np.ones(1)
    for _ in range(600):
        x = x - ratio * x - left_over.forecast(0.01)
        missed = ratio * x
        left_over.note(missed)
        x -= missed
    assert abs(x[0]) < 1e-3


def test_a_forecast_belongs_to_one_length_and_one_factorisation() -> None:
    left_over, missed = ChordPredictor(2), np.array([4.0, -8.0])
    np.testing.assert_array_equal(left_over.forecast(0.01), 0.0)
    left_over.note(missed)
    np.testing.assert_array_equal(left_over.forecast(0.01), missed)
    np.testing.assert_array_equal(left_over.forecast(0.005), 0.0)
    left_over.note(missed)
    left_over.drop()
    np.testing.assert_array_equal(left_over.forecast(0.005), 0.0)


def test_level_and_slope_take_their_shares_of_what_was_missed() -> None:
    """l' = p + 0.8 m, s' = s + 0.2 m, p' = l' + s'; before that p is the first m."""
    predictor, first, then = ChordPredictor(2), np.array([4.0, -8.0]), np.array([1.0, 5.0])
    predictor.forecast(0.01)
    for missed in (first, then, then):
        predictor.note(missed)
    level = first + 0.8 * then + 0.2 * then
    np.testing.assert_allclose(predictor.forecast(0.01), level + 0.8 * then + 0.4 * then, rtol=1e-14)


@pytest.mark.parametrize(("length", "share"), [(0.001, 0.2), (0.005, 1.0), (0.02, 1.0)])
def test_steps_shorter_than_5_ms_are_solved_as_much_better(length: float, share: float) -> None:
    system = Simulation(load_scene("silicone", ["mesh.level=1"]))._system
    solver = OneSolve(system, 1e-6, 25, near=1e-5)
    solver._begin(length)
    assert solver.near == pytest.approx(share * 1e-5, rel=1e-12)


def test_a_restored_state_knows_nothing_of_what_was_left_over() -> None:
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1", *WORKING]))
    for k in range(40):
        simulation.step(swing(0.005 * (k + 1)))
    saved, ends = simulation.save(), []
    for turns in (1, 3, 0):
        for k in range(turns):
            simulation.step(swing(0.2 - 0.01 * k))
        simulation.restore(saved)
        for k in range(40, 50):
            simulation.step(swing(0.005 * (k + 1)))
        ends.append(simulation.state.positions.tobytes())
        simulation.restore(saved)
    assert ends[0] == ends[1] == ends[2]


def test_a_jump_of_the_servos_is_solved_to_the_length() -> None:
    ends = []
    for words in (["solver.mode=newton", "solver.tolerance=1e-8"], ["solver.mode=one_solve"]):
        simulation = Simulation(load_scene(SHARP, ["mesh.level=1", *words, *WORKING]))
        report = simulation.step(np.array([-0.9, -1.4965, -1.4965, 0.035]))
        assert report.iterations > 2
        ends.append(simulation.state.positions.copy())
    assert np.abs(ends[1] - ends[0]).max() < 5e-6


def test_the_length_decides() -> None:
    ends, solves = [], []
    for words in ("solver.mode=newton", "solver.position_tolerance=1e-4", "solver.position_tolerance=1e-8"):
        simulation = Simulation(load_scene(SHARP, [*WORKING, "mesh.level=1", "solver.tolerance=1e-9", words]))
        taken, found = 0, []
        for k in range(100):
            taken += simulation.step(fast(0.005 * (k + 1))).iterations
            found.append(simulation.state.positions.copy())
        ends.append(np.array(found))
        solves.append(taken)
    coarse, fine = (np.abs(end - ends[0]).max() for end in ends[1:])
    assert fine < 5e-6
    assert 3e-5 < coarse < 5e-4
    assert solves[1] < solves[2]


def test_statics_goes_to_the_tolerance() -> None:
    options = ["mesh.level=1", "inertia=off", "damping=off", "solver.mode=one_solve", "solver.tolerance=1e-7"]
    simulation = Simulation(load_scene(SHARP, options))
    report = simulation.step(np.array([-0.2, 0.0, 0.0, 0.0]))
    assert report.residual <= 1e-7


def test_a_length_out_of_range_and_the_share_of_old_are_named() -> None:
    with raises_naming(SceneError, "solver.position_tolerance", 0.0, "above 0 m", "at most 0.01 m"):
        load_scene(SHARP, ["solver.position_tolerance=0.0"])
    with raises_naming(SceneError, "solver.share", "unknown", "fields", "position_tolerance"):
        load_scene(SHARP, ["solver.share=0.1"])


@pytest.mark.parametrize("scheme", IMPLICIT)
def test_the_first_step_finds_its_factorisation_made(scheme: str) -> None:
    options = ["mesh.level=1", f"inertia.scheme={scheme}", *WORKING]
    simulation = Simulation(load_scene(SHARP, options))
    ends = []
    for _ in range(2):
        first = simulation.step(swing(0.005))
        assert first.factorisations == 0
        for k in range(1, 20):
            simulation.step(swing(0.005 * (k + 1)))
        ends.append(simulation.state.copy())
        simulation.reset()
    for name in ("positions", "velocities", "modes"):
        np.testing.assert_array_equal(getattr(ends[0], name), getattr(ends[1], name))


@pytest.mark.parametrize("scheme", ["implicit_euler", "bdf2"])
def test_what_a_step_would_begin_with_can_be_done_before_it_with_the_same_bits(scheme: str) -> None:
    ways = []
    for ahead in (False, True):
        simulation = Simulation(load_scene(SHARP, [*WORKING, f"inertia.scheme={scheme}"]))
        factor, inside, counts = simulation._system.factor, [0], []

        def counted(*given: float, inside: list[int] = inside, factor: Any = factor) -> bool:
            inside[0] += 1
            return bool(factor(*given))

        simulation._system.factor = counted  # type: ignore[method-assign]
        found, reported = [], 0
        for k in range(600):
            before = inside[0]
            reported += simulation.step(swing(1.5 * (k + 1) * simulation.scene.dt)).factorisations
            counts.append(inside[0] - before)
            found.append(simulation.state.positions.copy())
            if ahead:
                simulation.renew()
        ways.append((np.array(found), reported, sum(counts), inside[0]))
    (lazy, told, within, _), (early, told_early, within_early, all_early) = ways
    assert np.array_equal(lazy, early)
    assert told == told_early >= 3
    assert within == told
    assert within_early <= told - 2
    assert all_early - told in (0, 1)  # what a step after the last would begin with


def test_what_was_done_before_a_step_is_not_used_after_a_change_of_the_state() -> None:
    simulations = [Simulation(load_scene(SHARP, WORKING)) for _ in range(2)]
    for simulation in simulations:
        for k in range(40):
            simulation.step(swing(6 * (k + 1) * simulation.scene.dt))
        simulation._stepper.forget()
    simulations[1].renew()
    for simulation in simulations:
        simulation.reset()
        simulation.step(swing(0.1))
    assert np.array_equal(simulations[0].state.positions, simulations[1].state.positions)
