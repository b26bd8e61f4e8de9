"""Surfaces: OBJ and STL files, what is refused and how it is named, hostile bytes."""

import struct
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.messages import assert_names, raises_naming
from tripod_sim.errors import SceneError
from tripod_sim.mesh import file_format, obj
from tripod_sim.mesh.obj import read_obj
from tripod_sim.mesh.read_surface import read_surface
from tripod_sim.mesh.surface_mesh import SurfaceMesh, check_surface
from tripod_sim.mesh.y_piece import LEVELS, y_piece
from tripod_sim.springs import net
from tripod_sim.springs.net import spring_net
from tripod_sim.tables.bodies import Springs

TETRAHEDRON = SurfaceMesh(
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
)
SQUARE = SurfaceMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])


def piece() -> SurfaceMesh:
    """Return the boundary of the silicone piece, every vertex of it used."""
    mesh = y_piece(LEVELS[1])
    used, triangles = np.unique(mesh.surface, return_inverse=True)
    return SurfaceMesh(mesh.nodes[used], triangles.reshape(-1, 3))


def obj_text(mesh: SurfaceMesh) -> bytes:
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    rows += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.triangles.tolist()]
    return "\n".join([*rows, ""]).encode()


def ascii_stl(mesh: SurfaceMesh) -> bytes:
    rows = ["solid piece of silicone"]
    for triangle in mesh.vertices[mesh.triangles].tolist():
        corners = [f"      vertex {x!r} {y!r} {z!r}" for x, y, z in triangle]
        rows += ["  facet normal 0 0 0", "    outer loop", *corners, "    endloop", "  endfacet"]
    return "\n".join([*rows, "endsolid piece of silicone", ""]).encode()


def binary_stl(mesh: SurfaceMesh, header: bytes = b"solid, says the header") -> bytes:
    found = header.ljust(80, b"\0") + struct.pack("<I", len(mesh.triangles))
    for triangle in mesh.vertices[mesh.triangles]:
        found += struct.pack("<12fH", 0, 0, 0, *triangle.ravel(), 7)
    return found


FORMATS = {"a.obj": obj_text, "a.stl": ascii_stl, "b.stl": binary_stl}


def read_bytes(content: bytes, name: str, scale: float = 1.0) -> SurfaceMesh:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content)
        try:
            return read_surface(path, scale, "obstacle.source")
        except SceneError as error:
            raise SceneError(str(error).replace(str(path), name)) from None


def refusal(content: bytes, name: str) -> str:
    with pytest.raises(SceneError) as caught:
        read_bytes(content, name)
    message = str(caught.value)
    assert message.startswith("obstacle.source")
    assert message.isprintable()
    assert len(message) < 300
    return message


def corner_set(mesh: SurfaceMesh, digits: int) -> set[tuple]:
    """Return the triangles by rounded positions, each begun at its smallest corner, so that order does not count."""
    found = set()
    for triangle in np.round(mesh.vertices[mesh.triangles], digits).tolist():
        start = triangle.index(min(triangle))
        found.add(tuple(map(tuple, triangle[start:] + triangle[:start])))
    return found


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_surface_that_was_written(name: str) -> None:
    """In millimetres; binary STL keeps 24 bits, so positions within 55 mm to 55 mm / 2^24 = 3 nm."""
    mesh = piece()
    millimetres = SurfaceMesh(mesh.vertices * 1000, mesh.triangles)
    found = read_bytes(FORMATS[name](millimetres), name, 1e-3)
    assert len(found.vertices) == len(mesh.vertices)
    assert corner_set(found, 7) == corner_set(mesh, 7)
    assert found.watertight
    assert found.volume == pytest.approx(mesh.volume, rel=1e-6)


def test_obj_polygons_are_divided_and_numbers_may_count_back() -> None:
    text = (
        b"# pentagon, square below it\nmtllib x.mtl\no part\nv 0 0 0\nv 2 0 0 1.0\nv 3 1 0 0.5 0.5 0.5\nvn 0 0 1\n"
        b"v 1 2 0\nvt 0 0\nv -1 1 0\ng top\nusemtl red\ns off\nf 1/1/1 2//1 3/1 4 \\\n 5\n"
        b"v 0 -1 0\nv 2 -1 0\nv 9 9 9\nf -3 -2 2 1\n"
    )
    found = read_bytes(text, "x.obj")
    np.testing.assert_array_equal(found.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [5, 6, 1], [5, 1, 0]])
    assert len(found.vertices) == 7  # the last one is not used
    np.testing.assert_array_equal(found.vertices[2], [3, 1, 0])
    assert not found.watertight


CONCAVE = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.2, 0], [0, 2, 0.0]])
"""A crown of area 2.2: from its first corner it would be divided into triangles that overlap."""


@pytest.mark.parametrize("first", range(5))
@pytest.mark.parametrize("back", [False, True])
def test_obj_polygons_that_are_not_convex_keep_their_shape(first: int, back: bool) -> None:
    corners = np.roll(CONCAVE, -first, axis=0) @ np.array([[1, 0, 0], [0, 0.6, 0.8], [0, -0.8, 0.6]])
    face = "f 5 4 3 2 1\n" if back else "f 1 2 3 4 5\n"
    mesh = read_bytes(
        ("".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in corners.tolist()) + face).encode(), "x.obj"
    )
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    area = 0.5 * np.cross(b - a, c - a) @ np.array([0, -0.8, 0.6] if not back else [0, 0.8, -0.6])
    assert len(area) == 3
    assert area.min() > 0.1
    assert area.sum() == pytest.approx(2.2)


def test_an_obj_polygon_may_have_corners_in_a_line_and_a_spiral_is_one() -> None:
    text = b"v 0 0 0\nv 1 0 0\nv 2 0 0\nv 1 1 0\nf 1 2 3 4\n"
    np.testing.assert_allclose(_areas(read_bytes(text, "x.obj")), 0.5)
    turns = np.linspace(0, 5 * np.pi, 60)
    arm = [(r * np.cos(t), r * np.sin(t), 0.0) for t, r in zip(turns, 1 + turns, strict=True)]
    inner = [(0.7 * x, 0.7 * y, 0.0) for x, y, _ in reversed(arm)]
    spiral = "".join(f"v {x} {y} {z}\n" for x, y, z in [*arm, *inner])
    mesh = read_bytes((spiral + "f " + " ".join(str(k + 1) for k in range(120)) + "\n").encode(), "x.obj")
    x, y, _ = np.array([*arm, *inner]).T
    area = 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
    assert _areas(mesh).sum() == pytest.approx(area)
    assert _areas(mesh).min() > 0


def _areas(mesh: SurfaceMesh) -> np.ndarray:
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    return 0.5 * np.cross(b - a, c - a)[:, 2]


def test_an_ascii_stl_may_hold_several_solids_in_any_case() -> None:
    first, second = TETRAHEDRON, SurfaceMesh(TETRAHEDRON.vertices + 5, TETRAHEDRON.triangles)
    found = read_bytes(ascii_stl(first) + b"\n\n" + ascii_stl(second).upper(), "a.stl")
    assert len(found.vertices) == 8
    assert found.watertight
    assert found.volume == pytest.approx(2 / 6)


def test_negative_zero_is_zero_where_corners_meet() -> None:
    corners = ascii_stl(TETRAHEDRON).replace(b"vertex 0.0 0.0", b"vertex -0.0 0.0", 2)
    assert len(read_bytes(corners, "a.stl").vertices) == 4


def test_watertight_means_every_edge_twice() -> None:
    assert TETRAHEDRON.watertight
    assert TETRAHEDRON.volume == pytest.approx(1 / 6)
    assert SurfaceMesh(TETRAHEDRON.vertices, TETRAHEDRON.triangles[:, ::-1]).volume == pytest.approx(-1 / 6)
    opened = SurfaceMesh(TETRAHEDRON.vertices, TETRAHEDRON.triangles[1:])
    check_surface(opened, "open")  # no error: a cloth is open
    assert not opened.watertight
    assert not SurfaceMesh(np.zeros((0, 3)), np.zeros((0, 3))).watertight


def test_a_surface_keeps_copies_that_nobody_can_write() -> None:
    for array in (SQUARE.vertices, SQUARE.triangles):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


V, T = SQUARE.vertices, SQUARE.triangles


@pytest.mark.parametrize(
    ("mesh", "named"),
    [
        (SurfaceMesh(V, np.zeros((0, 3))), ("surface", "no triangles")),
        (SurfaceMesh([[np.nan, 0, 0], *V[1:]], T), ("vertices 0", "finite")),
        (SurfaceMesh(V, [[0, 1, 2], [0, 2, 4]]), ("triangles 1", "vertices", "outside 0..3")),
        (SurfaceMesh(V, [[0, 1, 2], [0, -1, 3]]), ("triangles 1", "vertices", "outside 0..3")),
        (SurfaceMesh([*V, [5, 5, 5]], T), ("vertices 4", "no triangle")),
        (SurfaceMesh([*V, V[2]], [[0, 1, 2], [0, 4, 3]]), ("vertices 2, 4", "position")),
        (SurfaceMesh([*V, V[2] + 5e-10], [[0, 1, 2], [0, 4, 3]]), ("vertices 2, 4", "position")),
        (SurfaceMesh([*V[:3], [0.5, 0.5, 0]], T), ("triangles 1", "no area")),
        (SurfaceMesh(V, [[0, 1, 2], [0, 2, 3], [2, 2, 3]]), ("triangles 2", "no area")),
        (
            SurfaceMesh([*V, [0, 0, 1]], [*T, [0, 2, 4]]),
            ("edges", "vertices 0, 2", "more than two triangles"),
        ),
        (SurfaceMesh(V, [*T, [0, 1, 2]]), ("edges", "vertices 0, 2", "more than two triangles")),
        (SurfaceMesh(V, [[0, 1, 2], [0, 3, 2]]), ("triangles 0, 1", "opposite orientation", "neighbour")),
        (
            SurfaceMesh(TETRAHEDRON.vertices, [[0, 1, 2], *TETRAHEDRON.triangles[1:]]),
            ("triangles 0, 1, 2, 3", "opposite orientation", "neighbour"),
        ),
    ],
)
def test_an_unusable_surface_is_refused_with_its_offenders(mesh: SurfaceMesh, named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, "the wall", *named):
        check_surface(mesh, "the wall")


@pytest.mark.parametrize(("size", "shift"), [(1e-6, 0.0), (1e-6, 1.0), (1e9, 1e3)])
def test_a_valid_surface_passes_at_any_size_and_place(size: float, shift: float) -> None:
    check_surface(SurfaceMesh(TETRAHEDRON.vertices * size + shift, TETRAHEDRON.triangles), "tetrahedron")


def test_a_sliver_is_judged_by_its_shape_and_not_by_its_size() -> None:
    for size in (1e-8, 1.0, 1e8):
        for height, flat in ((2e-9, False), (0.0, True)):
            sliver = SurfaceMesh(np.array([[0, 0, 0], [1, 0, 0], [0.5, height, 0]]) * size, [[0, 1, 2]])
            if flat:
                with raises_naming(SceneError, "triangles 0", "no area"):
                    check_surface(sliver, "s")
            else:
                check_surface(sliver, "s")


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (b"", ("no triangles",)),
        (b"v 0 0\n", ("line 1", "vertex", "3 coordinates", "2 words")),
        (b"v 0 0 inf\n", ("line 1", "coordinate 'inf'", "finite")),
        (b"v 0 0 a\n", ("line 1", "'a'", "coordinate")),
        (b"v 0 0 0\nf 1 1\n", ("line 2", "face", "at least 3 vertices", "found 2")),
        (b"v 0 0 0\nf 1 2 1\n", ("line 2", "vertex 2", "face", "1 vertices before")),
        (b"v 0 0 0\nf 1 -2 1\n", ("line 2", "vertex -2", "face", "1 vertices before")),
        (b"v 0 0 0\nf 0 1 1\n", ("line 2", "vertex 0", "face")),
        (b"v 0 0 0\nf 1.5 1 1\n", ("line 2", "'1.5'", "number of a vertex")),
        (b"v 0 0 0\nf /1 1 1\n", ("line 2", "''", "number of a vertex")),
        (b"v 0 0 0\nf 1 1 1\n", ("triangles 0", "no area")),
        (
            b"v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\n",
            ("line 5", "face of 4 vertices", "crosses itself", "convex"),
        ),
        (b"hello\n", ("line 1", "'hello'", "OBJ")),
        (b"v 0 0 0 \\\n", ("last line", "continued")),
        (b"\x00" * 70000, ("line 1", "65536 bytes")),
    ],
)
def test_a_wrong_obj_is_refused_by_line_and_reason(text: bytes, named: tuple[str, ...]) -> None:
    assert_names(refusal(text, "x.obj"), *named)


ASCII = ascii_stl(SQUARE)
"""2 facets of 7 lines, after the first line."""


def edited(line: int, text: bytes) -> bytes:
    rows = ASCII.split(b"\n")
    rows[line - 1] = text
    return b"\n".join(rows)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (b"", ("'x.stl'", "STL", "'solid'", "0 bytes")),
        (b"x" * 84, ("84 bytes", "2021161080 triangles", "101058054084")),
        (binary_stl(SQUARE, b"x")[:-1], ("183 bytes", "2 triangles", "184")),
        (binary_stl(SQUARE, b"x") + b"\0", ("185 bytes", "2 triangles", "184")),
        (binary_stl(SurfaceMesh(V, T[:0])), ("no triangles",)),
        (binary_stl(SurfaceMesh(V * [np.nan, 1, 1], T)), ("vertices", "not finite")),
        (b"solid\nendsolid\n", ("no triangles",)),
        (edited(2, b"facet"), ("line 2", "'facet normal'", "'endsolid'", "'facet'")),
        (edited(3, b"inner loop"), ("line 3", "'outer loop'", "'inner'")),
        (edited(5, b"vertex 1 2"), ("line 5", "vertex", "3 coordinates", "2 words")),
        (edited(5, b"vertex 1 2 x"), ("line 5", "'x'", "coordinate")),
        (edited(5, b"vertex 1 2 nan"), ("line 5", "coordinate 'nan'", "finite")),
        (edited(6, b"endloop"), ("line 6", "expected 'vertex'", "found 'endloop'")),
        (edited(7, b"vertex 1 1 1"), ("line 7", "expected 'endloop'", "found 'vertex'")),
        (edited(16, b""), ("line 16", "'endsolid'", "cut short")),
        (ASCII + b"facet normal\n", ("line 17", "expected 'solid'", "found 'facet'")),
        (ASCII[: len(ASCII) // 2], ("cut short",)),
    ],
)
def test_a_wrong_stl_is_refused_with_its_reason(content: bytes, named: tuple[str, ...]) -> None:
    assert_names(refusal(content, "x.stl"), *named)


def test_a_statement_continued_for_ever_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(obj, "MOST_WORDS", 10)
    assert_names(refusal(b"f 1 1 \\\n" * 9, "x.obj"), "line 4", "more than 10 words")


def test_a_small_file_of_very_many_triangles_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.obj"
    path.write_bytes(b"v 0 0 0\nf" + b" 1" * 12 + b"\nf 1 1 1\nwords\n")  # what follows is not read
    with raises_naming(SceneError, "x.obj", "more than 10 triangles"):
        read_obj(path, str(path), None, 10)


def test_files_that_cannot_be_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def message(path: Path, scale: float = 1.0) -> str:
        with pytest.raises(SceneError) as caught:
            read_surface(path, scale, "maze.source")
        return str(caught.value).replace(str(tmp_path), "")

    wall = tmp_path / "wall.STL"
    wall.write_bytes(ASCII)
    check_surface(read_surface(wall, 1.0, "maze.source"), "wall")
    assert_names(message(tmp_path / "gone.stl"), "maze.source", "file '/gone.stl'", "not exist")
    assert_names(message(tmp_path), "maze.source", "file ''", "directory")
    for scale in (0.0, -1.0, float("nan"), float("inf")):
        assert_names(message(wall, scale), "maze.source", f"scale is {scale} m", "finite", "above 0 m")
    other = tmp_path / "wall.step"
    other.write_bytes(b"x")
    assert_names(message(other), "maze.source", "'/wall.step'", "step", "OBJ", "STL")
    other.write_bytes(b"# vtk DataFile Version 3.0\n")
    assert_names(message(other), "maze.source", "'/wall.step'", "vtk", "OBJ", "STL")
    other.write_bytes(ASCII)
    check_surface(read_surface(other, 1.0, "maze.source"), "by its content")
    monkeypatch.setattr(file_format, "MAX_BYTES", 10)
    assert_names(message(wall), "maze.source", "file '/wall.STL'", "larger than 10 bytes")


@pytest.mark.parametrize("name", FORMATS)
def test_a_surface_of_more_triangles_than_fit_is_refused_with_their_number(name: str, tmp_path: Path) -> None:
    path, count = tmp_path / name, len(TETRAHEDRON.triangles)
    path.write_bytes(FORMATS[name](TETRAHEDRON))
    assert len(read_surface(path, 1.0, "springs.source", None, count).triangles) == count
    with raises_naming(SceneError, "springs.source", name, f"more than {count - 1} triangles", "reduce"):
        read_surface(path, 1.0, "springs.source", None, count - 1)


def test_a_cloth_from_a_file_has_the_limit_of_a_generated_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "x.obj").write_bytes(obj_text(TETRAHEDRON))
    assert len(spring_net(Springs(str(tmp_path / "x.obj"))).nodes) == len(TETRAHEDRON.vertices)
    monkeypatch.setattr(net, "MOST_NODES", len(TETRAHEDRON.triangles) // 2 - 1)
    with raises_naming(SceneError, "springs.source", f"more than {len(TETRAHEDRON.triangles) - 2} triangles"):
        spring_net(Springs(str(tmp_path / "x.obj")))


def test_positions_that_overflow_with_the_scale_are_named() -> None:
    with raises_naming(SceneError, "positions", "vertices 1, 2, 3", "finite"):
        read_bytes(obj_text(SurfaceMesh(SQUARE.vertices * 1e300, SQUARE.triangles)), "x.obj", 1e10)


WORDS = st.sampled_from(
    b"v |f |vn|\n|0|1|-1|/|\\|1e308 |-1e308 |nan |# |solid |facet normal|endfacet|endsolid|vertex |outer loop|"
    b"\xff".split(b"|")
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


def accepted_or_refused(content: bytes, name: str) -> None:
    try:
        found = read_bytes(content, name)
    except SceneError as error:
        assert str(error).isprintable()
    else:
        check_surface(found, "found")


@pytest.mark.parametrize("name", ["x.obj", "x.stl"])
@given(st.binary(max_size=200) | st.lists(WORDS, max_size=20).map(b"".join))
def test_arbitrary_bytes_are_read_or_refused(name: str, content: bytes) -> None:
    accepted_or_refused(content, name)


@pytest.mark.parametrize("name", FORMATS)
@given(st.data())
def test_mutated_files_are_read_or_refused(name: str, data: st.DataObject) -> None:
    accepted_or_refused(data.draw(mutations(FORMATS[name](TETRAHEDRON))), name)


def test_the_surface_of_a_solid_is_a_surface() -> None:
    mesh = piece()
    check_surface(mesh, "piece")
    assert mesh.watertight
