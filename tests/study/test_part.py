"""How a part is refined for an accuracy, and what its mesh costs."""

from pathlib import Path

import numpy as np
import pytest

from tripod_sim.mesh.block import block
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.write import write_mesh
from tripod_sim.scene import at_rest
from tripod_sim.simulation import Simulation
from tripod_study.part import HELD, SAG, bar_scene, held_faces, refined, relative_error, step_cost


@pytest.mark.parametrize("order", [1, 2])
def test_meshes_are_refined_until_the_error_is_small_enough(order: int) -> None:
    seen = list[float]()

    def error_of(size: float) -> tuple[float, int]:
        seen.append(size)
        return 0.4 * (size / 0.01) ** order, round(300 * (0.01 / size) ** 3)

    trials = refined(0.01, 0.05, 10**6, error_of)
    assert [t.size for t in trials] == seen
    assert trials[-1].error <= 0.05
    assert all(t.error > 0.05 for t in trials[:-1])
    assert (np.diff(seen) < 0).all()
    assert 2 * seen[-1] >= seen[-2]
    assert trials[-1].error > 0.05 / 4 / 2 ** (order - 1), "not much finer than needed"


def test_refinement_ends_before_too_many_unknowns() -> None:
    trials = refined(0.01, 0.001, 5000, lambda size: (0.4 * size / 0.01, round(300 * (0.01 / size) ** 3)))
    assert trials[-1].error > 0.001
    assert trials[-1].unknowns > 600
    assert len(trials) < 4


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_part_bends_a_little_under_its_weight_whatever_its_longest_side(axis: int, tmp_path: Path) -> None:
    size = np.roll([0.1, 0.02, 0.02], axis)
    corners = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    )
    mesh = convert(block(corners * size, tuple(np.roll([8, 2, 2], axis).tolist())), "t10")
    path = tmp_path / "bar.msh"
    held = held_faces(mesh)
    write_mesh(path, mesh, {HELD: held})
    scene = bar_scene(path, mesh.nodes)
    error, unknowns = relative_error(scene)
    assert 1e-4 < error < 0.1
    cost = step_cost(scene)
    assert unknowns == cost.unknowns
    assert 1e-5 < cost.step < 10
    simulation = Simulation(at_rest(scene))
    simulation.step()
    moved = np.linalg.norm(simulation.positions - simulation.mesh.nodes, axis=1).max()
    assert 0.5 * SAG < moved / 0.1 < 1.2 * SAG
    at_end = simulation.mesh.nodes[:, axis] == 0
    assert sorted(np.unique(held).tolist()) == np.flatnonzero(mesh.nodes[:, axis] == 0).tolist()
    assert (simulation.positions[at_end] == simulation.mesh.nodes[at_end]).all()
