"""Shape: a capsule, all points within a radius of a segment: a cylinder with a half ball at each end."""

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.mesh.surfaces import Part
from tripod_sim.shapes import Shape
from tripod_sim.tables.bodies import Obstacle, Rigid

FIELDS = ("radius", "length")

AROUND, RINGS = 24, 6
"""Corners of the polygons that show a capsule, and how many of them, with its equator, show each end."""


def make(table: Rigid | Obstacle, field: str, obstacle: bool) -> Shape:
    """Return the capsule of `radius` and `length`."""
    return capsule(table.radius, table.length)


def capsule(radius: float, length: float) -> Shape:
    """Return the capsule of `radius` r about a segment of `length` l [m] along Z: it touches as exactly that.

    With the cylinder's share of the volume, a = l / (l + 4 r / 3), and the ends' b = 1 - a:

        I_zz = a r² / 2 + b 2 r² / 5
        I_xx = I_yy = a (r² / 4 + l² / 12) + b (2 r² / 5 + l² / 4 + 3 l r / 8)
    """
    r, ends = radius, np.array([[0.0, 0.0, -0.5 * length], [0.0, 0.0, 0.5 * length]])
    a = length / (length + 4 * r / 3)
    b = 1 - a
    along = a * r**2 / 2 + b * 2 * r**2 / 5
    across = a * (r**2 / 4 + length**2 / 12) + b * (2 * r**2 / 5 + length**2 / 4 + 3 * length * r / 8)
    part = Part(ends, segments=np.array([[0, 1]], dtype=np.int64), rigid=True, radius=r)
    volume = np.pi * r**2 * (length + 4 * r / 3)
    return Shape(part, *_picture(r, length), np.diag([across, across, along]), float(volume))


def _picture(radius: float, length: float) -> tuple[FloatArray, IndexArray]:
    """Return vertices [m] and triangles of a polyhedron inscribed in a capsule: rings from the lower pole up."""
    rise = np.linspace(0.0, 0.5 * np.pi, RINGS + 1)[:-1]
    polar = np.concatenate([-rise[::-1], rise])
    turn = 2 * np.pi * np.arange(AROUND) / AROUND
    x, y = np.outer(np.cos(polar), np.cos(turn)), np.outer(np.cos(polar), np.sin(turn))
    z = radius * np.sin(polar) + 0.5 * length * np.repeat([-1.0, 1.0], RINGS)
    rings = np.stack([radius * x, radius * y, np.repeat(z[:, None], AROUND, axis=1)], axis=2).reshape(-1, 3)
    top = 0.5 * length + radius
    vertices = np.concatenate([rings, [[0.0, 0.0, -top], [0.0, 0.0, top]]])
    south, north = len(rings), len(rings) + 1
    last, here = 2 * RINGS - 1, np.arange(AROUND)
    ahead = (here + 1) % AROUND
    faces = [np.stack([np.full(AROUND, south), ahead, here], axis=1)]
    for k in range(last):
        low, high = k * AROUND, (k + 1) * AROUND
        faces.append(np.stack([low + here, low + ahead, high + ahead], axis=1))
        faces.append(np.stack([low + here, high + ahead, high + here], axis=1))
    faces.append(np.stack([last * AROUND + here, last * AROUND + ahead, np.full(AROUND, north)], axis=1))
    return vertices, np.concatenate(faces).astype(np.int64)
