"""One factorisation that serves many steps: as exact as Newton's method, with fewer factorisations."""

from pathlib import Path

import numpy as np
import pytest

from tests.scenes import held_bar
from tripod_sim import Simulation, load_scene
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
@pytest.mark.parametrize("element", ["t4", "h20"])
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
