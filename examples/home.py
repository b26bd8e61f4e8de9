"""Home the winches of the robot, so that the board knows their places. Start `tripod up` before, and take control.

python examples/home.py
"""

import sys

import rclpy
from rclpy.executors import ExternalShutdownException
from std_srvs.srv import Trigger

from tripod_graph import names
from tripod_graph.loopback import keep_local

if "--help" in sys.argv or "-h" in sys.argv:
    print(__doc__)
    sys.exit()
keep_local()  # nothing leaves this machine
rclpy.init()
node = rclpy.create_node("home")
client = node.create_client(Trigger, names.ROBOT_HOME)
try:
    if not client.wait_for_service(timeout_sec=10.0):
        sys.exit("no driver answers on robot/home: start `tripod up` with a robot that has winches")
    done = client.call_async(Trigger.Request())
    rclpy.spin_until_future_complete(node, done)
except (KeyboardInterrupt, ExternalShutdownException):
    sys.exit(130)
print(done.result().message)
sys.exit(not done.result().success)
