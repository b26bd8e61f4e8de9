"""The surface of a board as triangles, for whoever shows it."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.maze.board import Board

SEGMENTS = 48
"""Sides of the polygon that stands for a round hole; a multiple of 8, so that rays meet the corners of its square."""

_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
_SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6))
_CAPS = ((0, 2, 6, 4), (1, 5, 7, 3))


@dataclass(frozen=True, eq=False)
class BoardMesh:
    """Triangles, counter-clockwise seen from outside.

    Attributes:
        vertices: In the frame of the effector's disc [m], shape (n, 3).
        triangles: Indices, shape (m, 3).
    """

    vertices: FloatArray
    triangles: IndexArray


def board_mesh(board: Board, offset: float) -> BoardMesh:
    """Return the surface of a board whose floor's top lies `offset` [m] above the disc's centre.

    Walls are whole boxes that overlap in the posts; a round hole is a polygon of SEGMENTS sides with its corners on the
    circle. An STL maze gives its own triangles.
    """
    o = board.obstacles
    soup = o.triangles.reshape(-1, 3, 3)
    if len(o.boxes):
        quads = [
            _floor(o.boxes[0], o.holes, 0.5 * board.pitch),
            *(_box(b, _SIDES + _CAPS) for b in o.boxes[1:]),
        ]
        corners = np.concatenate(quads)
        soup = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]], soup])
    vertices, indices = np.unique(soup.reshape(-1, 3), axis=0, return_inverse=True)
    return BoardMesh(vertices + np.array([0.0, 0.0, offset]), indices.reshape(-1, 3).astype(np.int64))


def _box(box: FloatArray, faces: tuple[tuple[int, int, int, int], ...]) -> FloatArray:
    """Return the corners of some faces of a box (centre, half extents), shape (f, 4, 3)."""
    corners = box[:3] + _CORNERS * box[3:]
    return np.array([corners[list(face)] for face in faces])


def _floor(box: FloatArray, holes: FloatArray, half: float) -> FloatArray:
    """Return the quadrilaterals of a floor with round holes (x, y, radius), shape (f, 4, 3).

    Top and underside are cut into rectangles along the squares of half side `half` [m] round the holes; what is left of
    a square is a ring between its border and the hole.
    """
    if not len(holes):
        return _box(box, _SIDES + _CAPS)
    low, high = box[2] - box[5], box[2] + box[5]
    cuts = [
        np.unique(
            np.round([box[a] - box[3 + a], *holes[:, a] - half, *holes[:, a] + half, box[a] + box[3 + a]], 12)
        )
        for a in (0, 1)
    ]
    flat = [
        [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        for x0, x1 in pairwise(cuts[0].tolist())
        for y0, y1 in pairwise(cuts[1].tolist())
        if not (np.abs(holes[:, :2] - (0.5 * (x0 + x1), 0.5 * (y0 + y1))).max(axis=1) < half).any()
    ]
    tubes = []
    turn = 2 * np.pi * np.arange(SEGMENTS + 1) / SEGMENTS
    ray = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    square = ray / np.abs(ray).max(axis=1, keepdims=True)
    for x, y, radius in holes:
        circle, border = (x, y) + radius * ray, (x, y) + half * square
        for (c0, c1), (b0, b1) in zip(pairwise(circle.tolist()), pairwise(border.tolist()), strict=True):
            flat.append([tuple(c0), tuple(b0), tuple(b1), tuple(c1)])
            tubes.append([(*c0, high), (*c1, high), (*c1, low), (*c0, low)])
    top = np.array([[(x, y, high) for x, y in quad] for quad in flat])
    underside = np.array([[(x, y, low) for x, y in quad[::-1]] for quad in flat])
    return np.concatenate([_box(box, _SIDES), top, underside, np.array(tubes)])
