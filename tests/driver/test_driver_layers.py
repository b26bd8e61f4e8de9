"""The driver knows nothing of physics, and its rules know nothing of ROS."""

import subprocess
import sys
from pathlib import Path

import pytest


def loaded_by(*modules: str) -> set[str]:
    """Return the top-level packages that a fresh interpreter has after importing `modules`."""
    code = f"import {', '.join(modules)}, sys; print(*{{name.partition('.')[0] for name in sys.modules}})"
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(run.stdout.split())


def test_rules_protocol_and_ports_need_no_ros() -> None:
    loaded = loaded_by("tripod_driver.driver", "tripod_driver.ports.choose")
    assert {"tripod_driver", "tripod_graph", "serial"} <= loaded
    assert not {"rclpy", "tripod_msgs"} & loaded


def test_protocol_needs_the_standard_library_only() -> None:
    assert not {"numpy", "serial", "rclpy"} & loaded_by("tripod_driver.protocol")


def test_the_node_knows_nothing_of_physics() -> None:
    pytest.importorskip("tripod_msgs")
    loaded = loaded_by("tripod_driver.node")
    assert "rclpy" in loaded
    assert not {"tripod_sim", "tripod_ik", "tripod_view", "scipy", "numba"} & loaded
