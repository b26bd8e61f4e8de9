"""The plate on the effector disc: mass points that turn with it, and where it goes in a step."""

from dataclasses import dataclass, replace

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.constraints.groups import Groups
from tripod_sim.maze.board import Board, make_board, mass_points
from tripod_sim.tables.maze import Maze


@dataclass(frozen=True, eq=False)
class Plate:
    """A board fastened to rigid body 0.

    Attributes:
        board: What is on it.
        offset: Height of the floor's top above the disc's centre [m].
        nodes: Of the mass points and of their mirror images in the disc's centre, shape (12,).
        mass: Of these nodes [kg], shape (12,); the images have none.
    """

    board: Board
    offset: float
    nodes: IndexArray
    mass: FloatArray


def fasten(rest: FloatArray, groups: Groups, maze: Maze, radius: float) -> tuple[FloatArray, Groups, Plate]:
    """Return nodes, groups and plate with a maze fastened to rigid body 0.

    The plate's mass points join the nodes of the disc; with each goes an image without mass on the other side of the
    disc's centre, so that the mean of the body's nodes, its centre, stays where it was.

    Args:
        rest: Undeformed positions [m], shape (n, 3).
        groups: With the disc as rigid body 0.
        maze: The maze.
        radius: Of the ball [m]; 0 if there is none.

    Raises:
        SceneError: the maze cannot be built.
    """
    board = make_board(maze, radius)
    disc = groups.rigid[0]
    points, masses = mass_points(maze, board)
    arms = points + np.array([0.0, 0.0, maze.offset])
    centre = rest[disc].mean(axis=0)
    nodes = len(rest) + np.arange(12)
    rest = np.concatenate([rest, centre + arms, centre - arms])
    groups = replace(groups, size=len(rest), rigid=(np.concatenate([disc, nodes]), *groups.rigid[1:]))
    return rest, groups, Plate(board, maze.offset, nodes, np.concatenate([masses, np.zeros(6)]))
