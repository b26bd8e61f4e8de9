"""A trajectory that is too large is refused before it is read, whatever its bytes are."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

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
    with pytest.raises(CommandError, match=f"a trajectory of 100000 points; allowed are {MOST_POINTS}"):
        check_size(serialised(100_000, frame, names=names))


def test_many_joints_and_many_bytes_are_refused() -> None:
    pytest.importorskip("rclpy")
    with pytest.raises(CommandError, match=f"a trajectory of 17 joints; allowed are {MOST_NAMES}"):
        check_size(serialised(1, joints=17))
    with pytest.raises(CommandError, match=f"of {MOST_BYTES + 1} bytes; allowed are {MOST_BYTES}"):
        check_size(bytes(MOST_BYTES + 1))


@given(st.binary(max_size=200))
def test_no_bytes_do_more_than_be_refused(data: bytes) -> None:
    try:
        check_size(data)
    except CommandError as error:
        assert "a trajectory of" in str(error)
