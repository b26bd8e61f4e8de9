"""Recordings of several files, and what is attached to them, as independent readers see them."""

import json
import random
import time
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader as RosbagsReader

from tests.record.bags import START, cdr_string, new_bag, read_with_rosbags, string_of, write_some
from tripod_record import recorder as recorder_module
from tripod_record import versions
from tripod_record.bag import Bag
from tripod_record.info import info_text, read_info
from tripod_record.recorder import Recorder
from tripod_record.writer import BagWriter


def attachments(path: Path) -> dict[str, str]:
    with path.open("rb") as file:
        return {a.name: a.data.decode() for a in make_reader(file, validate_crcs=True).iter_attachments()}


def split_bag(directory: Path) -> BagWriter:
    """Return a bag with 30, 20 and 10 messages on /chatter in three files; the last is not closed yet."""
    writer = new_bag(directory)
    write_some(writer, 30)
    writer.split()
    write_some(writer, 20, first=30)
    writer.split()
    write_some(writer, 10, first=50)
    return writer


def test_a_split_recording_is_one_for_every_reader(tmp_path: Path) -> None:
    writer = split_bag(tmp_path / "bag")
    assert writer.messages == 66
    writer.close()
    assert writer.kept == 66
    names = [f"bag_{i}.mcap" for i in range(3)]
    assert sorted(p.name for p in (tmp_path / "bag").glob("*.mcap")) == names
    found = read_with_rosbags(tmp_path / "bag")
    assert [string_of(data) for _, data in found["/chatter"]] == [f"message {i}" for i in range(60)]
    with RosbagsReader(tmp_path / "bag") as reader:
        assert reader.message_count == 66
        assert {t.msgcount for t in reader.topics.values()} == {60, 6}
    about = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (about["version"], about["relative_file_paths"]) == (9, names)
    files = about["files"]
    assert [f["message_count"] for f in files] == [33, 22, 11]
    assert [f["starting_time"]["nanoseconds_since_epoch"] - START for f in files] == [
        0,
        30 * 10**7,
        50 * 10**7,
    ]
    for name, count in zip(names, (33, 22, 11), strict=True):  # each is a whole file by itself
        with (tmp_path / "bag" / name).open("rb") as file:
            assert sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages()) == count
    info = read_info(tmp_path / "bag", check=True)
    assert (info.messages, info.damage, info.truncated) == (66, (), "")
    assert [h.topic for h in Bag(tmp_path / "bag").messages()].count("/chatter") == 60


def test_a_file_without_messages_is_not_left_behind(tmp_path: Path) -> None:
    writer = new_bag(tmp_path / "bag")
    writer.split()
    write_some(writer, 1)
    writer.split()
    writer.split()
    writer.close()
    assert len(list((tmp_path / "bag").glob("*.mcap"))) == 2


def test_what_is_attached_is_in_every_file_the_newest_last(tmp_path: Path) -> None:
    writer = new_bag(tmp_path / "bag")
    writer.attach("scene.toml", b"a = 1\n", START)
    write_some(writer, 5)
    writer.attach("scene.toml", b"a = 2\n", START)
    writer.attach("versions.json", b"{}", START)
    writer.split()
    write_some(writer, 5, first=5)
    writer.attach("versions.json", b"{}", START)  # nothing new
    writer.close()
    for name in ("bag_0.mcap", "bag_1.mcap"):
        assert attachments(tmp_path / "bag" / name) == {"scene.toml": "a = 2\n", "versions.json": "{}"}
    with (tmp_path / "bag" / "bag_1.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert len(summary.attachment_indexes) == summary.statistics.attachment_count == 2
    for check in (False, True):
        assert "attached   scene.toml, versions.json\n" in info_text(read_info(tmp_path / "bag", check=check))


def test_a_split_recording_whose_directory_is_harmed_goes_on_with_what_is_left(tmp_path: Path) -> None:
    writer = split_bag(tmp_path / "bag")
    writer.sync()
    (tmp_path / "bag" / "bag_0.mcap").unlink()
    writer.path.unlink()
    assert writer.rescue(tmp_path / "again") == 33
    assert (writer.messages, writer.kept) == (33, 33)
    write_some(writer, 10, first=60)
    writer.close()
    found = read_with_rosbags(tmp_path / "again")
    assert [string_of(data) for _, data in found["/chatter"]] == [f"message {i}" for i in range(30, 70)]


def recorder_of(directory: Path, **options) -> Recorder:
    return Recorder(new_bag(directory), period=0.02, **options)


@pytest.mark.parametrize("options", [{"max_size": 20_000}, {"max_duration": 1.0}])
def test_a_recorder_goes_on_in_a_new_file_when_one_is_full(tmp_path: Path, options: dict) -> None:
    at = iter(range(START, START + 10**12, 10**7))  # 10 ms a message
    recorder = recorder_of(tmp_path / "bag", stamp=lambda: next(at), **options)
    for i in range(500):
        assert recorder.offer("/chatter", cdr_string(random.Random(i).randbytes(100).hex()))
        if i % 20 == 19:
            wanted, end = i + 1, time.monotonic() + 60.0
            while recorder.progress.messages < wanted:
                assert time.monotonic() < end
                time.sleep(0.002)
    assert recorder.stop().is_whole
    found = read_with_rosbags(tmp_path / "bag")
    assert len(found["/chatter"]) == 500
    assert len(list((tmp_path / "bag").glob("*.mcap"))) in (4, 5, 6)


def test_a_recorder_splits_and_attaches_when_it_is_asked_to(tmp_path: Path) -> None:
    recorder = recorder_of(tmp_path / "bag")
    recorder.attach("a.txt", b"A")
    recorder.offer("/chatter", cdr_string("one"))
    assert recorder.split(60.0)
    assert recorder.progress.path.name == "bag_1.mcap"
    recorder.offer("/chatter", cdr_string("two"))
    recorder.stop()
    assert not recorder.split(0.1)
    texts = [string_of(data) for _, data in read_with_rosbags(tmp_path / "bag")["/chatter"]]
    assert texts == ["one", "two"]
    assert attachments(tmp_path / "bag" / "bag_1.mcap") == {"a.txt": "A"}
    assert recorder_module.State.CLOSED is recorder.progress.state


def test_versions_name_the_revision_of_a_checkout_and_nothing_of_none(tmp_path: Path) -> None:
    found = json.loads(versions.versions_json())
    assert found["numpy"]
    assert found["python"]
    assert versions.git_revision(tmp_path / "nowhere") == ""
    assert versions.git_revision().removesuffix("-dirty") == found["git"].removesuffix("-dirty")
