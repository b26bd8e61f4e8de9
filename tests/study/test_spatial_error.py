"""Finer meshes, and the error of a mesh estimated by the next finer one."""

from dataclasses import replace

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.scenes import SHARP
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.element import node_volumes
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.refine import HALVED, refine
from tripod_sim.mesh.solid_mesh import check_mesh
from tripod_sim.mesh.y_piece import LEVELS, divided, y_piece
from tripod_study.spatial_error import spatial_error

SAG, ENERGY = -2.097e-3, 0.6959
"""Height of the flat piece under its weight [m] and strain energy with all servos at -45 degrees [J], converged."""


@pytest.mark.parametrize("name", [e.name for e in ELEMENTS.values() if e.plain.cell in HALVED])
def test_every_cell_becomes_eight_and_the_volume_stays(name: str) -> None:
    mesh = convert(y_piece(LEVELS[1]), name)
    fine = refine(mesh)
    check_mesh(fine, "refined")
    assert len(fine.elements) == 8 * len(mesh.elements)
    assert fine.kind is mesh.kind
    volumes = [node_volumes(m.kind, m.nodes[m.elements])[0].sum() for m in (mesh, fine)]
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-12)
    corners = np.unique(mesh.elements[:, : mesh.kind.corners])
    gaps = np.linalg.norm(fine.nodes[:, None] - mesh.nodes[corners][None], axis=2).min(axis=0)
    assert gaps.max() < 1e-12
    assert len(fine.boundary[0].nodes) == 4 * len(mesh.boundary[0].nodes)  # neighbours fit together


def test_the_generator_divides_as_its_own_family_of_levels() -> None:
    for m in (2, 3, 4):
        found, expected = (list(vars(level).values()) for level in (divided(LEVELS[8], m), LEVELS[7 + m]))
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    fine = Simulation(load_scene(SHARP, ["mesh.level=8", "mesh.refine=1"]))
    np.testing.assert_allclose(fine.mesh.nodes, y_piece(LEVELS[9]).nodes, atol=1e-12)


@pytest.mark.parametrize("level", [1, 2])
def test_the_estimate_is_within_a_factor_three_of_the_true_error(level: int) -> None:
    scene = load_scene(SHARP, [f"mesh.level={level}"])
    sag = spatial_error(scene)
    assert sag.position is not None and sag.effector is not None
    true = SAG - sag.position[2]
    assert 1 / 3 < sag.effector[2] / true < 3
    assert abs(true) > 5e-5
    bent = spatial_error(scene, np.array([-np.pi / 4, -np.pi / 4, -np.pi / 4, 0.0]))
    true = ENERGY - bent.strain_computed
    assert 1 / 3 < bent.strain / true < 3
    assert abs(true) > 5e-3
    assert bent.largest >= np.linalg.norm(bent.effector) - 1e-9


def test_a_piece_without_effector_or_servos_has_one_too() -> None:
    found = spatial_error(load_scene("silicone", ["mesh.level=1"]))
    assert found.effector is None and found.position is None
    assert found.efforts.shape == (0,)
    assert 1e-6 < found.largest < 0.05


def test_it_is_the_same_twice_and_leaves_effects_of_motion_out() -> None:
    scene = load_scene(SHARP, ["mesh.level=1"])
    plain = replace(scene, inertia=None, damping=None)
    found = [spatial_error(s) for s in (scene, plain, replace(scene))]
    assert {f.largest for f in found} == {found[0].largest}


@pytest.mark.parametrize(
    ("name", "words", "named"),
    [
        ("pendulum", [], ("springs", "no mesh")),
        ("bounce", [], ("rigid bodies", "no mesh")),
        ("silicone", ["fixed=off"], ("nothing holds the body",)),
        ("tripod", ["mesh.refine=3"], ("mesh.refine", 4, "at least 0", "at most 3")),
    ],
)
def test_what_has_no_estimate_is_refused(name: str, words: list[str], named: tuple[object, ...]) -> None:
    with raises_naming(SceneError, *named):
        spatial_error(load_scene(name, words))


def test_joints_that_do_not_fit_are_refused() -> None:
    with raises_naming(SceneError, "joints", "(3,)", "needs (4,)"):
        spatial_error(load_scene(SHARP), np.zeros(3))


def test_a_body_that_prescribed_motions_alone_hold_has_an_estimate() -> None:
    place = "low=[0.045,-0.02,-0.01], high=[0.06,0.02,0.01]"
    words = [f'set=[{{name="held", {place}}}]', 'prescribed=[{set="held", move="0: 0,0,0"}]', "fixed=off"]
    held = spatial_error(load_scene("silicone", ["mesh.level=1", *words]))
    assert held.largest == pytest.approx(spatial_error(load_scene("silicone", ["mesh.level=1"])).largest)
