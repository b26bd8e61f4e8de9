"""A target of your own: inverse kinematics moves the effector there. Start `tripod up` before it.

python examples/target.py 0.001 0 0      # x, y, z [m] in the frame "world"
"""

import sys
from contextlib import suppress

import rclpy
from geometry_msgs.msg import Point, PoseStamped
from rclpy.executors import ExternalShutdownException
from tripod_msgs.msg import ControlMode, IkStatus

from tripod_graph import names
from tripod_graph.loopback import keep_local
from tripod_graph.qos import LATCHED, RELIABLE

if "--help" in sys.argv or "-h" in sys.argv:
    print(__doc__)
    sys.exit()
x, y, z = map(float, sys.argv[1:4] if len(sys.argv) > 3 else ("0.001", "0", "0"))
keep_local()  # nothing leaves this machine
rclpy.init()
node = rclpy.create_node("target")
modes = node.create_publisher(ControlMode, names.CONTROL_MODE, LATCHED)
targets = node.create_publisher(PoseStamped, names.TARGET_POSE, RELIABLE)
# The mode is one of STOP 0, TELEOP 1, IK 2, REPLAY 3; a decision holds for 1 s.
decision = ControlMode(mode=ControlMode.IK, source="target")
decision.header.stamp = node.get_clock().now().to_msg()
target = PoseStamped()
target.header.frame_id = "world"
target.pose.position, target.pose.orientation.w = Point(x=x, y=y, z=z), 1.0


def ask() -> None:
    """Repeat the decision, with the same stamp, and the target."""
    modes.publish(decision)
    target.header.stamp = node.get_clock().now().to_msg()
    targets.publish(target)


def tell(status: IkStatus) -> None:
    """Say how far the effector is from this target, until it is there."""
    if max(abs(status.target.x - x), abs(status.target.y - y), abs(status.target.z - z)) > 1e-9:
        return  # another one
    if status.state not in (IkStatus.TRACKING, IkStatus.CLOSEST, IkStatus.SEARCHING):
        return  # nothing is solved now: the numbers are those of before
    print(f"{1e3 * status.error:.2f} mm from the target", status.message)
    if status.error < 1e-4:
        raise SystemExit


node.create_timer(0.2, ask)
node.create_subscription(IkStatus, names.IK_STATUS, tell, RELIABLE)
print("asking whoever listens, such as `tripod up`, until the effector is there or Ctrl-C")
with suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(node)
# from now on there is silence: everything holds, then parks
