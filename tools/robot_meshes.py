"""Write the meshes of the scenes `finger_cable`, `finger_pneumatic` and `diamond`: `python -m tools.robot_meshes`.

The cells are hexahedra, in GiD's text format, in millimetres. The sizes are our own, except reach,
height and pull points of the diamond: those of the example of SOFA's plugin SoftRobots [Duriez2013].
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from tripod_host.arrays import Array, FloatArray

SCENES = Path(__file__).parents[1] / "tripod_sim/scenes"

CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
"""Of a hexahedron, in the order of GiD and VTK."""

Cells = tuple[FloatArray, Array]
"""Points [mm], shape (n, 3), and the nodes of the hexahedra, shape (m, 8)."""


def lattice(points: FloatArray, filled: Array) -> Cells:
    """Return the filled cells of a lattice: points, shape (a + 1, b + 1, c + 1, 3), filled, shape (a, b, c)."""
    node = np.arange(points[..., 0].size).reshape(points.shape[:3])
    a, b, c = filled.shape
    cells = np.stack([node[i : i + a, j : j + b, k : k + c] for i, j, k in CORNERS], axis=-1)[filled]
    return points.reshape(-1, 3), cells


def joined(parts: list[Cells]) -> Cells:
    """Return parts as one mesh: points at one place become one, those of no cell are left out."""
    offsets = np.cumsum([0, *(len(points) for points, _ in parts)])
    points = np.concatenate([points for points, _ in parts])
    cells = np.concatenate([cells + start for (_, cells), start in zip(parts, offsets, strict=False)])
    used, cells = np.unique(cells, return_inverse=True)
    places, first, back = np.unique(np.round(points[used], 4), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), int)
    rank[order] = np.arange(len(order))
    return places[order] + 0.0, rank[back.ravel()][cells.reshape(-1, 8)]


def grid(steps: list[list[float]], filled: Callable[..., Array], start: tuple[float, ...]) -> Cells:
    """Return a block of cells with these edges along x, y, z [mm]; `filled` takes the numbers i, j, k of cells."""
    lines = [np.concatenate([[0.0], np.cumsum(edges)]) + s for edges, s in zip(steps, start, strict=True)]
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    return joined([lattice(points, filled(*np.indices([len(edges) for edges in steps])))])


def finger_cable() -> Cells:
    """Return a finger of 100 x 20 x 16 mm along x with four notches of 8 mm depth in its lower side."""
    x, notch = [8.0, 8.0], 4.0
    for _ in range(4):
        x += [notch, 8.5, 8.5]
    i_notch = np.arange(2, len(x), 3)
    return grid(
        [x, [5.0] * 4, [4.0] * 4],
        lambda i, _, k: ~(np.isin(i, i_notch) & (k < 2)),
        (0.0, -10.0, 0.0),
    )


def finger_pneumatic() -> Cells:
    """Return a finger of 92 x 20 x 17 mm along x: six chambers side by side, joined by a channel over the floor."""
    x = list[float]()
    for _ in range(6):
        x += [2.0, 4.5, 4.5, 2.0, 2.4]
    x[-1:] = [2.0]  # the tip closes the last chamber
    last = len(x) - 1

    def filled(i: Array, j: Array, k: Array) -> Array:
        place = np.where(i == last, 3, i % 5)
        inside = np.isin(place, (1, 2)) & (j > 0) & (j < 4) & (k > 1) & (k < 5)
        channel = (j == 2) & (k == 2) & (i > 0) & (i < last - 1)
        return ~(inside | channel | ((place == 4) & (k > 3)))

    return grid([x, [2.0, 6.0, 4.0, 6.0, 2.0], [1.0, 1.0, 3.0, 2.0, 8.0, 2.0]], filled, (0.0, -10.0, 0.0))


def diamond() -> Cells:
    """Return four curved legs between a foot and a head: elbows 97 mm from the axis, the top 125 mm high."""
    half, thick, elbow, top = 12.0, 24.0, 97.0, 125.0
    across, over = np.linspace(-half, half, 3), np.linspace(-thick / 2, thick / 2, 3)
    far = (4 * elbow - half) / 3
    ends = np.array([[half, thick / 2], [far, thick / 2], [far, top - thick / 2], [half, top - thick / 2]])
    t = np.linspace(0.0, 1.0, 17)[:, None]
    bends = [
        (1 - t) ** 3,
        3 * t * (1 - t) ** 2,
        3 * t**2 * (1 - t),
        t**3,
    ]  # a cubic Bézier curve in the plane r, z
    path = np.sum([b * end for b, end in zip(bends, ends, strict=True)], axis=0)
    lean = np.gradient(path, axis=0)
    lean[0], lean[-1] = (1, 0), (-1, 0)
    lean /= np.linalg.norm(lean, axis=1)[:, None]
    normal = np.stack([-lean[:, 1], lean[:, 0]], axis=1)
    rz = path[:, None, :] + over[None, :, None] * normal[:, None, :]  # (sections, 3, 2)
    leg = np.empty((len(path), 3, 3, 3))
    leg[..., 0], leg[..., 2] = rz[:, None, :, 0], rz[:, None, :, 1]
    leg[..., 1] = across[None, :, None]
    parts = list[Cells]()
    for cos, sin in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        turned = leg.copy()
        turned[..., 0], turned[..., 1] = (
            cos * leg[..., 0] - sin * leg[..., 1],
            sin * leg[..., 0] + cos * leg[..., 1],
        )
        parts.append(lattice(turned, np.ones((len(path) - 1, 2, 2), bool)))
    for low in (0.0, top - thick):
        block = np.stack(np.meshgrid(across, across, low + over + thick / 2, indexing="ij"), axis=-1)
        parts.append(lattice(block, np.ones((2, 2, 2), bool)))
    return joined(parts)


def text(cells: Cells) -> str:
    """Return a mesh as GiD's text."""
    points, nodes = cells
    lines = [
        "# by python -m tools.robot_meshes",
        'MESH "robot" dimension 3 ElemType Hexahedra Nnode 8',
        "Coordinates",
    ]
    lines += [f"{n} {x:.6g} {y:.6g} {z:.6g}" for n, (x, y, z) in enumerate(points.tolist(), 1)]
    lines += ["End Coordinates", "Elements"]
    lines += [" ".join(map(str, (n, *cell))) for n, cell in enumerate((nodes + 1).tolist(), 1)]
    return "\n".join([*lines, "End Elements", ""])


MESHES = {"finger_cable": finger_cable, "finger_pneumatic": finger_pneumatic, "diamond": diamond}


def main() -> None:
    """Write all meshes beside the scenes."""
    for name, mesh in MESHES.items():
        (SCENES / f"{name}.gidmsh").write_text(text(mesh()), encoding="ascii")


if __name__ == "__main__":
    main()
