"""The plate with walls: from a maze to boxes, holes and mass."""

from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_host.reading import read_file
from tripod_sim.ball.obstacles import Obstacles, sorted_obstacles
from tripod_sim.errors import SceneError, shown
from tripod_sim.maze.grid import MazeGrid, parse_maze, random_maze
from tripod_sim.tables.maze import Maze

GOAL = 0.35
"""Radius of the goal over the pitch."""

RANDOM_SIZE = 7
"""Rows and columns of a random maze that names none."""

MOST_BYTES = 1_000_000
"""Of a text file."""


@dataclass(frozen=True, eq=False)
class Board:
    """A maze as a plate, in a frame whose origin is above the disc's centre, on the top of the floor.

    Attributes:
        obstacles: Floor, walls and holes, or the triangles of a surface.
        start: Where the ball stands at the start: x, y [m].
        goal: Centre x, y and radius of the goal [m]; a radius of 0 is no goal.
        grid: The cells; None for a surface.
        pitch: Of the cells [m].
        notes: What users should know of it.
    """

    obstacles: Obstacles
    start: tuple[float, float]
    goal: tuple[float, float, float]
    grid: MazeGrid | None
    pitch: float
    notes: tuple[str, ...] = ()


def maze_names() -> list[str]:
    """Return the names of the shipped mazes."""
    folder = resources.files("tripod_sim") / "maze" / "mazes"
    return sorted(f.name.removesuffix(".txt") for f in folder.iterdir() if f.name.endswith(".txt"))


def read_maze(source: str) -> MazeGrid:
    """Return a maze by name, from a text file, or a random one (see `scene.Maze`). Raises SceneError."""
    if source.startswith("random:"):
        return _random(source)
    if source.endswith(".txt"):
        path = Path(source)
        try:
            text = read_file(path, MOST_BYTES).decode("utf-8-sig")
        except OSError as error:
            raise SceneError(f"maze.source {shown(source)} cannot be read: {error.strerror}") from None
        except UnicodeDecodeError:
            raise SceneError(
                f"maze.source {shown(source)} is not a text file; a drawing is a .txt file, a surface an .stl "
                "file"
            ) from None
        return parse_maze(text, f"maze {path.name!r}")
    if source not in maze_names():
        raise SceneError(
            f"maze.source is {shown(source)}; allowed: {', '.join(maze_names())}, random:SEED, "
            "random:SEED:COLUMNSxROWS, or the path of a .txt or .stl file"
        )
    text = (resources.files("tripod_sim") / "maze" / "mazes" / f"{source}.txt").read_text(encoding="utf-8")
    return parse_maze(text, f"maze {source!r}")


def _random(source: str) -> MazeGrid:
    _, seed, *rest = source.split(":")
    columns, cross, rows = rest[0].partition("x") if rest else (str(RANDOM_SIZE), "x", str(RANDOM_SIZE))
    words = (seed, columns, rows)
    if not (cross and len(rest) <= 1 and all(w.isascii() and w.isdigit() and len(w) < 10 for w in words)):
        raise SceneError(
            f"maze.source is {shown(source)}; a random maze is random:SEED or random:SEED:COLUMNSxROWS"
        )
    return random_maze(int(seed), int(rows), int(columns))


def make_board(maze: Maze, radius: float) -> Board:
    """Return the board of a maze for a ball of `radius` [m]; 0 if there is none. Raises SceneError."""
    if maze.source.endswith(".stl"):
        return _surface_board(maze, radius)
    grid = read_maze(maze.source)
    free = maze.pitch - maze.wall
    if not free > max(2 * radius, 0):
        raise SceneError(
            f"maze.pitch {maze.pitch} m minus maze.wall {maze.wall} m leaves corridors {free:.4g} m wide, "
            f"but the ball is {2 * radius:.4g} m wide; set a larger pitch or a smaller ball.radius"
        )
    if grid.holes and not radius < maze.hole_radius < 0.5 * free:
        raise SceneError(
            f"maze.hole_radius is {maze.hole_radius} m; it must be between the ball's radius {radius} m and half the "
            f"width of the corridors, {0.5 * free:.4g} m"
        )
    half = 0.5 * maze.pitch * np.array([grid.columns, grid.rows]) + 0.5 * maze.wall
    floor = [0.0, 0.0, -0.5 * maze.thickness, *half, 0.5 * maze.thickness]
    boxes = np.array([floor, *_walls(grid, maze)])
    holes = np.array([[*grid.centre(c, maze.pitch), maze.hole_radius] for c in sorted(grid.holes)])
    extent = np.array([*-half, *half, -maze.thickness])
    obstacles = sorted_obstacles(boxes, np.zeros((0, 9)), holes, extent, maze.pitch)
    x, y = grid.centre(grid.goal, maze.pitch)
    return Board(obstacles, grid.centre(grid.start, maze.pitch), (x, y, GOAL * maze.pitch), grid, maze.pitch)


def _walls(grid: MazeGrid, maze: Maze) -> list[list[float]]:
    """Return centre and half extents of each straight wall; walls that meet overlap in the post."""
    found = []
    thick, z, p = 0.5 * maze.wall, 0.5 * maze.height, maze.pitch
    x0, y0 = -0.5 * grid.columns * p, 0.5 * grid.rows * p
    for r, row in enumerate(grid.above):
        for first, last in _runs(row):
            middle, half = x0 + 0.5 * (first + last) * p, 0.5 * (last - first) * p + thick
            found.append([middle, y0 - r * p, z, half, thick, z])
    for c, column in enumerate(grid.left.T):
        for first, last in _runs(column):
            middle, half = y0 - 0.5 * (first + last) * p, 0.5 * (last - first) * p + thick
            found.append([x0 + c * p, middle, z, thick, half, z])
    return found


def _runs(walls: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the posts at which unbroken walls begin and end."""
    change = np.flatnonzero(np.diff(np.concatenate([[False], walls, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in change.reshape(-1, 2)]


def _surface_board(maze: Maze, radius: float) -> Board:
    from tripod_sim.mesh.read_surface import read_surface  # noqa: PLC0415 - only for a maze that is a surface

    surface = read_surface(Path(maze.source), maze.scale, "maze.source")
    name = Path(maze.source).name
    corners = surface.vertices[surface.triangles].reshape(-1, 9)
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    for what, place in (("start", maze.start), ("goal", maze.goal[:2])):
        if not ((low[:2] < place) & (place < high[:2])).all():
            raise SceneError(
                f"maze.{what} is {list(place)} m; the surface of {name!r} covers {low[:2].tolist()} to "
                f"{high[:2].tolist()} m (maze.scale is {maze.scale} m)"
            )
    extent = np.array([*low[:2], *high[:2], low[2]])
    cell = max(4 * radius, float(np.ptp(surface.vertices[:, :2], axis=0).max()) / 50)
    notes: tuple[str, ...] = ()
    if not surface.watertight:
        notes = (f"the surface of maze {name!r} is open (not watertight): both its sides stop the ball",)
    return Board(
        sorted_obstacles(np.zeros((0, 6)), corners, np.zeros((0, 3)), extent, cell),
        maze.start,
        maze.goal,
        None,
        0.0,
        notes,
    )


def mass_points(maze: Maze, board: Board) -> tuple[FloatArray, FloatArray]:
    """Return six points (6, 3), in the plate's frame, and their mass [kg] that move as the plate does.

    A flat box with the floor's extents: same mass, centre and moments of inertia as equal masses at
    c +- e_k sqrt(3 s_k), s_k = (side k)² / 12.
    """
    low_x, low_y, high_x, high_y, bottom = board.obstacles.extent
    sides = np.array([high_x - low_x, high_y - low_y, maze.thickness])
    centre = np.array([0.5 * (low_x + high_x), 0.5 * (low_y + high_y), max(-0.5 * maze.thickness, bottom)])
    arms = np.diag(np.sqrt(3 * sides**2 / 12))
    points = np.concatenate([centre + arms, centre - arms])
    return points, np.full(6, maze.mass / 6)
