"""A recording whose numbers are known, written as the recorder writes."""

from pathlib import Path

import numpy as np
from rosbags.typesys import Stores, get_typestore

from tripod_record.topic import Qos, Topic
from tripod_record.writer import BagWriter

STORE = get_typestore(Stores.ROS2_JAZZY)
T = STORE.types
START = 1_700_000_000_000_000_000  # [ns]
JOINTS, POSE = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseStamped"


def write_joint_bag(directory: Path) -> None:
    """Write 101 messages in a second: servo 1 goes evenly from -0.1 to -1 rad, the effector 10 mm along x."""
    writer = BagWriter(directory)
    for name, kind in (("/sim/joint_states", JOINTS), ("/sim/effector_pose", POSE)):
        writer.add_topic(Topic(name, kind, STORE.generate_msgdef(kind, ros_version=2)[0], (Qos(),)))
    header = T["std_msgs/msg/Header"](
        stamp=T["builtin_interfaces/msg/Time"](sec=0, nanosec=0), frame_id="world"
    )
    names = ["servo_0", "servo_1", "servo_2", "slide"]
    turn = T["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    for k in range(101):
        share, stamp = k / 100, START + k * 10**7
        zeros = np.zeros(4)
        angles = np.array([0.0, -0.1 - 0.9 * share, 0.0, 0.0])
        joints = T[JOINTS](header=header, name=names, position=angles, velocity=zeros, effort=zeros)
        writer.write("/sim/joint_states", bytes(STORE.serialize_cdr(joints, JOINTS)), stamp)
        point = T["geometry_msgs/msg/Point"](x=0.01 * share, y=0.0, z=0.0)
        pose = T["geometry_msgs/msg/Pose"](position=point, orientation=turn)
        data = STORE.serialize_cdr(T[POSE](header=header, pose=pose), POSE)
        writer.write("/sim/effector_pose", bytes(data), stamp)
    writer.close()
