"""Mesh files as other programs write them: formats by content, cells that nobody needs, cells inside out, elements."""

from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.messages import assert_names, line_naming, raises_naming
from tests.sim.test_mesh_solid_files import GOOD, block, gid_text
from tripod_sim import Simulation
from tripod_sim.elements.element import node_volumes
from tripod_sim.errors import SceneError
from tripod_sim.mesh.described import described_mesh, element_of
from tripod_sim.mesh.file_format import format_of
from tripod_sim.mesh.read import read_solid
from tripod_sim.mesh.solid_mesh import SolidMesh, check_mesh
from tripod_sim.scene.file import load_scene
from tripod_sim.tables.bodies import Mesh

TETRAHEDRA = block("t4", (1, 1, 1))


def volume_of(mesh: SolidMesh) -> float:
    return float(node_volumes(mesh.kind, mesh.nodes[mesh.elements])[0].sum())


# formats --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "name", "expected"),
    [
        (b"# vtk DataFile Version 3.0\nx\nASCII\n", "a.inp", "vtk"),
        (b'<?xml version="1.0"?>\n<!-- by\nhand -->\n<VTKFile type="UnstructuredGrid">', "a.vtk", "vtu"),
        (b'\xef\xbb\xbf<VTKFile type="UnstructuredGrid">', "a.vtk", "vtu"),
        (b"$MeshFormat\n4.1 0 8\n", "a.vtk", "gmsh"),
        (b"**made by hand\n*Heading\nx\n", "a.msh", "abaqus"),
        (b"# by hand\n\nmesh dimension 3 ElemType Tetrahedra Nnode 4\n", "a.msh", "gid"),
        (b"# UCD\n8 1 0 0 0\n", "a.inp", "avsucd"),
        (b"8 1 0 0\n", "a.inp", ""),
        (b"# exported\nmtllib x.mtl\nv 0 0 0\n", "a.stl", "obj"),
        (b"solid x\n facet normal 0 0 1\n", "a.obj", "stl"),
        (b"\0" * 80 + (1).to_bytes(4, "little") + b"\0" * 50, "a.obj", "stl"),
        (b"\0" * 80 + (1).to_bytes(4, "little") + b"\0" * 49, "a.bin", ""),
        (b"words", "a.GIDMSH", "gid"),
        (b"words", "a.obj", "obj"),
        (b"", "a.vtk", ""),
    ],
)
def test_a_format_is_told_by_how_the_file_begins(
    content: bytes, name: str, expected: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(content)
    assert format_of(tmp_path / name) == expected


@pytest.mark.parametrize(
    ("form", "name"),
    [
        ("vtu", "x.vtk"),
        ("vtk", "x.vtu"),
        ("gmsh", "x.inp"),
        ("abaqus", "x.msh"),
        ("avsucd", "x.inp"),
        ("medit", "x.vtk"),
    ],
)
def test_a_file_with_the_name_of_another_format_is_read(form: str, name: str, tmp_path: Path) -> None:
    meshio.write(tmp_path / name, meshio.Mesh(TETRAHEDRA.nodes, [("tetra", TETRAHEDRA.elements)]), form)
    found = read_solid(tmp_path / name, 1.0, "t4")
    check_mesh(found, name)
    np.testing.assert_allclose(found.nodes, TETRAHEDRA.nodes, rtol=1e-12)
    assert volume_of(found) == pytest.approx(volume_of(TETRAHEDRA), rel=1e-12)
    assert found.notes == ()


def test_gid_is_read_by_any_name(tmp_path: Path) -> None:
    (tmp_path / "x.vtk").write_text(GOOD)
    np.testing.assert_array_equal(read_solid(tmp_path / "x.vtk", 1.0, "t4").elements, TETRAHEDRA.elements)


def test_a_surface_is_no_solid_and_the_message_says_what_to_do(tmp_path: Path) -> None:
    """Faces with normals, as most programs write them, which meshio does not read."""
    (tmp_path / "cube.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nf 1//1 2//1 3//1\n")
    with raises_naming(
        SceneError, "cube.obj", "cells with a volume", "mesh.size", "tripod mesh", "obstacles.source"
    ):
        described_mesh(Mesh(str(tmp_path / "cube.obj")))


# cells that nobody needs ----------------------------------------------------------------------------------------------


NODES = "".join(
    f"{i}, {x!r}, {y!r}, {z!r}\n" for i, (x, y, z) in enumerate(block("t10", (1, 1, 1)).nodes.tolist(), 1)
)
T10 = block("t10", (1, 1, 1))


def abaqus(solid: str = "C3D10", springs: int = 0, more: str = "") -> str:
    """Return a block of ten-node tetrahedra as gmsh writes it: surface cells of six nodes first, and sets."""
    text = ["*Heading", " x.inp", "*NODE", NODES.rstrip(), "*ELEMENT, type=CPS6, ELSET=Surface1"]
    face = T10.elements[0][list(T10.kind.faces[0].nodes)] + 1
    text += ["1, " + ", ".join(map(str, face)), f"*Element, TYPE={solid}, ELSET=Volume1"]
    text += [f"{i}, " + ", ".join(map(str, row)) for i, row in enumerate((T10.elements + 1).tolist(), 2)]
    text += ["*ELEMENT, TYPE=SPRINGA", *(f"{900 + i}, 1, 2" for i in range(springs))] if springs else []
    return "\n".join(
        [*text, "*ELSET, ELSET=Half", "2, 3,", "4", "*ELSET, ELSET=Both", "Half, Surface1", more, ""]
    )


def test_an_abaqus_file_of_gmsh_is_read_with_its_surfaces_and_sets(tmp_path: Path) -> None:
    (tmp_path / "x.inp").write_text(abaqus(springs=3))
    found = described_mesh(Mesh(str(tmp_path / "x.inp")))
    assert found.kind.name == "t10"
    np.testing.assert_array_equal(found.elements, T10.elements)
    face = sorted(T10.elements[0][list(T10.kind.faces[0].nodes)].tolist())
    assert found.groups["Surface1"].tolist() == face
    assert {name: cells.tolist() for name, cells in found.cell_groups.items()} == {
        "Volume1": [0, 1, 2, 3, 4, 5], "Half": [0, 1, 2], "Both": [0, 1, 2]
    }  # fmt: skip
    assert set(found.groups["Both"]) == {*face, *T10.elements[:3].ravel().tolist()}
    assert_names(line_naming("\n".join(found.notes), "SPRINGA"), "x.inp", "3 SPRINGA", "not read")


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (abaqus("COH3D10"), ("COH3D10",)),
        (abaqus(more="*ELEMENT, TYPE=C3D15V\n99, 1, 2, 3, 4, 5"), ("cannot be used", "C3D15V")),
        (abaqus(more="*NODE\n1, 0, 0, 0"), ("2 nodes", "number 1")),
        (abaqus(more="*ELEMENT, TYPE=C3D10\n99, 1, 2, 3, 4, 5, 6, 7, 8, 9, 777"), ("cut short", "777")),
    ],
)
def test_an_abaqus_file_that_cannot_be_is_refused_with_what_is_in_it(
    text: str, named: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "x.inp").write_text(text)
    with raises_naming(SceneError, "x.inp", *named):
        described_mesh(Mesh(str(tmp_path / "x.inp")))


def test_blocks_of_nodes_are_joined(tmp_path: Path) -> None:
    rows = NODES.splitlines()
    (tmp_path / "x.inp").write_text(
        abaqus().replace(
            NODES.rstrip(), "\n".join([*rows[:5], "*NODE, NSET=Rest", *(f"{r}," for r in rows[5:])])
        )
    )
    np.testing.assert_allclose(described_mesh(Mesh(str(tmp_path / "x.inp"))).nodes, T10.nodes, rtol=1e-12)


def legacy(cells: list[tuple[int, list[int]]], nodes: np.ndarray) -> str:
    """Return a VTK file in its old form."""
    lines = [
        "# vtk DataFile Version 3.0",
        "x",
        "ASCII",
        "DATASET UNSTRUCTURED_GRID",
        f"POINTS {len(nodes)} double",
    ]
    lines += [" ".join(map(repr, p)) for p in nodes.tolist()]
    lines += [f"CELLS {len(cells)} {sum(1 + len(c) for _, c in cells)}"]
    lines += [" ".join(map(str, (len(c), *c))) for _, c in cells]
    lines += [f"CELL_TYPES {len(cells)}", *(str(kind) for kind, _ in cells)]
    lines += [f"CELL_DATA {len(cells)}", "SCALARS part int 1", "LOOKUP_TABLE default"]
    return "\n".join([*lines, *(str(i % 2) for i in range(len(cells))), ""])


def xml(pieces: list[tuple[np.ndarray, list[tuple[int, list[int]]]]]) -> str:
    """Return a VTK file in XML of some pieces."""
    text = []
    for nodes, cells in pieces:
        arrays = {
            "connectivity": [p for _, c in cells for p in c],
            "offsets": np.cumsum([len(c) for _, c in cells]).tolist(),
            "types": [kind for kind, _ in cells],
        }
        data = "".join(
            f'<DataArray type="Int64" Name="{n}" format="ascii">{" ".join(map(str, v))}</DataArray>'
            for n, v in arrays.items()
        )
        points = " ".join(map(repr, nodes.ravel().tolist()))
        part = " ".join(str(i % 2) for i in range(len(cells)))
        text.append(
            f'<Piece NumberOfPoints="{len(nodes)}" NumberOfCells="{len(cells)}"><Points><DataArray type="Float64" '
            f'NumberOfComponents="3" format="ascii">{points}</DataArray></Points><Cells>{data}</Cells><CellData>'
            f'<DataArray type="Int64" Name="part" format="ascii">{part}</DataArray></CellData></Piece>'
        )
    return (
        '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>'
        f"{''.join(text)}</UnstructuredGrid></VTKFile>"
    )


SOLID = [(10, row) for row in TETRAHEDRA.elements.tolist()]
LEFT_OUT = [(4, [0, 1, 2]), (6, [0, 1, 2, 3, 4]), (36, [0, 1, 2, 3, 4, 5])]
"""A polyline, a triangle strip, a quadratic polygon, by the numbers of VTK."""


@pytest.mark.parametrize("write", [legacy, lambda cells, nodes: xml([(nodes, cells)])])
def test_cells_of_vtk_that_nobody_needs_are_left_out_and_counted(write, tmp_path: Path) -> None:
    cells = [LEFT_OUT[0], *SOLID[:2], *LEFT_OUT[1:], *SOLID[2:], LEFT_OUT[0]]
    (tmp_path / "x.vtk").write_text(write(cells, TETRAHEDRA.nodes))
    found = read_solid(tmp_path / "x.vtk", 1.0, "t4")
    np.testing.assert_array_equal(found.elements, TETRAHEDRA.elements)
    (note,) = found.notes
    assert_names(note, "x.vtk", "2 polyline", "1 triangle strip", "1 quadratic polygon")
    numbers = [i % 2 for i, (kind, _) in enumerate(cells) if kind == 10]
    assert found.cell_groups["part:1"].tolist() == np.flatnonzero(numbers).tolist()
    for kind, name in ((11, "voxel"), (42, "polyhedron"), (80, "VTK_BEZIER_WEDGE"), (99, "VTK type 99")):
        (tmp_path / "x.vtk").write_text(write([*SOLID, (kind, list(range(8)))], TETRAHEDRA.nodes))
        with raises_naming(SceneError, "x.vtk", "cannot be used", name):
            read_solid(tmp_path / "x.vtk", 1.0, "t4")


def test_all_pieces_of_a_vtk_file_count(tmp_path: Path) -> None:
    pieces = [(TETRAHEDRA.nodes, SOLID), (TETRAHEDRA.nodes + np.array([5.0, 0, 0]), SOLID)]
    (tmp_path / "x.vtu").write_text(xml(pieces))
    found = read_solid(tmp_path / "x.vtu", 1.0, "t4")
    expected = np.concatenate([TETRAHEDRA.elements, TETRAHEDRA.elements + len(TETRAHEDRA.nodes)])
    np.testing.assert_array_equal(found.elements, expected)
    assert found.cell_groups["part:0"].tolist() == [0, 2, 4, 6, 8, 10]


@pytest.mark.parametrize(
    ("cells", "named"),
    [
        ([*SOLID, (10, [0, 1, 2])], ("tetra", "4 points")),
        ([*SOLID, (12, [0, 1, 2, 3])], ("hexahedron", "8 points")),
    ],
)
def test_cells_of_too_few_points_are_damage(
    cells: list[tuple[int, list[int]]], named: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "x.vtk").write_text(legacy(cells, TETRAHEDRA.nodes))
    with raises_naming(SceneError, "x.vtk", "damaged", *named):
        read_solid(tmp_path / "x.vtk", 1.0, "t4")


def test_points_that_no_cell_has_are_damage(tmp_path: Path) -> None:
    text = xml([(TETRAHEDRA.nodes, SOLID)])
    (tmp_path / "x.vtu").write_text(
        text.replace('"connectivity" format="ascii">', '"connectivity" format="ascii">7 ')
    )
    with raises_naming(SceneError, "x.vtu", "cut short", "damaged", "more or fewer points"):
        read_solid(tmp_path / "x.vtu", 1.0, "t4")


def test_balls_in_a_gid_file_are_left_out_and_counted(tmp_path: Path) -> None:
    more = (
        "MESH dimension 3 ElemType Sphere Nnode 1\nCoordinates\nEnd Coordinates\nElements\n7 1 0.5\n8 2 0.5\n"
    )
    (tmp_path / "x.gidmsh").write_text(f"{GOOD}{more}End Elements\n")
    found = read_solid(tmp_path / "x.gidmsh", 1.0, "t4")
    np.testing.assert_array_equal(found.elements, TETRAHEDRA.elements)
    assert_names("\n".join(found.notes), "x.gidmsh", "2 sphere")


# cells inside out -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["t4", "t10", "h8", "h20", "h27"])
def test_a_mesh_that_is_inside_out_is_turned_over_and_told(name: str, tmp_path: Path) -> None:
    """Seen in a mirror: the same node numbers at places with the other sign of x."""
    mesh = block(name)
    seen = mesh.nodes * [-1, 1, 1]
    kind = {"t4": "Tetrahedra", "t10": "Tetrahedra"}.get(name, "Hexahedra")
    text = gid_text(seen, mesh.elements, mesh.kind.cell).replace("ElemType Tetra ", f"ElemType {kind} ")
    (tmp_path / "x.gidmsh").write_text(text)
    found = read_solid(tmp_path / "x.gidmsh", 1.0, name)
    check_mesh(found, "corrected")
    assert volume_of(found) == pytest.approx(volume_of(mesh), rel=1e-12)
    assert_names("\n".join(found.notes), f"all {len(mesh.elements)} cells", "x.gidmsh", "corrected")
    order = mesh.kind.mirrored
    assert sorted(order) == list(range(mesh.kind.size))
    assert [order[i] for i in order] == list(range(mesh.kind.size))  # twice is as before


def test_a_single_cell_inside_out_is_refused(tmp_path: Path) -> None:
    turned = TETRAHEDRA.elements.copy()
    turned[2] = turned[2, TETRAHEDRA.kind.mirrored]
    (tmp_path / "x.gidmsh").write_text(gid_text(TETRAHEDRA.nodes, turned, "tetra"))
    with raises_naming(SceneError, "elements 2 ", "inverted"):
        described_mesh(Mesh(str(tmp_path / "x.gidmsh")))


# the element that nobody names ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "expected"),
    [("t4", "t10"), ("t10", "t10"), ("h8", "h8_modes"), ("h20", "h20"), ("h27", "h27")],
)
def test_without_a_name_the_cells_decide_the_element(name: str, expected: str, tmp_path: Path) -> None:
    mesh = block(name, (1, 1, 1))
    (tmp_path / "x.gidmsh").write_text(gid_text(mesh.nodes, mesh.elements, mesh.kind.cell))
    described = Mesh(str(tmp_path / "x.gidmsh"))
    found = described_mesh(described)
    assert found.kind.name == element_of(described) == expected
    assert volume_of(found) == pytest.approx(volume_of(mesh), rel=1e-12)
    assert len(found.notes) == (name == "t4")
    if found.notes:
        assert_names(found.notes[0], "mesh.element", "tetra", "x.gidmsh", "'t10'", "'t4'")


def test_what_a_generator_makes_has_the_element_that_it_had() -> None:
    assert [Mesh(source).element for source in ("y_piece", "block", "x.vtk")] == [
        "h8_modes",
        "h8_modes",
        "auto",
    ]
    assert Mesh(element="t10").element == "t10"


def test_a_scene_takes_a_file_of_tetrahedra_in_place_of_its_mesh_and_says_which_element(
    tmp_path: Path,
) -> None:
    (tmp_path / "x.gidmsh").write_text(gid_text(0.01 * TETRAHEDRA.nodes, TETRAHEDRA.elements, "tetra"))
    words = [f"mesh.source={tmp_path / 'x.gidmsh'}", "fixed=off"]
    simulation = Simulation(load_scene("silicone", words))
    assert isinstance(simulation.mesh, SolidMesh)
    assert simulation.mesh.kind.name == "t10"
    line_naming("\n".join(simulation.notes), "mesh.element", "'t10'", "x.gidmsh")
