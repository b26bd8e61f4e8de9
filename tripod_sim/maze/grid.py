"""A maze as a grid of cells with walls between them, its text, and what can be asked of it.

    +---+---+---+
    | S     |   |
    +   +---+   +
    |         G |
    +---+---+---+

Posts `+`, walls `---` and `|`, openings of spaces; in the middle of a cell `S` the start, `G` the goal, `o` a hole.
Lines that begin with `#` are comments. Row 0 is the first line of cells; x grows with the columns, y against the rows.
"""

from collections import deque
from dataclasses import dataclass
from itertools import product

import numpy as np

from tripod_host.arrays import BoolArray
from tripod_sim.errors import SceneError, shown

Cell = tuple[int, int]

MOST_CELLS = 10_000
WIDTH = 4
"""Characters from one post to the next."""


@dataclass(frozen=True, eq=False)
class MazeGrid:
    """Cells, row by row, and the walls between them.

    Attributes:
        above: Whether there is a wall above cell (row, column), shape (rows + 1, columns); the last row closes below.
        left: Whether there is one to the left of it, shape (rows, columns + 1); the last column closes on the right.
        start, goal: Cells (row, column).
        holes: Cells with a hole in the middle.
    """

    above: BoolArray
    left: BoolArray
    start: Cell
    goal: Cell
    holes: frozenset[Cell] = frozenset()

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.left)

    @property
    def columns(self) -> int:
        """Number of columns."""
        return self.above.shape[1]

    def centre(self, cell: Cell, pitch: float) -> tuple[float, float]:
        """Return x and y of the middle of a cell [m]; the middle of the maze is the origin."""
        return (cell[1] - 0.5 * (self.columns - 1)) * pitch, (0.5 * (self.rows - 1) - cell[0]) * pitch

    def cell_at(self, x: float, y: float, pitch: float) -> Cell:
        """Return the cell at x, y [m], the nearest for a place outside."""
        column, row = round(x / pitch + 0.5 * (self.columns - 1)), round(0.5 * (self.rows - 1) - y / pitch)
        return min(max(row, 0), self.rows - 1), min(max(column, 0), self.columns - 1)

    def neighbours(self, cell: Cell) -> list[Cell]:
        """Return the cells next to a cell without a wall between."""
        r, c = cell
        found = []
        if not self.above[r, c]:
            found.append((r - 1, c))
        if not self.above[r + 1, c]:
            found.append((r + 1, c))
        if not self.left[r, c]:
            found.append((r, c - 1))
        if not self.left[r, c + 1]:
            found.append((r, c + 1))
        return found

    def distances(self, origin: Cell) -> dict[Cell, int]:
        """Return how many steps each cell that can be reached is from `origin`, without passing a hole."""
        steps, todo = {origin: 0}, deque([origin])
        while todo:
            cell = todo.popleft()
            for other in self.neighbours(cell):
                if other not in steps and other not in self.holes:
                    steps[other] = steps[cell] + 1
                    todo.append(other)
        return steps


def parse_maze(text: str, name: str) -> MazeGrid:
    """Return the maze that `text` draws, checked.

    Raises:
        SceneError: not such a drawing, not closed, no or two starts or goals, or a goal that cannot be reached; the
            message names line and column.
    """
    numbered = [(i + 1, line.rstrip()) for i, line in enumerate(text.splitlines())]
    lines = [(i, line) for i, line in numbered if line and not line.startswith("#")]
    if len(lines) < 3 or len(lines) % 2 == 0:
        raise SceneError(
            f"{name} has {len(lines)} lines of drawing; a maze of n rows of cells needs 2 n + 1, with "
            "posts in the first and last"
        )
    width = max(len(line) for _, line in lines)
    columns, rows = (width - 1) // WIDTH, len(lines) // 2
    if width % WIDTH != 1 or not 0 < rows * columns <= MOST_CELLS:
        raise SceneError(
            f"{name} is {width} characters wide and has {rows} rows; n columns need {WIDTH} n + 1 "
            f"characters; allowed: 1 to {MOST_CELLS} cells each way"
        )
    above, left = np.zeros((rows + 1, columns), dtype=bool), np.zeros((rows, columns + 1), dtype=bool)
    marks: dict[str, list[Cell]] = {"S": [], "G": [], "o": []}
    for k, (number, line) in enumerate(lines):
        padded = line.ljust(width)
        if k % 2 == 0:
            _read_walls(padded, f"{name}, line {number}", above[k // 2])
        else:
            _read_cells(padded, f"{name}, line {number}", k // 2, left[k // 2], marks)
    for letter, what in (("S", "start"), ("G", "goal")):
        if len(marks[letter]) != 1:
            raise SceneError(
                f"{name} has {len(marks[letter])} cells marked {letter} ({what}); it needs exactly one"
            )
    grid = MazeGrid(above, left, marks["S"][0], marks["G"][0], frozenset(marks["o"]))
    check_maze(grid, name)
    return grid


def _read_walls(line: str, where: str, above: BoolArray) -> None:
    for c in range(len(above) + 1):
        if line[WIDTH * c] != "+":
            raise SceneError(
                f"{where}, column {WIDTH * c + 1}: expected a post '+', found {shown(line[WIDTH * c])}"
            )
    for c in range(len(above)):
        wall = line[WIDTH * c + 1 : WIDTH * (c + 1)]
        if wall not in ("---", "   "):
            raise SceneError(
                f"{where}, column {WIDTH * c + 2}: expected a wall '---' or three spaces, found {shown(wall)}"
            )
        above[c] = wall == "---"


def _read_cells(line: str, where: str, row: int, left: BoolArray, marks: dict[str, list[Cell]]) -> None:
    for c in range(len(left)):
        letter = line[WIDTH * c]
        if letter not in "| ":
            raise SceneError(
                f"{where}, column {WIDTH * c + 1}: expected a wall '|' or a space, found {shown(letter)}"
            )
        left[c] = letter == "|"
    for c in range(len(left) - 1):
        inside = line[WIDTH * c + 1 : WIDTH * (c + 1)]
        mark = inside[1]
        if inside[0] + inside[2] != "  " or mark not in " SGo":
            raise SceneError(
                f"{where}, column {WIDTH * c + 2}: a cell holds ' ', 'S', 'G' or 'o' in its middle, found "
                f"{shown(inside)}"
            )
        if mark != " ":
            marks[mark].append((row, c))


def check_maze(grid: MazeGrid, name: str) -> None:
    """Refuse a maze that is not closed or whose goal cannot be reached. Raises SceneError."""
    gaps = [f"above column {c + 1} of row 1" for c in np.flatnonzero(~grid.above[0])]
    gaps += [f"below column {c + 1} of row {grid.rows}" for c in np.flatnonzero(~grid.above[-1])]
    gaps += [f"left of row {r + 1}" for r in np.flatnonzero(~grid.left[:, 0])]
    gaps += [f"right of row {r + 1}" for r in np.flatnonzero(~grid.left[:, -1])]
    if gaps:
        more = f" and {len(gaps) - 1} more" if len(gaps) > 1 else ""
        raise SceneError(f"{name} is not closed: an outer wall is missing {gaps[0]} of cells{more}; draw it")
    if grid.goal not in grid.distances(grid.start):
        around = " without passing a hole" if grid.holes else ""
        raise SceneError(
            f"{name}: no way leads from the start (row {grid.start[0] + 1}, column {grid.start[1] + 1}) "
            f"to the goal (row {grid.goal[0] + 1}, column {grid.goal[1] + 1}){around}; open a wall"
        )


def maze_to_text(grid: MazeGrid) -> str:
    """Return the drawing that `parse_maze` reads back equal."""
    marks = {grid.start: "S", grid.goal: "G", **dict.fromkeys(grid.holes, "o")}
    lines = []
    for r in range(grid.rows + 1):
        lines.append("+" + "".join(("---" if wall else "   ") + "+" for wall in grid.above[r]))
        if r < grid.rows:
            cells = [f" {marks.get((r, c), ' ')} " for c in range(grid.columns)]
            walls = ["|" if wall else " " for wall in grid.left[r]]
            lines.append("".join(a + b for a, b in zip(walls, [*cells, ""], strict=True)).rstrip())
    return "\n".join(lines) + "\n"


def random_maze(seed: int, rows: int, columns: int, holes: int = 0) -> MazeGrid:
    """Return a maze with exactly one way between any two cells, by randomised depth-first search.

    The start is the first cell, the goal the cell farthest from it; holes lie in other dead ends, as far as there are.

    Args:
        seed: Same seed, same maze.
        rows, columns: At least 1, at least 2 cells in all.
        holes: Wanted number of holes.

    Raises:
        SceneError: sizes out of range.
    """
    if rows < 1 or columns < 1 or not 2 <= rows * columns <= MOST_CELLS or holes < 0 or seed < 0:
        raise SceneError(
            f"a random maze of {columns} x {rows} cells, {holes} holes and seed {seed}: allowed: 2 to {MOST_CELLS} "
            "cells, holes and seed from 0"
        )
    rng = np.random.default_rng(seed)
    above, left = np.ones((rows + 1, columns), dtype=bool), np.ones((rows, columns + 1), dtype=bool)
    seen, stack = {(0, 0)}, [(0, 0)]
    while stack:
        r, c = stack[-1]
        options = [(r + dr, c + dc) for dr, dc in ((-1, 0), (1, 0), (0, -1), (0, 1))]
        options = [o for o in options if 0 <= o[0] < rows and 0 <= o[1] < columns and o not in seen]
        if not options:
            stack.pop()
            continue
        other = options[int(rng.integers(len(options)))]
        if other[0] != r:
            above[max(r, other[0]), c] = False
        else:
            left[r, max(c, other[1])] = False
        seen.add(other)
        stack.append(other)
    grid = MazeGrid(above, left, (0, 0), (0, 0))
    steps = grid.distances((0, 0))
    goal = max(steps, key=lambda cell: (steps[cell], cell))
    ends = [
        cell
        for cell in product(range(rows), range(columns))
        if len(grid.neighbours(cell)) == 1 and cell not in ((0, 0), goal)
    ]
    chosen = rng.permutation(len(ends))[:holes]
    return MazeGrid(above, left, (0, 0), goal, frozenset(ends[i] for i in chosen.tolist()))
