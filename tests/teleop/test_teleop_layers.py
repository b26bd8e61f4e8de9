"""The rules of the keys, and the terminal, need no ROS."""

import subprocess
import sys
from pathlib import Path

ROS = "{'rclpy', 'sensor_msgs', 'trajectory_msgs', 'tripod_msgs'}"


def test_all_but_the_node_and_its_parameters_import_no_ros() -> None:
    root = Path(__file__).parents[2]
    names = sorted(
        p.stem
        for p in (root / "tripod_teleop").glob("*.py")
        if p.stem not in ("__init__", "node", "settings")
    )
    assert {"keys", "escape", "drive", "operate", "terminal"} <= set(names)
    code = (
        f"import sys, {', '.join('tripod_teleop.' + n for n in names)}; assert not {ROS} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], cwd=root, check=True)
