"""A simulator that knows no mechanics: a rippling grid, and joints that follow commands by the rules of all followers.

`python tests/view/fake_simulator.py [SIDE]` publishes a grid of SIDE x SIDE nodes until it is told to stop.
"""

import json
import sys
import time
from array import array
from collections.abc import Sequence
from typing import Any
from zlib import crc32

import numpy as np
from geometry_msgs.msg import Point, PoseStamped
from rclpy.duration import Duration
from rclpy.node import Node
from sensor_msgs.msg import JointState
from shape_msgs.msg import Mesh, MeshTriangle, SolidPrimitive
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import BodyState, ControlMode, SimStatus

from tests.decisions import keep
from tripod_graph import names
from tripod_graph.command import CommandFollower, CommandLimits
from tripod_graph.joint import Joint
from tripod_graph.qos import LATCHED, RELIABLE, SENSOR
from tripod_graph.run import run_node

RATE = 60.0  # [Hz]


def grid(side: int, size: float = 0.09) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (side^2, 3) [m] and triangles (2 (side - 1)^2, 3) of a flat square."""
    axis = np.linspace(-size / 2, size / 2, side)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    nodes = np.stack([x.ravel(), y.ravel(), np.zeros(side * side)], axis=1)
    a = np.arange(side * side).reshape(side, side)
    a, b, c, d = a[:-1, :-1].ravel(), a[1:, :-1].ravel(), a[1:, 1:].ravel(), a[:-1, 1:].ravel()
    return nodes, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.uint32)


class FakeSimulator(Node):
    """Publishes what the page draws; `commands` and `modes` keep what came in."""

    def __init__(self, side: int = 9, *, rate: float = RATE, **options: Any) -> None:
        super().__init__("fake_sim", **options)
        # nodes and triangles, always changed together: a thread of its own publishes them
        self.body = grid(side)
        self.follower = CommandFollower(CommandLimits())
        self.commands: list[JointTrajectory] = []
        self.modes: list[ControlMode] = []
        self.targets: list[PoseStamped] = []
        self.spoil = ""  # what to publish wrongly: "nan", "size" or "topology"
        self.silent = False
        self.ticks = 0  # how often its timer has called it
        self.began = 0.0  # the steady time at which simulated time is 0 [s]
        self.speed = 1.0  # simulated over steady time
        self.figures: dict[str, Any] = {}
        self.state = SimStatus.RUNNING
        self.tells_joints = True
        self.scene = "fake"
        self._mesh = self.create_publisher(Mesh, names.MESH, LATCHED)
        self._maze = self.create_publisher(Mesh, names.MAZE_MESH, LATCHED)
        self._ball_shape = self.create_publisher(SolidPrimitive, names.BALL_SHAPE, LATCHED)
        self.ball = self.create_publisher(PoseStamped, names.SIM_BALL_POSE, RELIABLE)
        self._picture = self.create_publisher(String, names.SIM_PICTURE, LATCHED)
        self._figures = self.create_publisher(String, names.SIM_FIGURES, RELIABLE)
        self._state = self.create_publisher(BodyState, names.BODY_STATE, SENSOR)
        self._joints = self.create_publisher(JointState, names.SIM_JOINT_STATES, RELIABLE)
        self._effector = self.create_publisher(PoseStamped, names.EFFECTOR_POSE, RELIABLE)
        self._status = self.create_publisher(SimStatus, names.SIM_STATUS, RELIABLE)
        self.mode = self.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
        self.target = self.create_publisher(PoseStamped, names.TARGET_POSE, RELIABLE)
        self.create_subscription(JointTrajectory, names.JOINT_TRAJECTORY, self._on_command, RELIABLE)
        self.create_subscription(ControlMode, names.CONTROL_MODE, self._on_mode, LATCHED)
        self.create_subscription(PoseStamped, names.TARGET_POSE, self.targets.append, RELIABLE)
        self.create_timer(1 / rate, self._tick)
        self.create_timer(0.1, self._tell)
        self.publish_mesh()

    def close(self) -> None:
        self.destroy_node()

    def jump_to(self, *joints: float) -> None:
        """Hold at `joints`: three angles [rad] and the slide [m]."""
        self.follower = CommandFollower(self.follower.limits, joints)

    def have_joints(self, servos: int, others: Sequence[Joint]) -> None:
        """Have so many servos and these other joints from now on, parked where they are others than before."""
        limits = CommandLimits().of(servos, tuple(others))
        if limits.joints != self.follower.limits.joints:
            self.follower = CommandFollower(limits)

    def publish_mesh(self) -> None:
        points = [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in self.body[0]]
        triangles = [MeshTriangle(vertex_indices=t) for t in self.body[1]]
        self._mesh.publish(Mesh(vertices=points, triangles=triangles))

    def wait_for_mesh(self, seconds: float) -> None:
        """Wait until all who listen have the mesh: one that comes late lets the page forget what it kept before."""
        assert self._mesh.wait_for_all_acked(Duration(seconds=seconds))

    def publish_picture(self, table: dict[str, Any]) -> None:
        """Describe a scene, and take its name."""
        self.scene = table["name"]
        self._picture.publish(String(data=json.dumps(table)))

    def publish_game(self, maze: bool, *ball: float, kind: int = SolidPrimitive.SPHERE) -> None:
        """Publish a triangle as the maze, or none, and the dimensions of the ball."""
        corners = [Point(x=0.01), Point(y=0.01), Point(z=0.008)] if maze else []
        triangles = [MeshTriangle(vertex_indices=[0, 1, 2])] if maze else []
        self._maze.publish(Mesh(vertices=corners, triangles=triangles))
        self._ball_shape.publish(SolidPrimitive(type=kind, dimensions=list(ball)))

    def publish_ball(self, x: float, y: float, z: float) -> None:
        message = PoseStamped()
        message.header.frame_id, message.header.stamp = names.WORLD, self.get_clock().now().to_msg()
        p = message.pose.position
        p.x, p.y, p.z = x, y, z
        message.pose.orientation.z, message.pose.orientation.w = 0.6, 0.8
        self.ball.publish(message)

    def _on_command(self, message: JointTrajectory) -> None:
        self.commands.append(message)
        times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points]
        positions, efforts = ([list(getattr(p, k)) for p in message.points] for k in ("positions", "effort"))
        self.follower.accept(
            message.joint_names, times, positions, time.monotonic(), efforts=efforts if any(efforts) else ()
        )

    def _on_mode(self, message: ControlMode) -> None:
        keep(self.modes, message)
        if message.mode == ControlMode.STOP:
            self.follower.stop(time.monotonic())

    def publish_joints(self, joints: np.ndarray) -> None:
        """Say that the joints are there: angles [rad], others [m, m³, N, Pa] and the slide [m]."""
        limits, back = self.follower.limits, [-0.01, -0.02, 0.3, *[0.5] * len(joints)]
        table = [joint for joint in limits.table if joint.name in limits.known]
        rows = [(b, v) if j.is_effort else (v, b) for j, v, b in zip(table, joints, back, strict=False)]
        state = JointState(name=[joint.name for joint in table])
        state.position, state.effort = (array("d", column) for column in zip(*rows, strict=True))
        state.header.stamp = self.get_clock().now().to_msg()
        self._joints.publish(state)

    def _tick(self) -> None:
        self.ticks += 1
        nodes, triangles = self.body
        now = time.monotonic()
        joints = self.follower.setpoint(now)
        if self.silent:
            return
        stamp = self.get_clock().now().to_msg()
        message = BodyState(topology_id=crc32(triangles.tobytes()), time=self.speed * (now - self.began))
        message.header.stamp, message.header.frame_id = stamp, names.WORLD
        tilt = 0.005 * joints[: self.follower.limits.count].sum()
        z = 0.004 * np.sin(60 * np.hypot(nodes[:, 0], nodes[:, 1]) - 4 * now) + tilt
        positions = np.column_stack([nodes[:, :2], nodes[:, 2] + z])
        if self.spoil == "nan":
            positions[3, 1] = np.nan
        elif self.spoil == "topology":
            message.topology_id += 1
        message.positions = array("d", (positions[:-1] if self.spoil == "size" else positions).tobytes())
        self._state.publish(message)
        if self.follower.limits.size and self.tells_joints:
            self.publish_joints(joints)
        pose = PoseStamped()
        pose.header = message.header
        pose.pose.position.z = float(z[len(z) // 2])
        self._effector.publish(pose)

    def _tell(self) -> None:
        if not self.silent:
            told = self.follower.limits.table[:-1]
            self._status.publish(
                SimStatus(
                    scene=self.scene, state=self.state, dt=0.002, real_time_factor=1.0, capacity=4.0,
                    step_time_median=0.0005,
                    joint_names=[j.name for j in told], units=[j.unit for j in told], lower=[j.low for j in told],
                    upper=[j.high for j in told], speed=[j.speed for j in told],
                )
            )  # fmt: skip
            if self.figures:
                self._figures.publish(String(data=json.dumps(self.figures)))


if __name__ == "__main__":
    sys.exit(run_node("fake_sim", lambda: FakeSimulator(int(sys.argv[1]) if len(sys.argv) > 1 else 9), []))
