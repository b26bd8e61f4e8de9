"""Load increments of statics: the same equilibrium in far fewer solves, and rolled back where they do not get there."""

import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_sim import Simulation, StepError, load_scene
from tripod_sim.build import build
from tripod_sim.integrators.load_steps import LoadSteps
from tripod_sim.integrators.newton import Newton
from tripod_sim.linear.solver import LinearError
from tripod_sim.scene.lowering import lowered
from tripod_sim.state import State
from tripod_sim.system import System

STATIC = ("inertia=off", "damping=off", "mesh.level=1")


def flat(*overrides: str) -> tuple[System, State]:
    """The piece that hangs from one end, before it hangs."""
    system = build(load_scene("silicone", [*STATIC, *overrides])).system
    return system, system.start_state(np.zeros(1))


def test_the_hanging_piece_needs_few_increments_and_no_line_search() -> None:
    simulation = Simulation(load_scene("silicone", STATIC))
    assert simulation.step().increments > 5
    system, state = flat()
    report = LoadSteps(system, 1e-4).carry(state)
    assert report.halvings == 0
    assert 5 < report.increments < 40
    system.evaluate(state)
    assert system.unbalanced() <= 1e-4
    np.testing.assert_allclose(state.positions, simulation.positions, atol=1e-5)


def test_it_is_the_equilibrium_that_a_line_search_finds() -> None:
    """Which takes more than three times the solves; both leave 1e-8 N on a piece that yields about 1 m/N."""
    (system, state), (other, searched) = flat(), flat()
    carried = LoadSteps(system, 1e-8).carry(state)
    report = Newton(other, 1e-8, 1000).solve(searched, np.zeros(1))
    np.testing.assert_allclose(state.positions, searched.positions, atol=1e-7)
    assert state.positions[:, 2].min() < -0.07
    assert report.iterations > 3 * carried.increments


def test_the_step_reports_its_increments_and_the_next_has_none() -> None:
    parts = build(load_scene("silicone", STATIC))
    state = parts.system.start_state(np.zeros(1))
    first = parts.stepper.step(state, np.zeros(1), 0.0)
    assert first.increments > 5
    assert first.iterations == first.increments
    assert first.factorisations >= first.increments  # one for each of them
    assert first.residual <= 1e-4
    second = parts.stepper.step(state, np.zeros(1), 0.0)
    assert second.increments == 0
    assert second.iterations == 0


def test_a_nearly_incompressible_piece_is_rolled_back_and_its_reach_halved() -> None:
    """At nu 0.499 the first reach turns elements inside out; a line search alone never got there."""
    parts = build(load_scene("silicone", [*STATIC, "material.poisson=0.499"]))
    state = parts.system.start_state(np.zeros(1))
    report = parts.stepper.step(state, np.zeros(1), 0.0)
    assert report.halvings >= 1
    assert report.parts == 1
    assert report.residual <= 1e-4
    assert state.positions[:, 2].min() == pytest.approx(-0.0746, abs=5e-4)
    assert parts.system.elastic.terms[0].worst_element(state.positions, state.modes)[1] > 0.9


def test_an_indefinite_tangent_or_an_unsolved_one_has_no_response(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the start the state stays as it is, and is not called factored; on the way the increments are rolled back."""
    system, state = flat()
    start, factor = state.positions.copy(), System.factor
    monkeypatch.setattr(System, "factor", lambda self, shift=0.0: False)
    report = LoadSteps(system, 1e-4).carry(state)
    assert (report.increments, report.factorisations, report.halvings) == (0, 0, 0)
    np.testing.assert_array_equal(state.positions, start)
    monkeypatch.setattr(System, "factor", factor)

    def fail(right: np.ndarray) -> np.ndarray:
        raise LinearError("no convergence")

    with monkeypatch.context() as changed:
        changed.setattr(system.linear, "solve", fail)
        report = LoadSteps(system, 1e-4).carry(state)
    assert (report.increments, report.factorisations, report.halvings) == (0, 0, 0)
    made = list[bool]()
    monkeypatch.setattr(
        System,
        "factor",
        lambda self, shift=0.0: made.append(True) or (factor(self, shift) and len(made) != 3),
    )
    report = LoadSteps(system, 1e-4).carry(state)
    assert report.halvings == 1


def test_what_told_that_a_load_bends_little_begins_its_solution(monkeypatch: pytest.MonkeyPatch) -> None:
    parts = build(load_scene("silicone", [*STATIC, "material.young=1e8"]))
    factor, made = System.factor, list[float]()
    monkeypatch.setattr(System, "factor", lambda self, shift=0.0: made.append(shift) or factor(self, shift))
    report = parts.stepper.step(parts.system.start_state(np.zeros(1)), np.zeros(1), 0.0)
    assert report.increments == 0
    assert report.residual <= 1e-4
    assert report.factorisations == len(made) >= 1


def test_a_load_that_bends_little_is_left_to_newton_s_method() -> None:
    parts = build(load_scene("tripod", STATIC))
    state = parts.system.start_state(np.zeros(4))
    report = parts.stepper.step(state, np.zeros(4), 0.0)
    assert report.increments == 0
    assert state.centres[0, 2] < -1e-3


@pytest.mark.parametrize("reach", [10.0, 1e-9])
def test_what_cannot_be_carried_stays_where_it_was(reach: float) -> None:
    """A reach beyond the body folds it over; one far below it never ends."""
    system, state = flat()
    steps = LoadSteps(system, 1e-4)
    steps._reach, steps.MOST, steps.HALVINGS = reach, 3, 1
    before = state.copy()
    report = steps.carry(state)
    if reach < 1:
        assert report.halvings == 2
        assert report.increments > 0
    for name in ("positions", "modes", "centres", "rotations", "joints"):
        np.testing.assert_array_equal(getattr(state, name), getattr(before, name))


def test_where_the_tangent_becomes_unstable_no_increment_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stable for the first increment, and never again: one increment, and all is rolled back as often as may be."""
    system, state = flat()
    factor, calls = system.factor, iter([True, True])
    monkeypatch.setattr(system, "factor", lambda: factor() and next(calls, False))
    before, steps = state.positions.copy(), LoadSteps(system, 1e-4)
    report = steps.carry(state)
    assert (report.increments, report.halvings) == (1, steps.HALVINGS + 1)
    np.testing.assert_array_equal(state.positions, before)


@pytest.mark.parametrize(("turn", "slide"), [(0.12, 0.0), (0.0, 0.008), (0.05, 0.012)])
def test_servos_move_in_increments_and_the_slide_counts_as_a_turn_of_an_arm(
    turn: float, slide: float
) -> None:
    scene = load_scene("tripod", ["mesh.level=1", "inertia=off", "damping=off", "solver.max_turn=0.05"])
    simulation = Simulation(scene)
    goal = simulation.command + np.array([turn, 0.0, 0.0, slide])
    parts = max(turn, slide / lowered(scene).reach) / 0.05
    assert simulation.step(goal).parts == int(np.ceil(parts - 1e-9))


def test_where_iterations_are_used_up_their_number_is_named() -> None:
    words = ["mesh.level=1", "solver.max_iterations=2", "servos.angles=[-1,-1,-1]"]
    with raises_naming(StepError, "3 iterations", "node", "solver.max_iterations is 2"):
        Simulation(load_scene("tripod", words))
