"""Shape: a box, edges along the axes of its frame."""

from itertools import product

import numpy as np

from tripod_sim.mesh.surfaces import Part
from tripod_sim.shapes import Shape
from tripod_sim.tables.bodies import Obstacle, Rigid

FIELDS = ("size",)

CUBE = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
"""Faces of a cube whose corners are the products of (-1, 1), seen from outside counter-clockwise."""


def make(table: Rigid | Obstacle, field: str, obstacle: bool) -> Shape:
    """Return the box with edges `size`."""
    return box(table.size)


def box(size: tuple[float, float, float]) -> Shape:
    """Return a box with edges `size` [m]: I = (|s|² 1 - diag(s²)) / 12."""
    vertices = np.array(list(product((-0.5, 0.5), repeat=3))) * np.array(size)
    triangles = np.array([[q[0], q[k], q[k + 1]] for q in CUBE for k in (1, 2)], dtype=np.int64)
    squares = np.array(size) ** 2
    inertia = (squares.sum() * np.eye(3) - np.diag(squares)) / 12
    return Shape(Part(vertices, triangles, rigid=True), vertices, triangles, inertia, float(np.prod(size)))
