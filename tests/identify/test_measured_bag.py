"""Recordings as measured data: commands, measured poses, IMU; those of other robots are refused."""

import re
from pathlib import Path

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from tests.identify.robots import tripod
from tests.messages import assert_names, raises_naming
from tripod_bringup.measured_bag import read_recording
from tripod_identify.errors import DataError
from tripod_record.topic import Qos, Topic
from tripod_record.writer import BagWriter
from tripod_sim import load_scene

STORE = get_typestore(Stores.ROS2_JAZZY)
T = STORE.types
START = 1_700_000_000_000_000_000  # [ns]
JOINTS, POSE, IMU = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/Imu"
NAMES = ("servo_0", "servo_1", "servo_2", "slide")


def write_bag(
    directory: Path, joints=NAMES, seen=("/robot/effector_pose",), robots=("",), lost=0, broken=(), silent=()
) -> Path:
    """Stand for 2 s at angles 0, go in 1 s to -0.5, stand for 2 s; the disc is at -10 mm times the share.

    The first `lost` of its 501 poses are NaN, so are the commands `broken`; those of numbers `silent` are not there.
    """
    writer = BagWriter(directory)
    header = T["std_msgs/msg/Header"](
        stamp=T["builtin_interfaces/msg/Time"](sec=0, nanosec=0), frame_id="world"
    )
    kinds = {f"{r}/robot/joint_states": JOINTS for r in robots}
    kinds |= {name: IMU if name.endswith("imu") else POSE for name in seen}
    for name, kind in kinds.items():
        writer.add_topic(Topic(name, kind, STORE.generate_msgdef(kind, ros_version=2)[0], (Qos(),)))
    half = 0.5 * 0.2
    turn = T["geometry_msgs/msg/Quaternion"](x=float(np.sin(half)), y=0.0, z=0.0, w=float(np.cos(half)))
    for k in range(501):
        share, stamp = float(np.clip((k / 100 - 2), 0, 1)), START + k * 10**7
        position = np.array([-0.5 * share] * (len(joints) - 1) + [0.02 * share])
        position[list(broken) if k == 300 else []] = np.nan
        point = T["geometry_msgs/msg/Point"](x=np.nan if k < lost else 0.0, y=0.0, z=-0.01 * share)
        vector = T["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
        messages = {
            JOINTS: T[JOINTS](header=header, name=list(joints), position=position, velocity=position, effort=position),
            POSE: T[POSE](header=header, pose=T["geometry_msgs/msg/Pose"](position=point, orientation=turn)),
            IMU: T[IMU](
                header=header, orientation=turn, orientation_covariance=np.zeros(9),
                angular_velocity=vector, angular_velocity_covariance=np.zeros(9),
                linear_acceleration=vector, linear_acceleration_covariance=np.zeros(9),
            ),
        }  # fmt: skip
        for name, kind in kinds.items():
            if kind == JOINTS and k in silent:
                continue
            writer.write(name, bytes(STORE.serialize_cdr(messages[kind], kind)), stamp)
        if k == 250:
            writer.sync()  # a chunk of its own
    writer.close()
    return directory


def test_a_recording_is_a_motion(tmp_path: Path) -> None:
    found = read_recording(write_bag(tmp_path / "b"), tripod(), poses=False)
    assert [c.label for c in found.channels] == [f"effector.{a}" for a in ("x", "y", "z", "rx", "ry", "rz")]
    assert len(found.times) == 501
    assert found.commands[250] == pytest.approx([-0.25] * 3)
    assert found.slide[250] == pytest.approx(0.01)
    assert found.values[250] == pytest.approx([0, 0, -0.005, 0.2, 0, 0])


def test_stands_of_a_recording_are_poses(tmp_path: Path) -> None:
    found = read_recording(write_bag(tmp_path / "b"), tripod(), poses=True)
    assert found.times is None
    assert found.commands == pytest.approx(np.array([[0.0] * 3, [-0.5] * 3]), abs=1e-3)
    assert found.values[:, 2] == pytest.approx([0, -0.01])


def test_what_a_recording_lost_is_left_out_and_told(tmp_path: Path) -> None:
    """As of a camera that saw no marker: at first, during all of a stand, ever."""
    scene, path = tripod(), write_bag(tmp_path / "b", lost=250)
    moving = read_recording(path, scene, poses=False)
    standing = read_recording(path, scene, poses=True)
    for found, share in ((moving, "250 of 3006 values"), (standing, "1 of 12 values")):
        (note,) = found.notes
        assert_names(note, share, "missing")
    assert np.isnan(standing.values[:, 0]).tolist() == [True, False]
    never = read_recording(write_bag(tmp_path / "c", lost=501), scene, poses=True)
    assert "effector.x" not in [c.label for c in never.channels]
    with raises_naming(DataError, "servo_1", "nan rad", "-2.1 to 0.6 rad"):
        read_recording(write_bag(tmp_path / "d", broken=(1,)), scene, poses=False)


def test_what_was_measured_while_nothing_was_commanded_for_long_is_left_out_and_told(tmp_path: Path) -> None:
    found = read_recording(write_bag(tmp_path / "b", silent=range(100, 220)), tripod(), poses=False)
    assert found.times.tolist() == pytest.approx([k / 100 for k in range(501) if not 99 <= k < 220])
    (note,) = found.notes
    assert_names(note, "121 rows", "commands")
    whole = read_recording(write_bag(tmp_path / "c", silent=range(100, 190)), tripod(), poses=False)
    assert (len(whole.times), whole.notes) == (501, ())
    rare = read_recording(
        write_bag(tmp_path / "d", silent=set(range(501)) - set(range(0, 501, 125))), tripod(), poses=False
    )
    assert (len(rare.times), rare.notes) == (501, ())


def test_the_imu_tells_orientations_alone(tmp_path: Path) -> None:
    found = read_recording(write_bag(tmp_path / "b", seen=("/robot/imu",)), tripod(), poses=False)
    assert [c.label for c in found.channels] == ["effector.rx", "effector.ry", "effector.rz"]
    assert found.values[0] == pytest.approx([0.2, 0, 0])


@pytest.mark.parametrize(
    ("more", "scene", "named"),
    [
        (
            {"joints": ("servo_0", "servo_1", "slide")},
            "tripod",
            ("'tripod'", "servo_0, servo_1, servo_2", "another robot"),
        ),
        ({}, "cross", ("'cross'", "servo_0, servo_1, servo_2, servo_3", "another robot")),
        ({}, "silicone", ("'silicone'", "no effector")),
        ({"seen": ()}, "tripod", ("no measured pose", "robot/effector_pose, robot/imu")),
        (
            {"robots": ("/left", "/right")},
            "tripod",
            ("several robots", "/left/robot/joint_states", "/right/robot/joint_states"),
        ),
    ],
)
def test_another_robots_recording_is_refused_in_one_line(
    more: dict, scene: str, named: tuple[str, ...], tmp_path: Path
) -> None:
    with raises_naming(DataError, *named) as error:
        read_recording(write_bag(tmp_path / "b", **more), load_scene(scene), poses=False)
    assert "\n" not in str(error.value)


def test_what_of_a_damaged_recording_is_left_out_is_told(tmp_path: Path) -> None:
    (file,) = write_bag(tmp_path / "b").glob("*.mcap")
    whole = file.read_bytes()
    places = [match.end() + 40 for match in re.finditer(b"zstd", whole)]
    first, *later = places[: len(places) // 2]  # each chunk is named again in the summary
    assert not read_recording(file, tripod(), poses=False).notes
    data = bytearray(whole)
    for place in later:
        data[place] ^= 0xFF
    file.write_bytes(data)
    [note] = read_recording(file, tripod(), poses=False).notes
    assert_names(note, "left out", f"{file}: byte")
    data[first] ^= 0xFF
    file.write_bytes(data)
    with raises_naming(DataError, "no commands", "left out", f"{file}: byte"):
        read_recording(file.parent, tripod(), poses=False)
