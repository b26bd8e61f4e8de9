"""The surface of a board against what can be said of it in closed form."""

from pathlib import Path

import numpy as np
import pytest

from tripod_sim.maze.board import make_board, maze_names
from tripod_sim.maze.board_mesh import SEGMENTS, BoardMesh, board_mesh
from tripod_sim.tables.maze import Maze

OFFSET = 0.008


def corners(mesh: BoardMesh) -> np.ndarray:
    return mesh.vertices[mesh.triangles]


def volume(mesh: BoardMesh) -> float:
    """Return the enclosed volume by the divergence theorem; it is positive only if the triangles face outward."""
    a, b, c = np.moveaxis(corners(mesh), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("name", [*maze_names(), "random:3:4x9"])
def test_it_encloses_floor_and_walls_without_the_holes(name: str) -> None:
    maze = Maze(name)
    board = make_board(maze, 0.002)
    mesh = board_mesh(board, OFFSET)
    o = board.obstacles
    polygon = 0.5 * SEGMENTS * np.sin(2 * np.pi / SEGMENTS)  # area of the polygon in a unit circle
    expected = 8 * o.boxes[:, 3:].prod(axis=1).sum() - maze.thickness * polygon * (o.holes[:, 2] ** 2).sum()
    assert volume(mesh) == pytest.approx(expected, rel=1e-9)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    assert [*low, *high] == pytest.approx(
        [*o.extent[:2], OFFSET - maze.thickness, *o.extent[2:4], OFFSET + maze.height]
    )
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)


def test_nothing_covers_a_hole_and_the_rest_of_the_floor_is_covered_once() -> None:
    board = make_board(Maze("holes"), 0.002)
    triangles = corners(board_mesh(board, OFFSET))
    top = triangles[(np.abs(triangles[:, :, 2] - OFFSET) < 1e-9).all(axis=1)]
    x0, y0, x1, y1, _ = board.obstacles.extent
    rng = np.random.default_rng(0)
    for point in rng.uniform((x0, y0), (x1, y1), (500, 2)):
        p = top[:, :, :2] - point
        areas = np.stack(
            [p[:, i, 0] * p[:, j, 1] - p[:, i, 1] * p[:, j, 0] for i, j in ((0, 1), (1, 2), (2, 0))], 1
        )
        distances = np.hypot(*(board.obstacles.holes[:, :2] - point).T) - board.obstacles.holes[:, 2]
        if distances.min() > 0:
            # the undersides of the walls lie on the floor too; they face down, their areas are negative
            assert (areas > 0).all(axis=1).sum() == 1
        elif distances.min() < -1e-5:  # the polygon is within the circle by r (1 - cos(pi / n)) = 6 um
            assert not (areas > 0).all(axis=1).any()


def test_an_stl_maze_shows_its_own_triangles(tmp_path: Path) -> None:
    (tmp_path / "tray.stl").write_text(
        "solid tray\n"
        + "".join(
            "facet normal 0 0 1\nouter loop\n"
            + "".join(f"vertex {x} {y} 0\n" for x, y in triangle)
            + "endloop\nendfacet\n"
            for triangle in (((-9, -9), (9, -9), (9, 9)), ((-9, -9), (9, 9), (-9, 9)))
        )
        + "endsolid tray\n"
    )
    board = make_board(Maze(str(tmp_path / "tray.stl")), 0.002)
    mesh = board_mesh(board, OFFSET)
    assert mesh.triangles.shape == (2, 3)
    assert mesh.vertices.shape == (4, 3)
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.018, 0.018, 0])
    assert mesh.vertices[:, 2] == pytest.approx(OFFSET)
