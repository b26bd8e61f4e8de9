"""Closed surfaces of meshes: cavities by number, faces of sets, caps, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.blocks import brick
from tests.messages import assert_names, raises_naming
from tests.sim.hollow_bodies import sphere_shell, tube
from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim import SceneError
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.mesh.cavity import cavity_faces, closed_surfaces, faces_of_set
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import Block, SolidMesh, check_mesh

CAVITY, SET = "chamber.0.cavity", "chamber.0.set"
KINDS = ("t4", "t10", "h8", "h20", "h27")


def without(element: str, cells: tuple[int, int, int], holes: list[tuple[int, int, int]]) -> SolidMesh:
    """A brick of unit cells without some of them, given by their place in the grid."""
    whole = brick("h8", [np.linspace(0, n, n + 1) for n in cells])
    centres = whole.nodes[whole.elements].mean(axis=1)
    kept = np.ones(len(centres), dtype=bool)
    for hole in holes:
        kept &= np.abs(centres - np.array(hole) - 0.5).max(axis=1) > 0.1
    used, elements = np.unique(whole.elements[kept], return_inverse=True)
    mesh = SolidMesh.of(whole.nodes[used], elements.reshape(-1, 8), whole.kind)
    return mesh if element == "h8" else convert(mesh, element)


def within(mesh: SolidMesh, low: list[float], high: list[float]) -> IndexArray:
    """Nodes in a box."""
    return np.flatnonzero(
        ((mesh.nodes > np.array(low) - 1e-9) & (mesh.nodes < np.array(high) + 1e-9)).all(axis=1)
    )


TWO = [(1, 1, 3), (1, 1, 1)]


@pytest.mark.parametrize("element", KINDS)
def test_cavities_are_numbered_by_their_smallest_node(element: str) -> None:
    mesh = without(element, (3, 3, 5), TWO)
    assert [round(s.volume(mesh.nodes), 12) for s in closed_surfaces(mesh)] == [-45, 1, 1]
    for number, z in ((0, 1), (1, 3)):
        found = cavity_faces(mesh, number, CAVITY)
        np.testing.assert_array_equal(found.nodes, within(mesh, [1, 1, z], [2, 2, z + 1]))
        assert not found.rims
        assert sum(len(faces.nodes) for faces in found.faces) == (6 if element.startswith("h") else 12)
    assert found.nodes.min() > cavity_faces(mesh, 0, CAVITY).nodes.min()


def test_a_pocket_smaller_than_an_element_is_no_cavity() -> None:
    mesh = without("h8", (3, 3, 5), TWO)
    low = within(mesh, [1, 1, 1], [2, 2, 2])
    nodes = mesh.nodes.copy()
    nodes[low] = 1.5 + 0.3 * (nodes[low] - 1.5)
    mesh = replace(mesh, nodes=nodes)
    assert [round(s.volume(mesh.nodes), 3) for s in closed_surfaces(mesh)] == [-45, 0.027, 1]
    assert cavity_faces(mesh, 0, CAVITY).volume(mesh.nodes) == pytest.approx(1)
    with raises_naming(SceneError, "1 cavity", "0 to 0"):
        cavity_faces(mesh, 1, CAVITY)


def test_each_of_several_bodies_has_its_outside() -> None:
    one = without("h8", (3, 3, 3), [(1, 1, 1)])
    shift = np.array([10.0, 0.0, 0.0])
    two = SolidMesh.of(
        np.concatenate([one.nodes, 2 * one.nodes + shift]),
        np.concatenate([one.elements, one.elements + len(one.nodes)]),
        one.kind,
    )
    assert sorted(round(s.volume(two.nodes), 9) for s in closed_surfaces(two)) == [-216, -27, 1, 8]
    assert cavity_faces(two, 1, CAVITY).volume(two.nodes) == pytest.approx(8)


def test_a_cavity_between_elements_of_two_kinds_has_faces_of_each() -> None:
    """One hexahedron beside the cavity is divided into two wedges, whose triangles lie at the cavity."""
    mesh = without("h8", (3, 3, 3), [(1, 1, 1)])
    beside = np.abs(mesh.nodes[mesh.elements].mean(axis=1) - [1.5, 2.5, 1.5]).max(axis=1) < 0.1
    wedges = np.concatenate([mesh.elements[beside][:, k] for k in ([0, 5, 1, 3, 6, 2], [0, 4, 5, 3, 7, 6])])
    both = SolidMesh(mesh.nodes, (Block(mesh.kind, mesh.elements[~beside]), Block(ELEMENTS["w6"], wedges)))
    check_mesh(both, "both")
    found = cavity_faces(both, 0, CAVITY)
    assert sorted((faces.shape.corners, len(faces.nodes)) for faces in found.faces) == [(3, 2), (4, 5)]
    assert found.volume(both.nodes) == pytest.approx(1)


def test_a_body_without_a_cavity_says_how_many_surfaces_it_has() -> None:
    with raises_naming(SceneError, CAVITY, "no cavity", "1 closed surface", "cap = true"):
        cavity_faces(brick("h8", [np.linspace(0, 1, 2)] * 3), 0, CAVITY)


@pytest.mark.parametrize("number", [-1, 2])
def test_a_number_out_of_range_is_refused_with_what_there_is(number: int) -> None:
    mesh = without("h8", (3, 3, 5), TWO)
    with raises_naming(
        SceneError, CAVITY, number, "2 cavities", "0 to 1", "1 m³", "(1.5, 1.5, 1.5)"
    ) as caught:
        cavity_faces(mesh, number, CAVITY)
    assert_names(caught.value, "(1.5, 1.5, 3.5)")


@pytest.mark.parametrize("element", KINDS)
def test_the_faces_of_a_set_are_those_of_its_cavity(element: str) -> None:
    mesh = without(element, (3, 3, 5), TWO)
    found = faces_of_set(mesh, within(mesh, [1, 1, 3], [2, 2, 4]), SET, "upper")
    np.testing.assert_array_equal(found.nodes, cavity_faces(mesh, 1, CAVITY).nodes)
    assert found.volume(mesh.nodes) == pytest.approx(1)


WELL = [(1, 1, 1), (1, 1, 2)]
"""Of a brick of 3 x 3 x 3: a hole from the top."""


@pytest.mark.parametrize("element", KINDS)
def test_a_set_that_does_not_close_names_open_edges_by_their_ends(element: str) -> None:
    mesh = without(element, (3, 3, 3), WELL)
    well = within(mesh, [1, 1, 1], [2, 2, 3])
    with raises_naming(SceneError, SET, "'well'", "4 edges", "cap = true") as caught:
        faces_of_set(mesh, well, SET, "well")
    message, corners = str(caught.value), ("(1, 1, 3)", "(2, 1, 3)", "(2, 2, 3)", "(1, 2, 3)")
    ends = [(a, b) for a in corners for b in corners if f"{a} to {b} m" in message]
    assert len(ends) == 3
    assert all(corners.index(a) - corners.index(b) in (1, -1, 3, -3) for a, b in ends)


def test_a_set_without_faces_is_refused() -> None:
    mesh = without("h8", (3, 3, 3), [(1, 1, 1)])
    with raises_naming(SceneError, SET, "'edge'", "2 nodes", "enlarge the set"):
        faces_of_set(mesh, within(mesh, [1, 1, 1], [2, 1, 1]), SET, "edge")


@pytest.mark.parametrize("low", [-1.0, 2.5])
def test_the_outside_of_a_body_is_no_chamber(low: float) -> None:
    """Alone, closed or by a cap, and together with the cavity."""
    mesh = without("h8", (3, 3, 3), [(1, 1, 1)])
    with raises_naming(SceneError, SET, "'all'", "-26 m³", "outside"):
        faces_of_set(mesh, np.arange(len(mesh.nodes)), SET, "all")
    with raises_naming(SceneError, SET, "'top'", "m³", "outside"):
        faces_of_set(mesh, np.flatnonzero(mesh.nodes[:, 2] > low), SET, "top", cap=True)


@pytest.mark.parametrize("element", KINDS)
def test_a_cap_closes_a_well_and_its_pressure_acts_on_the_rim(element: str) -> None:
    mesh = without(element, (3, 3, 3), WELL)
    found = faces_of_set(mesh, within(mesh, [1, 1, 1], [2, 2, 3]), SET, "well", cap=True)
    (rim,) = found.rims
    assert rim.shape == (4, 3)
    assert ((rim[:, 2] >= 0) == (element in ("t10", "h20", "h27"))).all()
    assert found.volume(mesh.nodes) == pytest.approx(2)
    tilted = mesh.nodes + 0.3 * mesh.nodes[:, [2, 0, 1]] * mesh.nodes[:, [1]]  # the rim is no longer planar
    assert found.volume(tilted) == pytest.approx(found.volume(tilted + 7.0))


def test_each_opening_of_a_tube_gets_its_cap() -> None:
    mesh = tube("h20", 0.01, 0.02, 0.005, 4, 1)
    inner = np.flatnonzero(np.linalg.norm(mesh.nodes[:, :2], axis=1) < 0.01 + 1e-9)
    found = faces_of_set(mesh, inner, SET, "inner", cap=True)
    assert len(found.rims) == 2
    assert found.volume(mesh.nodes) == pytest.approx(np.pi * 1e-4 * 0.005, rel=2e-4, abs=0)


def missing_half(mesh: SolidMesh) -> IndexArray:
    """Nodes of the cavity of a sphere without those in one octant beyond a plane, so that the rim is bent."""
    nodes: FloatArray = mesh.nodes
    inner = np.linalg.norm(nodes, axis=1) < 0.01 + 1e-9
    return np.flatnonzero(inner & ~((nodes > 1e-9).sum(axis=1) >= 2))


def test_a_rim_far_from_a_plane_gets_no_cap() -> None:
    mesh = sphere_shell("h8", 0.01, 0.02, 4, 1)
    with raises_naming(SceneError, SET, "'most'", "planar"):
        faces_of_set(mesh, missing_half(mesh), SET, "most", cap=True)


def test_openings_that_meet_in_a_node_get_no_cap() -> None:
    """The bottom of a chamber of 2 x 2 cells with two opposite quarters of its bottom left out."""
    holes = [(x, y, 1) for x in (1, 2) for y in (1, 2)]
    mesh = without("h8", (4, 4, 3), [*holes, (1, 1, 0), (2, 2, 0)])
    chamber = within(mesh, [1, 1, 1], [3, 3, 2])
    with raises_naming(SceneError, SET, "'room'", "simple loop", "(2, 2, 1)"):
        faces_of_set(mesh, chamber, SET, "room", cap=True)
