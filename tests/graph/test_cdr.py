"""A trajectory that is too large is refused before it is read, whatever its bytes are."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.messages import assert_names, raises_naming
from tripod_graph.cdr import MOST_BYTES, MOST_NAMES, MOST_POINTS, check_size
from tripod_graph.command import CommandError


def serialised(points: int, frame: str = "/teleop#1", joints: int = 3, names: str = "servo_0") -> bytes:
    """Return what ROS makes of a trajectory of that many points; those have zeros alone and no values."""
    from rclpy.serialization import serialize_message
    from trajectory_msgs.msg import JointTrajectory

    message = JointTrajectory(joint_names=[names] * joints)
    message.header.frame_id = frame
    head = bytes(serialize_message(message))
    assert head[-4:] == bytes(4)
    return head[:-4] + struct.pack("<I", points) + bytes(24 * min(points, 3))


@pytest.mark.parametrize("frame", ["", "a", "abc", "abcd", "/teleop#3fa2c1"])
@pytest.mark.parametrize("names", ["", "s", "servo_0", "servo_00"])
def test_points_are_counted_behind_names_of_any_length(frame: str, names: str) -> None:
    pytest.importorskip("rclpy")
    check_size(serialised(MOST_POINTS, frame, names=names))
    with raises_naming(CommandError, "trajectory", "100000 points", MOST_POINTS):
        check_size(serialised(100_000, frame, names=names))


def test_many_joints_and_many_bytes_are_refused() -> None:
    pytest.importorskip("rclpy")
    with raises_naming(CommandError, "trajectory", "17 joints", MOST_NAMES):
        check_size(serialised(1, joints=17))
    with raises_naming(
        CommandError, "trajectory", f"{MOST_BYTES + 1} bytes", MOST_BYTES, f"{MOST_POINTS} points"
    ):
        check_size(bytes(MOST_BYTES + 1))


@given(st.binary(max_size=200))
def test_no_bytes_do_more_than_be_refused(data: bytes) -> None:
    try:
        check_size(data)
    except CommandError as error:
        assert_names(error, "trajectory")
