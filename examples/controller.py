"""A controller of your own: a node that lets the servos wave. Start `tripod up` first, this in a second terminal."""

import sys
from contextlib import suppress
from math import pi, sin

import rclpy
from rclpy.executors import ExternalShutdownException
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from tripod_msgs.msg import ControlMode

from tripod_graph import names
from tripod_graph.loopback import keep_local
from tripod_graph.qos import LATCHED, RELIABLE

if "--help" in sys.argv or "-h" in sys.argv:
    print(__doc__)
    sys.exit()
keep_local()  # nothing leaves this machine
rclpy.init()
node = rclpy.create_node("wave")
modes = node.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
commands = node.create_publisher(JointTrajectory, names.JOINT_TRAJECTORY, RELIABLE)
now = node.get_clock().now
began = now()
decision = ControlMode(mode=ControlMode.TELEOP, source="wave")  # holds for 1 s: repeated, with the same stamp
decision.header.stamp = began.to_msg()


def wave() -> None:
    """Ask for three sines, 120 degrees apart."""
    t = 1e-9 * (now() - began).nanoseconds
    angles = [-0.4 + 0.2 * sin(2 * t + 2 * pi * i / 3) for i in range(3)]
    message = JointTrajectory(joint_names=list(names.SERVOS), points=[JointTrajectoryPoint(positions=angles)])
    message.header.frame_id = "wave"  # who commands
    commands.publish(message)


print("waving to whoever listens, such as `tripod up`, until Ctrl-C")
node.create_timer(0.2, lambda: modes.publish(decision))
node.create_timer(0.04, wave)
with suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(node)
# from now on there is silence: everything holds, then parks
