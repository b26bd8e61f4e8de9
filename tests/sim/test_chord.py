"""Steps with a kept factorisation that turns with the body."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tripod_sim import Simulation, load_scene
from tripod_sim.integrators.turning import Rotations, TurningSolver
from tripod_sim.linear.solver import LinearSolver
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.system import System

W = -1.4965


class Dense(LinearSolver):
    """Solves with a dense matrix."""

    def __init__(self, matrix: np.ndarray) -> None:
        self.matrix = matrix

    def factor(self) -> bool:
        return True

    def is_positive(self) -> bool:
        return True

    def solve(self, b: np.ndarray) -> np.ndarray:
        return np.linalg.solve(self.matrix, b)


def test_it_solves_as_if_the_matrix_had_turned() -> None:
    rng = np.random.default_rng(1)
    root, b = rng.normal(size=(12, 12)), rng.normal(size=12)
    matrix = root @ root.T + np.eye(12)
    first, second = Rotation.random(4, rng=1).as_matrix(), Rotation.random(4, rng=2).as_matrix()
    solver = TurningSolver(Dense(matrix), 12)
    solver.turn(first)
    assert solver.factor()
    np.testing.assert_array_equal(solver.solve(b), np.linalg.solve(matrix, b))
    solver.turn(second)
    turn = np.zeros((12, 12))
    for k, since in enumerate(second @ first.transpose(0, 2, 1)):
        turn[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = since
    np.testing.assert_allclose(solver.solve(b), np.linalg.solve(turn @ matrix @ turn.T, b))


@pytest.mark.parametrize("element", ["h20", "t4", "h8_modes"])
def test_parts_of_a_body_that_turns_turn_with_it(element: str) -> None:
    simulation = Simulation(load_scene("tripod", [f"mesh.element={element}", "mesh.level=2"]))
    system, mesh = simulation.system, simulation.mesh
    assert isinstance(system, System) and isinstance(mesh, SolidMesh)
    turn = Rotation.from_rotvec([0.3, -1.2, 0.7]).as_matrix()
    state = simulation.state.copy()
    state.positions[:] = system.rest @ turn.T
    state.rotations[0] = turn
    found = Rotations.of_own_mesh(system).at(state)
    assert found.shape == (system.unknowns // 3, 3, 3)
    np.testing.assert_allclose(found, np.broadcast_to(turn, found.shape), atol=1e-9)


def test_it_spares_the_richer_mesh_factorisations(monkeypatch: pytest.MonkeyPatch) -> None:
    counts = []
    for turns in (True, False):
        if not turns:
            monkeypatch.setattr(TurningSolver, "turn", lambda *_: None)
        simulation = Simulation(
            load_scene(
                "tripod", [f"servos.angles=[{W},{W},{W}]", "servos.slide=0.035", "mesh_error={share=1e-9}"]
            )
        )
        estimate, count = simulation._mesh_error, 0
        assert estimate
        factor = estimate._turning.factor

        def counted(factor=factor) -> bool:
            nonlocal count
            count += 1
            return bool(factor())

        monkeypatch.setattr(estimate._turning, "factor", counted)
        for k in range(1, 49):
            simulation.step(np.array([W + 0.01 * k, W, W, 0.035]))
            if k % 12 == 0:
                estimate.estimate(simulation.state)
        counts.append(count)
    assert counts[0] < counts[1], counts
