"""Without a place for ROS's logs every part says so in one line."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.messages import assert_names, raises_naming
from tripod_graph.log_place import LogPlaceError, check_log_place, log_place


@pytest.mark.parametrize(
    ("environment", "place"),
    [
        ({"HOME": "/h"}, Path("/h/.ros/log")),
        ({"HOME": "/h", "ROS_HOME": "~/r"}, Path("/h/r/log")),
        ({"HOME": "/h", "ROS_HOME": "/r", "ROS_LOG_DIR": "/l"}, Path("/l")),
        ({"HOME": "/h", "ROS_HOME": "", "ROS_LOG_DIR": "~/l"}, Path("/h/l")),
        ({"ROS_LOG_DIR": "/l"}, Path("/l")),
        ({}, None),
    ],
)
def test_the_place_is_where_ros_looks_for_it(environment: dict[str, str], place: Path | None) -> None:
    assert log_place(environment) == place


def test_it_is_made_and_one_that_cannot_be_is_named(tmp_path: Path) -> None:
    check_log_place({"HOME": str(tmp_path)})
    assert (tmp_path / ".ros" / "log").is_dir()
    (tmp_path / "file").touch()
    with raises_naming(LogPlaceError, f"{tmp_path}/file/log", "Not a directory", "ROS_LOG_DIR"):
        check_log_place({"ROS_HOME": f"{tmp_path}/file"})


@pytest.mark.ros
@pytest.mark.parametrize(
    "words", [["up", "--no-view"], ["driver", "--set", "port=mock"]], ids=["tripod up", "driver"]
)
def test_without_a_place_one_line_says_so(words: list[str], domain: int) -> None:
    pytest.importorskip("rclpy")
    bare = {
        name: value for name, value in os.environ.items() if name not in ("HOME", "ROS_HOME", "ROS_LOG_DIR")
    }
    ended = subprocess.run(
        [sys.executable, "-P", "-m", "tripod_bringup", *words],
        env={**bare, "ROS_DOMAIN_ID": str(domain)}, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert ended.returncode == 2
    assert_names(ended.stderr, "HOME", "not set", "logs", "ROS_LOG_DIR")
    assert ended.stderr.count("\n") == 1
