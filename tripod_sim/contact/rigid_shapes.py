"""What rigid bodies can be: a box, a ball, a closed surface from a file; where they touch, their inertia."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.contact.surfaces import Part
from tripod_sim.errors import SceneError
from tripod_sim.mesh.surface_mesh import SurfaceMesh

ROUND = 2
"""Times that the triangles of an icosahedron are divided to show a ball."""

CUBE = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
"""Faces of a cube whose corners are the products of (-1, 1), seen from outside counter-clockwise."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A rigid body of unit mass about its centre, in its own frame.

    Attributes:
        part: The surface with which it touches.
        vertices: Of the surface that shows it [m], shape (k, 3).
        triangles: Of these vertices, shape (t, 3).
        inertia: About the centre, for a mass of 1 kg [m²], shape (3, 3).
    """

    part: Part
    vertices: FloatArray
    triangles: IndexArray
    inertia: FloatArray


def box(size: tuple[float, float, float]) -> Shape:
    """Return a box with edges `size` [m]: I = (|s|² 1 - diag(s²)) / 12."""
    vertices = np.array(list(product((-0.5, 0.5), repeat=3))) * np.array(size)
    triangles = np.array([[q[0], q[k], q[k + 1]] for q in CUBE for k in (1, 2)], dtype=np.int64)
    squares = np.array(size) ** 2
    inertia = (squares.sum() * np.eye(3) - np.diag(squares)) / 12
    return Shape(Part(vertices, triangles, rigid=True), vertices, triangles, inertia)


def ball(radius: float) -> Shape:
    """Return a ball of `radius` [m], which touches as the sphere that it is: I = 2/5 r² 1."""
    vertices, triangles = _sphere()
    part = Part(np.zeros((1, 3)), rigid=True, radius=radius)
    return Shape(part, radius * vertices, triangles, 0.4 * radius**2 * np.eye(3))


def solid_of(surface: SurfaceMesh, field: str) -> Shape:
    """Return the body that a closed surface encloses, of even density, moved so that its centre is the origin.

    With V, V c and C = integrals of 1, x and (x - c) (x - c)^T over the tetrahedra between origin and triangles,
    I = (tr C 1 - C) / V.

    Raises:
        SceneError: the surface is open or faces inward; `field` names it.
    """
    if not surface.watertight:
        raise SceneError(
            f"{field}: the surface is open; a rigid body needs a closed one: close its holes, or make it "
            "one of the [[obstacles]], which may be open"
        )
    middle = surface.vertices.mean(axis=0)
    a, b, c = np.moveaxis((surface.vertices - middle)[surface.triangles], 1, 0)
    volumes = np.einsum("ti,ti->t", a, np.cross(b, c)) / 6
    volume, total = float(volumes.sum()), a + b + c
    if not volume > 0:
        raise SceneError(
            f"{field}: the surface encloses {volume:.3g} m³, so its triangles face inward; reverse their "
            "node order (flip the normals)"
        )
    centre = np.asarray((volumes[:, None] * total).sum(axis=0) / (4 * volume))
    moment = np.einsum("t,ti,tj->ij", volumes, total, total)
    for x in (a, b, c):
        moment += np.einsum("t,ti,tj->ij", volumes, x, x)
    spread = moment / (20 * volume) - np.outer(centre, centre)
    vertices = surface.vertices - middle - centre
    part = Part(vertices, surface.triangles, rigid=True)
    return Shape(part, vertices, surface.triangles, np.trace(spread) * np.eye(3) - spread)


def _sphere() -> tuple[FloatArray, IndexArray]:
    """Return vertices and triangles of the unit sphere."""
    g = (1 + np.sqrt(5)) / 2
    points = np.array([[s, t * g, 0] for s in (-1, 1) for t in (-1, 1)])
    vertices = np.concatenate([np.roll(points, k, axis=1) for k in range(3)])
    gap = np.linalg.norm(vertices[:, None] - vertices[None], axis=2)
    near = gap < 2.1  # the edge is 2
    faces = [
        (i, j, k) for i in range(12) for j in range(i + 1, 12) for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]  # fmt: skip
    for _ in range(ROUND):
        vertices, faces = _divided(vertices, faces)
    unit = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    triangles = np.array(faces, dtype=np.int64)
    a, b, c = np.moveaxis(unit[triangles], 1, 0)
    inward = np.einsum("ti,ti->t", a, np.cross(b, c)) < 0
    triangles[inward] = triangles[inward][:, [0, 2, 1]]
    return unit, triangles


def _divided(
    vertices: FloatArray, faces: list[tuple[int, int, int]]
) -> tuple[FloatArray, list[tuple[int, int, int]]]:
    """Return the mesh with each triangle divided into four."""
    points, middle, out = vertices.tolist(), dict[tuple[int, int], int](), list[tuple[int, int, int]]()
    for face in faces:
        cut = []
        for k in range(3):
            i, j = sorted((face[k], face[(k + 1) % 3]))
            if (i, j) not in middle:
                middle[i, j] = len(points)
                points.append(((vertices[i] + vertices[j]) / 2).tolist())
            cut.append(middle[i, j])
        out += [(face[k], cut[k], cut[k - 1]) for k in range(3)] + [(cut[0], cut[1], cut[2])]
    return np.array(points), out
