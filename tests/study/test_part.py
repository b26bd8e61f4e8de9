"""How a part is refined for an accuracy, and what its mesh costs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names
from tripod_sim.mesh.block import block
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.write import write_mesh
from tripod_sim.scene import at_rest
from tripod_sim.simulation import Simulation
from tripod_study.part import (
    HELD,
    PLAIN,
    SAG,
    Trial,
    bar_scene,
    error_need,
    held_faces,
    judged,
    refined,
    step_cost,
)  # fmt: skip

ROOM = 64e9


def trial_by(order: int, *, feature: float = np.inf, fill: float = 0.1):
    """Return what gives the mesh of a size, with an error of this order, and the sizes that were asked for.

    `feature`: an edge that the mesh has at most, however large the size.
    """
    seen = list[float]()

    def trial_of(size: float) -> Trial:
        seen.append(size)
        edge = min(size, feature)
        return Trial(size, 0.4 * (edge / 0.01) ** order, round(300 * (0.01 / edge) ** 3), edge, fill)

    return trial_of, seen


@pytest.mark.parametrize("order", [1, 2])
def test_meshes_are_refined_until_the_error_is_small_enough(order: int) -> None:
    trial_of, seen = trial_by(order)
    trials, why = refined(0.01, 0.05, 10**6, ROOM, trial_of)
    assert why == ""
    assert [t.size for t in trials] == seen
    assert trials[-1].error <= 0.05
    assert all(t.error > 0.05 for t in trials[:-1])
    assert (np.diff(seen) < 0).all()
    assert 2 * seen[-1] >= seen[-2]
    assert trials[-1].error > 0.05 / 4 / 2 ** (order - 1), "not much finer than needed"


def test_a_size_that_small_features_make_meaningless_is_left_at_once() -> None:
    trial_of, seen = trial_by(1, feature=0.005)
    refined(0.01, 0.03, 10**6, ROOM, trial_of)
    assert seen[1] == pytest.approx(0.5 * PLAIN * 0.005)


@pytest.mark.parametrize(
    ("most", "room", "fill", "named"),
    [
        (5000, ROOM, 0.1, ("--most-unknowns", 5000)),
        (10**6, 0.5e9, 2.0, ("GB", "0.5 GB")),
        (10**6, ROOM, 100.0, ("GB", "3.3 GB")),  # more entries than are factored
    ],
)
def test_refinement_ends_with_the_reason_before_unknowns_or_memory_are_too_many(
    most: int, room: float, fill: float, named: tuple
) -> None:
    trial_of, _ = trial_by(1, fill=fill)
    trials, why = refined(0.01, 0.001, most, room, trial_of)
    assert trials[-1].error > 0.001
    assert len(trials) < 4
    assert_names(why, *named)


def test_what_an_estimate_needs_is_told_as_measured() -> None:
    cube = error_need(70644 // 8, 115549245 / 70644**1.5)
    assert cube.memory == pytest.approx(2.505e9, rel=0.1)
    bar = error_need(81120 // 8, 65344374 / 81120**1.5)
    assert bar.memory == pytest.approx(1.495e9, rel=0.1)
    assert 10 < bar.seconds < cube.seconds < 1000


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
    found = judged(scene, 0.01, 0.008)
    unknowns = found.unknowns
    assert 1e-4 < found.error < 0.1
    fine = Simulation(replace(at_rest(scene), mesh=replace(scene.mesh, refine=1)))
    assert found.fill == pytest.approx(fine._system.linear.entries / fine.unknowns**1.5)
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
