"""One factorisation that serves many steps: as exact as Newton's method, with fewer factorisations."""

from pathlib import Path

import numpy as np
import pytest

from tests.scenes import held_bar
from tripod_host.rotations import rotation_matrix
from tripod_sim import Simulation, load_scene
from tripod_sim.forces import solid_arrays
from tripod_sim.integrators import quasi_newton
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.turning import Rotations
from tripod_sim.steps import steppers


@pytest.fixture
def beam(tmp_path: Path):
    """Return what builds the beam, with overrides."""
    path = tmp_path / "beam.toml"
    path.write_text(held_bar((14, 2, 2)))
    return lambda *words: Simulation(load_scene(str(path), list(words)))


def fall(simulation: Simulation, steps: int) -> tuple[int, float]:
    """Return how many factorisations steps took, and the largest unbalanced force in the end of one [N]."""
    count, worst = 0, 0.0
    for _ in range(steps):
        simulation.step()
        count += simulation.report.factorisations
        worst = max(worst, simulation.report.residual)
    return count, worst


def by_newton(model, system) -> Newton:
    return Newton(system, model.solver.tolerance, model.solver.max_iterations)


@pytest.mark.parametrize("scheme", ["implicit_euler", "bdf2", "tr_bdf2"])
@pytest.mark.parametrize("element", ["t4", "h20", "h8_modes"])
def test_it_ends_where_newton_does_with_fewer_factorisations(
    beam, monkeypatch: pytest.MonkeyPatch, scheme: str, element: str
) -> None:
    words = (
        f"inertia.scheme={scheme}",
        f"mesh.element={element}",
        "mesh.cells=[8,1,1]",
        "solver.tolerance=1e-9",
    )
    ours = beam(*words)
    found, residual = fall(ours, 20)
    monkeypatch.setattr(steppers, "_solver_to_tolerance", by_newton)
    other = beam(*words)
    needed, _ = fall(other, 20)
    assert residual <= ours.scene.solver.tolerance
    assert ours.state.positions[:, 2].min() < -0.03
    np.testing.assert_allclose(ours.state.positions, other.state.positions, atol=1e-7)
    assert 3 * found < needed


def test_turning_the_factorisation_spares_others(beam, monkeypatch: pytest.MonkeyPatch) -> None:
    found, _ = fall(beam(), 25)
    monkeypatch.setattr(
        Rotations, "at", lambda self, state: np.tile(np.eye(3), (len(self._around) + 2 * self._bodies, 1, 1))
    )
    unturned, _ = fall(beam(), 25)
    assert 2 * found < unturned


TURN = 'prescribed=[{set="tip", turn="0: 0,0,0; 0.25: 0,1.2,0", centre=[0.2,0.01,0.01]}]'


def test_condensations_of_modes_turn_with_their_elements(beam, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are those of the turned body, and spare steps."""
    simulation = beam("mesh.element=h8_modes", "solver.tolerance=1e-7", TURN)
    (solid,) = simulation.system.elastic.terms
    simulation.step()
    x, modes = simulation.state.positions, simulation.state.modes
    solid.stiffness(x, modes, project=False)
    R = rotation_matrix(np.array([0.3, -0.2, 0.5]))
    solid.turn_modes(np.tile(R, (len(solid.elements), 1, 1)))
    turned = solid.solid.X.copy(), solid.solid.inverse.copy()
    solid.stiffness(x @ R.T, modes @ R.T, project=False)
    np.testing.assert_allclose(solid.solid.X, turned[0], atol=1e-9 * np.abs(turned[0]).max())
    np.testing.assert_allclose(solid.solid.inverse, turned[1], atol=1e-9 * np.abs(turned[1]).max())
    counts = []
    for turns in (True, False):
        if not turns:
            monkeypatch.setattr(type(solid), "turn_modes", lambda self, rotations: None)
        simulation, count = beam("mesh.element=h8_modes", "solver.tolerance=1e-7", TURN), 0
        for _ in range(25):
            simulation.step()
            count += simulation.report.iterations + 5 * simulation.report.factorisations
        counts.append(count)
    assert counts[0] < 0.9 * counts[1], counts


def test_modes_are_remembered_with_the_nodes(beam, monkeypatch: pytest.MonkeyPatch) -> None:
    """A gradient without the modes' part would be that of another potential."""
    words = ("mesh.element=h8_modes", "mesh.cells=[8,1,1]", "solver.tolerance=1e-9")
    counts = []
    for curved in (quasi_newton.CURVED, 2.0):
        monkeypatch.setattr(quasi_newton, "CURVED", curved)
        simulation, count = beam(*words), 0
        for _ in range(20):
            simulation.step()
            count += simulation.report.iterations + 5 * simulation.report.factorisations
        counts.append(count)
    assert counts[0] < counts[1], counts


def test_remembering_steps_spares_steps(beam, monkeypatch: pytest.MonkeyPatch) -> None:
    counts = []
    for curved in (quasi_newton.CURVED, 2.0):  # no cosine is larger
        monkeypatch.setattr(quasi_newton, "CURVED", curved)
        simulation, count = beam("material.poisson=0.49"), 0
        for _ in range(25):
            simulation.step()
            count += simulation.report.iterations
        counts.append(count)
    assert counts[0] < counts[1]


def test_after_a_reset_it_makes_the_same_steps(beam) -> None:
    simulation = beam()
    fall(simulation, 12)
    first = simulation.state.positions.copy()
    simulation.reset()
    fall(simulation, 12)
    np.testing.assert_array_equal(simulation.state.positions, first)


@pytest.mark.parametrize("angle", [0.5, 1.5])
def test_a_jump_of_the_tip_is_solved(beam, angle: float) -> None:
    turn = f'prescribed=[{{set="tip", turn="0: 0,0,0; 0.01: 0,{angle},0", centre=[0.2,0.01,0.01]}}]'
    simulation = beam(turn)
    _, residual = fall(simulation, 5)
    assert residual <= simulation.scene.solver.tolerance
    assert np.isfinite(simulation.state.positions).all()


def test_a_body_with_a_disc_and_servos_is_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["solver.mode=newton", "mesh.level=1", "servos.angles=[-0.4,-0.4,-0.4]", "solver.tolerance=1e-9"]
    ends, counts = [], []
    for newton in (False, True):
        if newton:
            monkeypatch.setattr(steppers, "_solver_to_tolerance", by_newton)
        simulation, count = Simulation(load_scene("tripod", words)), 0
        for k in range(1, 31):
            simulation.step(np.array([-0.4 - 0.03 * k, -0.4, -0.4, simulation.state.joints[-1]]))
            count += simulation.report.factorisations
        ends.append(simulation.state.positions.copy())
        counts.append(count)
    np.testing.assert_allclose(*ends, atol=1e-7)
    assert 2 * counts[0] < counts[1]


@pytest.mark.parametrize("element", ["t4", "t10", "h8_modes"])
def test_parts_of_a_solid_give_the_same_with_any_number_of_threads(
    beam, element: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    for points, threads in ((10**9, "1"), (60, "1"), (60, "4")):
        monkeypatch.setattr(solid_arrays, "POINTS", points)
        monkeypatch.setenv("NUMBA_NUM_THREADS", threads)
        simulation = beam(f"mesh.element={element}")
        (solid,) = simulation.system.elastic.terms
        assert bool(solid._parts) == (points == 60)
        fall(simulation, 8)
        found.append(simulation.state.positions)
    whole, one, four = found
    assert np.array_equal(one, four)
    assert np.abs(one - whole).max() < 1e-8


def test_a_part_that_is_unstable_or_infinite_is_told(beam, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solid_arrays, "POINTS", 60)
    simulation = beam("material.law=neo_hooke")
    (solid,) = simulation.system.elastic.terms
    x = simulation.state.positions.copy()
    x[solid.elements[-1]] = x[solid.elements[-1]][::-1]  # inside out
    assert np.isinf(solid.add_gradient(x, solid.rest_modes(), np.zeros_like(x)))


def test_what_is_remembered_of_modes_is_what_they_do(beam, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step of nodes by dx moves modes by -y - X dx, and its gradient is that of the condensations at hand."""
    simulation, seen = beam("mesh.element=h8_modes", "solver.tolerance=1e-7"), 0
    system, newton = simulation.system, simulation._stepper.newton
    (solid,) = system.elastic.terms
    propose, take = newton._proposed, newton.take

    def proposed() -> np.ndarray:
        known = newton._gradient()
        system.known_no_more()
        system.evaluate(newton._state)
        np.testing.assert_allclose(known, newton._gradient(), atol=1e-12 + 1e-9 * np.abs(known).max())
        return propose()

    def taken(phi: float, share: float) -> None:
        nonlocal seen
        before, moved = newton._state.copy(), newton._begun is not None
        take(phi, share)
        if moved and newton._pairs:
            after = newton._state
            dx = (after.positions - before.positions)[solid.elements].reshape(len(solid.elements), -1)
            change = (after.modes - before.modes).reshape(len(dx), -1) + np.einsum(
                "erc,ec->er", solid.solid.X, dx
            )
            said = newton._pairs[-1][0][system.unknowns :]
            np.testing.assert_allclose(change.ravel(), said, atol=1e-14 + 1e-6 * np.abs(said).max())
            seen += 1

    monkeypatch.setattr(newton, "_proposed", proposed)
    monkeypatch.setattr(newton, "take", taken)
    for _ in range(12):
        simulation.step()
    assert seen > 12
