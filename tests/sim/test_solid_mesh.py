"""Meshes: the generated piece is what its dimensions say, and an unusable mesh is refused with its offenders named."""

import importlib.util
import os
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tripod_host.arrays import FloatArray
from tripod_sim.build import build
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.element import node_volumes
from tripod_sim.elements.hexahedron import FACES
from tripod_sim.errors import SceneError
from tripod_sim.mesh import file_format, read
from tripod_sim.mesh.solid_mesh import SolidMesh, check_mesh, element_quality
from tripod_sim.mesh.y_piece import LEVELS, YLevel, YShape, y_piece
from tripod_sim.scene.file import load_scene, scene_to_toml
from tripod_sim.tables.bodies import Mesh

BRICK = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float
)
SPLIT = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
"""Six tetrahedra around the diagonal of a hexahedron; they fill it exactly where its faces are plane."""


def row(count: int) -> SolidMesh:
    """Return unit cubes side by side along x; element i shares its last face with element i + 1."""
    nodes = np.array([[x, y, z] for x in range(count + 1) for z in (0, 1) for y in (0, 1)], float)
    first = np.array([0, 4, 5, 1, 2, 6, 7, 3])
    return SolidMesh.of(nodes, first + 4 * np.arange(count)[:, None])


def volumes(mesh: SolidMesh) -> FloatArray:
    """Return the volume of each element [m³], shape (m,)."""
    a, b, c, d = np.moveaxis(mesh.nodes[mesh.elements[:, SPLIT]], 2, 0)
    return np.linalg.det(np.stack([b - a, c - a, d - a], axis=-1)).sum(axis=1) / 6


def enclosed_volume(mesh: SolidMesh) -> float:
    a, b, c = np.moveaxis(mesh.nodes[mesh.surface], 1, 0)
    return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6)


def refusal(mesh: SolidMesh) -> str:
    with pytest.raises(SceneError) as caught:
        check_mesh(mesh, "the mesh")
    message = str(caught.value)
    assert message.startswith("the mesh: ")
    assert message.isprintable()
    return message


def changed(mesh: SolidMesh, *, nodes: dict | None = None, elements: dict | None = None) -> SolidMesh:
    new_nodes, new_elements = mesh.nodes.copy(), mesh.elements.copy()
    for i, value in (nodes or {}).items():
        new_nodes[i] = value
    for i, value in (elements or {}).items():
        new_elements[i] = value
    return SolidMesh.of(new_nodes, new_elements)


ODD_SHAPE = YShape(0.008, 0.04, 0.1, 0.07, 0.009, 0.004)
PIECES = {f"level {n}": (level, YShape()) for n, level in LEVELS.items() if n < 10}  # the rest divide level 8
PIECES |= {
    "three layers": (YLevel(3, 2, 4, 1.0, 3), YShape()),
    "odd shape": (YLevel(5, 3, 2, 1.3, 2), ODD_SHAPE),
    "graded": (YLevel(3, 3, 4, 1.3, clamped=3, inner_grading=1.4, clamped_grading=1.5), YShape()),
}


@pytest.fixture(params=PIECES)
def piece(request: pytest.FixtureRequest) -> tuple[SolidMesh, YLevel, YShape]:
    level, shape = PIECES[request.param]
    return y_piece(level, shape), level, shape


def test_the_piece_is_valid(piece) -> None:
    check_mesh(piece[0], "the piece")


def test_the_piece_has_the_volume_of_its_shape(piece) -> None:
    """Exact with the hole as the polygon that it is; against the round hole, what its chords leave out.

    A regular n-gon in a circle of radius r lacks r² (pi - n/2 sin(2 pi / n)) < r² 2 pi³ / (3 n²) of its area.
    """
    mesh, level, s = piece
    half = s.width / 2
    triangle = half**2 / np.tan(np.pi / 3)  # from the centre to two inner corners
    strips = 3 * (triangle + s.width * (s.tip_radius - half / np.tan(np.pi / 3)))
    sides = 3 * level.across
    polygon = sides / 2 * s.hole_radius**2 * np.sin(2 * np.pi / sides)
    assert volumes(mesh).sum() == pytest.approx(s.thickness * (strips - polygon), rel=1e-12)
    lack = s.hole_radius**2 * 2 * np.pi**3 / (3 * sides**2)
    round_hole = s.thickness * (strips - np.pi * s.hole_radius**2)
    assert 0 < volumes(mesh).sum() - round_hole < s.thickness * lack


def test_the_piece_reaches_where_its_shape_says(piece) -> None:
    mesh, level, s = piece
    strip = mesh.nodes[(mesh.nodes[:, 0] > s.clamp_radius - 1e-9)]
    lines = np.unique(strip[:, 0].round(9))
    assert len(lines) == level.clamped + 1
    np.testing.assert_allclose(lines[[0, -1]], [s.clamp_radius, s.tip_radius], atol=1e-9)
    np.testing.assert_allclose([strip[:, 1].min(), strip[:, 1].max()], [-s.width / 2, s.width / 2])
    np.testing.assert_allclose(
        [mesh.nodes[:, 2].min(), mesh.nodes[:, 2].max()], [-s.thickness / 2, s.thickness / 2]
    )
    radius = np.hypot(mesh.nodes[:, 0], mesh.nodes[:, 1])
    np.testing.assert_allclose(radius.min(), s.hole_radius)
    assert (abs(radius - s.disc_radius) < 1e-12).sum() >= 9  # the disc's rim is a line of the mesh


@pytest.mark.parametrize("name", ["h20", "h27"])
def test_quadratic_hexahedra_follow_the_arcs(piece, name: str) -> None:
    """Their corners are the linear mesh's; of the round hole's area they lack two orders less than its polygon."""
    linear, level, s = piece
    mesh = y_piece(level, s, ELEMENTS[name])
    check_mesh(mesh, "the piece")
    np.testing.assert_allclose(mesh.nodes[mesh.elements[:, :8]], linear.nodes[linear.elements], atol=1e-15)
    assert len(np.unique(mesh.elements)) == len(mesh.nodes)
    radius = np.hypot(mesh.nodes[:, 0], mesh.nodes[:, 1])
    np.testing.assert_allclose(radius.min(), s.hole_radius)
    assert (abs(radius - s.disc_radius) < 1e-12).sum() >= 2 * 3 * level.across * (level.layers + 1)
    half = s.width / 2
    strips = 3 * (half**2 / np.tan(np.pi / 3) + s.width * (s.tip_radius - half / np.tan(np.pi / 3)))
    exact = s.thickness * (strips - np.pi * s.hole_radius**2)
    found = node_volumes(mesh.kind, mesh.nodes[mesh.elements])[0].sum()
    # of the area under an arc of angle a a parabola through it misses r² a^5 / 960, the chord r² a³ / 12
    assert abs(found - exact) < (2 * np.pi / (3 * level.across)) ** 2 / 70 * (volumes(linear).sum() - exact)


def test_levels_8_to_11_divide_one_mesh_ever_finer() -> None:
    """The nodes of level 8 stay, and its elements are divided by m³, all but those inside of the rigid disc."""
    coarse = y_piece(LEVELS[8])
    for m in (2, 3, 4):
        fine = y_piece(LEVELS[7 + m])
        assert len(fine.elements) == 3 * 2 * m * (1 + 7 * m) * m
        gaps = np.linalg.norm(coarse.nodes[:, None] - fine.nodes[None], axis=2).min(axis=1)
        assert gaps.max() < 1e-15


def test_elements_shrink_towards_disc_and_clamp_edge_by_their_gradings() -> None:
    level = YLevel(2, 3, 4, 1.3, clamped=3, inner_grading=1.4, clamped_grading=1.5)
    nodes = y_piece(level).nodes
    x = np.unique(nodes[(abs(nodes[:, 1]) < 1e-12) & (nodes[:, 0] > 0.007), 0].round(12))
    lengths = np.diff(x)
    assert len(lengths) == 10
    np.testing.assert_allclose(lengths[1:3] / lengths[:2], 1.4, rtol=1e-6)
    np.testing.assert_allclose(lengths[3:6] / lengths[4:7], 1.3, rtol=1e-6)
    np.testing.assert_allclose(lengths[8:] / lengths[7:9], 1.5, rtol=1e-6)


def same_points(a: FloatArray, b: FloatArray) -> bool:
    distance = np.linalg.norm(a[:, None] - b[None], axis=2)
    return bool((distance.min(axis=0) < 1e-15).all() and (distance.min(axis=1) < 1e-15).all())


def test_the_piece_is_symmetric(piece) -> None:
    """Nodes and element centres fall on themselves when turned by a third and when mirrored in a strip."""
    mesh = piece[0]
    c, s = -0.5, np.sqrt(0.75)
    turn, mirror = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.diag([1.0, -1.0, 1.0])
    for points in (mesh.nodes, mesh.nodes[mesh.elements].mean(axis=1)):
        for move in (turn, mirror, turn @ mirror, np.diag([1.0, 1.0, -1.0])):
            assert same_points(points @ move.T, points)
        assert not same_points(points @ np.diag([-1.0, 1.0, 1.0]), points)


def test_the_surface_is_closed_and_faces_outward(piece) -> None:
    mesh = piece[0]
    edges = mesh.surface[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    directed = {(a, b) for a, b in edges.tolist()}
    assert len(directed) == len(edges)
    assert directed == {(b, a) for a, b in directed}  # each edge twice, once each way
    assert enclosed_volume(mesh) == pytest.approx(volumes(mesh).sum(), rel=1e-12)
    corners = mesh.nodes[mesh.surface]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    top = (corners[:, :, 2] == mesh.nodes[:, 2].max()).all(axis=1)
    assert top.any()
    assert (normal[top, 2] > 0).all()


def test_faces_of_a_brick_face_outward() -> None:
    for face in BRICK[np.array(FACES)]:
        normal = np.cross(face[1] - face[0], face[2] - face[0])
        assert normal @ (face.mean(axis=0) - 0.5) == pytest.approx(0.5)


def test_the_surface_of_cubes_in_a_row_leaves_out_shared_faces() -> None:
    mesh = row(3)
    assert len(mesh.surface) == 2 * (3 * 4 + 2)
    assert enclosed_volume(mesh) == pytest.approx(3)


@pytest.mark.parametrize(
    "shape",
    [
        "hole_radius=0",
        "hole_radius=0.008",
        "disc_radius=0.0087",
        "clamp_radius=0.008",
        "tip_radius=0.04",
        "width=nan",
        "thickness=0",
    ],
)
def test_an_impossible_shape_is_refused(shape: str) -> None:
    name, value = shape.split("=")
    with raises_naming(SceneError, "y_piece", "0 < hole_radius < disc_radius"):
        YShape(**{name: float(value)})


def test_the_topology_id_is_the_crc_of_count_and_connectivity() -> None:
    words = struct.pack("<9q", 8, 0, 1, 2, 3, 4, 5, 6, 7)
    assert SolidMesh.of(BRICK, np.arange(8)[None]).topology_id == zlib.crc32(words)


def test_the_topology_id_tells_levels_apart_and_ignores_positions() -> None:
    ids = [y_piece(level).topology_id for level in LEVELS.values()]
    assert ids == [y_piece(level).topology_id for level in LEVELS.values()]
    assert (
        len(set(ids))
        == len({y_piece(level).elements.tobytes() for level in LEVELS.values()})
        == len(LEVELS) - 1
    )
    mesh = row(2)
    assert SolidMesh.of(mesh.nodes * 2, mesh.elements).topology_id == mesh.topology_id
    assert SolidMesh.of(np.vstack([mesh.nodes, [9, 9, 9]]), mesh.elements).topology_id != mesh.topology_id
    assert changed(mesh, elements={1: mesh.elements[1, ::-1]}).topology_id != mesh.topology_id


def test_a_mesh_keeps_copies_that_nobody_can_write() -> None:
    nodes, elements = BRICK.copy(), np.arange(8)[None].copy()
    mesh = SolidMesh.of(nodes, elements)
    nodes[0], elements[0, 0] = 7, 7
    np.testing.assert_array_equal(mesh.nodes, BRICK)
    assert mesh.elements[0, 0] == 0
    for array in (mesh.nodes, mesh.elements):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_quality_is_the_sine_product_of_its_worst_corner() -> None:
    """A brick has 1 at any size; a prism over a rhomb of angle a has sin a at every corner."""
    quality = element_quality(SolidMesh.of(BRICK * [1e-6, 3.0, 200.0], np.arange(8)[None]))
    assert quality == pytest.approx([1.0], rel=1e-12)
    angle = 0.3
    sheared = BRICK @ np.array([[1, 0, 0], [np.cos(angle), np.sin(angle), 0], [0, 0, 1]])
    assert element_quality(SolidMesh.of(sheared, np.arange(8)[None])) == pytest.approx(
        [np.sin(angle)], rel=1e-12
    )
    inward = changed(SolidMesh.of(BRICK, np.arange(8)[None]), nodes={6: [0.3, 0.3, 0.3]})
    assert element_quality(inward)[0] < 0  # one corner pushed in, though the volume is positive
    assert volumes(inward)[0] > 0


ROW = row(12)
FLIPPED = ROW.elements[:, [4, 5, 6, 7, 0, 1, 2, 3]]
FLAT = [[1, 2 * y - 0.5, 2 * z - 0.5] for z in (0, 1) for y in (0, 1)]
"""The far face of the second of two cubes, brought into the plane of its near face."""


@pytest.mark.parametrize(
    ("mesh", "named"),
    [
        (changed(ROW, elements={3: FLIPPED[3]}), ("elements 3 are inverted", "node order or geometry")),
        (changed(ROW, elements={3: FLIPPED[3], 5: FLIPPED[5]}), ("elements 3, 5 are inverted",)),
        (SolidMesh.of(ROW.nodes, FLIPPED), ("elements 0, 1, 2, 3, 4, 5, 6, 7 and", "4 more", "inverted")),
        (SolidMesh.of(row(2).nodes * [-1, 1, 1], row(2).elements), ("elements 0, 1 are inverted",)),
        (changed(row(2), nodes={11: [0.4, 0.4, 0.4]}), ("elements 1 are inverted",)),
        (changed(row(2), nodes=dict(zip(range(8, 12), FLAT, strict=True))), ("elements 1 have no volume",)),
        (SolidMesh.of(row(2).nodes * [1, 1, 0] + [0, 0, 1], row(2).elements), ("nodes", "same position")),
        (SolidMesh.of(row(2).nodes, [[0, 4, 5, 1, 2, 6, 7, 3], [4, 8, 9, 5, 10, 10, 11, 11]]),
         ("elements 1 have no volume",)),
        (SolidMesh.of(row(1).nodes, [[0, 4, 5, 1, 2, 6, 7, 3], [0, 4, 5, 1, 2, 2, 3, 3]]),
         ("elements 1 have no volume",)),
        (changed(row(2), nodes={5: [1, np.nan, 0]}), ("nodes 5 are", "not finite")),
        (changed(row(2), nodes={5: [1, np.inf, 0], 7: [-np.inf, 0, 0]}), ("nodes 5, 7 are", "not finite")),
        (changed(row(3), elements={1: [4, 8, 9, 5, 6, 10, 11, 99]}), ("elements 1 name nodes", "0..15")),
        (changed(row(3), elements={2: [8, 12, 13, 9, 10, 14, 15, -1]}), ("elements 2 name nodes", "0..15")),
        (changed(row(3), elements={2: [8, 12, 13, 9, 10, 14, 15, 16]}), ("elements 2 name nodes", "0..15")),
        (SolidMesh.of(np.vstack([row(2).nodes, BRICK]), row(2).elements),
         ("nodes 12, 13, 14, 15, 16, 17, 18, 19 belong",)),
        (SolidMesh.of(row(2).nodes, row(1).elements), ("nodes 8, 9, 10, 11 belong", "no element")),
        (SolidMesh.of(np.vstack([BRICK, row(1).nodes + 1]), [range(8), [8, 12, 13, 9, 10, 14, 15, 11]]),
         ("nodes 6, 8 have", "same position")),
        (SolidMesh.of(row(3).nodes, row(3).elements[[0, 1, 2, 1]]), ("elements 1, 3 have", "another element")),
        (SolidMesh.of(row(2).nodes, np.zeros((0, 8))), ("no elements",)),
        (SolidMesh.of(np.zeros((0, 3)), np.zeros((0, 8))), ("no elements",)),
        (SolidMesh.of(np.zeros((8, 3)), np.arange(8)[None]), ("nodes 0, 1, 2, 3, 4, 5, 6, 7 have", "same position",)),
        (SolidMesh.of(BRICK * 1e-170, np.arange(8)[None]), ("elements 0 have no volume",)),
    ],
)  # fmt: skip
def test_an_unusable_mesh_is_refused_with_its_offenders(mesh: SolidMesh, named: tuple[str, ...]) -> None:
    assert_names(refusal(mesh), *named)


@pytest.mark.parametrize(("size", "shift"), [(1e-6, 0), (1e-6, 1.0), (1.0, -1e6), (1.0, 1e11), (1e9, 1e3)])
def test_a_valid_mesh_passes_at_any_size_and_place(size: float, shift: float) -> None:
    mesh = row(4)
    check_mesh(SolidMesh.of(mesh.nodes * size + shift, mesh.elements), "cubes")


def scene_with(folder: Path, source: str, scale: float = 1.0) -> Path:
    """Write the tripod's scene with a mesh file."""
    path = folder / "scene.toml"
    path.write_text(scene_to_toml(replace(load_scene("tripod"), mesh=Mesh(source, scale=scale))))
    return path


def file_refusal(path: Path) -> str:
    with pytest.raises(SceneError) as caught:
        build(load_scene(path))
    message = str(caught.value)
    assert message.startswith("mesh.source")
    assert message.isprintable()
    assert len(message) < 500
    return message


PIECE = y_piece(LEVELS[1])


def write(folder: Path, mesh: SolidMesh, name: str = "piece.vtk", scale: float = 1.0, **cells: list) -> Path:
    """Write a mesh and a scene that uses it; return the scene."""
    blocks = [("hexahedron", mesh.elements), *cells.items()]
    meshio.write(folder / name, meshio.Mesh(mesh.nodes / scale, blocks))
    return scene_with(folder, name, scale)


@pytest.mark.parametrize("name", ["piece.vtk", "piece.vtu", "piece.msh", "piece.inp"])
def test_a_mesh_file_gives_the_mesh_that_was_written(name: str, tmp_path: Path) -> None:
    built = build(load_scene(write(tmp_path, PIECE, name, 1e-3))).mesh
    np.testing.assert_array_equal(built.elements, PIECE.elements)
    np.testing.assert_allclose(built.nodes, PIECE.nodes, rtol=0, atol=1e-16)


def test_other_cells_and_their_nodes_are_left_out(tmp_path: Path) -> None:
    far = np.array([[9.0, 9, 9], [8, 9, 9], [9, 8, 9]])
    mesh = SolidMesh.of(np.vstack([far, PIECE.nodes]), PIECE.elements + 3)
    built = build(load_scene(write(tmp_path, mesh, triangle=[[0, 1, 2]], quad=[[0, 1, 2, 4]]))).mesh
    np.testing.assert_array_equal(built.elements, PIECE.elements)
    np.testing.assert_array_equal(built.nodes, PIECE.nodes)


def test_blocks_of_hexahedra_are_joined(tmp_path: Path) -> None:
    blocks = [("hexahedron", PIECE.elements[:5]), ("hexahedron", PIECE.elements[5:])]
    meshio.write(tmp_path / "piece.vtu", meshio.Mesh(PIECE.nodes, blocks))
    built = build(load_scene(scene_with(tmp_path, "piece.vtu"))).mesh
    np.testing.assert_array_equal(built.elements, PIECE.elements)


SWAPPED = PIECE.elements[:, [4, 5, 6, 7, 0, 1, 2, 3]]


@pytest.mark.parametrize(
    ("mesh", "named"),
    [
        (changed(PIECE, elements={3: SWAPPED[3], 7: SWAPPED[7]}), ("elements 3, 7 are inverted",)),
        (SolidMesh.of(PIECE.nodes * [1, 1, 1e-9], PIECE.elements), ("nodes", "same position")),
        (SolidMesh.of(PIECE.nodes * [1, 1, 1e-300] + PIECE.nodes[:, :1] * [0, 0, 1], PIECE.elements),
         ("same position",)),
        (changed(PIECE, nodes={4: [np.nan, 0, 0]}), ("nodes 4 are", "not finite")),
    ],
)  # fmt: skip
def test_a_file_with_bad_elements_is_refused_with_their_numbers(
    mesh, named: tuple[str, ...], tmp_path: Path
) -> None:
    assert_names(file_refusal(write(tmp_path, mesh)), f"{tmp_path / 'piece.vtk'}'", *named)


def test_a_file_with_a_flat_element_is_refused_with_its_number(tmp_path: Path) -> None:
    cube = row(2)
    flat = changed(cube, nodes=dict(zip(range(8, 12), FLAT, strict=True)))
    assert_names(file_refusal(write(tmp_path, flat)), "elements 1 have no volume")


def test_a_file_in_the_wrong_unit_is_refused_by_what_it_misses(tmp_path: Path) -> None:
    scene = write(tmp_path, PIECE, scale=1e-3)
    scene.write_text(scene.read_text().replace("scale = 0.001", "scale = 1.0"))
    with raises_naming(SceneError, "effector.radius", "0.0075 m", "no node", "5 m"):
        build(load_scene(scene))


def test_a_disc_of_too_few_nodes_is_refused_with_the_radius_that_holds_enough() -> None:
    block = 'mesh={source="block", corners=%s, cells=[2, 2, 1]}' % (
        [[x, y, z] for z in (-0.01, 0.01) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    )
    with raises_naming(SceneError, "effector.radius", "0.0075 m", "2 nodes", "needs 3", "within 1 m"):
        build(load_scene("silicone_free", [block, "effector={}"]))
    with raises_naming(SceneError, "effector.radius", "3 nodes", "on a line", "enlarge"):
        build(load_scene("silicone_free", [block.replace("2, 2, 1]", "2, 2, 2]"), "effector={}"]))


@pytest.mark.parametrize(
    ("name", "content", "named"),
    [
        ("gone.vtk", None, ("not exist",)),
        ("noise.vtk", bytes(range(256)) * 4, ("its name", "vtk", "not begin")),
        ("noise.inp", bytes(range(256)) * 4, ("its name", "abaqus", "not begin")),
        ("noise.msh", b"words", ("cut short", "damaged", "format", "its name")),
        ("empty.vtk", b"", ("empty",)),
        ("empty.vtu", b"", ("empty",)),
        ("sheet.vtk", b"<VTKFile type='PolyData'></VTKFile>", ("UnstructuredGrid", "PolyData")),
        ("lines.msh", b"$MeshFormat\n4.1 0\n8\n", ("cut short", "damaged")),
        ("piece.doc", b"x", ("format is unknown",)),
        ("f.ply", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
         b"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
         ("tetra", "hexahedron", "triangle")),
        ("void.obj", b"", ("cells with a volume", "OBJ")),
    ],
)  # fmt: skip
def test_a_file_that_is_no_mesh_is_refused(
    name, content: bytes | None, named: tuple[str, ...], tmp_path, capfd
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    assert_names(file_refusal(scene_with(tmp_path, name)), f"{name}'", *named)
    assert capfd.readouterr() == ("", "")  # what parsers print would spoil `tripod run --json`


def test_a_folder_is_no_mesh_file(tmp_path: Path) -> None:
    (tmp_path / "folder.vtk").mkdir()
    assert_names(file_refusal(scene_with(tmp_path, "folder.vtk")), "folder.vtk'", "a directory")


def test_a_file_that_a_parser_never_ends_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """This parser looks for the end of the header for ever; so do those of gmsh and Kratos in some files cut short."""
    monkeypatch.setattr(read, "PATIENCE", 1.0)
    (tmp_path / "cut.ply").write_bytes(b"ply\n")
    refused = file_refusal(scene_with(tmp_path, "cut.ply"))
    assert_names(refused, "cut.ply'", "2 s", "processor time", "cut short")


def test_a_reader_that_waits_for_a_busy_machine_is_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sitecustomize.py").write_text("import time; time.sleep(3)")  # as if others had the processor
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(read, "PATIENCE", 1.0)
    write(tmp_path, PIECE)
    assert read.read_solid(tmp_path / "piece.vtk", 1.0, "h8").elements.shape[1] == 8


NOISY_READER = """
import os
import types
import numpy as np

NAMED = ("point_sets", "cell_sets", "cell_data", "point_data", "field_data")

def read(path):
    print("in Python")
    os.write(1, b"below Python")
    cube = types.SimpleNamespace(type="hexahedron", dim=3, data=np.load(path + ".elements.npy"))
    return types.SimpleNamespace(points=np.load(path + ".points.npy"), cells=[cube], **dict.fromkeys(NAMED, {}))

gmsh = types.SimpleNamespace(read=read)
"""


def test_what_a_parser_prints_spoils_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd) -> None:
    (tmp_path / "path").mkdir()
    (tmp_path / "path" / "meshio.py").write_text(NOISY_READER)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "path"), prepend=os.pathsep)
    (tmp_path / "piece.msh").write_text("$MeshFormat\n")
    np.save(tmp_path / "piece.msh.points.npy", PIECE.nodes)
    np.save(tmp_path / "piece.msh.elements.npy", PIECE.elements)
    built = build(load_scene(scene_with(tmp_path, "piece.msh"))).mesh
    np.testing.assert_array_equal(built.nodes, PIECE.nodes)
    assert capfd.readouterr() == ("", "")


def test_a_file_that_is_too_large_is_refused_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_format, "MAX_BYTES", 100)
    assert_names(file_refusal(write(tmp_path, PIECE)), "piece.vtk'", "larger", "100 bytes")


def test_a_file_with_elements_beyond_its_nodes_is_refused_with_their_numbers(tmp_path: Path) -> None:
    beyond = changed(PIECE, elements={2: 1000 + np.arange(8), 4: -1 - np.arange(8)})
    named = ("elements 2, 4 name nodes", f"0..{len(PIECE.nodes) - 1}")
    assert_names(file_refusal(write(tmp_path, beyond)), *named)


def test_without_meshio_the_message_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "meshio" else find(name))
    assert_names(file_refusal(write(tmp_path, PIECE)), "meshio", "pip install 'tripod[mesh]'")


def test_a_name_that_is_neither_generator_nor_file_is_refused() -> None:
    with raises_naming(SceneError, "mesh.source", "'x_piece'", "allowed: y_piece, block", "mesh file"):
        build(load_scene("tripod", ["mesh.source=x_piece"]))
