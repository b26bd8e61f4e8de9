"""Read a recording of the robot: an mcap file, decoded by the definitions in it. No ROS is needed.

tripod up --demo --record recordings       # makes one, in recordings/NAME
python examples/read_recording.py recordings/NAME
"""

import sys
from pathlib import Path

import numpy as np

from tripod_record.bag import Bag


def main(path: Path) -> None:
    """Print the topics, then what the servos and the effector did."""
    bag = Bag(path)
    for topic in bag.info.topics:
        print(f"{topic.count:7} {topic.name}")

    angles, places = [], []
    for heard in bag.messages(lambda name: name.endswith(("sim/joint_states", "sim/effector_pose"))):
        message, seconds = bag.decoded(heard), 1e-9 * (heard.log_time - bag.start)
        if heard.topic.endswith("joint_states"):
            angles.append([seconds, *message.position])
        else:
            p = message.pose.position
            places.append([seconds, p.x, p.y, p.z])

    if angles:
        low, high = np.min(angles, axis=0), np.max(angles, axis=0)
        for k, name in enumerate(("servo_0", "servo_1", "servo_2"), start=1):
            print(f"{name}: {np.degrees(low[k]):.1f} to {np.degrees(high[k]):.1f} degrees")
    if places:
        way = np.linalg.norm(np.diff(np.array(places)[:, 1:], axis=0), axis=1).sum()
        print(f"the effector went {1e3 * way:.1f} mm in {places[-1][0] - places[0][0]:.1f} s")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: read_recording.py FILE.mcap, or the directory of a recording")
    main(Path(sys.argv[1]))
