"""Volume meshes from files: every format and element, their node orders, and hostile files."""

import tempfile
from pathlib import Path

import meshio
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.messages import assert_names
from tripod_sim.build import build
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.element import node_volumes
from tripod_sim.elements.hexahedron import CORNERS
from tripod_sim.errors import SceneError
from tripod_sim.mesh import fit, read
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.gid import read_gid
from tripod_sim.mesh.read import read_solid
from tripod_sim.mesh.solid_mesh import SolidMesh, check_mesh, element_quality
from tripod_sim.mesh.y_piece import LEVELS, y_piece
from tripod_sim.scene.file import load_scene

CELLS = {"tetra": "t4", "tetra10": "t10", "hexahedron": "h8", "hexahedron20": "h20", "hexahedron27": "h27"}

GID_NAMES = {"tetra": "Tetrahedra", "hexah": "Hexahedra"}

# between or amid which corners lie the further nodes, as the manuals of gmsh and of GiD draw them
GMSH_MIDDLES = {
    "tetra10": ("01", "12", "02", "03", "23", "13"),
    "hexahedron20": ("01", "03", "04", "12", "15", "23", "26", "37", "45", "47", "56", "67"),
}
GMSH_MIDDLES["hexahedron27"] = (
    *GMSH_MIDDLES["hexahedron20"], "0123", "0145", "0347", "1256", "2367", "4567", "01234567"
)  # fmt: skip
GID_MIDDLES = {
    "tetra10": ("01", "12", "02", "03", "13", "23"),
    "hexahedron20": ("01", "12", "23", "03", "04", "15", "26", "37", "45", "56", "67", "47"),
}
GID_MIDDLES["hexahedron27"] = (
    *GID_MIDDLES["hexahedron20"], "0123", "0145", "1256", "2367", "0347", "4567", "01234567"
)  # fmt: skip


def block(name: str, cells: tuple[int, int, int] = (2, 2, 2), noise: float = 0.1) -> SolidMesh:
    """Return distorted cells in a block."""
    counts = tuple(c + 1 for c in cells)
    nodes = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1).reshape(-1, 3).astype(float)
    nodes += np.random.default_rng(3).uniform(-noise, noise, nodes.shape)
    n = np.arange(len(nodes)).reshape(counts)
    steps = ((CORNERS + 1) // 2).astype(int)
    elements = [[n[tuple(np.add(c, s))] for s in steps] for c in np.ndindex(cells)]
    return convert(SolidMesh.of(nodes, np.array(elements)), name)


def rearranged(mesh: SolidMesh, middles: tuple[str, ...]) -> np.ndarray:
    """Return the elements with their further nodes in the order of `middles`."""
    reference, c = mesh.kind.reference, mesh.kind.corners
    order = list(range(c))
    for corners in middles:
        middle = reference[[int(i) for i in corners]].mean(axis=0)
        order.append(int(np.argmin(np.linalg.norm(reference - middle, axis=1))))
    assert sorted(order) == list(range(mesh.kind.size))
    return mesh.elements[:, order]


def gid_text(nodes: np.ndarray, elements: np.ndarray, cell: str) -> str:
    text = [f"MESH dimension 3 ElemType {GID_NAMES[cell[:5]]} Nnode {elements.shape[1]}", "Coordinates"]
    text += [f"{i} {x!r} {y!r} {z!r}" for i, (x, y, z) in enumerate(nodes.tolist(), 1)]
    text += ["End Coordinates", "", "Elements"]
    text += [" ".join(map(str, [i, *row])) for i, row in enumerate((elements + 1).tolist(), 1)]
    return "\n".join([*text, "End Elements", ""])


def gmsh_text(nodes: np.ndarray, elements: np.ndarray, cell: str) -> str:
    code = {"tetra": 4, "hexahedron": 5, "tetra10": 11, "hexahedron27": 12, "hexahedron20": 17}[cell]
    text = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(nodes))]
    text += [f"{i} {x!r} {y!r} {z!r}" for i, (x, y, z) in enumerate(nodes.tolist(), 1)]
    text += ["$EndNodes", "$Elements", str(len(elements))]
    text += [" ".join(map(str, [i, code, 2, 1, 1, *row])) for i, row in enumerate((elements + 1).tolist(), 1)]
    return "\n".join([*text, "$EndElements", ""])


def write(path: Path, mesh: SolidMesh, scale: float = 1.0) -> Path:
    cell = mesh.kind.cell
    if path.name.startswith("gid"):
        path.write_text(gid_text(mesh.nodes / scale, rearranged(mesh, GID_MIDDLES.get(cell, ())), cell))
    elif path.name.startswith("gmsh"):
        path.write_text(gmsh_text(mesh.nodes / scale, rearranged(mesh, GMSH_MIDDLES.get(cell, ())), cell))
    else:
        form = (
            "gmsh" if path.suffix == ".msh" else None
        )  # version 4.1, binary; by its name it would be Ansys's
        meshio.write(path, meshio.Mesh(mesh.nodes / scale, [(cell, mesh.elements)]), form)
    return path


def refusal(path: Path, element: str, scale: float = 1.0) -> str:
    with pytest.raises(SceneError) as caught:
        check_mesh(read_solid(path, scale, element), "mesh.source")
    message = str(caught.value)
    assert message.isprintable()
    assert len(message) < 500
    return message.replace(str(path), path.name)


@pytest.mark.parametrize("name", ["a.vtk", "a.vtu", "gmsh.msh", "b.msh", "gid.gidmsh", "gid.msh"])
@pytest.mark.parametrize("cell", CELLS)
def test_every_format_gives_the_elements_that_were_written(
    cell: str, name: str, tmp_path: Path, monkeypatch
) -> None:
    if not name.startswith(
        "gid"
    ):  # meshio must have turned the node orders of its formats into VTK's by itself
        monkeypatch.setattr(fit, "in_order", lambda nodes, elements, kind: elements)
    mesh = block(CELLS[cell])
    found = read_solid(write(tmp_path / name, mesh, 1e-3), 1e-3, CELLS[cell])
    assert found.kind is mesh.kind
    np.testing.assert_array_equal(found.elements, mesh.elements)
    np.testing.assert_allclose(found.nodes, mesh.nodes, rtol=1e-12, atol=1e-12)
    check_mesh(found, "found")
    assert element_quality(found).min() > 0.3
    volume = node_volumes(found.kind, found.nodes[found.elements])[0].sum()
    assert volume == pytest.approx(node_volumes(mesh.kind, mesh.nodes[mesh.elements])[0].sum(), rel=1e-12)


def test_the_mean_order_of_a_distorted_mesh_is_read_off_its_positions() -> None:
    for cell in ("tetra10", "hexahedron20", "hexahedron27"):
        mesh, rng = block(CELLS[cell]), np.random.default_rng(4)
        nodes = mesh.nodes + rng.uniform(-0.05, 0.05, mesh.nodes.shape)
        c = mesh.kind.corners
        shuffled = np.hstack(
            [mesh.elements[:, :c], mesh.elements[:, c + rng.permutation(mesh.kind.size - c)]]
        )
        np.testing.assert_array_equal(fit.in_order(nodes, shuffled, mesh.kind), mesh.elements)


@pytest.mark.parametrize(
    ("cell", "name"),
    [*((cell, "gid.gidmsh") for cell in CELLS), ("tetra", "gmsh.msh"), ("hexahedron20", "a.vtu")],
)
def test_one_element_with_permuted_nodes_is_refused_with_its_number(
    cell: str, name: str, tmp_path: Path
) -> None:
    mesh = block(CELLS[cell])
    permuted, c = mesh.elements.copy(), mesh.kind.corners
    permuted[3, :c] = permuted[3, [1, 0, *range(2, c)]]
    assert "elements 3 " in refusal(
        write(tmp_path / name, SolidMesh.of(mesh.nodes, permuted, mesh.kind)), CELLS[cell]
    )
    if mesh.kind.size > c:
        permuted = mesh.elements.copy()
        permuted[5, [c, c + 1]] = permuted[5, [c + 1, c]]
        written = write(tmp_path / name, SolidMesh.of(mesh.nodes, permuted, mesh.kind))
        assert "elements 5 " in refusal(written, CELLS[cell])


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("element", ELEMENTS)
def test_the_cells_decide_which_elements_a_scene_may_name(cell: str, element: str, tmp_path: Path) -> None:
    path = write(tmp_path / "gid.msh", block(CELLS[cell]))
    kind = ELEMENTS[element]
    if cell == "hexahedron" or kind.cell == cell or (cell == "tetra" and kind.corners == 4):
        found = read_solid(path, 1.0, element)
        assert found.kind is kind
        check_mesh(found, "found")
        volume = node_volumes(kind, found.nodes[found.elements])[0].sum()
        original = block("h8")
        exact = node_volumes(original.kind, original.nodes[original.elements])[0].sum()
        assert volume == pytest.approx(exact, rel=1e-12 if kind.corners == 8 else 0.02)
    else:
        allowed = [e.name for e in ELEMENTS.values() if e.cell == cell]
        allowed = ["t4", "t10"] if cell == "tetra" else allowed
        assert_names(
            refusal(path, element), f"mesh.element is {element!r}", f"{cell} cells", "'gid.msh'", *allowed
        )


def test_hexahedra_that_do_not_point_alike_are_not_divided_into_tetrahedra(tmp_path: Path) -> None:
    mesh = block("h8")
    turned = mesh.elements.copy()
    turned[0] = turned[0, [1, 2, 3, 0, 5, 6, 7, 4]]
    path = write(tmp_path / "gid.msh", SolidMesh.of(mesh.nodes, turned, mesh.kind))
    check_mesh(read_solid(path, 1.0, "h27"), "turned")
    assert_names(refusal(path, "t10"), "mesh.element is 't10'", "hexahedra", "tetra")


def test_cells_that_do_not_fit_together_or_are_unknown_are_refused(tmp_path: Path) -> None:
    mesh = block("h8")
    for extra, named in ((("pyramid", [[0, 1, 4, 3, 13]]), ("cells", "cannot be used", "pyramid")),):
        path = tmp_path / "mixed.vtu"
        meshio.write(path, meshio.Mesh(mesh.nodes, [("hexahedron", mesh.elements), extra]))
        assert_names(refusal(path, "h8"), "'mixed.vtu'", *named)


GOOD = gid_text(block("t4", (1, 1, 1)).nodes, block("t4", (1, 1, 1)).elements, "tetra")
"""8 nodes in lines 3 to 10, 6 elements in lines 14 to 19."""


def edited(line: int, text: str) -> str:
    rows = GOOD.split("\n")
    rows[line - 1] = text
    return "\n".join(rows)


def test_a_tutorial_like_file_is_read_as_its_format_allows(tmp_path: Path) -> None:
    """Several blocks, comments, any case, names, materials, numbers that begin anywhere, blank lines, a unit."""
    text = GOOD.replace("MESH dimension", '# made by hand\n\nmesh "Layer dimension 2" DIMENSION').replace(
        "\n1 ", "\n\t 1 "
    )
    text = text.replace("\nElements", '\nUnit "mm"\nELEMENTS').replace(
        "End Coordinates", "end coordinates # done"
    )
    rows = text.splitlines()
    start = rows.index("ELEMENTS")
    rows[start + 1 : -1] = [f"{row} 7" for row in rows[start + 1 : -1]]
    rows += [
        "MESH dimension 3 ElemType Triangle Nnode 3",
        "Coordinates",
        "End Coordinates",
        "Elements",
        "1 1 2 3",
    ]
    path = tmp_path / "t.gidmsh"
    path.write_text("\r\n".join([*rows, "End Elements"]))
    plain = tmp_path / "p.gidmsh"
    plain.write_text(GOOD)
    found, expected = read_gid(path, "t"), read_gid(plain, "p")
    assert (found.others, found.solid, found.skipped) == (("triangle",), (), {})
    np.testing.assert_array_equal(found.points, expected.points)
    np.testing.assert_array_equal(found.volumes["tetra"], expected.volumes["tetra"])


def test_gid_numbers_need_not_be_in_order(tmp_path: Path) -> None:
    path = tmp_path / "t.gidmsh"
    path.write_text(
        "MESH dimension 3 ElemType Tetrahedra Nnode 4\nCoordinates\n90 0 0 1\n-4 0 0 0\n7 1 0 0\n1000000007 0 1 0\n"
        "End Coordinates\nElements\n3 -4 7 1000000007 90\nEnd Elements\n"
    )
    mesh = read_solid(path, 0.5, "t4")
    np.testing.assert_array_equal(
        mesh.nodes[mesh.elements[0]], [[0, 0, 0], [0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]]
    )


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", ("MESH dimension 3 ElemType ... Nnode ...",)),
        ("hello\n", ("line 1", "MESH dimension 3 ElemType ... Nnode ...", "'hello'")),
        (edited(1, "MESH dimension 3 Nnode 4"), ("line 1", "MESH", "without elemtype")),
        (edited(1, "MESH dimension 3 ElemType Tetrahedra Nnode"), ("line 1", "MESH", "without nnode")),
        (edited(1, "MESH dimension 2 ElemType Tetrahedra Nnode 4"), ("line 1", "dimension is '2'", "only 3")),
        (
            edited(1, "MESH dimension 3 ElemType Cube Nnode 4"),
            ("line 1", "ElemType is 'cube'", "Tetrahedra", "Hexahedra"),
        ),
        (edited(1, "MESH dimension 3 ElemType Tetrahedra Nnode 5"), ("'tetrahedra'", "Nnode 5", "4, 10")),
        (edited(1, "MESH dimension 3 ElemType Tetrahedra Nnode x"), ("line 1", "'x'", "number of nodes")),
        (edited(1, "MESH dimension 3 ElemType Hexahedra Nnode 8"), ("line 14", "element", "8 nodes")),
        (edited(2, "Coordinate"), ("line 2", "Coordinates", "Elements", "MESH", "'Coordinate'")),
        (edited(4, "2 0 0"), ("line 4", "node", "3 coordinates", "3 words")),
        (edited(4, "2 0 zero 0"), ("line 4", "'zero'", "coordinate")),
        (edited(4, "2 0 nan 0"), ("line 4", "coordinate 'nan'", "finite")),
        (edited(4, "2 0 1e999 0"), ("line 4", "coordinate '1e999'", "finite")),
        (edited(4, "2.5 0 0 0"), ("line 4", "'2.5'", "number of a node")),
        (edited(4, "9999999999999999999 0 0 0"), ("line 4", "'9999999999999999999'", "number of a node")),
        (edited(4, "1 0 0 0"), ("line 4", "node 1", "already", "line 3")),
        (edited(11, "End Elements"), ("line 11", "End Coordinates")),
        (edited(11, ""), ("line 13", "node", "3 coordinates", "1 words")),
        (edited(14, "1 1 2 3"), ("line 14", "element", "4 nodes", "material", "4 words")),
        (edited(15, "2 1 2 3 99"), ("line 15", "node 99", "Coordinates")),
        (edited(4, "20 1 0 0"), ("line 18", "node 2", "Coordinates")),
        (edited(20, ""), ("Elements", "line 13", "cut short")),
        (GOOD[: GOOD.index("End Coord")], ("Coordinates", "line 2", "cut short")),
        (GOOD[: GOOD.index("Elements")], ("no volume cells", "tetra (0)", "wedge")),
        (GOOD + "x" * 70000, ("line 21", "65536 bytes", "text file")),
        (GOOD + "\x00\x01 \x1b[2J", ("line 21", "Coordinates", "Elements", "MESH", "'\\x00\\x01'")),
    ],
)
def test_a_wrong_gid_file_is_refused_by_line_and_reason(
    text: str, named: tuple[str, ...], tmp_path: Path
) -> None:
    path = tmp_path / "x.gidmsh"
    path.write_text(text)
    assert_names(refusal(path, "t4"), "mesh.source", "'x.gidmsh'", *named)


def test_a_gid_file_runs_as_a_scene(tmp_path: Path) -> None:
    """The tripod on tetrahedra from a file in millimetres is the tripod on the generator's tetrahedra."""
    generated = convert(y_piece(LEVELS[1]), "t4")
    path = write(tmp_path / "gid_piece.gidmsh", generated, 1e-3)
    parts = build(load_scene("tripod", [f"mesh.source={path}", "mesh.scale=0.001", "mesh.element=t4"]))
    np.testing.assert_array_equal(parts.mesh.elements, generated.elements)
    np.testing.assert_allclose(parts.mesh.nodes, generated.nodes, atol=1e-15)


@pytest.mark.parametrize("level", LEVELS)
def test_every_element_on_every_level_of_the_generator_is_valid(level: int) -> None:
    hexahedra = y_piece(LEVELS[level])
    volume = node_volumes(hexahedra.kind, hexahedra.nodes[hexahedra.elements])[0].sum()
    for name, kind in ELEMENTS.items():
        mesh = convert(hexahedra, name)
        assert mesh.kind is kind
        check_mesh(mesh, name)
        assert node_volumes(kind, mesh.nodes[mesh.elements])[0].sum() == pytest.approx(volume, rel=1e-12)


def accepted_or_refused(content: bytes, name: str, element: str) -> bool:
    """Return whether a file is read and valid; any error but SceneError fails the test."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content)
        try:
            check_mesh(read_solid(path, 1e-3, element), "file")
        except SceneError as error:
            assert str(error).isprintable()
            return False
        return True


WORDS = st.sampled_from(
    b"MESH dimension 3 ElemType Hexahedra Nnode 27\n|Elements\n|End Elements\n|End |Coordinates\n|1e308 |-1e308|nan|"
    b"\n|0|-|1 2 3 4 5\n|\xff|#".split(b"|")
)


def mutations(original: bytes) -> st.SearchStrategy[bytes]:
    """Return up to 4 replacements of a stretch of a file by a word or by arbitrary bytes."""
    place = st.tuples(st.integers(0, len(original)), st.integers(0, 30), WORDS | st.binary(max_size=8))

    def apply(edits: list[tuple[int, int, bytes]]) -> bytes:
        text = original
        for start, length, new in edits:
            text = text[:start] + new + text[start + length :]
        return text

    return st.lists(place, min_size=1, max_size=4).map(apply)


@given(st.binary(max_size=300) | st.lists(WORDS, max_size=12).map(b"".join))
def test_arbitrary_bytes_are_no_gid_mesh(content: bytes) -> None:
    assert not accepted_or_refused(content, "x.gidmsh", "t4")


@given(mutations(GOOD.encode()))
def test_a_mutated_gid_mesh_is_read_or_refused(content: bytes) -> None:
    accepted_or_refused(content, "x.gidmsh", "t10")


def test_what_is_mutated_is_valid_before() -> None:
    assert accepted_or_refused(GOOD.encode(), "x.msh", "t10")


@pytest.mark.parametrize("name", ["a.vtk", "a.vtu", "gmsh.msh"])
def test_a_mutated_foreign_mesh_is_read_or_refused(name: str, tmp_path: Path, monkeypatch) -> None:
    original = write(tmp_path / name, block("h8", (1, 1, 1))).read_bytes()
    rng = np.random.default_rng(8)
    assert accepted_or_refused(original, name, "h8")
    monkeypatch.setattr(read, "PATIENCE", 3.0)  # the reader may hang on a mutated file
    for _ in range(3):
        content = bytearray(original)
        for place in rng.integers(len(content), size=6):
            content[place] = rng.integers(256)
        accepted_or_refused(bytes(content[: rng.integers(len(content) // 2, len(content) + 1)]), name, "h8")


@pytest.mark.parametrize("name", ["gmsh.msh", "a.vtk", "a.inp"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.75])
def test_a_file_that_is_cut_short_is_called_so(name: str, share: float, tmp_path: Path) -> None:
    path = write(tmp_path / name, block("h8", (2, 2, 2)))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    assert_names(refusal(path, "h8"), f"'{name}'", "cut short", "damaged")


def test_a_file_that_claims_more_than_memory_holds_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "huge.msh"
    path.write_text(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 400000000000 1 400000000000\n3 1 0 400000000000\n1\n"
        "$EndNodes\n"
    )
    refused = refusal(path, "h8")
    assert_names(refused, "'huge.msh'", "MemoryError")
