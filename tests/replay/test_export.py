"""Recordings as numbers, curves and a page: what independent readers of these formats find in them."""

import csv
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet
from rosbags.typesys import Stores, get_typestore
from typer.testing import CliRunner

from tests.messages import assert_names, line_naming, raises_naming
from tests.replay.sessions import run_session, write_session
from tripod_bringup.bag_export import export_command, html_command, plot_command
from tripod_bringup.bag_plot import panels
from tripod_bringup.cli import app
from tripod_graph.names import COMMANDS, SCENE
from tripod_record.bag import Bag
from tripod_record.errors import RecordError
from tripod_record.table import read_series, table
from tripod_record.topic import Qos, Topic
from tripod_record.writer import BagWriter

START = 1_700_000_000_000_000_000  # [ns]
STORE = get_typestore(Stores.ROS2_JAZZY)
JOINTS, POSE = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseStamped"


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Joint states at 0.00, 0.02, ... 0.08 s, and poses at 0.05 and 0.07 s."""
    writer = BagWriter(tmp_path_factory.mktemp("bags") / "bag")
    for topic, kind in (("/sim/joint_states", JOINTS), ("/left/sim/effector_pose", POSE)):
        writer.add_topic(Topic(topic, kind, STORE.generate_msgdef(kind, ros_version=2)[0], (Qos(),)))
    T = STORE.types
    header = T["std_msgs/msg/Header"](
        stamp=T["builtin_interfaces/msg/Time"](sec=1, nanosec=2), frame_id="world"
    )
    said = []
    for k in range(5):
        message = T[JOINTS](
            header=header, name=["servo_0", "servo_1"], position=np.array([0.1 * k, -0.1 * k]),
            velocity=np.array([]), effort=np.array([float(k)]),
        )  # fmt: skip
        said.append((20 * k, "/sim/joint_states", JOINTS, message))
    for k in (50, 70):
        point = T["geometry_msgs/msg/Point"](x=0.001 * k, y=0.0, z=-0.01)
        pose = T["geometry_msgs/msg/Pose"](
            position=point, orientation=T["geometry_msgs/msg/Quaternion"](0, 0, 0, 1)
        )
        said.append((k, "/left/sim/effector_pose", POSE, T[POSE](header=header, pose=pose)))
    for at, topic, kind, message in sorted(said, key=lambda one: one[0]):
        writer.write(topic, bytes(STORE.serialize_cdr(message, kind)), START + at * 10**6)
        writer.sync()  # a chunk each
    writer.close()
    return writer.directory


def test_a_table_has_the_newest_values_at_the_times_of_all_messages(bag: Path) -> None:
    columns = table(read_series(Bag(bag)))
    np.testing.assert_allclose(columns["time"], [0.0, 0.02, 0.04, 0.05, 0.06, 0.07, 0.08])
    np.testing.assert_allclose(
        columns["sim/joint_states.position.servo_1"], [0, -0.1, -0.2, -0.2, -0.3, -0.3, -0.4]
    )
    np.testing.assert_allclose(columns["sim/joint_states.effort.0"], [0, 1, 2, 2, 3, 3, 4])
    nan = np.nan
    x = [nan, nan, nan, 0.05, 0.05, 0.07, 0.07]
    np.testing.assert_allclose(columns["left/sim/effector_pose.pose.position.x"], x)
    assert not [name for name in columns if "stamp" in name or "frame" in name]


def test_csv_npz_and_parquet_hold_the_same_numbers(bag: Path, tmp_path: Path) -> None:
    columns = table(read_series(Bag(bag)))
    for name in ("table.csv", "table.parquet", "topics.npz"):
        assert export_command(bag, tmp_path / name, "") == 0
    with (tmp_path / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    read = parquet.read_table(tmp_path / "table.parquet")
    assert list(rows[0]) == read.column_names == list(columns)
    for name, values in columns.items():
        np.testing.assert_array_equal([float(row[name] or "nan") for row in rows], values)
        np.testing.assert_array_equal(read[name].to_numpy(), values)
    with np.load(tmp_path / "topics.npz", allow_pickle=False) as arrays:
        np.testing.assert_allclose(arrays["left/sim/effector_pose/time"], [0.05, 0.07])
        np.testing.assert_allclose(arrays["sim/joint_states/position.servo_0"], 0.1 * np.arange(5))


def test_only_the_topics_that_are_asked_for_are_written(bag: Path, tmp_path: Path) -> None:
    assert export_command(bag, tmp_path / "left.csv", "/left/*") == 0
    assert len((tmp_path / "left.csv").read_text().splitlines()) == 3


def test_topics_may_be_asked_for_one_by_one(bag: Path, tmp_path: Path) -> None:
    out = tmp_path / "both.npz"
    words = ["bag", "export", str(bag), str(out), "--topics", "/left/*", "--topics", "sim/joint_states"]
    assert CliRunner().invoke(app, words).exit_code == 0
    with np.load(out) as written:
        assert {"left/sim/effector_pose/time", "sim/joint_states/time"} <= set(written)


def test_curves_are_drawn_of_what_there_is(bag: Path, tmp_path: Path) -> None:
    shown = panels(read_series(Bag(bag)))
    assert [(title.partition(":")[0], len(curves)) for title, _, curves in shown] == [
        ("servo angles", 2),
        ("effector", 3),
    ]
    assert plot_command(bag, tmp_path / "curves.png") == 0
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")


def written(path: Path, definition: str, *messages: bytes) -> Bag:
    """Return a recording of /sim/status with that definition, a message each 10 ms."""
    writer = BagWriter(path)
    writer.add_topic(Topic("/sim/status", "tripod_msgs/msg/SimStatus", definition, (Qos(),)))
    for k, message in enumerate(messages):
        writer.write("/sim/status", b"\0\1\0\0" + message, START + k * 10**7)
    writer.close()
    return Bag(path)


def test_errors_of_steps_and_mesh_are_drawn_where_the_recording_has_them(tmp_path: Path) -> None:
    old = written(tmp_path / "old", "float64 effector_time_error\n", struct.pack("<d", 3e-5))
    new = written(
        tmp_path / "new",
        "float64 effector_time_error -1\nfloat64 effector_mesh_error -1  # [m]\n",
        *(struct.pack("<dd", -1, error) for error in (9e-5, -1)),
    )
    for bag, names in ((old, ["effector_time_error"]), (new, ["effector_time_error", "effector_mesh_error"])):
        ((title, _, curves),) = panels(read_series(bag))
        assert title.startswith("errors")
        assert [curve[1] for curve in curves] == names
    assert read_series(new)["/sim/status"].values["effector_mesh_error"].tolist() == [9e-5, -1]


def test_constants_and_stamps_are_no_columns(tmp_path: Path) -> None:
    line, parts = "=" * 80 + "\n", []
    parts.append("uint8 IDLE=0\nuint8 state\ntripod_msgs/Authority authority\n")
    parts.append("MSG: tripod_msgs/Authority\nuint8 STOP=0\nuint8 mode\nbuiltin_interfaces/Time stamp\n")
    parts.append("MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n")
    bag = written(tmp_path / "bag", line.join(parts), struct.pack("<BBxxiI", 3, 1, 7, 8))
    values = read_series(bag)["/sim/status"].values
    assert {name: v.tolist() for name, v in values.items()} == {"state": [3], "authority.mode": [1]}


def test_a_message_that_ends_with_an_empty_sequence_is_read_as_rclpy_pads_it(tmp_path: Path) -> None:
    """Of a scene without servos `sim/status` ends so."""
    said = struct.pack("<dI", 0.5, 0)
    for name, data in (("as it is", said), ("padded", said + b"\x7e\x2e\xb8\0")):
        bag = written(tmp_path / name.replace(" ", "_"), "float64 time\nfloat64[] upper\n", data)
        assert {k: v.tolist() for k, v in read_series(bag)["/sim/status"].values.items()} == {"time": [0.5]}
    bag = written(tmp_path / "torn", "float64 time\nfloat64[] upper\n", said[:-2])
    with raises_naming(RecordError, "message", "/sim/status"):
        read_series(bag)


def test_a_page_is_made_of_the_session_simulated_again(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    found = run_session("tripod", ("mesh.level=1",), steps=40, seed=6, reset_at=20)
    path, page = write_session(found, tmp_path / "session"), tmp_path / "session.html"
    assert html_command(path, page, "") == 0
    text = page.read_text()
    assert text.startswith("<!doctype html>")
    assert "http://" not in text.replace("http://www.w3.org", "")
    assert "servo torques" in text
    for snapshot in found.bodies:
        snapshot.positions[:] += 1e-9
    other = write_session(found, tmp_path / "other")
    assert html_command(other, tmp_path / "other.html", "") == 1
    line_naming(capfd.readouterr().err, "tripod bag html: ", "recorded", "step 7")


def test_the_page_of_a_recording_with_several_segments_shows_the_longest_or_the_one_that_is_named(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    first = run_session("pendulum", (), steps=40, seed=1)
    second = run_session("pendulum", ("springs.nodes=8",), steps=60, seed=1)
    bag = write_session(first, tmp_path / "bag", then=(second,))
    assert html_command(bag, tmp_path / "a.html", "") == 0
    line_naming(capfd.readouterr().err, "segment 2", "60 steps", "springs.nodes = 8", 2, "--segment")
    assert html_command(bag, tmp_path / "b.html", "", 1) == 0
    assert not capfd.readouterr().err


def test_numbers_of_a_segment_are_those_between_its_restart_and_the_next(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    first, second = (run_session("pendulum", (), steps=45, seed=1, every=10) for _ in range(2))
    bag = write_session(first, tmp_path / "bag", then=(second,))
    counts = []
    for number in (None, 1, 2):
        assert export_command(bag, tmp_path / "a.npz", "/sim/body_state", number) == 0
        counts.append(len(np.load(tmp_path / "a.npz")["sim/body_state/step"]))
    assert counts == [8, 4, 4]
    assert export_command(bag, tmp_path / "a.npz", "", 3) == 2
    assert_names(capfd.readouterr().err, "no segment 3", 2)


@pytest.mark.parametrize(
    ("command", "out", "named"),
    [
        (export_command, "table.txt", ("table.txt", ".csv, .npz or .parquet")),
        (export_command, "gone/table.csv", ("gone/table.csv", "cannot be written")),
        (html_command, "page.htm", ("page.htm", "end in .html")),
        (html_command, "page.html", (SCENE, COMMANDS)),
    ],
)
def test_what_cannot_be_written_is_refused_in_one_line(
    bag: Path, command, out: str, named: tuple[str, ...], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert command(bag, tmp_path / out, "") == 2
    err = capfd.readouterr().err
    assert_names(err, *named)
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_recording_without_numbers_says_so(
    bag: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert export_command(bag, tmp_path / "table.csv", "/nothing") == 2
    assert_names(capfd.readouterr().err, "nothing to write", "topics")


@pytest.mark.parametrize("command", [export_command, lambda file, out, _: plot_command(file, out)])
def test_what_is_missing_in_a_damaged_recording_is_told(
    bag: Path, command, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (whole,) = bag.glob("*.mcap")
    data = bytearray(whole.read_bytes())
    file, out = (
        tmp_path / "bag.mcap",
        tmp_path / ("numbers.npz" if command is export_command else "curves.png"),
    )
    file.write_bytes(data)
    assert command(file, out, "") == 0
    assert not capfd.readouterr().err
    data[data.index(b"zstd", data.index(b"zstd") + 4) + 40] ^= 0xFF  # in the second chunk
    file.write_bytes(data)
    assert command(file, out, "") == 1
    err = capfd.readouterr().err
    assert_names(err, "left out", f"{file}: byte")
    assert err.count("\n") == 1


@pytest.mark.parametrize("command", [export_command, lambda file, out, _: plot_command(file, out)])
def test_a_recording_of_which_nothing_can_be_read_says_why_nothing_is_written(
    bag: Path, command, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (whole,) = bag.glob("*.mcap")
    data, at = bytearray(whole.read_bytes()), 0
    while (at := data.find(b"zstd", at) + 4) > 3:
        data[at + 40] ^= 0xFF
    file = tmp_path / "bag.mcap"
    file.write_bytes(data)
    assert command(file, tmp_path / ("table.csv" if command is export_command else "curves.png"), "") == 2
    err = capfd.readouterr().err
    assert_names(err, "left out", f"{file}: byte")
    assert err.count("\n") == 1


def test_a_page_of_a_recording_has_colours_and_forces(tmp_path: Path) -> None:
    found = run_session("tripod", ("mesh.level=1",), steps=30, seed=6)
    path, page = write_session(found, tmp_path / "session"), tmp_path / "session.html"
    words = ["bag", "html", str(path), str(page), "--colour"]
    assert CliRunner().invoke(app, [*words, "von_mises", "--forces"]).exit_code == 0
    text = page.read_text()
    stage = json.loads(text.partition('id="film" type="application/json">')[2].partition("</script>")[0])
    assert stage["colouring"]["name"] == "von Mises stress"
    assert [(arrows["name"], arrows["longest"] > 0) for arrows in stage["arrows"]] == [
        (name, True) for name in ("reaction", "reaction moment", "servo torque", "weight")
    ]
    for field, named in (("mesh_error", "[mesh_error]"), ("tension", "tension"), ("none", "von_mises")):
        result = CliRunner().invoke(app, [*words, field])
        assert result.exit_code == 2
        assert_names(result.output, field, named)
