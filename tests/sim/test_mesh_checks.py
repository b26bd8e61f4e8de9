"""Checks of a volume mesh beyond single elements: coincident nodes, boundaries that are no surface, loose parts."""

import tracemalloc
from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.messages import assert_names, lines_naming, names, raises_naming
from tripod_sim import Simulation
from tripod_sim.build import build
from tripod_sim.effects.gravity import Gravity
from tripod_sim.effects.inertia import Inertia
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.errors import SceneError
from tripod_sim.mesh import solid_mesh
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import SolidMesh, check_boundary, check_held, check_mesh, element_quality
from tripod_sim.mesh.topology import MOST_NEIGHBOURS, coincident, edge_uses, parts
from tripod_sim.mesh.y_piece import LEVELS, y_piece
from tripod_sim.scene import Scene
from tripod_sim.scene.file import scene_from_toml
from tripod_sim.tables.bodies import Material
from tripod_sim.tables.bodies import Mesh as SceneMesh
from tripod_sim.tables.contact import Contact
from tripod_sim.tables.sets import Fixed, Load, NodeSet

BRICK = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float
)


def bricks(*origins: tuple[float, float, float]) -> SolidMesh:
    """Return unit bricks that share the nodes at which they touch."""
    corners = np.concatenate([BRICK + np.array(origin) for origin in origins])
    nodes, elements = np.unique(corners, axis=0, return_inverse=True)
    return SolidMesh.of(nodes, elements.reshape(-1, 8))


def refusal(mesh: SolidMesh) -> str:
    with pytest.raises(SceneError) as caught:
        check_mesh(mesh, "the mesh")
    return str(caught.value)


def grid(n: int) -> np.ndarray:
    return np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3).astype(float)


def test_equal_points_are_all_named_wherever_they_stand() -> None:
    points = np.vstack([grid(5), grid(5)[[7, 40]], -0.0 * grid(5)[:1]])
    np.testing.assert_array_equal(coincident(points, 0.0), [0, 7, 40, 125, 126, 127])
    np.testing.assert_array_equal(coincident(np.ones((3000, 3)), 0.0), np.arange(3000))


@pytest.mark.parametrize("at", [0.0, 0.5e-6, 1.0, 3.3])
def test_near_points_are_found_in_any_direction_and_no_others(at: float) -> None:
    """Also across the limits of any raster: the pairs stand at many places."""
    rng = np.random.default_rng(2)
    base = grid(6) + at
    apart = rng.standard_normal((len(base), 3))
    apart *= 1e-6 / np.linalg.norm(apart, axis=1)[:, None]
    assert not coincident(base, 1e-6).size
    pairs = np.vstack([base, base + 0.99 * apart])
    np.testing.assert_array_equal(coincident(pairs, 1e-6), np.arange(2 * len(base)))
    assert not coincident(np.vstack([base, base + 1.01 * apart]), 1e-6).size


def test_near_points_behind_a_crowd_are_found_up_to_its_limit() -> None:
    """Points in a plane across the direction of sorting all lie between the two of a pair."""
    direction = np.array([0.5377, 0.6180, 0.5735])
    across = np.cross(direction, [1.0, 0, 0])
    crowd = np.outer(np.arange(1, MOST_NEIGHBOURS), across)
    step = 1e-6 * direction / np.linalg.norm(direction)
    points = np.vstack([-0.4 * step, crowd, 0.4 * step])
    np.testing.assert_array_equal(coincident(points, 1e-6), [0, len(points) - 1])


def test_a_hostile_crowd_costs_no_square_of_its_size() -> None:
    points = np.random.default_rng(0).uniform(0, 1e-12, (20_000, 3))
    tracemalloc.start()
    assert coincident(points, 1e-9).size == len(points)
    assert tracemalloc.get_traced_memory()[1] < 20_000 * 1000  # 3.2 GB would be the square
    tracemalloc.stop()


def test_edges_are_counted_once_for_each_polygon() -> None:
    edges, uses = edge_uses([np.array([[0, 1, 2, 3], [1, 0, 4, 5]])])
    assert {tuple(e): n for e, n in zip(edges.tolist(), uses.tolist(), strict=True)} == {
        (0, 1): 2, (1, 2): 1, (2, 3): 1, (0, 3): 1, (0, 4): 1, (4, 5): 1, (1, 5): 1
    }  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_parts_are_those_of_a_search(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = rng.permutation(300)
    rows = np.stack([chain[:-1], chain[1:]], 1)[rng.permutation(299)]
    rows = np.delete(rows, rng.integers(299, size=6), axis=0)
    near: dict[int, set[int]] = {i: {i} for i in range(300)}
    for a, b in rows.tolist():
        near[a].add(b)
        near[b].add(a)
    label = parts([rows], 300)
    for start in range(300):
        seen, waiting = {start}, [start]
        while waiting:
            new = near[waiting.pop()] - seen
            seen |= new
            waiting += new
        assert label[start] == min(seen)


HINGED = bricks((0, 0, 0), (1, 1, 0))


def test_elements_that_touch_along_an_edge_only_have_no_surface_for_contact() -> None:
    shared = [int(np.flatnonzero((HINGED.nodes == [1, 1, z]).all(axis=1))[0]) for z in (0, 1)]
    check_mesh(HINGED, "a mesh")
    with raises_naming(SceneError, "the mesh", f"nodes {shared[0]}, {shared[1]}", "contact", "fill the gap"):
        check_boundary(HINGED, "the mesh")
    check_boundary(bricks((0, 0, 0), (1, 1, 0), (1, 0, 0)), "with the gap filled")
    check_boundary(bricks((0, 0, 0), (1, 1, 1)), "touching in one node")


@pytest.mark.parametrize("name", ELEMENTS)
def test_every_element_knows_its_edges(name: str) -> None:
    with raises_naming(SceneError, "nodes", "an edge only"):
        check_boundary(convert(HINGED, name), "the mesh")
    ring = [(x, y, 0) for x in range(3) for y in range(3) if (x, y) != (1, 1)]
    check_boundary(convert(bricks(*ring), name), "ring")


def hinged(folder: Path, **more: object) -> Scene:
    """Return a scene of two bricks that share an edge, or a node."""
    mesh = more.pop("mesh", HINGED)
    assert isinstance(mesh, SolidMesh)
    meshio.write(folder / "two.vtu", meshio.Mesh(mesh.nodes, [("hexahedron", mesh.elements)]))
    described = SceneMesh(str(folder / "two.vtu"))
    return Scene("two", described, Material(density=1000.0), **{"inertia": Inertia(), **more})  # type: ignore[arg-type]


@pytest.mark.parametrize("mesh", [HINGED, bricks((0, 0, 0), (1, 1, 1))])
def test_a_mesh_whose_elements_share_an_edge_or_a_node_only_moves(mesh: SolidMesh, tmp_path: Path) -> None:
    """It falls as one: implicit Euler's steps add up to g dt² n (n + 1) / 2."""
    simulation = Simulation(hinged(tmp_path, mesh=mesh, gravity=Gravity((0.0, 0.0, -10.0)), dt=0.01))
    for _ in range(10):
        simulation.step()
    moved = simulation.positions - mesh.nodes
    np.testing.assert_allclose(moved, np.tile([0, 0, -10 * 0.01**2 * 55], (len(moved), 1)), atol=1e-9)


def test_a_pressure_needs_no_surface_that_is_closed_at_an_edge(tmp_path: Path) -> None:
    """On the two lower faces of 1 m²: 5 Pa push 2000 kg up by p A / m, less than a millionth of g."""
    low = NodeSet("low", along=(0.0, 0.0, 1.0), at=0.0)
    simulation = Simulation(hinged(tmp_path, set=(low,), load=(Load("low", pressure=5.0),), dt=0.01))
    simulation.step()
    mass = np.full(len(simulation.positions), 125.0)  # an eighth of a brick
    mass[np.flatnonzero((HINGED.nodes[:, :2] == 1).all(axis=1))] = 250.0
    mean = mass @ (simulation.positions - HINGED.nodes) / mass.sum()
    np.testing.assert_allclose(mean, [0, 0, 10.0 / 2000.0 * 0.01**2], atol=1e-12)


def test_contact_of_elements_that_share_an_edge_only_is_refused_with_what_to_do(tmp_path: Path) -> None:
    with raises_naming(SceneError, "mesh.source", "two.vtu", "nodes", "own", "[contact]"):
        Simulation(hinged(tmp_path, contact=Contact(self_contact=True), gravity=Gravity()))


def test_a_face_of_three_elements_is_refused_with_its_nodes() -> None:
    """Two bricks on one side of a face, a little apart."""
    mesh = bricks((0, 0, 0), (1, 0, 0))
    face = np.flatnonzero(mesh.nodes[:, 0] == 1)
    far = np.array([[1.5, 0.1, 0.1], [1.5, 1.1, 0.1], [1.5, 0.1, 1.1], [1.5, 1.1, 1.1]])
    nodes = np.vstack([mesh.nodes, far])
    n = len(mesh.nodes)
    third = [*mesh.elements[1]]
    for corner, node in enumerate(mesh.elements[1]):
        if mesh.nodes[node, 0] == 2:
            _, y, z = mesh.nodes[node]
            third[corner] = n + int(y) + 2 * int(z)
    refused = refusal(SolidMesh.of(nodes, [*mesh.elements, third]))
    assert_names(refused, "the mesh", f"faces at nodes {', '.join(map(str, face))}", "more than two elements")


def test_quality_does_not_depend_on_how_many_elements_are_kept_at_a_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mesh = convert(y_piece(LEVELS[2]), "t10")
    whole = element_quality(mesh)
    assert whole.shape == (len(mesh.elements),)
    assert len(np.unique(whole.round(6))) > 3
    monkeypatch.setattr(solid_mesh, "CHUNK", 7)
    np.testing.assert_array_equal(element_quality(mesh), whole)


TWO = bricks((0, 0, 0), (1, 0, 0), (5, 0, 0))


def test_every_part_must_be_held_or_tied_to_one_that_is() -> None:
    left, right = np.flatnonzero(TWO.nodes[:, 0] == 0), np.flatnonzero(TWO.nodes[:, 0] == 6)
    check_mesh(TWO, "two parts")  # in motion they may be
    check_held(TWO, [], np.concatenate([left, right]), "m")
    check_held(TWO, [np.concatenate([left[:1], right])], left, "m")
    for bodies, held, loose in (
        ([], left, "12, 13, 14"),
        ([right], left, "12, 13, 14"),
        ([], right, "0, 1, 2"),
    ):
        with raises_naming(SceneError, "m", "2 parts", f"nodes {loose}", "without inertia"):
            check_held(TWO, bodies, held, "m")


def test_a_static_scene_with_a_loose_part_is_refused_and_one_in_motion_is_not(tmp_path: Path) -> None:
    meshio.write(tmp_path / "two.vtu", meshio.Mesh(TWO.nodes, [("hexahedron", TWO.elements)]))
    source = SceneMesh(str(tmp_path / "two.vtu"))
    left = Fixed(low=(0.0, 0.0, 0.0), high=(0.0, 1.0, 1.0))
    right = Fixed(low=(6.0, 0.0, 0.0), high=(6.0, 1.0, 1.0))
    loose = ("2 parts", "nodes 12, 13, 14, 15")
    with raises_naming(SceneError, *loose):
        build(Scene("two", source, Material(), fixed=(left,)))
    build(Scene("two", source, Material(), fixed=(left, right)))
    for fixed, count in ((left,), 1), ((left, right), 0), ((), 0):
        notes = build(Scene("two", source, Material(), fixed=fixed, inertia=Inertia())).notes
        told = lines_naming("\n".join(notes), "2 parts")
        assert len(told) == 1
        assert names(told[0], "by itself") == bool(count)
        assert names(told[0], "gap") == (not count)
        assert_names(told[0], "body 'body'", "no node", *loose)


def test_a_mesh_that_was_accepted_is_checked_once_and_another_like_it_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mesh, asked = bricks((0, 0, 0), (1, 0, 0)), []
    whole = solid_mesh.element_quality
    monkeypatch.setattr(solid_mesh, "element_quality", lambda m: asked.append(m) or whole(m))
    solid_mesh._check.cache_clear()
    for _ in range(3):
        check_mesh(SolidMesh.of(mesh.nodes, mesh.elements), "the mesh")
    assert len(asked) == 1
    moved = mesh.nodes.copy()
    moved[mesh.elements[0, 6]] -= 3.0
    assert_names(refusal(SolidMesh.of(moved, mesh.elements)), "inverted")
    assert_names(refusal(SolidMesh.of(mesh.nodes, mesh.elements[:, [4, 5, 6, 7, 0, 1, 2, 3]])), "inverted")


MILLIMETRES = """
name = "brick"
gravity = {}
[mesh]
source = "block"
scale = 0.001
corners = [[0,0,0],[20,0,0],[20,10,0],[0,10,0],[0,0,10],[20,0,10],[20,10,10],[0,10,10]]
cells = [2, 1, 1]
[material]
mass = 0.002
[[fixed]]
low = [0, 0, 0]
high = [0, 1, 1]
"""


def test_what_has_no_effect_or_no_sensible_mass_is_told() -> None:
    """Of a brick of 20 x 10 x 10 mm, corners in millimetres; 2 g are 1000 kg/m³."""
    assert Simulation(scene_from_toml(MILLIMETRES)).notes == ()
    (unread,) = Simulation(scene_from_toml(MILLIMETRES.replace("cells", "level = 3\nlegs = 4\ncells"))).notes
    assert_names(unread, "mesh.level", "mesh.legs", "ignored", "mesh.source is 'block'")
    heavy = MILLIMETRES.replace("mass = 0.002", "mass = 2")
    (note,) = Simulation(scene_from_toml(heavy)).notes
    assert_names(note, "material.mass", "2 kg", "2e-06 m³", "1e+06 kg/m³", "10 to 25000 kg/m³", "grams")
    assert (
        Simulation(scene_from_toml(heavy.replace("gravity = {}\n", ""))).notes == ()
    )  # it does nothing there
    metres = MILLIMETRES.replace("scale = 0.001\n", "").replace("high = [0, 1, 1]", "high = [0, 10, 10]")
    (wide,) = Simulation(scene_from_toml(metres)).notes
    assert_names(wide, "20 m wide", "millimetres", "mesh.scale = 0.001")
