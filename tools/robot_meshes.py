"""Write the meshes of the scenes with cables and air: `python -m tools.robot_meshes`.

The cells are hexahedra, in GiD's text format, in millimetres. The sizes of the fingers are our own. Those of the
diamond and the trunk are measured on the examples Diamond and Trunk of SOFA's plugin SoftRobots [Duriez2013].
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


LEG = (
    ((14.0, -9.6), (14.0, -37.0), 14.0),
    ((36.0, -9.0), (43.0, -34.0), 14.0),
    ((57.0, 10.0), (74.0, -19.0), 13.0),
    ((66.0, 19.0), (80.5, -4.0), 12.0),
    ((75.0, 27.0), (86.0, 11.0), 11.4),
    ((82.0, 34.5), (91.5, 25.0), 10.9),
    ((87.5, 41.0), (95.0, 36.5), 10.4),
    ((89.5, 47.0), (97.0, 45.0), 10.0),
    ((88.3, 50.5), (94.8, 53.5), 10.2),
    ((84.5, 53.5), (88.5, 58.5), 10.6),
    ((77.0, 57.0), (81.0, 63.5), 11.0),
    ((66.0, 61.0), (72.5, 71.5), 11.7),
    ((56.0, 65.0), (64.0, 78.5), 12.5),
    ((46.0, 69.0), (55.0, 86.0), 13.2),
    ((38.0, 75.0), (45.0, 94.0), 13.8),
    ((31.5, 88.0), (36.0, 102.5), 14.0),
    ((25.0, 97.5), (29.0, 107.0), 14.0),
    ((17.0, 103.0), (19.5, 113.0), 14.0),
    ((14.0, 107.0), (14.0, 125.0), 14.0),
)
"""Sections of a leg of the diamond, from foot to head: inner and outer edge in the plane r, z, half the width [mm]."""


def diamond() -> Cells:
    """Return four bent legs between a foot and a head: elbows 97 mm from the axis, thin there and below the head."""
    edges, half = np.array([section[:2] for section in LEG]), np.array([section[2] for section in LEG])
    leg = np.empty((len(LEG), 2, 2, 3))
    leg[..., 0], leg[..., 2] = edges[:, None, ::-1, 0], edges[:, None, ::-1, 1]
    leg[..., 1] = half[:, None, None] * np.array([-1.0, 1.0])[None, :, None]
    one, parts = np.ones((1, 1, 1), bool), list[Cells]()
    for cos, sin in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        turned = leg.copy()
        turned[..., 0], turned[..., 1] = (
            cos * leg[..., 0] - sin * leg[..., 1],
            sin * leg[..., 0] + cos * leg[..., 1],
        )
        parts.append(lattice(turned, np.ones((len(LEG) - 1, 1, 1), bool)))
    for (low, high), width in ((sorted(edges[k, :, 1]), half[k]) for k in (0, -1)):
        x = np.array([-width, width])
        parts.append(lattice(np.stack(np.meshgrid(x, x, [low, high], indexing="ij"), axis=-1), one))
    return joined(parts)


def trunk() -> Cells:
    """Return eleven square discs on a core that tapers over 195 mm, of about the area of the circles in the example."""
    z = np.array([0.0, *(z + 17.5 * k for k in range(10) for z in (21.0, 27.0)), 195.0])
    core, disc = 4.3 - 2.0 * z / 195, 11.4 - 7.1 * z / 195
    lines = np.column_stack([-disc, -core, core, disc])  # (22, 4)
    points = np.empty((22, 4, 4, 3))
    points[..., 0], points[..., 1] = lines[:, :, None], lines[:, None, :]
    points[..., 2] = -z[:, None, None]
    filled = np.ones((21, 3, 3), bool)
    filled[1::2], filled[1::2, 1, 1] = False, True  # notches
    return joined([lattice(points[::-1].transpose(1, 2, 0, 3), filled[::-1].transpose(1, 2, 0))])


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


MESHES = {
    "finger_cable": finger_cable,
    "finger_pneumatic": finger_pneumatic,
    "diamond": diamond,
    "trunk": trunk,
}


def main() -> None:
    """Write all meshes beside the scenes."""
    for name, mesh in MESHES.items():
        (SCENES / f"{name}.gidmsh").write_text(text(mesh()), encoding="ascii")


if __name__ == "__main__":
    main()
