"""The recording thread: nothing is lost in silence, whatever the disk does."""

import errno
import os
import re
import threading
import time
from datetime import datetime
from pathlib import Path

import pytest

from tests.record.bags import STRING, cdr_string, read_with_rosbags
from tripod_record.errors import RecordError
from tripod_record.info import read_info
from tripod_record.place import check_place, free_space, recording_directory
from tripod_record.recorder import Progress, Recorder, State
from tripod_record.selection import is_selected, listening, patterns
from tripod_record.topic import Qos
from tripod_record.writer import BagWriter

DEADLINE = 20.0  # [s]


def until(recorder: Recorder, done, what: str) -> Progress:
    end = time.monotonic() + DEADLINE
    while time.monotonic() < end:
        progress = recorder.progress
        if done(progress):
            return progress
        time.sleep(0.01)
    raise AssertionError(f"{what} did not happen: {progress}")


def started(tmp_path: Path, **options) -> Recorder:
    recorder = Recorder(BagWriter(tmp_path / "bag"), **options)
    recorder.add_topic(STRING)
    return recorder


def test_what_several_threads_offer_is_recorded_in_the_order_of_its_stamps(tmp_path: Path) -> None:
    recorder = started(tmp_path, period=0.05)

    def offer(name: str) -> None:
        for i in range(500):
            assert recorder.offer("/chatter", cdr_string(f"{name} {i}"))

    threads = [threading.Thread(target=offer, args=(name,)) for name in "abc"]
    before = time.time_ns()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    ended = recorder.stop()
    assert (ended.state, ended.error, ended.messages, ended.dropped, ended.waiting) == (
        State.CLOSED,
        "",
        1500,
        0,
        0,
    )
    messages = read_with_rosbags(ended.path)["/chatter"]
    stamps = [stamp for stamp, _ in messages]
    assert stamps == sorted(stamps)
    assert before <= stamps[0] <= stamps[-1] <= time.time_ns()
    for name in "abc":
        mine = [data for _, data in messages if data[8:9] == name.encode()]
        assert mine == [cdr_string(f"{name} {i}") for i in range(500)]


def test_messages_reach_the_disk_within_the_period(tmp_path: Path) -> None:
    recorder = started(tmp_path, period=0.1)
    recorder.offer("/chatter", cdr_string("first"))
    progress = until(recorder, lambda p: p.messages == 1, "a sync")
    assert read_with_rosbags(progress.path)["/chatter"][0][1] == cdr_string("first")
    recorder.stop()


def test_nothing_is_taken_after_the_end(tmp_path: Path) -> None:
    recorder = started(tmp_path)
    recorder.stop()
    assert not recorder.offer("/chatter", cdr_string("late"))
    assert recorder.stop().messages == 0


class StuckWriter(BagWriter):
    """A disk that does not answer until `free` is set."""

    free = threading.Event()
    stuck = threading.Event()

    def sync(self) -> None:
        if self.messages:
            self.stuck.set()
            assert self.free.wait(DEADLINE)
        super().sync()


@pytest.fixture
def stuck(tmp_path: Path):
    StuckWriter.free.clear()
    StuckWriter.stuck.clear()
    yield StuckWriter(tmp_path / "bag")
    StuckWriter.free.set()


def test_a_slow_disk_drops_and_counts(stuck: StuckWriter) -> None:
    recorder = Recorder(stuck, period=0.01, queue_size=10_000)
    recorder.add_topic(STRING)
    assert recorder.offer("/chatter", cdr_string("one"))
    assert stuck.stuck.wait(DEADLINE)
    taken = sum(recorder.offer("/chatter", bytes(1000)) for _ in range(25))
    assert taken == 10  # a thousand each, ten thousand may wait
    assert recorder.progress.dropped == 15
    assert recorder.progress.waiting == 10_000
    stuck.free.set()
    until(recorder, lambda p: p.messages == 11, "the disk's return")
    assert recorder.offer("/chatter", bytes(1000))
    ended = recorder.stop()
    assert (ended.state, ended.messages, ended.dropped) == (State.CLOSED, 12, 15)


def test_a_queue_that_fills_is_written_before_its_period(tmp_path: Path) -> None:
    recorder = started(tmp_path, period=1000.0, queue_size=10_000)
    for _ in range(6):
        assert recorder.offer("/chatter", bytes(1000))
    until(recorder, lambda p: p.messages == 6, "writing")
    recorder.stop()


def test_a_stuck_disk_does_not_hold_the_node(stuck: StuckWriter) -> None:
    recorder = Recorder(stuck, period=0.01)
    recorder.add_topic(STRING)
    recorder.offer("/chatter", cdr_string("one"))
    assert stuck.stuck.wait(DEADLINE)
    ended = recorder.stop(timeout=0.1)
    assert (ended.state, ended.error) == (State.FAILED, f"{stuck.path}: the disk does not answer")


class FailingWriter(BagWriter):
    """A disk that fails at the third sync with messages."""

    error: Exception
    turns = 0

    def sync(self) -> None:
        self.turns += self.messages > self.kept
        if self.turns == 3:
            raise self.error
        super().sync()


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), "No space left on device"),
        (OSError(errno.EIO, os.strerror(errno.EIO)), "Input/output error"),
        (ZeroDivisionError("a bug"), "a bug"),
    ],
)
def test_a_failing_disk_ends_the_recording_and_keeps_what_is_written(
    tmp_path: Path, error: Exception, reason: str
) -> None:
    FailingWriter.error = error
    recorder = Recorder(FailingWriter(tmp_path / "bag"), period=0.01)
    recorder.add_topic(STRING)
    for i in range(2):
        assert recorder.offer("/chatter", cdr_string(f"message {i}"))
        until(recorder, lambda p, n=i + 1: p.messages == n, "a sync")
    recorder.offer("/chatter", cdr_string("lost"))
    failed = until(recorder, lambda p: p.state is State.FAILED, "the failure")
    assert failed.error == f"{failed.path}: {reason}; 2 messages are kept"
    assert not recorder.offer("/chatter", cdr_string("refused"))
    assert recorder.stop() == failed
    assert [data for _, data in read_with_rosbags(failed.path)["/chatter"]] == [
        cdr_string("message 0"),
        cdr_string("message 1"),
    ]


def test_a_disk_that_is_nearly_full_ends_the_recording_with_a_whole_file(tmp_path: Path) -> None:
    left = [50_000_000]
    recorder = started(tmp_path, period=0.01, low_space=10_000_000, free=lambda _: left[0])
    recorder.offer("/chatter", cdr_string("one"))
    until(recorder, lambda p: p.messages == 1, "a sync")
    left[0] = 9_900_000
    failed = until(recorder, lambda p: p.state is State.FAILED, "the end")
    assert failed.error == f"{failed.path}: the disk is full: 9.9 MB are left; 1 messages are kept"
    info = read_info(failed.path)
    assert (info.messages, info.truncated, info.damage) == (1, "", ())


# places ----------------------------------------------------------------------------------------------------


def test_a_place_that_will_do_is_made(tmp_path: Path) -> None:
    check_place(tmp_path / "a" / "b", 1000)
    assert list((tmp_path / "a" / "b").iterdir()) == []


def test_a_place_that_will_not_do_is_named_with_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    advice = "choose another directory, or make this one writable"
    for directory, reason in (
        (tmp_path / "file", "File exists"),
        (tmp_path / "file" / "in", "Not a directory"),
        (Path("/proc/self"), "No such file or directory"),
        (Path("/proc/none"), "No such file or directory"),
    ):
        with pytest.raises(RecordError, match=f"^cannot record into {directory}: {reason}; {advice}$"):
            check_place(directory, 0)


def test_too_little_space_is_told_in_megabytes(tmp_path: Path) -> None:
    with pytest.raises(RecordError) as raised:
        check_place(tmp_path, 10**18)
    found = re.fullmatch(
        rf"cannot record into {tmp_path}: ([\d.]+) MB are free, 1000000000000\.0 MB are needed; "
        "delete something or choose another directory",
        str(raised.value),
    )
    assert found is not None
    assert float(found[1]) == pytest.approx(free_space(tmp_path) / 1e6, rel=0.1)


def test_names_of_recordings(tmp_path: Path) -> None:
    now = datetime(2026, 1, 2, 3, 4, 5)
    assert recording_directory(tmp_path, "", now) == tmp_path / "tripod_2026-01-02_03-04-05"
    for expected in ("run", "run_2", "run_3"):
        path = recording_directory(tmp_path, "run", now)
        assert path == tmp_path / expected
        path.mkdir()
    for name in (".", "..", "a/b", "a\n", "/"):
        with pytest.raises(RecordError, match=r"recording name .* is not allowed"):
            recording_directory(tmp_path, name, now)


# what is listened to ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("topic", "namespace", "wanted", "unwanted", "selected"),
    [
        ("/sim/status", "/", (), (), True),
        ("/rosout", "/", (), ("/rosout", "/parameter_events"), False),
        ("/rosout", "/", ("/rosout",), ("/rosout", "/parameter_events"), True),
        ("/_hidden", "/", (), (), False),
        ("/sim/_action/status", "/", (), (), False),
        ("/_hidden", "/", ("/_hidden",), (), True),
        ("/one/sim/status", "/one", (), (), True),
        ("/two/sim/status", "/one", (), (), False),
        ("/onetwo", "/one", (), (), False),
        ("/diagnostics", "/one", (), (), True),
        ("/tf", "/one", (), (), True),
        ("/sim/status", "/", ("/sim/*",), (), True),
        ("/ik/status", "/", ("/sim/*",), (), False),
        ("/diagnostics", "/", ("/sim/*",), (), False),
        ("/sim/status", "/", ("/sim/*",), ("/sim/st*",), False),
    ],
)
def test_which_topics_are_recorded(topic: str, namespace: str, wanted, unwanted, selected: bool) -> None:
    assert is_selected(topic, namespace, wanted, unwanted) is selected


def test_patterns_are_relative_to_the_namespace() -> None:
    assert patterns("sim/*, /tf  status", "/one") == ("/one/sim/*", "/tf", "/one/status")
    assert patterns("sim/*", "/") == ("/sim/*",)
    assert patterns(" , ", "/") == ()


@pytest.mark.parametrize(
    ("offered", "expected"),
    [
        ([Qos()], (True, False)),
        ([Qos(durability="transient_local")], (True, True)),
        ([Qos(reliability="best_effort")], (False, False)),
        ([Qos(), Qos(reliability="best_effort")], (False, False)),
        ([Qos(durability="transient_local"), Qos()], (True, False)),
        ([Qos(reliability="unknown")], (False, False)),
        ([], (False, False)),
    ],
)
def test_listening_asks_for_what_all_can_give(offered: list[Qos], expected: tuple[bool, bool]) -> None:
    assert listening(offered) == expected
