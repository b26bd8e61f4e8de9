"""Shape: a ball, exactly a sphere."""

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.mesh.surfaces import Part
from tripod_sim.shapes import Shape
from tripod_sim.tables.bodies import Obstacle, Rigid

FIELDS = ("radius",)

ROUND = 2
"""Times that the triangles of an icosahedron are divided to show a ball."""


def make(table: Rigid | Obstacle, field: str, obstacle: bool) -> Shape:
    """Return the ball of `radius`."""
    return ball(table.radius)


def ball(radius: float) -> Shape:
    """Return a ball of `radius` [m], which touches as the sphere that it is: I = 2/5 r² 1."""
    vertices, triangles = _sphere()
    part = Part(np.zeros((1, 3)), rigid=True, radius=radius)
    volume = 4.0 / 3.0 * np.pi * radius**3
    return Shape(part, radius * vertices, triangles, 0.4 * radius**2 * np.eye(3), volume)


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
