"""Bodies of several kinds of elements: hexahedra, wedges and tetrahedra in one mesh."""

from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.checks import law_vector
from tests.messages import assert_names, raises_naming
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.forces.set_loads import face_integrals
from tripod_sim.forces.solid import Solid
from tripod_sim.mesh.block import block
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.described import described_mesh
from tripod_sim.mesh.read import read_solid
from tripod_sim.mesh.refine import refine
from tripod_sim.mesh.solid_mesh import (
    Block,
    SolidMesh,
    check_boundary,
    check_mesh,
    element_quality,
    solid_volumes,
)
from tripod_sim.mesh_error.estimate import MeshError
from tripod_sim.tables.bodies import Mesh

LENGTH, SIDE = 0.1, 0.02
KINDS = {"hexahedron": "h8", "wedge": "w6", "tetra": "t4"}
FORMATS = {"m.vtk": "vtk", "m.vtu": "vtu", "m.msh": "gmsh22", "m.inp": "abaqus"}


def corners(length: float, side: float) -> np.ndarray:
    square = np.array([[0, 0], [length, 0], [length, side], [0, side]])
    return np.vstack([np.column_stack([square, np.full(4, z)]) for z in (0.0, side)])


def parts(mesh: SolidMesh, kind_of: np.ndarray, hexahedron: str = "h8") -> SolidMesh:
    """Return a mesh of hexahedra with each cell as the kind of cells of `kind_of`, None leaves it out."""
    blocks, cells = [], np.array(mesh.elements)
    for cell in [c for c in KINDS if (kind_of == c).any()]:
        name = hexahedron if cell == "hexahedron" else KINDS[cell]
        own = SolidMesh.of(mesh.nodes, cells[kind_of == cell], ELEMENTS["h8"])
        if cell != "hexahedron":
            division = np.array(ELEMENTS[name].divisions["hexahedron"])
            own = SolidMesh.of(
                own.nodes, own.elements[:, division].reshape(-1, division.shape[1]), ELEMENTS[name]
            )
        blocks.append(Block(ELEMENTS[name], np.array(own.elements)))
    used = np.unique(np.concatenate([b.elements.ravel() for b in blocks]))
    return SolidMesh(mesh.nodes[used], tuple(Block(k, np.searchsorted(used, e)) for k, e in blocks))


def three_kinds(noise: float = 0.0) -> SolidMesh:
    """Hexahedra beside wedges, on which tetrahedra stand: an L of 1.25 m³ with inner nodes at each joint."""
    cells = (4, 2, 4)
    whole = block(np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0, 0, 1], [2, 0, 1], [2, 1, 1], [0, 1, 1]],
                           float), cells)  # fmt: skip
    middle = whole.nodes[whole.elements].mean(axis=1)
    kind_of = np.full(len(middle), None, dtype=object)
    kind_of[(middle[:, 0] < 1) & (middle[:, 2] < 0.5)] = "hexahedron"
    kind_of[(middle[:, 0] > 1) & (middle[:, 2] < 0.5)] = "wedge"
    kind_of[(middle[:, 0] > 1) & (middle[:, 2] > 0.5)] = "tetra"
    mesh = parts(whole, kind_of, "h8_modes")
    moved = np.random.default_rng(4).uniform(-noise, noise, mesh.nodes.shape)
    return SolidMesh(mesh.nodes + moved, mesh.blocks)


def solids(mesh: SolidMesh, law: str = "neo_hooke", poisson: float = 1.0) -> list[Solid]:
    return [Solid(mesh.nodes, e, kind, law, law_vector(law, poisson, 1.0)) for kind, e in mesh.blocks]


def gradient(terms: list[Solid], x: np.ndarray) -> np.ndarray:
    g = np.zeros_like(x)
    for term in terms:
        modes = term.rest_modes()
        for _ in range(12):
            term.stiffness(x, modes, project=False)
            term.add_gradient(x, modes, np.zeros_like(x))
            term.advance_modes(modes.copy(), np.zeros_like(x), 1.0, modes)
        term.stiffness(x, modes, project=False)
        term.add_gradient(x, modes, g)
    return g


def assembled(terms: list[Solid], size: int) -> np.ndarray:
    K = np.zeros((3 * size, 3 * size))
    for term in terms:
        for e, k in zip(term.elements, term.matrices, strict=True):
            dofs = (3 * e[:, None] + np.arange(3)).ravel()
            K[np.ix_(dofs, dofs)] += k
    return K


def test_the_surface_is_closed_across_the_kinds_and_encloses_the_volume() -> None:
    mesh = three_kinds(0.02)
    check_mesh(mesh, "m")
    check_boundary(mesh, "m")
    assert [b.kind.name for b in mesh.blocks] == ["h8_modes", "w6", "t4"]
    t = mesh.surface
    edges = {tuple(e) for e in np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]).tolist()}
    assert len(edges) == 3 * len(t) and all((b, a) in edges for a, b in edges)
    x = three_kinds()
    assert solid_volumes(x).sum() == pytest.approx(1.5, rel=1e-12)
    corners = x.nodes[x.surface]
    assert np.einsum("ti,ti->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6 == pytest.approx(
        1.5
    )
    inner = {f.kind.name: len(f.nodes) for f in x.boundary if f.shape.corners == 4}
    assert inner == {"h8_modes": 4 * 4 - 4 + 4 + 4 - 4 + 4, "w6": 4 + 2 * 4}


def test_a_patch_of_all_kinds_holds_a_large_uniform_strain() -> None:
    mesh = three_kinds(0.05)
    F = np.array([[1.3, 0.2, 0.0], [0.1, 0.9, 0.1], [0.0, 0.2, 1.1]])
    g = gradient(solids(mesh), mesh.nodes @ F.T)
    outer = np.unique(mesh.surface)
    inner = np.setdiff1d(np.arange(len(mesh.nodes)), outer)
    for kind, elements in mesh.blocks:
        assert np.isin(elements, inner).any(), kind.name
    assert np.abs(g[outer]).max() > 0.01
    np.testing.assert_allclose(g[inner], 0, atol=1e-12)


def test_rigid_motions_alone_have_no_energy_and_the_tangent_is_the_slope_of_the_forces() -> None:
    mesh = three_kinds(0.05)
    terms, rng = solids(mesh), np.random.default_rng(1)
    gradient(terms, np.array(mesh.nodes))
    values = np.linalg.eigvalsh(assembled(terms, len(mesh.nodes)))
    assert (np.abs(values) < 1e-10 * values[-1]).sum() == 6
    x, d, h = (
        mesh.nodes + 0.01 * rng.standard_normal(mesh.nodes.shape),
        rng.standard_normal(mesh.nodes.shape),
        1e-6,
    )
    gradient(terms, x)
    K = assembled(terms, len(x))
    slope = (gradient(terms, x + h * d) - gradient(terms, x - h * d)).ravel() / (2 * h)
    np.testing.assert_allclose(K @ d.ravel(), slope, atol=1e-6 * np.abs(slope).max())


def test_kinds_that_do_not_share_whole_faces_are_refused() -> None:
    whole = block(corners(2, 1), (2, 1, 1))
    with raises_naming(SceneError, "m", "h8", "t4", "wedges"):
        check_mesh(parts(whole, np.array(["hexahedron", "tetra"])), "m")
    linear = convert(SolidMesh.of(whole.nodes, whole.elements, ELEMENTS["h8"]), "t4")
    half = len(linear.elements) // 2
    rich = convert(linear, "t10")
    nodes = rich.nodes[np.union1d(np.arange(len(linear.nodes)), np.unique(rich.elements[half:]))]
    numbers = np.union1d(np.arange(len(linear.nodes)), np.unique(rich.elements[half:]))
    mixed = SolidMesh(
        nodes,
        (
            Block(ELEMENTS["t4"], linear.elements[:half]),
            Block(ELEMENTS["t10"], np.searchsorted(numbers, rich.elements[half:])),
        ),
    )
    with raises_naming(SceneError, "m", "t4", "t10"):
        check_mesh(mixed, "m")


def write(path: Path, mesh: SolidMesh, *, over: bool = False) -> Path:
    blocks = []
    for kind, elements in mesh.blocks:
        turned = over and kind.cell == "wedge"
        blocks.append((kind.cell, np.array(elements[:, kind.mirrored] if turned else elements)))
    binary = {"binary": False} if FORMATS[path.name] in ("vtk", "vtu", "gmsh22") else {}
    meshio.write(path, meshio.Mesh(mesh.nodes, blocks), file_format=FORMATS[path.name], **binary)
    return path


@pytest.mark.parametrize("name", FORMATS)
def test_files_of_several_kinds_are_read(name: str, tmp_path: Path) -> None:
    mesh = three_kinds()
    found = read_solid(write(tmp_path / name, mesh), 1.0, "auto")
    check_mesh(found, name)
    assert {b.kind.name for b in found.blocks} == {"h8_modes", "w6", "t4"}
    assert solid_volumes(found).sum() == pytest.approx(1.5, rel=1e-12)
    assert {b.kind.name: len(b.elements) for b in found.blocks} == {
        b.kind.name: len(b.elements) for b in mesh.blocks
    }
    assert_names(found.notes[-1], name, "hexahedron", "h8_modes", "wedge", "w6", "tetra", "t4")
    other = read_solid(tmp_path / name, 1.0, "h8")
    assert {b.kind.name for b in other.blocks} == {"h8", "w6", "t4"}
    with raises_naming(SceneError, "mesh.element", "t10", "w6"):
        read_solid(tmp_path / name, 1.0, "t10")


def test_wedges_numbered_the_other_way_round_are_turned_over_by_themselves(tmp_path: Path) -> None:
    """Two orders of wedges are in use, and each is the mirror image of the other."""
    mesh = three_kinds()
    found = read_solid(write(tmp_path / "m.vtu", mesh, over=True), 1.0, "auto")
    assert element_quality(found).min() > 0.1
    assert_names(" ".join(found.notes), "wedge", "reverse order")
    assert solid_volumes(found).sum() == pytest.approx(1.5, rel=1e-12)
    turned = SolidMesh(mesh.nodes, mesh.blocks[:1])
    some = np.array(mesh.blocks[1].elements)
    some[2] = some[2, mesh.blocks[1].kind.mirrored]
    with raises_naming(SceneError, len(turned.elements) + 2, "inverted"):
        check_mesh(SolidMesh(mesh.nodes, (mesh.blocks[0], Block(ELEMENTS["w6"], some), mesh.blocks[2])), "m")


SCENE = """
name = "mixed"
dt = 0.005
[mesh]
source = "SOURCE"
[material]
young = 1e5
poisson = 0.0
density = 1000.0
[gravity]
[[fixed]]
low = [-1, -1, -1]
high = [1e-6, 1, 1]
"""


def beam(folder: Path, name: str, kinds: tuple[str, ...], *words: str, more: str = "") -> Simulation:
    """Return a beam along x of columns of hexahedra whose kinds follow each other."""
    whole = block(corners(LENGTH, SIDE), (20, 4, 4))
    column = np.floor(whole.nodes[whole.elements].mean(axis=1)[:, 0] / (LENGTH / 4)).astype(int)
    mesh = parts(whole, np.array(kinds, dtype=object)[column % len(kinds)])
    write(folder / name, mesh)
    (folder / "scene.toml").write_text(SCENE.replace("SOURCE", name) + more)
    return Simulation(load_scene(folder / "scene.toml", words))


HEX, MIXED = ("hexahedron",), ("hexahedron", "wedge")
END = '[[set]]\nname = "end"\nalong = [1, 0, 0]\nbeyond = 0.1\n'


def sag(simulation: Simulation) -> float:
    for _ in range(3):
        simulation.step()
    end = simulation.mesh.nodes[:, 0] > LENGTH - 1e-9
    return float((simulation.positions - simulation.mesh.nodes)[end, 2].mean())


def test_a_beam_of_hexahedra_and_wedges_bends_as_one_of_hexahedra(tmp_path: Path) -> None:
    """Plain wedges are a little stiffer than hexahedra with modes, and far closer to these than wedges alone."""
    of = {kinds: sag(beam(tmp_path, "m.vtk", kinds)) for kinds in (HEX, MIXED, ("wedge",))}
    assert of[HEX] < -1e-3
    assert abs(of[MIXED] / of[HEX] - 1) < 0.06
    assert abs(of["wedge",] / of[HEX] - 1) > 1.2 * abs(of[MIXED] / of[HEX] - 1)


def test_masses_regions_and_loads_reach_elements_of_all_kinds(tmp_path: Path) -> None:
    """A stiff heavy half and a pull on the end: F L / (E A), whatever the cells are."""
    more = (
        END
        + '[[load]]\nset = "end"\nforce = [0.4, 0, 0]\n[[set]]\nname = "half"\nalong = [1, 0, 0]\nbeyond = 0.05\n'
    )
    more += '[[region]]\nset = "half"\nyoung = 4e5\npoisson = 0.0\ndensity = 3000.0\n'
    simulation = beam(tmp_path, "m.msh", MIXED, "gravity.acceleration=[0, 0, 0]", more=more)
    volume = LENGTH * SIDE**2
    assert simulation._mass.sum() == pytest.approx(volume * 2000, rel=1e-12)
    simulation.step()
    end = simulation.mesh.nodes[:, 0] > LENGTH - 1e-9
    stretch = (simulation.positions - simulation.mesh.nodes)[end, 0].mean()
    assert stretch == pytest.approx(0.4 / SIDE**2 * (LENGTH / 2) * (1 / 1e5 + 1 / 4e5), rel=0.02)


def test_faces_of_all_shapes_bear_a_pressure(tmp_path: Path) -> None:
    """Underneath are quadrilaterals of hexahedra and triangles of wedges: together 2 m²."""
    mesh = three_kinds()
    below = np.flatnonzero(mesh.nodes[:, 2] < 1e-9)
    found = mesh.faces_within(below)
    assert {f.shape.corners for f in found} == {3, 4}
    of = [face_integrals(faces, mesh.nodes) for faces in found]
    assert sum(areas.sum() for areas, _, _ in of) == pytest.approx(2.0)
    np.testing.assert_allclose(sum(normals.sum(axis=(0, 1)) for _, _, normals in of), [0, 0, -2], atol=1e-12)
    more = '[[set]]\nname = "top"\nalong = [0, 0, 1]\nat = 0.02\n[[load]]\nset = "top"\npressure = 5.0\n'
    assert sag(beam(tmp_path, "m.vtu", MIXED, "gravity.acceleration=[0, 0, 0]", more=more)) < -1e-5


@pytest.mark.parametrize("scheme", ["implicit_euler", "tr_bdf2", "explicit_euler"])
def test_it_swings_under_every_kind_of_scheme_with_damping_and_contact(scheme: str, tmp_path: Path) -> None:
    """The explicit scheme finds steps that stay stable from the forces themselves."""
    more = f'[inertia]\nscheme = "{scheme}"\n[damping]\nstiffness = 1e-4\n'
    if scheme != "explicit_euler":
        more += "[contact]\ncontact_distance = 1e-3\nalarm_distance = 4e-3\n"
        more += '[[rigid]]\nshape = "ball"\nradius = 0.01\nmass = 0.005\nposition = [0.08, 0.01, 0.032]\n'
    simulation = beam(tmp_path, "m.inp", MIXED, "dt=0.002", more=more)
    for _ in range(20):
        simulation.step()
    moved = (
        simulation.positions[: len(simulation.mesh.nodes)]
        - simulation.mesh.nodes[: len(simulation.positions)]
    )
    assert np.isfinite(moved).all() and 1e-4 < np.abs(moved).max() < LENGTH


def test_free_fall_keeps_its_shape(tmp_path: Path) -> None:
    """Weight in proportion to inertia at every node, across the kinds."""
    simulation = beam(tmp_path, "m.vtk", MIXED, "fixed=[]", "inertia={scheme='implicit_euler'}")
    for _ in range(10):
        simulation.step()
    moved = simulation.positions - simulation.mesh.nodes
    assert moved[:, 2].max() < -1e-3
    np.testing.assert_allclose(moved, np.broadcast_to(moved[0], moved.shape), atol=1e-9)


def test_what_needs_one_kind_is_refused_with_the_reason(tmp_path: Path) -> None:
    write(tmp_path / "m.vtk", mesh := three_kinds())
    with raises_naming(SceneError, "mesh.refine", "wedge"):
        described_mesh(Mesh(str(tmp_path / "m.vtk"), refine=1))
    with raises_naming(SceneError, "h8_modes", "w6", "t4", "one kind"):
        _ = mesh.elements
    with raises_naming(SceneError, "mesh_error", "h8_modes", "w6"):
        MeshError(None, mesh, None)  # type: ignore[arg-type]
    plain = convert(block(corners(2, 1), (1, 1, 1)), "w6")
    with raises_naming(SceneError, "mesh.refine", "wedge"):
        refine(plain)
    with raises_naming(SceneError, "mesh.element", "wedge", "h20"):
        convert(plain, "h20")
