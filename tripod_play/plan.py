"""The way through a maze: cells to the goal, and the straight stretches that the ball is led along."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_play.errors import PlayError
from tripod_sim.maze.grid import Cell, MazeGrid


def shortest_way(grid: MazeGrid, start: Cell) -> list[Cell]:
    """Return the cells from `start` to the goal, both included, by the fewest steps and past no hole.

    Raises:
        PlayError: the goal cannot be reached from there.
    """
    steps = grid.distances(grid.goal)
    if start not in steps:
        raise PlayError(f"the goal cannot be reached from cell (row {start[0] + 1}, column {start[1] + 1})")
    way = [start]
    while way[-1] != grid.goal:
        way.append(min((c for c in grid.neighbours(way[-1]) if c in steps), key=lambda c: (steps[c], c)))
    return way


def corners(way: list[Cell]) -> list[Cell]:
    """Return the cells of a way in which it turns, and its last one."""

    def turning() -> Iterator[Cell]:
        for before, here, after in zip(way, way[1:], way[2:], strict=False):
            if (here[0] - before[0], here[1] - before[1]) != (after[0] - here[0], after[1] - here[1]):
                yield here

    return [*turning(), way[-1]]


@dataclass(frozen=True, eq=False)
class Stretch:
    """A straight part of the way.

    Attributes:
        begin, end: x, y [m], shape (2,).
        direction: Unit vector from begin to end; zero in the goal.
        last: Whether it ends in the goal.
        by_hole: Whether a hole opens beside it or beyond its end.
    """

    begin: FloatArray
    end: FloatArray
    direction: FloatArray
    last: bool
    by_hole: bool = False


class PlannerThread:
    """Knows from every cell where to roll next; it has no memory, so a ball that strays is led from where it is."""

    def __init__(self, grid: MazeGrid, pitch: float) -> None:
        """`pitch`: of the cells [m]."""
        self.grid, self.pitch = grid, pitch
        self._stretches = {cell: self._from(cell) for cell in grid.distances(grid.goal)}
        for cell in grid.holes:  # on the brink: back to where it came from
            solid = [c for c in grid.neighbours(cell) if c in self._stretches]
            if solid:
                begin, end = self._middle(cell), self._middle(solid[0])
                self._stretches[cell] = Stretch(begin, end, (end - begin) / pitch, last=False)

    def cell(self, position: FloatArray) -> Cell:
        """Return the cell of a ball at `position` [m], shape (2,)."""
        return self.grid.cell_at(float(position[0]), float(position[1]), self.pitch)

    def stretch(self, position: FloatArray) -> Stretch:
        """Return the stretch from the cell of a ball at `position` [m], shape (2,).

        Raises:
            PlayError: the goal cannot be reached from there.
        """
        cell = self.cell(position)
        if cell not in self._stretches:
            raise PlayError(f"the goal cannot be reached from cell (row {cell[0] + 1}, column {cell[1] + 1})")
        return self._stretches[cell]

    def _from(self, cell: Cell) -> Stretch:
        way = shortest_way(self.grid, cell)
        turn = corners(way)[0]
        begin, end = self._middle(cell), self._middle(turn)
        length = float(np.hypot(*(end - begin)))
        direction = (end - begin) / length if length else end - begin
        beside = {c for passed in way[: way.index(turn) + 1] for c in self.grid.neighbours(passed)}
        return Stretch(begin, end, direction, turn == self.grid.goal, not beside.isdisjoint(self.grid.holes))

    def _middle(self, cell: Cell) -> FloatArray:
        return np.array(self.grid.centre(cell, self.pitch))
