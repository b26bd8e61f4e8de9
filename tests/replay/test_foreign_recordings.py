"""Recordings of other programs: definitions in IDL or absent, relative names, topics of every node, trajectories."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from tests.messages import assert_names, line_naming, raises_naming
from tests.record.bags import START, Foreign, cdr_string, write_foreign
from tripod_bringup.bag_export import export_command, plot_command, unused_path
from tripod_bringup.bag_motion import joint_path
from tripod_bringup.bag_play import play_command
from tripod_bringup.options import To
from tripod_record.bag import Bag, store_of
from tripod_record.definitions import definition_text
from tripod_record.errors import RecordError

STORE = get_typestore(Stores.ROS2_JAZZY)
STRING, EMPTY, LOG = "std_msgs/msg/String", "std_msgs/msg/Empty", "rcl_interfaces/msg/Log"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
HEAD = "=" * 80 + "\nIDL: "
IDL = f"""{HEAD}{STRING}
// generated
#include "other/msg/Other.idl"

module std_msgs {{
  module msg {{
    @verbatim (language="comment", text="# not for the preprocessor")
    struct String {{
      string data;
    }};
  }};
}};
"""


def texts(*values: str) -> list[tuple[float, bytes]]:
    return [(0.05 * i, cdr_string(value)) for i, value in enumerate(values)]


def all_true(_: str) -> bool:
    return True


@pytest.mark.parametrize(
    "as_recorded",
    [("", ""), ("ros2idl", IDL), ("ros2msg", "string data\n")],
    ids=["absent", "IDL", ".msg"],
)
def test_messages_are_read_whatever_their_definition_was_written_in(
    as_recorded: tuple[str, str], tmp_path: Path
) -> None:
    encoding, text = as_recorded
    file = write_foreign(tmp_path / "a.mcap", Foreign("/chatter", STRING, texts("a", "b"), text, encoding))
    bag = Bag(file)
    assert [bag.decoded(heard).data for heard in bag.messages()] == ["a", "b"]


def test_a_definition_in_idl_with_parts_and_includes_is_that_of_the_installed_type() -> None:
    pytest.importorskip("sensor_msgs.msg")
    import sensor_msgs

    share = Path(sensor_msgs.__file__).parents[4] / "share"
    kinds = ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    files = [share / f"{kind}.idl" for kind in kinds]
    if not all(file.exists() for file in files):
        pytest.skip("the installed messages come without their IDL files")
    text = "".join(f"{HEAD}{kind}\n{file.read_text()}" for kind, file in zip(kinds, files, strict=True))
    found = store_of(kinds[0], text, "ros2idl").hash_rihs01(kinds[0])
    assert found == store_of(kinds[0], definition_text(kinds[0])).hash_rihs01(kinds[0])


@pytest.mark.parametrize(
    ("topic", "named"),
    [
        (Foreign("/a", "some_msgs/msg/Gone", texts("a"), "", ""), ("/a", "some_msgs/msg/Gone", "not installed")),
        (Foreign("/a", "", texts("a")), ("/a", "without a message type")),
        (Foreign("/a", STRING, texts("a"), "{}", "jsonschema"), ("/a", "jsonschema")),
        (Foreign("/a", STRING, texts("a"), encoding="json"), ("/a", "json", "cdr")),
        (Foreign("/a", STRING, texts("a"), HEAD + "x\nmodule {", "ros2idl"), ("/a", "definition", STRING)),
        (Foreign("/a", STRING, texts("a"), IDL.replace("String", "Other"), "ros2idl"), ("/a", "definition", STRING)),
    ],
    ids=["not installed", "no schema", "other schema", "other encoding", "broken IDL", "IDL of another type"],
)  # fmt: skip
def test_what_cannot_be_decoded_is_named_with_its_reason_and_the_rest_is_exported(
    topic: Foreign, named: tuple[str, ...], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    number = Foreign(
        "/number", "std_msgs/msg/Float64", [(0.1, b"\0\1\0\0" + np.float64(2.5).tobytes())], "float64 data\n"
    )
    file, out = write_foreign(tmp_path / "a.mcap", topic, number), tmp_path / "a.npz"
    bag = Bag(file)
    with raises_naming(RecordError, *named):
        [bag.decoded(heard) for heard in bag.messages()]
    assert export_command(file, out, "/*") == 0
    line_naming(capfd.readouterr().err, "left out", *named)
    assert np.load(out)["number/data"].tolist() == [2.5]


def test_messages_without_fields_are_exported_as_their_count(tmp_path: Path) -> None:
    button = Foreign("/button", EMPTY, [(0.5, b"\0\1\0\0\0"), (0.75, b"\0\1\0\0\0")], "")
    file, out = write_foreign(tmp_path / "a.mcap", button), tmp_path / "a.npz"
    assert export_command(file, out, "/button") == 0
    arrays = np.load(out)
    assert arrays["button/time"].tolist() == [0.0, 0.25]
    assert arrays["button/count"].tolist() == [1.0, 2.0]


def test_without_a_name_export_and_plot_write_a_new_file_beside_those_that_are_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bags").mkdir()
    button = Foreign("/button", EMPTY, [(0.5, b"\0\1\0\0\0")], "")
    file = write_foreign(tmp_path / "bags" / "run.mcap", button)
    for name in ("run.csv", "run_2.csv"):
        assert export_command(file, None, "/button") == 0
        line_naming(capfd.readouterr().out, name)
    assert (tmp_path / "run.csv").read_text().startswith("time,button.count")
    assert plot_command(file, None) == 2  # nothing to draw
    assert not (tmp_path / "run.png").exists()
    assert unused_path(Path(), ".html").name == f"{tmp_path.name}.html"


@pytest.mark.ros
def test_names_are_played_in_full_and_topics_of_every_node_are_left_out(
    tmp_path: Path, domain: int, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    log = STORE.types[LOG](
        stamp=STORE.types["builtin_interfaces/msg/Time"](sec=1, nanosec=0),
        level=20, name="talker", msg="hello", file="a", function="b", line=1,
    )  # fmt: skip
    said = bytes(STORE.serialize_cdr(log, LOG))
    text = STORE.generate_msgdef(LOG, ros_version=2)[0]
    file = write_foreign(
        tmp_path / "a.mcap",
        Foreign("chatter", STRING, texts("a", "b", "c")),
        Foreign("/rosout", LOG, [(0.0, said), (0.1, said)], text),
    )
    assert [heard.topic for heard in Bag(file).messages()][:1] == ["/chatter"]
    options: dict[str, Any] = {"to": To.TOPICS, "rate": 1.0, "start": 0.0, "subnet": False, "ros": ()}
    assert play_command(file, topics="", **options) == 0
    out, err = capfd.readouterr()
    assert_names(out, "3 messages")
    assert_names(err, "not played", "/rosout", "--topics")
    assert play_command(file, topics="/chatter /rosout", **options) == 0
    out, err = capfd.readouterr()
    assert_names(out, "5 messages")
    assert not err


def trajectory(
    *points: tuple[float, list[float]],
    joints: str = "servo_0 servo_1",
    stamp: float = 0.0,
    efforts: list[list[float]] | None = None,
) -> bytes:
    T, none = STORE.types, np.zeros(0)
    asked = [none] * len(points) if efforts is None else map(np.array, efforts)
    sec, nanosec = divmod(round(1e9 * stamp), 10**9)
    header = T["std_msgs/msg/Header"](
        stamp=T["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec), frame_id=""
    )
    rows = [
        T["trajectory_msgs/msg/JointTrajectoryPoint"](
            positions=np.array(angles), velocities=none, accelerations=none, effort=effort,
            time_from_start=T["builtin_interfaces/msg/Duration"](sec=int(time), nanosec=round(1e9 * (time % 1))),
        )
        for (time, angles), effort in zip(points, asked, strict=True)
    ]  # fmt: skip
    message = T[TRAJECTORY](header=header, joint_names=joints.split(), points=rows)
    return bytes(STORE.serialize_cdr(message, TRAJECTORY))


@pytest.fixture
def motion(tmp_path: Path) -> Callable[..., Any]:
    text = STORE.generate_msgdef(TRAJECTORY, ros_version=2)[0]

    def read(*messages: tuple[float, bytes], topic: str = "/arm_controller/joint_trajectory") -> Any:
        bag = Bag(write_foreign(tmp_path / "a.mcap", Foreign(topic, TRAJECTORY, messages, text)))
        return joint_path(bag, all_true)

    return read


def test_a_trajectory_is_followed_until_the_next_one_comes(motion: Callable[..., Any]) -> None:
    """As joint_trajectory_controller replaces the trajectory that it follows by a newer one."""
    first = trajectory((1.0, [-0.5, 0.0]), (3.0, [-1.0, 0.4]))
    second = trajectory((2.0, [-0.3, 0.2]), joints="servo_0 servo_1")
    path = motion((0.0, first), (2.0, second))
    assert path.servos == 2
    assert path.at(0.5).tolist() == [-0.5, 0.0]  # where it comes from is not known
    np.testing.assert_allclose(path.at(2.0), [-0.75, 0.2])  # halfway from -0.5 to -1.0
    np.testing.assert_allclose(path.at(3.0), [-0.525, 0.2])  # halfway from there to -0.3
    assert path.end == pytest.approx(4.0)


def test_a_trajectory_with_a_stamp_in_the_future_begins_then_and_joints_may_stand_in_any_order(
    motion: Callable[..., Any],
) -> None:
    late = trajectory(
        (0.0, [0.1, -0.1]), (1.0, [0.2, -0.3]), joints="servo_1 servo_0", stamp=1e-9 * START + 2.0
    )
    path = motion((0.0, trajectory((0.0, [-0.1, 0.1]))), (1.0, late), (4.0, trajectory((0.0, [-0.3, 0.2]))))
    np.testing.assert_allclose(path.at(2.5), [-0.2, 0.15])
    np.testing.assert_allclose(path.at(3.5), [-0.3, 0.2])


def test_a_trajectory_of_one_pose_can_be_played(motion: Callable[..., Any]) -> None:
    path = motion((0.0, trajectory((0.0, [-0.4, 0.1]))))
    assert path.end > path.times[0]
    assert path.at(path.end).tolist() == [-0.4, 0.1]


def test_cables_and_chambers_are_followed_by_their_names(motion: Callable[..., Any]) -> None:
    message = trajectory(
        (0.0, [0.01, 0.0]), (1.0, [0.02, 0.0]), joints="left air", efforts=[[0.0, 5e3], [0.0, 9e3]]
    )
    path = motion((0.0, message))
    assert (path.servos, path.names) == (0, ("left", "air"))
    np.testing.assert_allclose(path.at(0.5), [0.015, 7e3])


@pytest.mark.parametrize(
    ("message", "named"),
    [
        (trajectory((0.0, [0.1])), ("1 positions", "servo_0, servo_1")),
        (trajectory((0.0, [0.1, np.nan])), ("finite", "servo_0, servo_1")),
        (trajectory(), ("no motion", TRAJECTORY)),
    ],
    ids=["too few", "nan", "empty"],
)
def test_a_trajectory_that_no_joint_can_follow_is_refused(
    motion: Callable[..., Any], message: bytes, named: tuple[str, ...]
) -> None:
    with raises_naming(RecordError, *named):
        motion((0.0, message))
