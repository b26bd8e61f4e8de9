"""The toy on the robot: the maze, which rides on the effector, and the ball."""

import numpy as np

from tripod_view.body import Surface
from tripod_view.drawing import Drawing, Node, Rgb
from tripod_view.picture import MazePicture
from tripod_view.player.shapes import ball, disc
from tripod_view.pose import Pose

MAZE: Rgb = (196, 160, 116)
BALL: tuple[Rgb, Rgb] = ((205, 45, 45), (250, 240, 225))
"""Of the two halves, by which one sees it roll."""
HOLE: Rgb = (30, 30, 36)
GOAL: Rgb = (30, 160, 70)
START: Rgb = (60, 120, 210)


COVER = 1.004
"""Times its radius as which a ball is drawn: it hides the facets of the rigid body that it may be."""


class Game:
    """Draws what it is told, from the thread of ROS only; without maze and ball it draws nothing."""

    def __init__(self, drawing: Drawing, effector: str) -> None:
        """`effector`: path of the node to which the maze is fastened."""
        self._drawing, self._maze_path, self._marks_path = drawing, f"{effector}/maze", f"{effector}/marks"
        self._marks: Node | None = None
        self._maze: Node | None = None
        self._surface: Surface | None = None
        self._ball: Node | None = None

    def set_maze(self, maze: Surface | None) -> None:
        """Show another maze, given in the effector's frame; None takes it away."""
        self._surface = maze
        if self._maze is not None:
            self._maze.remove()
            self._maze = None
        if maze is not None:
            self._maze = self._drawing.mesh(self._maze_path, maze.nodes, maze.triangles, MAZE)

    def attach(self, marks: MazePicture | None) -> None:
        """Fasten the maze to a new effector, with its marks."""
        self.set_maze(self._surface)
        self.set_marks(marks)

    def set_marks(self, maze: MazePicture | None) -> None:
        """Mark holes, goal and start of a maze; None takes the marks away."""
        if self._marks is not None:
            self._marks.remove()
            self._marks = None
        if maze is None:
            return
        self._marks = self._drawing.add(self._marks_path, "group", axes=0.0)
        discs = [(f"hole {i}", *hole, HOLE, "") for i, hole in enumerate(maze.holes.tolist())]
        radius = maze.goal[2] if maze.goal else 0.002
        if maze.goal:
            discs.append(("goal", *maze.goal, GOAL, "goal"))
        discs.append(("start", *maze.start, 0.6 * radius, START, ""))
        for name, x, y, size, colour, label in discs:
            path = f"{self._marks_path}/{name.replace(' ', '_')}"
            self._drawing.mesh(path, *disc(size, 0.0003), colour, _at(x, y, maze.height + 0.0002))
            if label:
                self._drawing.add(f"{path}/label", "label", _at(0, 0, 0.006), text=label)

    def set_ball(self, radius: float | None) -> None:
        """Show a ball of `radius` [m] from its next pose on; None takes it away."""
        if self._ball is not None:
            self._ball.remove()
            self._ball = None
        if radius is not None:
            self._ball = self._drawing.add("/ball", "group", axes=0.0)
            self._ball.visible = False
            for i, (shape, colour) in enumerate(zip(ball(COVER * radius), BALL, strict=True)):
                self._drawing.mesh(f"/ball/{i}", *shape, colour, through=True, name="ball")

    def place_ball(self, pose: Pose) -> None:
        """Put the ball at `pose`."""
        if self._ball is not None:
            self._ball.place(pose)
            self._ball.visible = True


def _at(x: float, y: float, z: float) -> Pose:
    return Pose(np.array([x, y, z], dtype=float), np.array([0.0, 0.0, 0.0, 1.0]))
