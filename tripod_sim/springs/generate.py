"""Chains, grids and cloth from a surface: nodes, springs by kind, triangles, corners."""

from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.errors import SceneError
from tripod_sim.mesh.surface_mesh import SurfaceMesh

MOST_NODES = 250_000
"""Of a cloth, generated or from a file: it takes about 1 GB."""


@dataclass(frozen=True, eq=False)
class Net:
    """Nodes and who is tied to whom.

    Attributes:
        nodes: [m], shape (n, 3).
        structural: Node pairs along the lines of the net, shape (., 2).
        shear: Across its cells.
        bending: From one node to the next but one in a line, or across the common edge of two triangles.
        triangles: Of its surface, shape (t, 3).
        corners: Ends of a chain, corners of a grid counter-clockwise, of nothing else.
    """

    nodes: FloatArray
    structural: IndexArray
    shear: IndexArray
    bending: IndexArray
    triangles: IndexArray
    corners: IndexArray


def chain(count: int, length: float) -> Net:
    """Return `count` nodes in a line of `length` [m] from the origin along X."""
    nodes = np.zeros((count, 3))
    nodes[:, 0] = np.linspace(0.0, length, count)
    i = np.arange(count)
    none = np.zeros((0, 2), dtype=np.int64)
    return Net(
        nodes,
        np.column_stack([i[:-1], i[1:]]),
        none,
        np.column_stack([i[:-2], i[2:]]),
        np.zeros((0, 3), dtype=np.int64),
        np.array([0, count - 1]),
    )


def grid(count: int, size: float) -> Net:
    """Return `count` x `count` nodes over a square of edge `size` [m] in z = 0, centre in the origin, facing +Z.

    Corners: (-, -), (+, -), (+, +), (-, +) of (x, y). [Provot1995]
    """
    if count * count > MOST_NODES:
        raise SceneError(
            f"springs.nodes is {count}, for each side of the grid; the grid may have at most {MOST_NODES} "
            "nodes: set a smaller number"
        )
    x = np.linspace(-size / 2, size / 2, count)
    nodes = np.zeros((count * count, 3))
    nodes[:, 0], nodes[:, 1] = np.tile(x, count), np.repeat(x, count)
    i = np.arange(count * count).reshape(count, count)  # [row along Y, column along X]
    a, b, c, d = i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]
    flip = (np.add.outer(np.arange(count - 1), np.arange(count - 1)) % 2 == 1).ravel()
    one = np.where(flip[:, None, None], _stack((a, b, d), (b, c, d)), _stack((a, b, c), (a, c, d)))
    return Net(
        nodes,
        np.concatenate([_pairs(i[:, :-1], i[:, 1:]), _pairs(i[:-1], i[1:])]),
        np.concatenate([_pairs(a, c), _pairs(b, d)]),
        np.concatenate([_pairs(i[:, :-2], i[:, 2:]), _pairs(i[:-2], i[2:])]),
        one.reshape(-1, 3),
        np.array([i[0, 0], i[0, -1], i[-1, -1], i[-1, 0]]),
    )


def net_of_surface(mesh: SurfaceMesh, polygons: IndexArray | None = None) -> Net:
    """Return the edges of a surface as springs: structural along edges, bending across them.

    Args:
        mesh: Triangles; quadrangles and polygons are divided already.
        polygons: For each triangle the number of the polygon that it is part of: edges within one polygon become shear
            springs. None: every edge is structural.
    """
    t = mesh.triangles
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    opposite = np.concatenate([t[:, 2], t[:, 0], t[:, 1]])
    owner = np.tile(np.arange(len(t)), 3)
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.lexsort((high, low))
    low, high, opposite, owner = low[order], high[order], opposite[order], owner[order]
    same = (low[1:] == low[:-1]) & (high[1:] == high[:-1])
    first = np.flatnonzero(np.append(True, ~same))
    pairs = np.column_stack([low, high])[first]
    twice = np.flatnonzero(same)
    inner = np.zeros(len(low), dtype=bool)
    if polygons is not None:
        inner[twice] = polygons[owner[twice]] == polygons[owner[twice + 1]]
    across = np.column_stack([opposite[twice], opposite[twice + 1]])
    within = inner[first]
    keys = {(min(p), max(p)) for p in pairs.tolist()}
    shear = np.concatenate([pairs[within], across[inner[twice]]])
    bending = across[~inner[twice]]
    bending = np.array(
        [p for p in np.sort(bending, axis=1).tolist() if tuple(p) not in keys and p[0] != p[1]],
        dtype=np.int64,
    ).reshape(-1, 2)
    none = np.zeros(0, dtype=np.int64)
    return Net(mesh.vertices, pairs[~within], shear, np.unique(bending, axis=0), t, none)


def _pairs(a: IndexArray, b: IndexArray) -> IndexArray:
    return np.column_stack([a.ravel(), b.ravel()])


def _stack(*triangles: tuple[IndexArray, IndexArray, IndexArray]) -> IndexArray:
    """Return the triangles of every cell, shape (cells, len(triangles), 3)."""
    return np.stack([np.column_stack([corner.ravel() for corner in t]) for t in triangles], axis=1)
