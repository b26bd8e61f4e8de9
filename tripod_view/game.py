"""The toy on the robot: the maze, which rides on the effector, and the ball."""

import numpy as np
import viser

from tripod_view.body import Surface
from tripod_view.picture import MazePicture
from tripod_view.place import place, send_pose
from tripod_view.pose import Pose

Rgb = tuple[int, int, int]

MAZE: Rgb = (196, 160, 116)
BALL: Rgb = (205, 45, 45)
BELT: Rgb = (250, 240, 225)
HOLE: Rgb = (30, 30, 36)
GOAL: Rgb = (30, 160, 70)
START: Rgb = (60, 120, 210)


COVER = 1.004
"""Times its radius as which a ball is drawn: it hides the facets of the rigid body that it may be."""


class Game:
    """Draws what it is told, from the thread of ROS only; without maze and ball it draws nothing."""

    def __init__(self, api: viser.SceneApi, effector: str) -> None:
        """`effector`: name of the frame to which the maze is fastened."""
        self._api, self._maze_name, self._marks_name = api, f"{effector}/maze", f"{effector}/marks"
        self._marks: list[viser.SceneNodeHandle] = []
        self._maze: viser.MeshHandle | None = None
        self._surface: Surface | None = None
        self._ball: viser.FrameHandle | None = None

    def set_maze(self, maze: Surface | None) -> None:
        """Show another maze, given in the effector's frame; None takes it away."""
        self._surface = maze
        if self._maze is not None:
            self._maze.remove()
            self._maze = None
        if maze is not None:
            self._maze = self._api.add_mesh_simple(
                self._maze_name,
                maze.nodes.astype(np.float32),
                maze.triangles,
                color=MAZE,
                flat_shading=True,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )

    def detach(self) -> None:
        """Take off the effector what is fastened to it, before it is removed; `attach` brings the maze back."""
        self.set_marks(None)
        surface = self._surface
        self.set_maze(None)
        self._surface = surface

    def attach(self, marks: MazePicture | None) -> None:
        """Fasten the maze to a new effector, with its marks."""
        self.set_maze(self._surface)
        self.set_marks(marks)

    def set_marks(self, maze: MazePicture | None) -> None:
        """Mark holes, goal and start of a maze; None takes the marks away."""
        for mark in reversed(self._marks):
            mark.remove()
        self._marks = []
        if maze is None:
            return
        discs = [(f"hole {i}", *hole, HOLE, "") for i, hole in enumerate(maze.holes.tolist())]
        radius = maze.goal[2] if maze.goal else 0.002
        if maze.goal:
            discs.append(("goal", *maze.goal, GOAL, "goal"))
        discs.append(("start", *maze.start, 0.6 * radius, START, ""))
        for name, x, y, size, colour, label in discs:
            place = (x, y, maze.height + 0.0002)
            path = f"{self._marks_name}/{name.replace(' ', '_')}"
            self._marks.append(
                self._api.add_cylinder(
                    path, size, 0.0003, colour, position=place, cast_shadow=False, receive_shadow=False
                )
            )
            if label:
                self._marks.append(
                    self._api.add_label(f"{path}/label", label, position=(0, 0, 0.006), font_screen_scale=0.8)
                )

    def set_ball(self, radius: float | None) -> None:
        """Show a ball of `radius` [m] from its next pose on, with a belt that shows it roll; None takes it away."""
        if self._ball is not None:
            self._ball.remove()
            self._ball = None
        if radius is not None:
            self._ball = self._api.add_frame("/ball", show_axes=False, visible=False)
            send_pose(self._ball)
            covers = COVER * radius
            self._api.add_icosphere("/ball/sphere", covers, BALL, cast_shadow=False, receive_shadow=False)
            self._api.add_cylinder(
                "/ball/belt", 1.005 * covers, 0.2 * radius, BELT, cast_shadow=False, receive_shadow=False
            )

    def place_ball(self, pose: Pose) -> None:
        """Put the ball at `pose`."""
        if self._ball is not None:
            place(self._ball, pose)
            self._ball.visible = True
