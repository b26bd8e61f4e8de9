"""Recordings are written and read without ROS."""

import subprocess
import sys
from pathlib import Path

ROS = "{'rclpy', 'rosidl_parser', 'ament_index_python', 'diagnostic_msgs', 'std_srvs', 'tripod_msgs'}"


def test_all_but_nodes_and_parameters_import_no_ros() -> None:
    root = Path(__file__).parents[2]
    names = sorted(
        p.stem
        for p in (root / "tripod_record").glob("*.py")
        if p.stem not in ("__init__", "node", "play_node", "settings")
    )
    assert {"writer", "recorder", "info", "reading", "definitions"} <= set(names)
    code = (
        f"import sys, {', '.join('tripod_record.' + n for n in names)}; assert not {ROS} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], cwd=root, check=True)
