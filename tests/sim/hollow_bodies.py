"""Meshes of hollow bodies with curved faces for tests, and systems with a chamber in them."""

import numpy as np

from benchmarks.blocks import brick, elastic
from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.constraints.groups import Groups
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.forces.term import Term
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import SolidMesh, check_mesh
from tripod_sim.system import System


def sphere_shell(element: str, inner: float, outer: float, cells: int = 4, layers: int = 2) -> SolidMesh:
    """Return a hollow ball about the origin: a cube of cells^2 quadrilaterals on each side, mapped to spheres [m]."""
    cube = brick("h8", [np.linspace(-1, 1, cells + 1)] * 3)
    quads = cube.boundary[0].nodes
    used, numbers = np.unique(quads, return_inverse=True)
    quads = numbers.reshape(quads.shape)
    radii = np.geomspace(inner, outer, layers + 1)
    nodes = np.concatenate([radius * cube.nodes[used] for radius in radii])
    below = [quads + k * len(used) for k in range(layers)]
    return _mapped(nodes, np.concatenate(below), len(used), element, axes=3)


def tube(
    element: str, inner: float, outer: float, length: float, cells: int = 4, layers: int = 3
) -> SolidMesh:
    """Return a slice of a tube along z: a square of `cells` quadrilaterals on each side, mapped to cylinders [m]."""
    side = np.linspace(-1, 1, cells + 1)[:-1]
    one = np.ones(cells)
    square = [np.stack(p, axis=1) for p in ((side, -one), (one, side), (-side, one), (-one, -side))]
    ring, count = np.concatenate(square), 4 * cells
    radii = np.geomspace(inner, outer, layers + 1)
    flat = np.concatenate([radius * ring for radius in radii])
    nodes = np.concatenate([np.column_stack([flat, np.full(len(flat), z)]) for z in (0.0, length)])
    a = np.arange(count)
    b = np.roll(a, -1)
    rings = [np.stack([b, a, a + count, b + count], axis=1) + k * count for k in range(layers)]
    return _mapped(nodes, np.concatenate(rings), len(flat), element, axes=2)


def _mapped(nodes: FloatArray, below: IndexArray, above: int, element: str, axes: int) -> SolidMesh:
    """Return the mesh of cells between quadrilaterals, `below` and numbers higher by `above`.

    Cubes (`axes` 3) or squares (2) about the origin become spheres or circles, for the nodes within edges, too.
    """
    kind = ELEMENTS[element].plain
    cells = np.hstack([below, below + above])
    if kind.cell != "hexahedron":
        triangles = np.concatenate([below[:, [0, 1, 2]], below[:, [0, 2, 3]]])
        cells = np.hstack([triangles, triangles + above])
    if kind.cell == "tetra":
        u, v, w = np.sort(triangles, axis=1).T
        cells = np.concatenate(
            [
                np.stack(t, axis=1)
                for t in (
                    (u, v, w, w + above),
                    (u, v, v + above, w + above),
                    (u, u + above, v + above, w + above),
                )
            ]
        )
        turned = np.linalg.det(nodes[cells[:, 1:]] - nodes[cells[:, :1]]) < 0
        cells[turned] = cells[turned][:, [1, 0, 2, 3]]
    mesh = SolidMesh.of(nodes, cells, kind)
    mesh = mesh if element == kind.name else convert(mesh, element)
    nodes = np.array(mesh.nodes)
    flat = nodes[:, :axes]
    radius = np.abs(flat).max(axis=1, keepdims=True)
    direction = np.tan(np.pi / 4 * flat / radius)
    nodes[:, :axes] = radius * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    found = SolidMesh.of(nodes, np.array(mesh.elements), mesh.kind)
    check_mesh(found, "hollow body")
    return found


def on_axes(nodes: FloatArray, axes: int) -> IndexArray:
    """Return pins of nodes on the first axes, held across these: node and axis, shape (k, 2)."""
    pins = [
        (node, across)
        for axis in range(axes)
        for node in np.flatnonzero(np.abs(np.delete(nodes[:, :axes], axis, axis=1)).max(axis=1) < 1e-9)
        for across in range(axes)
        if across != axis
    ]
    return np.array(pins)


def commanded(pressure: float) -> FloatArray:
    """Return the joint values of a system with one chamber and no servos: its pressure [Pa], and the slide."""
    return np.array([pressure, 0.0])


def pressurised(
    mesh: SolidMesh,
    chamber: Term,
    pins: IndexArray,
    young: float,
    poisson: float,
    *more: Term,
    damping: float = 0.0,
) -> System:
    """Return a neo-Hookean body with a chamber, held by pins."""
    groups = Groups(len(mesh.nodes), pinned=pins, actuators=1)
    solid = elastic(mesh, young, poisson, damping=damping)
    return System(np.array(mesh.nodes), [solid], groups, [chamber, *more], damped=damping > 0)
