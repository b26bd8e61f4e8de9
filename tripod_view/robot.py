"""The Tripod's rigid parts on the page: rails, servo bodies, arms, the effector. Metres, z up."""

from collections.abc import Sequence

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_view.arm import ArmGeometry, Stand, arm_pose, carriage_pose
from tripod_view.drawing import Drawing, Node
from tripod_view.player.robot import (
    BASE,
    BODY_SIZE,
    EFFECTOR,
    SERVO_BODY,
    SERVO_COLOURS,
    arm_shape,
    rail_shape,
)
from tripod_view.player.shapes import ball, box, disc, joined
from tripod_view.pose import Pose

DOT = 0.3
"""Of an effector that is a point or a set: radius of the dot over that of a disc."""


class Robot:
    """Draws what it is told; every method is called from the thread of ROS only."""

    def __init__(
        self, drawing: Drawing, geometry: ArmGeometry, servos: Sequence[Stand], *, has_disc: bool = True
    ) -> None:
        """`servos`: where they stand; of none there is only the effector, once its pose is known."""
        self._stands = tuple(servos)
        self._rails, self._carriages, self._arms = [], [], []
        for i, stand in enumerate(self._stands):
            self._rails.append(drawing.mesh(f"/base/{i}", *rail_shape(stand), BASE))
            end = Pose.of(stand.hub, stand.quaternion).apply(np.array([0.028, 0.0, -0.004]))
            label = Pose.of(end, (0.0, 0.0, 0.0, 1.0))
            drawing.add(f"/base/{i}/label", "label", label, text=f"servo {i}")
            self._carriages.append(drawing.mesh(f"/servos/{i}", *box(BODY_SIZE), SERVO_BODY))
            colour = SERVO_COLOURS[i % len(SERVO_COLOURS)]
            self._arms.append(drawing.mesh(f"/arms/{i}", *arm_shape(stand, geometry), colour))
        self._slide = float("nan")
        self.set_joints(np.zeros(len(self._stands)), 0.0)
        radius = geometry.effector_radius
        shape = disc(radius, 1.2 * geometry.thickness) if has_disc else joined(ball(DOT * radius))
        self._effector = drawing.add("/effector", "group", axes=2 * radius)
        drawing.mesh("/effector/disc", *shape, EFFECTOR)
        self._effector.visible = False

    def remove(self) -> None:
        """Take it away."""
        for node in self._nodes():
            node.remove()

    def _nodes(self) -> list[Node]:
        return [*self._rails, *self._carriages, *self._arms, self._effector]

    def set_joints(self, angles: FloatArray, slide: float) -> None:
        """Put the arms at `angles` [rad], shape (servos,), and the servo bodies at `slide` [m]; of others none."""
        if len(angles) != len(self._stands):
            return
        for i, stand in enumerate(self._stands):
            if slide != self._slide:
                self._carriages[i].place(carriage_pose(stand, slide))
            self._arms[i].place(arm_pose(stand, float(angles[i]), slide))
        self._slide = slide

    def set_effector(self, pose: Pose) -> None:
        """Put the effector and its axes at `pose`."""
        self._effector.place(pose)
        self._effector.visible = True
