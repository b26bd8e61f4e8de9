"""Hard cases: nothing becomes NaN, nothing ends inside out, everything comes to rest; what cannot be saved says so."""

import itertools
import re
from typing import Any

import numpy as np
import pytest

from benchmarks import stability
from tests.messages import names, raises_naming
from tests.scenes import SHARP
from tests.sim.implicit_schemes import IMPLICIT
from tests.tiers import sampled
from tripod_sim import SceneError, Simulation, StepError, load_scene
from tripod_sim.integrators.load_steps import LoadSteps
from tripod_sim.integrators.newton import NewtonError, NewtonReport
from tripod_sim.state import State
from tripod_sim.system import System

FIXED = "fixed=[{low=[0.045, -1, -1], high=[1, 1, 1]}]"
WORKING = (-1.5, -1.5, -1.5, 0.035)

CASES = {
    "jump of 1.5 rad in one step": ([], WORKING),
    "jump of one servo": ([], (-1.5, 0.0, 0.0, 0.0)),
    "jump to the end stop": ([], (-2.1, -2.1, -2.1, 0.0)),
    "jump upwards": ([], (0.6, 0.6, 0.6, 0.0)),
    "buckling by the slide alone": ([], (0.0, 0.0, 0.0, 0.035)),
    "nearly incompressible": (["material.poisson=0.499"], WORKING),
    "dt 0.1 s": (["dt=0.1"], WORKING),
    "stiff": (["material.young=1e7"], WORKING),
    "soft": (["material.young=2e3"], WORKING),
    "gravity x100": (["gravity.acceleration=[0,0,-981]"], (0.0, 0.0, 0.0, 0.0)),
    "gravity x100 sideways": (["gravity.acceleration=[981,0,0]"], WORKING),
    "corotational jump": (["material.law=corotational"], WORKING),
    "no damping": (["damping=off"], WORKING),
    "statics": (["inertia=off", "damping=off"], WORKING),
}


@pytest.mark.parametrize("name", CASES)
def test_hard_case_stays_stable_and_comes_to_rest(name: str) -> None:
    overrides, joints = CASES[name]
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1", *overrides]))
    totals = []
    for _ in range(round(3.0 / simulation.scene.dt)):
        simulation.step(np.array(joints))
        assert np.isfinite(simulation.state.positions).all()
        e = simulation.energies()
        totals.append(e.kinetic + e.strain + e.gravity)
    # once the input rests, the energy only falls, to the solver's tolerance (1e-4 N over moves of some mm)
    assert np.diff(totals).max() < 1e-6 * max(1.0, abs(totals[0]))
    assert e.kinetic < 1e-7
    element, ratio = simulation._system.elastic.terms[0].worst_element(
        simulation.state.positions, simulation.state.modes
    )
    assert ratio > 0, f"element {element} is inside out"


@pytest.mark.parametrize("law", ["neo_hooke", "corotational"])
def test_noise_of_a_tenth_of_an_element_relaxes(law: str) -> None:
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1", f"material.law={law}"]))
    free = simulation._system.reduction.free
    rest = simulation.state.positions.copy()
    noise = 1e-3 * np.random.default_rng(0).uniform(-1, 1, (len(free), 3))
    simulation.state.positions[free] += noise
    for _ in range(200):
        simulation.step()
    assert np.abs(simulation.state.positions - rest).max() < 1e-5


def test_corotational_recovers_from_inverted_elements() -> None:
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1", "material.law=corotational"]))
    free = simulation._system.reduction.free
    rest = simulation.state.positions.copy()
    simulation.state.positions[free] += 4e-3 * np.random.default_rng(1).uniform(-1, 1, (len(free), 3))
    assert (
        simulation._system.elastic.terms[0].worst_element(simulation.state.positions, simulation.state.modes)[
            1
        ]
        < 0
    )
    for _ in range(300):
        simulation.step()
    assert (
        simulation._system.elastic.terms[0].worst_element(simulation.state.positions, simulation.state.modes)[
            1
        ]
        > 0
    )
    assert np.abs(simulation.state.positions - rest).max() < 1e-4


def test_a_tolerance_below_rounding_is_named_and_no_element_that_is_whole() -> None:
    with raises_naming(StepError, "solver.tolerance", "1e-14 N", "rounding") as told:
        Simulation(load_scene("silicone", ["mesh.level=1", "solver.tolerance=1e-14"])).step()
    assert not names(told.value, "element")


def test_a_step_that_cannot_be_saved_names_the_element_and_keeps_the_last_good_state() -> None:
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1"]))
    simulation.step(np.array([-0.1, 0, 0, 0]))
    good = simulation.state.copy()
    free = simulation._system.reduction.free
    simulation.state.positions[free[:20]] = 0.0  # crush elements to a point: neo-Hooke has no energy there
    broken = simulation.state.positions.copy()
    with raises_naming(StepError, "step 2 at 0.005 s") as told:
        simulation.step()
    assert re.search(r"element \d+", str(told.value))
    np.testing.assert_array_equal(simulation.state.positions, broken)  # unchanged by the failed step
    assert simulation.state.step == 1
    good.copy_to(simulation.state)
    simulation.step()
    assert np.isfinite(simulation.state.positions).all()


@pytest.mark.parametrize("scheme", IMPLICIT)
def test_parts_that_fail_leave_no_trace(scheme: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A large turn within few iterations, and the parts that were solved once more, without those that were not."""
    words = ["mesh.level=1", "dt=0.01", "solver.mode=newton", "solver.tolerance=1e-9"]
    words += [f"inertia.scheme={scheme}"]
    hasty, patient = (Simulation(load_scene(SHARP, words)) for _ in range(2))
    stepper, solved, failed = hasty._stepper, list[tuple[np.ndarray, float]](), list[float]()
    part = stepper.integrator.advance

    def watched(state: State, joints: np.ndarray, h: float) -> NewtonReport:
        before = state.positions.copy()
        try:
            report = part(state, joints, h)
        except NewtonError:
            failed.append(float(np.abs(state.positions - before).max()))
            raise
        solved.append((joints.copy(), h))
        return report

    monkeypatch.setattr(stepper.integrator, "advance", watched)
    stepper.newton.max_iterations = 7
    report = hasty.step(np.array([-0.4, 0.0, 0.0, 0.0]))
    assert (report.halvings, report.parts) == (len(failed), len(solved))
    assert len(failed) > 3 and max(failed) > 1e-4  # [m]: what a failed part has moved
    for joints, h in solved:
        patient._stepper.integrator.advance(patient.state, joints, h)
    np.testing.assert_allclose(hasty.state.positions, patient.state.positions, rtol=0, atol=1e-8)
    np.testing.assert_allclose(hasty.state.velocities, patient.state.velocities, rtol=0, atol=1e-5)


HEAVY = ["mesh.level=1", "material.mass=1e6", "inertia=off", "damping=off"]


@pytest.mark.parametrize("words", [["servos=off", FIXED], ["servos.angles=[-1,-1,-1]"]])
def test_a_weight_that_no_load_steps_bear_is_tried_once(
    words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Shorter parts begin at the same load; and where no servo moves they are the same."""
    whole, tries = LoadSteps.carry, list[int]()

    def carry(self: LoadSteps, state: State) -> NewtonReport:
        report = whole(self, state)
        tries.append(report.halvings)
        return report

    monkeypatch.setattr(LoadSteps, "carry", carry)
    with pytest.raises(StepError) as told:
        Simulation(load_scene(SHARP, [*HEAVY, *words]))
    assert tries == [LoadSteps.HALVINGS + 1]
    assert names(told.value, "substeps") == ("servos=off" not in words)


@pytest.mark.parametrize("steps", ["fixed", "auto"])
def test_a_step_that_fails_takes_a_bounded_number_of_linear_solves(
    steps: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["mesh.level=1", "solver.mode=newton", "solver.max_iterations=20", f"time_error.steps={steps}"]
    simulation = Simulation(load_scene(SHARP, words))
    newton = simulation._stepper.newton
    spent = newton.spent
    monkeypatch.setattr(System, "unbalanced", lambda self: 1.0)
    with raises_naming(StepError, "substeps", 0.0078, "unbalanced force", "1 N", "solver.tolerance"):
        simulation.step()
    assert 160 <= newton.spent - spent <= 168


@pytest.mark.parametrize(
    ("joints", "named"),
    [
        ([np.nan, 0, 0, 0], ("not finite",)),
        ([0, 0, 0], ("shape", "(3,)", "(4,)")),
        ([-3.0, 0, 0, 0], ("servo_0: angle", "-3 rad", "-2.1 to 0.6")),
        ([0, 0, 1.0, 0], ("servo_2: angle", "1 rad")),
        ([0, 0, 0, 0.5], ("slide", "0.5 m", "0 to 0.04")),
        (["a"] * 4, ("joints are ['a', ", "4 numbers")),
        ([[0.0], [0.0, 0.0]], ("joints are [[0.0], [0.0, 0.0]]", "4 numbers")),
        ([10**400] * 4, ("joints are [", "...", "4 numbers")),
    ],
)
def test_bad_commands_are_refused_and_change_nothing(joints: Any, named: tuple[str, ...]) -> None:
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1"]))
    before = simulation.state.positions.copy()
    with raises_naming(SceneError, *named):
        simulation.step(joints)
    np.testing.assert_array_equal(simulation.state.positions, before)
    assert simulation.state.step == 0


def test_the_state_of_another_scene_is_refused() -> None:
    one, other = (
        Simulation(load_scene("tripod", ["mesh.level=1", *words]))
        for words in ((), ("mesh.element=h8_modes",))
    )
    before = other.positions.copy()
    shapes = (str(one.state.positions.shape), str(other.state.positions.shape))
    with raises_naming(SceneError, "state", "another scene", "positions", *shapes):
        other.restore(one.save())
    np.testing.assert_array_equal(other.positions, before)


def test_torques_of_another_scene_are_refused_before_the_state_changes() -> None:
    simulation = Simulation(load_scene("tripod", ["mesh.level=1"]))
    start = simulation.save()[0]
    simulation.step(simulation.command - np.array([0.1, 0.0, 0.0, 0.0]))
    before = simulation.state.positions.copy()
    with raises_naming(SceneError, "another scene", "efforts", "(1,)", "(3,)"):
        simulation.restore((start, np.zeros(1)))
    np.testing.assert_array_equal(simulation.state.positions, before)


@pytest.mark.parametrize("steps", [0, 2.0, "3", None])
def test_a_number_of_steps_that_is_none_is_refused(steps: Any) -> None:
    simulation = Simulation(load_scene("pendulum"))
    with raises_naming(SceneError, f"steps is {steps!r}", "whole number", "at least 1"):
        simulation.advance(steps)
    assert simulation.state.step == 0


JUMP, STABLE, COROTATIONAL = (
    "1.5 rad and 35 mm in one step",
    "noise 50 %, stable neo-Hooke",
    "noise 50 %, corotational",
)
SOFT, TURNED, SLIVERS = stability.BLOCKS
SOME = ("t4", "t10", "h8_modes", "h8_mean", "h20")
SAMPLE = [
    *[(JUMP, element, scheme) for element in ("t4", "h8_modes") for scheme in stability.SCHEMES],
    *[("dt 0.1 s", element, scheme) for element in SOME for scheme in stability.SCHEMES],
    *[(SLIVERS, element, scheme) for element in ("t4", "h8_modes") for scheme in stability.SCHEMES],
    *[("E 10 MPa", element, "implicit_euler") for element in SOME],
    *[("gravity x100", element, "bdf2") for element in ("t4", "h8_modes", "h20")],
    *[("nu 0.499", element, "implicit_euler") for element in ("t4", "h8_modes", "h20")],
    *[(STABLE, element, "implicit_euler") for element in ("t4", "h8_modes")],
    *[(STABLE, "h8_modes", scheme) for scheme in ("bdf2", "tr_bdf2")],
    (JUMP, "h20", "bdf2"),
    (COROTATIONAL, "t4", "bdf2"),
    (COROTATIONAL, "t10", "implicit_euler"),
    (COROTATIONAL, "h8_modes", "implicit_euler"),
    (COROTATIONAL, "h20", "implicit_euler"),
    (SOFT, "t4", "implicit_euler"),
    (TURNED, "t4", "tr_bdf2"),
]
"""The cells of the matrix that `make test` runs; the others take four minutes."""

CELLS = itertools.product(stability.CASES, stability.ELEMENTS, stability.SCHEMES)


@pytest.mark.parametrize(("name", "element", "scheme"), sampled(CELLS, *SAMPLE))
def test_cell_of_the_stability_matrix(name: str, element: str, scheme: str) -> None:
    found = stability.run(name, element, scheme)
    assert not found.failure
    if "noise" in name:
        assert found.inverted < -0.1  # elements are inside out at the start
    if scheme == "implicit_euler":  # its potential bounds the energy of every step by that of the step before
        assert found.rise < 1e-6


def test_the_matrix_sees_what_does_not_come_to_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    brief = stability.Case(seconds=0.05)
    monkeypatch.setitem(stability.TRIPOD, JUMP, brief)
    assert "still moving" in stability.run(JUMP, "h8_modes", "bdf2").failure


def test_the_matrix_sees_what_ends_inside_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Simulation, "step", lambda self, joints: self.report)
    assert "ends inside out" in stability.run(STABLE, "h8_modes", "bdf2").failure


def test_the_matrix_sees_energy_that_grows(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = Simulation.step

    def push(self: Simulation, joints: np.ndarray) -> object:
        report = whole(self, joints)
        if self.state.step == 20:
            self.state.velocities[:, 2] += 20.0
        return report

    monkeypatch.setattr(Simulation, "step", push)
    assert "energy grows" in stability.run("gravity x100", "h8_modes", "implicit_euler").failure
