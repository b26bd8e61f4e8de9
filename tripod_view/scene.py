"""The 3-D part of the page, drawn from what the scene has. Metres, z up."""

from dataclasses import replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_view.arm import ArmGeometry, stands
from tripod_view.bodies import Bodies
from tripod_view.body import Surface
from tripod_view.drawing import Drawing
from tripod_view.forces import DrawnForces
from tripod_view.frame import frame, gone, staying, union, widened
from tripod_view.game import Game
from tripod_view.handle import Handle
from tripod_view.picture import Picture
from tripod_view.pose import Pose
from tripod_view.robot import Robot

UNKNOWN = Picture()
"""While no simulator has described its scene: the robot once it is heard, and what comes as a mesh."""

LEFT = 0.1
"""How far what moves may leave the picture before it is widened, as a share of the picture's radius."""


class Scene:
    """Draws what it is told; every method is called from the thread of ROS only.

    Attributes:
        game: Maze and ball.
        forces: On the bodies.
        lost: How many bodies are so far from the others that they are left out of sight.
    """

    def __init__(self, drawing: Drawing, geometry: ArmGeometry, box: tuple[FloatArray, FloatArray]) -> None:
        """`geometry`: of the robot while no simulator has told its own; `box`: corners for the target [m]."""
        self._drawing, self._default = drawing, geometry
        self._bodies = Bodies(drawing)
        self.picture = UNKNOWN
        self._surface: Surface | None = None
        self._nodes: FloatArray | None = None
        self._span: FloatArray | None = None
        self._first = self._now = np.zeros((2, 3))
        self.lost = 0
        self._robot, self._robot_heard = Robot(drawing, geometry, ()), 0
        self._own_box, self._handle = box, Handle(drawing, box)
        self.forces = DrawnForces(drawing)
        self.game = Game(drawing, "/effector")
        self.fit()

    @property
    def has_target(self) -> bool:
        """Whether the scene has an effector that can be sent somewhere."""
        return self.has_joints and (self.picture is UNKNOWN or bool(self.picture.effector))

    @property
    def has_joints(self) -> bool:
        """Whether there is something to command: in the scene or, while that is not known, at all."""
        return self._robot_heard > 0 if self.picture is UNKNOWN else bool(self.picture.joints)

    @property
    def target_box(self) -> tuple[FloatArray, FloatArray]:
        """Corners within which the target can be dragged [m]: as configured for servos, else half a body around it."""
        if self.picture is UNKNOWN or self.picture.servos or self._surface is None:
            return self._own_box
        low, high = self._surface.nodes.min(axis=0), self._surface.nodes.max(axis=0)
        room = 0.5 * (high - low).max()
        return low - room, high + room

    @property
    def gone(self) -> float:
        """How far the bodies have come [m], where that is too far to be looked at; else 0."""
        if self._nodes is None:
            return 0.0
        return gone(self._first, self._now)

    def find_robot(self, servos: int) -> bool:
        """Draw a robot with so many servos evenly about Z, since there is one, unless a simulator has told what there
        is; return whether that is new.
        """
        if self._robot_heard == servos or self.picture is not UNKNOWN:
            return False
        self._robot_heard = servos
        self._robot.remove()
        self._robot = Robot(self._drawing, self._default, stands(servos, self._default))
        return True

    def set_picture(self, picture: Picture) -> None:
        """Draw another scene, or the same with other things in it."""
        same, self.picture = picture.key == self.picture.key, picture
        if same:
            return
        self._robot.remove()
        geometry = self._default
        if picture.effector:
            geometry = replace(geometry, effector_radius=picture.effector)
        self._robot = Robot(
            self._drawing, geometry, picture.servos.arms if picture.servos else (), has_disc=picture.disc
        )
        self.game.attach(picture.maze)
        self._bodies.set_still(picture)
        if self._surface is not None:
            self._set_surface(self._surface)
        self._handle.set_box(self.target_box)
        if not self.has_target:
            self._handle.hide()
        self.fit()

    def set_surface(self, surface: Surface) -> None:
        """Show another mesh, undeformed."""
        self._set_surface(surface)
        self.fit()

    def _set_surface(self, surface: Surface) -> None:
        self._surface, self._nodes, self.lost = surface, None, 0
        self._bodies.set_surface(surface, self.picture.parts, self.picture.cables)
        self._first = union(self._bodies.boxes(surface.nodes))
        self._handle.set_box(self.target_box)

    def set_nodes(self, positions: FloatArray) -> None:
        """Move the nodes of the mesh to `positions` [m], shape (n, 3)."""
        self._bodies.set_nodes(positions)
        if not len(positions):
            return
        self._nodes = positions
        self._now = box = self._box(positions)
        seen, room = self._seen, LEFT * self._seen.radius
        if (box[0] < seen.low - room).any() or (box[1] > seen.high + room).any():
            self._widen(box)

    def set_field(self, name: str, values: FloatArray | None) -> None:
        """Tell a field at the nodes of the mesh, shape (n,); None: not any more."""
        self._bodies.set_field(name, values)

    def set_slack(self, names: frozenset[str]) -> None:
        """Show which cables are slack, by their names."""
        self._bodies.set_slack(names)

    def set_joints(self, angles: FloatArray, slide: float) -> None:
        """Put the arms at `angles` [rad], shape (servos,), and the servo bodies at `slide` [m]."""
        self._robot.set_joints(angles, slide)

    def set_effector(self, pose: Pose) -> None:
        """Put the effector's disc and frame at `pose`."""
        self._robot.set_effector(pose)

    def set_target(self, pose: Pose, *, dragging: bool) -> None:
        """Put the target at `pose`; see `Handle.set`."""
        if self.has_target:
            self._handle.set(pose, dragging=dragging)

    def let_turn(self, turns: bool) -> None:
        """Let the target be turned, or not."""
        self._handle.let_turn(turns)

    def fit(self) -> None:
        """Aim the camera of every browser at all there is."""
        nodes = self._nodes if self._nodes is not None else self._surface.nodes if self._surface else None
        self._span = None if nodes is None or not len(nodes) else self._box(nodes)
        self._aim(fit=True)

    def _box(self, positions: FloatArray) -> FloatArray:
        """Return the box about the bodies that are to be seen [m], shape (2, 3); see `staying`."""
        boxes = self._bodies.boxes(positions)
        seen = staying(self._first, boxes)
        if (lost := int((~seen).sum())) or self.lost:
            self._bodies.set_seen(seen.tolist())
        self.lost = lost
        return union(boxes[seen])

    def _widen(self, box: FloatArray) -> None:
        """Show what moves wherever it has been, or where it is, in browsers whose camera nobody has moved."""
        self._span = box if self._span is None else widened(self._span, box)
        self._aim(fit=False)

    def _aim(self, *, fit: bool) -> None:
        self._seen = frame(self.picture, self._span, self._default.axis_depth)
        self._drawing.aim(self._seen.aim, fit=fit)
