"""The surface of a part from an STL or OBJ file, broken or not: holes found and closed, triangles turned alike."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.errors import SceneError
from tripod_sim.mesh.obj import read_obj
from tripod_sim.mesh.stl import read_stl
from tripod_sim.mesh.surface_mesh import SurfaceMesh
from tripod_sim.mesh.topology import directed_edges

MOST_OPEN = 0.25
"""Largest area of the caps of holes, in parts of the area of the surface."""

CRACK = 2e-3
"""Distance of vertices that are joined where a surface has open edges, in parts of its largest extent."""

RAYS = 256
"""Rays along each side of the surface, by which the volume is found that it winds about."""

OVERLAP = 0.01
"""Difference of that volume from the signed one, in parts of it, from which on the surface crosses itself."""

FLAT = 1e-6
"""Smallest enclosed volume, in parts of the cube of the largest extent."""


@dataclass(frozen=True, eq=False)
class PartSurface:
    """A closed surface.

    Attributes:
        mesh: In metres; its volume is positive.
        holes: How many were closed by caps.
        widest: Largest extent of one of them [m].
        joined: Largest distance of vertices that were joined [m]; 0 if none were.
        volume: About which it winds, counted once [m³]; `mesh.volume` unless it crosses itself.
        turned: How many triangles were turned over.
        removed: How many triangles were removed: without area, or given twice.
    """

    mesh: SurfaceMesh
    volume: float
    holes: int
    widest: float
    joined: float
    turned: int
    removed: int

    @property
    def crosses(self) -> bool:
        """Whether it crosses itself, or lies within itself."""
        return self.volume != self.mesh.volume


def read_raw(path: Path, file_format: str, name: str) -> tuple[FloatArray, IndexArray]:
    """Return the vertices (n, 3), in the file's unit, and the triangles (m, 3) of an STL or OBJ file.

    Raises:
        SceneError: not such a file, without triangles, or with positions that are not finite.
    """
    vertices, triangles = read_obj(path, name) if file_format == "obj" else read_stl(path, name)
    if not len(triangles):
        raise SceneError(f"{name} has no triangles; export the surface of the part again")
    if bad := int((~np.isfinite(vertices[triangles]).all(axis=(1, 2))).sum()):
        raise SceneError(
            f"{name} has {bad} triangles with positions that are not finite; export the part again"
        )
    return vertices, triangles


def closed(vertices: FloatArray, triangles: IndexArray, name: str) -> PartSurface:
    """Return the surface of a part, closed and turned outwards.

    Args:
        vertices: [m], shape (n, 3).
        triangles: Shape (m, 3); they may be flat, doubled, turned over, or leave holes.
        name: What messages call the part.

    Raises:
        SceneError: the surface encloses nothing: it is flat, or its holes are too large.
    """
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    kept = triangles[np.sort(first)]
    kept = kept[_areas(vertices, kept) > 0]
    removed = len(triangles) - len(kept)
    if not len(kept):
        raise SceneError(f"{name}: no triangle has an area; export the surface of the part again")
    joined = 0.0
    if before := len(_open_edges(kept)):
        places, mended, distance = _joined(vertices, kept)
        if len(mended) and len(_open_edges(mended)) < before:
            vertices, kept, joined = places, mended, distance
    kept, turned = turned_alike(vertices, kept)
    area = _areas(vertices, kept).sum()
    whole, faces, holes, widest = _capped(vertices, kept)
    used, renumbered = np.unique(faces, return_inverse=True)
    mesh = SurfaceMesh(whole[used], renumbered.reshape(-1, 3))
    caps = _areas(whole, faces[len(kept) :]).sum()
    if caps > MOST_OPEN * area:
        raise SceneError(
            f"{name} is open: {holes} hole{'s' if holes > 1 else ''}, up to {1e3 * widest:.3g} mm wide, would need "
            f"caps of {100 * caps / area:.0f} % of its area (at most {100 * MOST_OPEN:.0f} %); close the surface in "
            "the CAD program"
        )
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    if mesh.volume < 0:
        mesh, turned = SurfaceMesh(mesh.vertices, mesh.triangles[:, ::-1]), len(kept) - turned
    if not mesh.volume > FLAT * extent**3:
        raise SceneError(
            f"{name} encloses {1e9 * mesh.volume:.2g} mm³ at an extent of {1e3 * extent:.3g} mm, so it is no solid; "
            "export a closed surface"
        )
    return PartSurface(mesh, _volume_once(mesh), holes, widest, joined, turned, removed)


def _volume_once(mesh: SurfaceMesh) -> float:
    """Return the volume about which a closed surface winds, where that is not about `mesh.volume`; else that [m³].

    Rays along z in a grid count how often the surface is crossed upwards and downwards.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    step = (high - low)[:2] / RAYS
    x = mesh.vertices[mesh.triangles]
    flat = (x[:, :, :2] - low[:2]) / step - (
        0.5 + 1e-3 * np.sqrt([2.0, 3.0])
    )  # rays at whole numbers, off edges
    first = np.maximum(np.ceil(flat.min(axis=1)), 0).astype(np.int64)
    count = np.maximum(np.floor(flat.max(axis=1)).astype(np.int64) - first + 1, 0)
    sizes = count.prod(axis=1)
    rows, heights, signs = list[IndexArray](), list[FloatArray](), list[FloatArray]()
    for start, end in _chunks(sizes):
        own = np.repeat(np.arange(start, end), sizes[start:end])
        place = np.arange(len(own)) - np.repeat(
            np.cumsum(sizes[start:end]) - sizes[start:end], sizes[start:end]
        )
        ray = first[own] + np.column_stack([place // count[own, 1], place % count[own, 1]])
        a, b, c = np.moveaxis(flat[own], 1, 0)
        u, v, w = (_cross(p - ray, q - ray) for p, q in ((b, c), (c, a), (a, b)))
        hit = ((u > 0) & (v > 0) & (w > 0)) | ((u < 0) & (v < 0) & (w < 0))
        u, v, w, own, ray = u[hit], v[hit], w[hit], own[hit], ray[hit]
        z = x[own, :, 2]
        heights.append((u * z[:, 0] + v * z[:, 1] + w * z[:, 2]) / (u + v + w))
        signs.append(np.sign(u))
        rows.append(ray[:, 0] * RAYS + ray[:, 1])
    row, height, sign = np.concatenate(rows), np.concatenate(heights), np.concatenate(signs)
    order = np.lexsort((height, row))
    row, height, sign = row[order], height[order], sign[order]
    winding = -np.cumsum(sign)  # from below: the first crossing goes in; each ray ends with 0
    inside = (winding[:-1] > 0.5) & (row[1:] == row[:-1])
    total = float(((height[1:] - height[:-1]) * inside).sum() * step.prod())
    return total if abs(total / mesh.volume - 1) > OVERLAP else mesh.volume


def _chunks(sizes: IndexArray, most: int = 2_000_000) -> list[tuple[int, int]]:
    """Return ranges of items, in each of which the sizes sum to about `most`."""
    cuts = np.flatnonzero(np.diff(np.cumsum(sizes) // most)) + 1
    return list(pairwise([0, *cuts.tolist(), len(sizes)]))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a × b of vectors in the plane, shape (k,)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _joined(vertices: FloatArray, triangles: IndexArray) -> tuple[FloatArray, IndexArray, float]:
    """Return vertices, of which those beside each other have one place, triangles, and how far they were apart [m]."""
    near = CRACK * float(np.ptp(vertices[triangles].reshape(-1, 3), axis=0).max())
    pairs = cKDTree(vertices).query_pairs(near, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), (len(vertices), len(vertices)))
    count, label = connected_components(graph, directed=False)
    places = np.zeros((count, 3))
    np.add.at(places, label, vertices)
    places /= np.bincount(label)[:, None]
    found = label[triangles]
    whole = (found != np.roll(found, 1, axis=1)).all(axis=1)
    apart = np.linalg.norm(vertices[pairs[:, 0]] - vertices[pairs[:, 1]], axis=1)
    return places, found[whole], float(apart.max(initial=0.0))


def _open_edges(triangles: IndexArray) -> IndexArray:
    """Return the edges, as triangles run along them, that no other triangle has the other way, shape (k, 2)."""
    edges = directed_edges(triangles)
    size = int(triangles.max()) + 1
    keys, back = (edges[:, a] * size + edges[:, b] for a, b in ((0, 1), (1, 0)))
    return edges[~np.isin(keys, back)]


def turned_alike(vertices: FloatArray, triangles: IndexArray) -> tuple[IndexArray, int]:
    """Return triangles of which neighbours face the same side, and how many were turned over.

    Across each edge of two triangles both run in opposite directions afterwards. Of each connected part the larger
    area keeps its orientation. On a surface with one side only some neighbours stay as they are.
    """
    m = len(triangles)
    edges = directed_edges(triangles)
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    starts = np.flatnonzero(np.r_[True, ~same])
    pairs = starts[np.diff(np.append(starts, len(order))) == 2]
    a, b = order[pairs], order[pairs + 1]
    alike = edges[a, 0] != edges[b, 0]
    one, two = a // 3, b // 3
    # node t: triangle t as it is; node t + m: turned over
    rows = np.concatenate([one, one + m])
    columns = np.concatenate([np.where(alike, two, two + m), np.where(alike, two + m, two)])
    graph = coo_matrix((np.ones(len(rows)), (rows, columns)), (2 * m, 2 * m))
    _, label = connected_components(graph, directed=False)
    asis, over = label[:m], label[m:]
    area = np.bincount(asis, _areas(vertices, triangles), minlength=label.max() + 1)
    turn = area[asis] < area[over]
    turn |= (area[asis] == area[over]) & (asis > over)
    found = triangles.copy()
    found[turn] = found[turn][:, ::-1]
    return found, int(turn.sum())


def _capped(vertices: FloatArray, triangles: IndexArray) -> tuple[FloatArray, IndexArray, int, float]:
    """Return vertices and triangles with a fan over each hole behind them, the number of holes, and the widest [m]."""
    open_ = _open_edges(triangles)
    if not len(open_):
        return vertices, triangles, 0, 0.0
    graph = coo_matrix((np.ones(len(open_)), open_.T), (len(vertices), len(vertices)))
    label = connected_components(graph, directed=False)[1][open_[:, 0]]
    fans, centres, widest = [triangles], [vertices], 0.0
    rims = np.unique(label)
    for k, one in enumerate(rims):
        rim = open_[label == one]
        places = vertices[np.unique(rim)]
        widest = max(widest, float(np.ptp(places, axis=0).max()))
        centres.append(places.mean(axis=0)[None])
        fans.append(np.column_stack([rim[:, 1], rim[:, 0], np.full(len(rim), len(vertices) + k)]))
    return np.concatenate(centres), np.concatenate(fans), len(rims), widest


def _areas(vertices: FloatArray, triangles: IndexArray) -> FloatArray:
    """Return the area of each triangle [m²], shape (m,)."""
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))
