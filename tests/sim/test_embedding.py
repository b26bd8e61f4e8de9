"""Points embedded in solids of every kind of element, in several kinds at once, and in nets of springs."""

import numpy as np
import pytest

from benchmarks.blocks import brick
from tests.messages import raises_naming
from tripod_sim import SceneError
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.mesh.embedding import Embedding, default_tolerance, in_net, in_solid, in_world, joined
from tripod_sim.mesh.solid_mesh import Block, SolidMesh, check_mesh

SIZE = 0.1
"""Largest extent of the bodies [m]."""


def wavy(element: str, *, away: float = 0.0) -> SolidMesh:
    """Return a brick of 5 x 2 x 3 cells with curved faces, which begins `away` from the origin [m]."""
    mesh = brick(element, [np.linspace(0, SIZE, 6), np.linspace(0, 0.02, 3), np.linspace(0, 0.03, 4)])
    x = mesh.nodes + 0.002 * np.sin(60 * mesh.nodes[:, [1, 2, 0]]) + away
    bent = SolidMesh(x, mesh.blocks)
    check_mesh(bent, "wavy")
    return bent


def within(mesh: SolidMesh, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return random places in the elements of a mesh [m], and the nodes of the element of each."""
    kind, elements = mesh.blocks[0]
    own = elements[rng.integers(0, len(elements), 40)]
    xi = rng.dirichlet(np.ones(kind.corners), 40) @ kind.reference[: kind.corners]
    return np.einsum("pa,pai->pi", kind.functions(xi), mesh.nodes[own]), own


@pytest.mark.parametrize("away", [0.0, 30.0])
@pytest.mark.parametrize("element", ELEMENTS)
def test_a_point_is_found_in_its_element_however_curved_and_moves_with_it(element: str, away: float) -> None:
    rng = np.random.default_rng(3)
    mesh = wavy(element, away=away)
    points, own = within(mesh, rng)
    found = in_solid(points, mesh)
    rounding = 1e-15 * (1 + away)
    np.testing.assert_array_equal(found.nodes, own)
    np.testing.assert_allclose(found.places(mesh.nodes), points, rtol=0, atol=rounding)
    np.testing.assert_allclose(found.weights.sum(axis=1), 1.0, rtol=0, atol=1e-13)
    strain = np.eye(3) + 0.3 * rng.standard_normal((3, 3))
    np.testing.assert_allclose(
        found.places(mesh.nodes @ strain.T + 0.5), points @ strain.T + 0.5, rtol=0, atol=10 * rounding
    )


@pytest.mark.parametrize("element", ELEMENTS)
def test_of_several_elements_a_point_on_their_faces_edges_and_corners_takes_the_first(element: str) -> None:
    mesh = wavy(element)
    kind, elements = mesh.blocks[0]
    found = in_solid(np.array(mesh.nodes), mesh)
    np.testing.assert_allclose(found.places(mesh.nodes), mesh.nodes, rtol=0, atol=1e-15)
    for node, chosen in enumerate(found.nodes):
        first = elements[(elements == node).any(axis=1)][0]
        np.testing.assert_array_equal(chosen, first)
    centres = [kind.reference[list(face.loop)].mean(axis=0) for face in kind.faces]
    points = np.einsum("fa,eai->efi", kind.functions(np.array(centres)), mesh.nodes[elements])
    found = in_solid(points.reshape(-1, 3), mesh)
    np.testing.assert_allclose(found.places(mesh.nodes), points.reshape(-1, 3), rtol=0, atol=1e-15)
    assert ((found.weights != 0.0).sum(axis=1) <= max(face.shape.size for face in kind.faces)).all()
    numbers = {tuple(e): k for k, e in enumerate(elements.tolist())}
    chosen = np.array([numbers[tuple(e)] for e in found.nodes.tolist()])
    assert (chosen <= np.repeat(np.arange(len(elements)), len(centres))).all()


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_point_a_little_outside_is_taken_to_the_surface_and_one_farther_is_refused(element: str) -> None:
    mesh = wavy(element)
    allowed = default_tolerance(mesh.nodes)
    assert allowed == pytest.approx(1e-6 * np.ptp(mesh.nodes, axis=0).max() + 1e-9)
    faces = mesh.boundary[0]
    a, b, c = (mesh.nodes[faces.corners[:, k]] for k in (0, 1, -1))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal, corner = normal[::9], faces.corners[::9, 0]
    for away in (0.1 * allowed, 0.9 * allowed):
        found = in_solid(mesh.nodes[corner] + away * normal, mesh)
        moved = np.linalg.norm(found.places(mesh.nodes) - mesh.nodes[corner] - away * normal, axis=1)
        assert (moved <= away * (1 + 1e-6)).all()
        assert moved.max() > 0.5 * away
    with raises_naming(SceneError, "point 0", "outside", "nearest place"):
        in_solid(mesh.nodes[corner[:1]] + 1.5 * allowed * normal[:1], mesh)
    box = brick(element, [np.linspace(0, SIZE, 6), np.linspace(0, 0.02, 3), np.linspace(0, 0.03, 4)])
    above, below = np.array([[0.047, 0.013, 0.034]]), np.array([[0.047, 0.013, 0.03]])
    with raises_naming(
        SceneError, "via point 1", "0.004 m outside", "(0.047, 0.013, 0.034) m", "(0.047, 0.013, 0.03) m"
    ):
        in_solid(np.concatenate([below, above]), box, name="via point")
    found = in_solid(above, box, tolerance=0.0041)
    np.testing.assert_allclose(found.places(box.nodes), below, rtol=0, atol=1e-15)


@pytest.mark.parametrize("element", ["h20", "t10", "h8"])
def test_the_nearest_place_of_a_curved_surface_is_where_its_normal_points_to_the_point(element: str) -> None:
    """Against dense samples of all faces, of elements that lean over: boxes about them tell little."""
    mesh, rng = wavy(element), np.random.default_rng(7)
    mesh = SolidMesh(mesh.nodes @ [[1, 0, 0], [0, 1, 0], [2.0, 1.0, 1]], mesh.blocks)
    middle = mesh.nodes.mean(axis=0)
    points = middle + [0.14, 0.05, 0.05] * rng.uniform(-1.0, 1.0, (12, 3))
    found = in_solid(points, mesh, tolerance=1.0).places(mesh.nodes)
    outside = np.linalg.norm(found - points, axis=1) > 5e-3
    points, found = points[outside], found[outside]
    assert len(points) > 5
    kind, elements = mesh.blocks[0]
    s = np.linspace(0, 1, 21)
    for point, place in zip(points, found, strict=True):
        least = np.inf
        for face in kind.faces:
            for three in face.shape.triangles:
                c = kind.reference[[face.nodes[i] for i in three]]
                xi = np.array(
                    [c[0] * (1 - p - q) + c[1] * p + c[2] * q for p in s for q in s if p + q <= 1.0]
                )
                samples = np.einsum("pa,eai->epi", kind.functions(xi), mesh.nodes[elements]).reshape(-1, 3)
                least = min(least, float(np.linalg.norm(samples - point, axis=1).min()))
        assert least * (1 - 1e-2) < np.linalg.norm(place - point) < least * (1 + 1e-9)


def test_several_bodies_in_one_numbering_and_points_in_the_world() -> None:
    one, two = wavy("h20"), wavy("t4")
    nodes = np.concatenate([one.nodes, two.nodes + np.array([0, 0.5, 0])])
    both = SolidMesh(nodes, (one.blocks[0], Block(two.kind, two.elements + len(one.nodes))))
    points = np.array([[0.05, 0.011, 0.012], [0.05, 0.511, 0.012]])
    embedded, still = in_solid(points, both), in_world(np.array([[1.0, 2.0, 3.0]]))
    assert embedded.nodes.shape == (2, 20)
    assert (embedded.nodes[0] < len(one.nodes)).all()
    assert (embedded.nodes[1, :4] >= len(one.nodes)).all()
    assert not embedded.weights[1, 4:].any()
    every = joined([still, embedded])
    assert isinstance(every, Embedding)
    moved = every.places(nodes + 0.25)
    np.testing.assert_allclose(moved, [[1, 2, 3], *(points + 0.25)], rtol=0, atol=1e-15)


def test_a_point_of_a_net_is_its_nearest_node() -> None:
    nodes = np.array([[9.0, 9, 9], [0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])
    own = np.array([1, 2, 3])
    found = in_net(np.array([[0.1 + 1e-7, 0, 0], [0.2, 1e-7, 0]]), nodes, own)
    np.testing.assert_array_equal(found.nodes, [[2], [3]])
    np.testing.assert_array_equal(found.places(nodes), nodes[[2, 3]])
    with raises_naming(SceneError, "via point 0", "(0.13, 0, 0) m", "0.03 m", "(0.1, 0, 0) m"):
        in_net(np.array([[0.13, 0, 0]]), nodes, own, name="via point")
    assert in_net(np.array([[0.13, 0, 0]]), nodes, own, tolerance=0.04).nodes.tolist() == [[2]]
