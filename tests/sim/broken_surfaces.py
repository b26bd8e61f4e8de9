"""Thirty STL files of parts as they come: sound ones, and broken in many ways; each fits into 40 mm."""

import struct
from pathlib import Path

import numpy as np

Triangles = np.ndarray
"""Corners [mm], shape (m, 3, 3)."""


def box(
    size: tuple[float, float, float] = (30, 20, 10), at: tuple[float, float, float] = (0, 0, 0)
) -> Triangles:
    """Return twelve triangles that face outwards."""
    corner = (
        np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * np.array(size, dtype=float)
        + at
    )
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corner[[three for a, b, c, d in faces for three in ((a, b, c), (a, c, d))]]


def ball(radius: float = 10, level: int = 2, at: tuple[float, float, float] = (0, 0, 0)) -> Triangles:
    """Return an octahedron divided `level` times, its vertices on a sphere."""
    x = np.array(
        [[[a, 0, 0], [0, b, 0], [0, 0, c]][:: a * b * c] for a in (1, -1) for b in (1, -1) for c in (1, -1)]
    )
    x = x.astype(float)
    for _ in range(level):
        a, b, c = np.moveaxis(x, 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        x = np.concatenate(
            [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return radius * x / np.linalg.norm(x, axis=2, keepdims=True) + at


def tube(outer: float = 10, inner: float = 8, height: float = 30, count: int = 24) -> Triangles:
    """Return a tube along z."""
    angle = 2 * np.pi * np.arange(count) / count
    ring = [
        np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(count, z)])
        for r, z in ((outer, 0.0), (outer, height), (inner, height), (inner, 0.0))
    ]
    found = []
    for k in range(4):
        a, b = ring[k], ring[(k + 1) % 4]
        c, d = np.roll(a, -1, axis=0), np.roll(b, -1, axis=0)
        found += [np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)]
    return np.concatenate(found)


def turned(x: Triangles, which: np.ndarray | slice) -> Triangles:
    """Return triangles, some of them turned over."""
    found = x.copy()
    found[which] = found[which][:, ::-1]
    return found


def moebius(count: int = 40) -> Triangles:
    """Return a band with one side."""
    t = 2 * np.pi * np.arange(count + 1) / count
    edge = [
        np.column_stack(
            [(12 + w * np.cos(t / 2)) * np.cos(t), (12 + w * np.cos(t / 2)) * np.sin(t), w * np.sin(t / 2)]
        )
        for w in (-4, 4)
    ]
    a, b, c, d = edge[0][:-1], edge[1][:-1], edge[0][1:], edge[1][1:]
    return np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])


def moved(x: Triangles, distance: float) -> Triangles:
    """Return triangles that do not quite meet: each is moved by itself."""
    return x + np.random.default_rng(1).uniform(-distance, distance, (len(x), 1, 3))


def surfaces() -> dict[str, Triangles]:
    """Return thirty surfaces by name."""
    brick, sphere = box(), ball()
    nan = brick.copy()
    nan[3, 1, 2] = np.nan
    wall = np.array([[[15, 0, 0], [15, 20, 0], [15, 20, 10]], [[15, 0, 0], [15, 20, 10], [15, 0, 10]]])
    return {
        "box": brick,
        "ball": sphere,
        "tube": tube(),
        "inward": turned(brick, slice(None)),
        "one_turned": turned(sphere, np.array([17])),
        "half_turned": turned(sphere, slice(0, len(sphere) // 2)),
        "one_missing": np.delete(sphere, 40, axis=0),
        "five_missing": np.delete(sphere, [3, 30, 60, 90, 120], axis=0),
        "no_lid": brick[2:],
        "half_ball": sphere[sphere[:, :, 2].min(axis=1) >= 0],
        "open_tube": tube()[: 2 * 24],
        "sheet": brick[:2],
        "doubled": np.concatenate([brick, brick]),
        "doubled_inward": np.concatenate([brick, turned(brick, slice(None))]),
        "flat_triangles": np.concatenate([brick, np.repeat(brick[:1, :1], 3, axis=1)]),
        "needle": np.concatenate([brick, np.stack([brick[:1, 0], brick[:1, 1], (brick[:1, 0] + brick[:1, 1]) / 2], 1)]),
        "cracked": moved(sphere, 0.02),
        "torn": moved(sphere, 1.5),
        "crossing": np.concatenate([box(), box((10, 40, 4), (10, -10, 3))]),
        "crossing_balls": np.concatenate([ball(), ball(8, at=(9, 0, 0))]),
        "two_parts": np.concatenate([ball(8), ball(8, at=(20, 0, 0))]),
        "touching": np.concatenate([box((10, 10, 10)), box((10, 10, 10), (10, 0, 0))]),
        "hollow": np.concatenate([ball(12), turned(ball(8), slice(None))]),
        "hollow_wrong": np.concatenate([ball(12), ball(8)]),
        "thin_wall": tube(10, 9.5),
        "thin_sheet": box((30, 20, 0.2)),
        "inner_wall": np.concatenate([brick, wall]),
        "one_sided": moebius(),
        "not_finite": nan,
        "empty": np.zeros((0, 3, 3)),
    }  # fmt: skip


def write_stl(path: Path, x: Triangles) -> Path:
    """Write triangles as a binary STL file."""
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *row, 0) for row in x.reshape(-1, 9).astype("<f4").tolist())
    path.write_bytes(bytes(80) + struct.pack("<I", len(x)) + body)
    return path


def write_obj(path: Path, x: Triangles) -> Path:
    """Write triangles as an OBJ file."""
    vertices, triangles = np.unique(x.reshape(-1, 3), axis=0, return_inverse=True)
    lines = ["v {} {} {}".format(*row) for row in vertices.tolist()]
    lines += ["f {} {} {}".format(*row) for row in (triangles.reshape(-1, 3) + 1).tolist()]
    path.write_text("\n".join([*lines, ""]))
    return path
