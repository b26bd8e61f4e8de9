"""Questions about connectivity and coincidence that volume and surface meshes share; plain arrays in, indices out."""

from collections.abc import Sequence

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray

DIRECTION = np.array([0.5377, 0.6180, 0.5735])
"""Points are sorted along this direction, in which no plane of a regular grid lies."""

MOST_NEIGHBOURS = 64
"""Neighbours in that order with which a point is compared."""


def coincident(points: FloatArray, tolerance: float) -> IndexArray:
    """Return which of the finite points (n, 3) share their position with another, ascending.

    Equal points are all found. If there are none, pairs closer than `tolerance` are, except where more than
    `MOST_NEIGHBOURS` other points lie between them in projection.
    """
    _, inverse, count = np.unique(points, axis=0, return_inverse=True, return_counts=True)
    if (count > 1).any():
        return np.flatnonzero(count[inverse.ravel()] > 1)
    centred = points - points[:1]
    order = np.argsort(centred @ DIRECTION, kind="stable")
    placed = centred[order]
    along = placed @ DIRECTION
    found = np.zeros(len(points), dtype=bool)
    for k in range(1, min(MOST_NEIGHBOURS, len(points) - 1) + 1):
        candidates = np.flatnonzero(along[k:] - along[:-k] <= tolerance)
        if not candidates.size:
            break
        near = np.linalg.norm(placed[candidates + k] - placed[candidates], axis=1) <= tolerance
        found[order[candidates[near]]] = found[order[candidates[near] + k]] = True
    return np.flatnonzero(found)


def equal_rows(rows: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Return the first of each set of equal rows of an array (m, k), and how many there are, both of shape (sets,)."""
    order = np.lexsort(rows.T)
    ranked = rows[order]
    starts = np.flatnonzero(np.r_[True, (ranked[1:] != ranked[:-1]).any(axis=1)][: len(rows)])
    return order[starts], np.diff(np.append(starts, len(rows)))


def directed_edges(polygons: IndexArray) -> IndexArray:
    """Return the edges of polygons (m, c) in the direction in which each runs round, shape (m c, 2)."""
    return np.stack([polygons, np.roll(polygons, -1, axis=1)], axis=2).reshape(-1, 2)


def edge_uses(polygons: Sequence[IndexArray]) -> tuple[IndexArray, IndexArray]:
    """Return the undirected edges of polygons, arrays (m, c), shape (k, 2), and how many polygons have each, (k,)."""
    edges = np.sort(np.concatenate([directed_edges(rows) for rows in polygons]), axis=1)
    size = int(edges.max(initial=0)) + 1
    keys, count = np.unique(edges[:, 0] * size + edges[:, 1], return_counts=True)
    return np.stack([keys // size, keys % size], axis=1), count


def parts(groups: list[IndexArray], size: int) -> IndexArray:
    """Return for each of `size` nodes the smallest node that it is connected with, shape (size,).

    Args:
        groups: Arrays (m, k) of node indices; the nodes of one row are connected.
        size: Number of nodes.
    """
    label = np.arange(size)
    while True:
        before = label.copy()
        for rows in groups:
            if rows.size:
                lowest = label[rows].min(axis=1)
                np.minimum.at(label, before[rows], lowest[:, None])
        label = label[label]  # the nodes follow their roots, so that chains halve
        if (label == before).all():
            return label
