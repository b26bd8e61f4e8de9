"""A recording, judged by the independent readers rosbags and mcap: contents, order, a kill at any moment."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import mcap.reader
import pytest
import yaml
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader as RosbagsReader

from tests.messages import raises_naming
from tests.record.bags import START, STRING, cdr_string, new_bag, read_with_rosbags, write_some
from tripod_record.append_file import TAIL
from tripod_record.errors import RecordError
from tripod_record.topic import Topic
from tripod_record.writer import BagWriter


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_rosbags_reads_what_was_written(tmp_path: Path, compression: str) -> None:
    writer = new_bag(tmp_path / "bag", compression=compression, chunk_size=1000)
    write_some(writer, 250)
    writer.close()
    assert (writer.messages, writer.kept) == (275, 275)
    for path in (tmp_path / "bag", writer.path):
        found = read_with_rosbags(path)
        assert {topic: len(messages) for topic, messages in found.items()} == {"/chatter": 250, "/mesh": 25}
        assert found["/chatter"] == [(START + i * 10**7, cdr_string(f"message {i}")) for i in range(250)]


def test_metadata_says_what_is_in_the_file(tmp_path: Path) -> None:
    writer = new_bag(tmp_path / "bag")
    write_some(writer, 101)
    writer.close()
    with RosbagsReader(tmp_path / "bag") as bag, RosbagsReader(writer.path) as file:
        for reader in (bag, file):
            assert (reader.start_time, reader.duration - 1) == (START, 100 * 10**7)
            assert reader.message_count == 112
            assert {c.topic: (c.msgtype, c.msgcount) for c in reader.connections} == {
                "/chatter": ("std_msgs/msg/String", 101),
                "/mesh": ("std_msgs/msg/String", 11),
            }
            offered = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}
            assert [q.reliability.name for q in offered["/mesh"]] == ["RELIABLE", "BEST_EFFORT"]
            assert [q.durability.name for q in offered["/mesh"]] == ["TRANSIENT_LOCAL", "VOLATILE"]
        assert {c.topic: c.digest for c in bag.connections} == {"/chatter": STRING.type_hash, "/mesh": ""}
    text = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (text["version"], text["storage_identifier"], text["ros_distro"]) == (9, "mcap", "jazzy")
    assert text["relative_file_paths"] == ["bag_0.mcap"]
    assert text["files"][0]["message_count"] == text["message_count"] == 112
    with writer.path.open("rb") as stream:
        records = list(mcap.reader.make_reader(stream).iter_metadata())
    assert [r.name for r in records] == ["rosbag2", "rosbag2"]  # at start and end, as rosbag2 does
    assert yaml.safe_load(records[-1].metadata["serialized_metadata"]) == text


def test_mcap_reads_profile_schemas_and_channels(tmp_path: Path) -> None:
    writer = new_bag(tmp_path / "bag")
    write_some(writer, 30)
    writer.close()
    with writer.path.open("rb") as stream:
        reader = mcap.reader.make_reader(stream, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        assert {(s.name, s.encoding, s.data) for s in summary.schemas.values()} == {
            ("std_msgs/msg/String", "ros2msg", b"string data\n")
        }
        assert len(summary.schemas) == 1  # one for both topics
        assert {(c.topic, c.message_encoding) for c in summary.channels.values()} == {
            ("/chatter", "cdr"),
            ("/mesh", "cdr"),
        }
        assert {c.topic: c.metadata["topic_type_hash"] for c in summary.channels.values()} == {
            "/chatter": STRING.type_hash,
            "/mesh": "",
        }
        qos = {c.topic: yaml.safe_load(c.metadata["offered_qos_profiles"]) for c in summary.channels.values()}
        assert qos["/chatter"][0]["liveliness_lease_duration"] == {"sec": 9223372036, "nsec": 854775807}
        assert all(sum(i.message_index_offsets.values()) > 0 for i in summary.chunk_indexes)
        decoded = [
            (m.log_time, m.sequence, d.data) for _, c, m, d in reader.iter_decoded_messages("/chatter")
        ]
    assert decoded == [(START + i * 10**7, i, f"message {i}") for i in range(30)]


def test_stamps_never_fall(tmp_path: Path) -> None:
    writer = new_bag(tmp_path / "bag")
    for stamp in (5, 3, 9, 1, 9, 10):
        writer.write("/chatter", cdr_string(""), START + stamp)
    writer.close()
    assert [s - START for s, _ in read_with_rosbags(writer.path)["/chatter"]] == [5, 5, 9, 9, 9, 10]


def test_a_message_larger_than_a_chunk_is_kept(tmp_path: Path) -> None:
    writer = new_bag(tmp_path / "bag", chunk_size=100)
    big = cdr_string("x" * 3_000_000)
    writer.write("/chatter", big, START)
    writer.close()
    assert read_with_rosbags(writer.path)["/chatter"] == [(START, big)]


def test_a_recording_without_messages_is_a_valid_file(tmp_path: Path) -> None:
    writer = new_bag(tmp_path / "bag")
    writer.close()
    for path in (tmp_path / "bag", writer.path):
        with RosbagsReader(path) as reader:
            assert reader.message_count == 0
            assert {c.topic for c in reader.connections} == {"/chatter", "/mesh"}


# what is on the disk before the end ------------------------------------------------------------------------


def test_after_each_sync_any_reader_reads_all_of_it(tmp_path: Path) -> None:
    writer = new_bag(tmp_path / "bag")
    for turn in range(4):
        write_some(writer, 20, first=20 * turn)
        assert len(read_with_rosbags(writer.path).get("/chatter", [])) == 20 * turn  # not yet
        writer.sync()
        for path in (tmp_path / "bag", writer.path):
            assert len(read_with_rosbags(path)["/chatter"]) == 20 * (turn + 1)
        with writer.path.open("rb") as stream:
            messages = mcap.reader.make_reader(stream).iter_messages("/chatter", log_time_order=False)
            assert sum(1 for _ in messages) == 20 * (turn + 1)
        assert writer.path.read_bytes().endswith(TAIL)
    writer.close()
    assert writer.path.read_bytes().count(TAIL) == 0


def test_a_topic_that_comes_later_is_in_the_metadata_after_the_next_sync(tmp_path: Path) -> None:
    writer = new_bag(tmp_path / "bag")
    writer.sync()
    writer.add_topic(Topic("/late", "std_msgs/msg/String", "string data\n"))
    writer.write("/late", cdr_string("here"), START)
    writer.sync()
    assert read_with_rosbags(tmp_path / "bag") == {"/late": [(START, cdr_string("here"))]}


KILLED = """
import sys, time
from pathlib import Path
from tests.record.bags import new_bag, cdr_string
from tripod_record.recorder import Recorder
from tests.record.bags import STRING
from tripod_record.writer import BagWriter

recorder = Recorder(BagWriter(Path(sys.argv[1])), period=0.2)
recorder.add_topic(STRING)
i = 0
while True:
    now = time.time_ns()
    recorder.offer("/chatter", cdr_string(f"message {i}"), sequence=i)
    i += 1
    print(now, recorder.progress.messages, flush=True)
    time.sleep(0.005)
"""


def test_kill_9_loses_nothing_that_was_synced(tmp_path: Path) -> None:
    """That is all but what came within the last period, and the time that the disk takes: see test_recorder.py."""
    path = tmp_path / "bag"
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(path)],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    sent = []
    while not sent or sent[-1][1] < 200:
        sent.append(tuple(map(int, process.stdout.readline().split())))
    process.kill()
    sent += [tuple(map(int, line.split())) for line in process.stdout.read().splitlines()]
    assert process.wait() == -signal.SIGKILL
    began, synced = sent[0][0], sent[-1][1]
    for place in (path, path / "bag_0.mcap"):
        messages = read_with_rosbags(place)["/chatter"]  # a strict reader, without any repair
        assert [data for _, data in messages] == [cdr_string(f"message {i}") for i in range(len(messages))]
        assert synced <= len(messages) <= len(sent) + 1
        assert began <= messages[0][0] <= time.time_ns()  # stamps are of this century


# refusals and full disks -----------------------------------------------------------------------------------


def test_what_cannot_be_created_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    remedy = "choose another directory"
    with raises_naming(RecordError, tmp_path / "file" / "bag", os.strerror(errno.ENOTDIR), remedy):
        BagWriter(tmp_path / "file" / "bag")
    (tmp_path / "taken").mkdir()
    with raises_naming(RecordError, tmp_path / "taken", os.strerror(errno.EEXIST), remedy):
        BagWriter(tmp_path / "taken")
    with raises_naming(RecordError, "compression", "'rar'", "none, lz4, zstd"):
        BagWriter(tmp_path / "bag", compression="rar")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "taken"]


def test_a_topic_of_two_types_is_refused(tmp_path: Path) -> None:
    writer = new_bag(tmp_path / "bag")
    writer.add_topic(STRING)  # again: nothing happens
    with raises_naming(RecordError, "/chatter", "std_msgs/msg/String", "std_msgs/msg/Bool"):
        writer.add_topic(Topic("/chatter", "std_msgs/msg/Bool", "bool data\n"))
    writer.close()


FULL = """
import resource, sys
from pathlib import Path
from tests.record.bags import new_bag, write_some

writer = new_bag(Path(sys.argv[1]), compression="none")
write_some(writer, 500)
writer.sync()
kept = writer.kept
size = writer.path.stat().st_size
resource.setrlimit(resource.RLIMIT_FSIZE, (size + 4000, size + 4000))
for turn in range(1, 1000):
    write_some(writer, 20, first=500 * turn)
    try:
        writer.sync() if sys.argv[2] == "sync" else writer.close()
    except OSError as error:
        writer.abandon()
        print(error.strerror, kept, writer.kept, writer.messages)
        break
    kept = writer.kept
"""


@pytest.mark.parametrize("when", ["sync", "close"])
def test_a_full_disk_keeps_all_that_was_synced(tmp_path: Path, when: str) -> None:
    command = [sys.executable, "-c", FULL, str(tmp_path / "bag"), when]
    root = Path(__file__).parents[2]
    out = subprocess.run(command, cwd=root, check=True, capture_output=True, text=True, env=os.environ).stdout
    before, kept, given = map(int, out.split()[-3:])
    assert out.startswith(os.strerror(errno.EFBIG))
    assert before >= 550
    assert kept == (before if when == "sync" else given)  # close begins with a sync, that one had room
    for path in (tmp_path / "bag", tmp_path / "bag" / "bag_0.mcap"):
        assert sum(map(len, read_with_rosbags(path).values())) == kept
    text = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())
    assert text["rosbag2_bagfile_information"]["message_count"] == kept
