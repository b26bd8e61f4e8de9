"""The recording thread: nothing is lost in silence, whatever the disk does."""

import dataclasses
import errno
import itertools
import os
import re
import shutil
import threading
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import mcap.reader
import pytest

from tests.memory import blocks_grown
from tests.messages import assert_names, names, raises_naming
from tests.record.bags import START, STRING, cdr_string, read_with_rosbags
from tripod_record import recorder as recorder_module
from tripod_record.errors import RecordError
from tripod_record.info import read_info
from tripod_record.place import check_place, free_space, recording_directory
from tripod_record.recorder import Progress, Recorder, State
from tripod_record.selection import is_selected, listening, patterns
from tripod_record.topic import Qos
from tripod_record.writer import BagWriter

DEADLINE = 60.0  # [s]


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


def test_messages_reach_the_disk_within_the_period(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float | None] = []

    class Condition(threading.Condition):
        def wait_for(self, predicate: Callable[[], object], timeout: float | None = None) -> object:
            waits.append(timeout)
            return super().wait_for(predicate, timeout)

    monkeypatch.setattr(recorder_module.threading, "Condition", Condition)
    recorder = started(tmp_path, period=0.1)
    recorder.offer("/chatter", cdr_string("first"))
    progress = until(recorder, lambda p: p.messages == 1, "a sync")
    assert read_with_rosbags(progress.path)["/chatter"][0][1] == cdr_string("first")
    recorder.stop()
    assert set(waits) == {0.1}  # the longest that it waits before it writes again


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
    assert recorder.progress.dropped_of == {"/chatter": 15}
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
    assert ended.state is State.FAILED
    assert_names(ended.error, stuck.path, "disk")


class WorkingWriter(BagWriter):
    """Takes long to close, as that of a long recording on a busy machine, and works all the time."""

    looks = 0

    def close(self) -> None:
        end = time.monotonic() + DEADLINE
        while self.looks < 10:
            assert time.monotonic() < end
            time.sleep(0.001)
        super().close()

    def processor_time(self, clock: int) -> float:
        """In place of `time.clock_gettime`: between two looks the thread has always worked."""
        self.looks += 1
        return CLOCK(clock) + self.looks


CLOCK = time.clock_gettime


def test_who_works_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = WorkingWriter(tmp_path / "bag")
    monkeypatch.setattr(recorder_module.time, "clock_gettime", writer.processor_time)
    recorder = Recorder(writer, period=0.01)
    recorder.add_topic(STRING)
    recorder.offer("/chatter", cdr_string("one"))
    ended = recorder.stop(timeout=3 * recorder_module.LOOK)
    assert (ended.state, ended.error, ended.messages) == (State.CLOSED, "", 1)
    assert writer.looks >= 10


class FailingWriter(BagWriter):
    """A disk that fails from the third sync with messages on, as long as there is an error."""

    error: Exception | None
    turns = 0

    def sync(self) -> None:
        self.turns += self.messages > self.kept
        if self.turns >= 3 and self.error is not None:
            raise self.error
        super().sync()


def failing(directory: Path, error: Exception, **options) -> tuple[FailingWriter, Recorder]:
    """Return a recorder with two messages on a disk that has failed at the third."""
    FailingWriter.error = error
    writer = FailingWriter(directory)
    recorder = Recorder(writer, period=0.01, **options)
    recorder.add_topic(STRING)
    for i in range(2):
        assert recorder.offer("/chatter", cdr_string(f"message {i}"))
        until(recorder, lambda p, n=i + 1: p.messages == n, "a sync")
    recorder.offer("/chatter", cdr_string("message 2"))
    until(recorder, lambda p: p.error, "the failure")
    return writer, recorder


DISK_ERRORS = [OSError(number, os.strerror(number)) for number in (errno.ENOSPC, errno.EIO, errno.EFBIG)]


@pytest.mark.parametrize("error", DISK_ERRORS, ids=str)
def test_what_a_full_disk_does_not_take_waits_for_room(tmp_path: Path, error: OSError) -> None:
    writer, recorder = failing(tmp_path / "bag", error)
    progress = recorder.progress
    assert (progress.state, progress.messages) == (State.RECORDING, 2)
    assert_names(progress.error, progress.path, "memory")
    assert error.strerror in progress.error
    for i in range(3, 10):
        assert recorder.offer("/chatter", cdr_string(f"message {i}"))
    assert [d for _, d in read_with_rosbags(progress.path)["/chatter"]] == [
        cdr_string(f"message {i}") for i in range(2)
    ]
    writer.error = None
    until(recorder, lambda p: p.messages == 10 and not p.error, "the recovery")
    ended = recorder.stop()
    assert (ended.state, ended.error, ended.is_whole) == (State.CLOSED, "", True)
    assert [d for _, d in read_with_rosbags(ended.path)["/chatter"]] == [
        cdr_string(f"message {i}") for i in range(10)
    ]


def test_a_disk_that_stays_full_drops_what_does_not_fit_into_memory(tmp_path: Path) -> None:
    writer, recorder = failing(tmp_path / "bag", DISK_ERRORS[0], queue_size=10_000)
    taken = sum(recorder.offer("/chatter", bytes(1000)) for _ in range(25))
    assert taken == 10
    writer.error = None
    until(recorder, lambda p: p.messages == 13, "the recovery")
    ended = recorder.stop()
    assert (ended.state, ended.messages, ended.dropped, ended.is_whole) == (State.CLOSED, 13, 15, False)


@pytest.mark.parametrize("error", [*DISK_ERRORS, ZeroDivisionError("a bug")], ids=str)
def test_a_disk_that_is_full_at_the_end_keeps_what_is_written_and_tells_the_number(
    tmp_path: Path, error: Exception
) -> None:
    if isinstance(error, OSError):
        _, recorder = failing(tmp_path / "bag", error)
        recorder.offer("/chatter", cdr_string("message 3"))
        reason, offered = error.strerror, 4
    else:
        FailingWriter.error = None
        writer = FailingWriter(tmp_path / "bag")
        recorder = Recorder(writer, period=0.01)
        recorder.add_topic(STRING)
        for i in range(2):
            recorder.offer("/chatter", cdr_string(f"message {i}"))
            until(recorder, lambda p, n=i + 1: p.messages == n, "a sync")
        writer.error = error
        recorder.offer("/chatter", cdr_string("message 2"))
        until(recorder, lambda p: p.state is State.FAILED, "the end")
        assert not recorder.offer("/chatter", cdr_string("refused"))
        reason, offered = "a bug", 3
    failed = recorder.stop()
    assert (failed.state, failed.is_whole) == (State.FAILED, False)
    assert_names(failed.error, failed.path, f"2 of {offered} messages")
    assert reason in failed.error
    assert [data for _, data in read_with_rosbags(failed.path)["/chatter"]] == [
        cdr_string("message 0"),
        cdr_string("message 1"),
    ]


def test_a_disk_that_is_nearly_full_keeps_its_last_room_for_the_end_of_the_recording(tmp_path: Path) -> None:
    left, looks = [50_000_000], list[Path]()

    def free(place: Path) -> int:
        looks.append(place)
        return left[0]

    recorder = started(tmp_path, period=0.01, low_space=10_000_000, free=free)
    recorder.offer("/chatter", cdr_string("one"))
    until(recorder, lambda p: p.messages == 1, "a sync")
    left[0] = 9_900_000
    low = until(recorder, lambda p: p.error, "a look at the room")
    assert_names(low.error, low.path, "full", "9.9 MB", "memory")
    recorder.offer("/chatter", cdr_string("two"))
    size, before = low.path.stat().st_size, len(looks)
    until(recorder, lambda _: len(looks) > before + 3, "more looks")
    assert low.path.stat().st_size == size
    ended = recorder.stop()
    info = read_info(ended.path)
    assert (ended.state, info.messages, info.truncated, info.damage) == (State.CLOSED, 2, "", ())


# other programs --------------------------------------------------------------------------------------------


def cut_to(share: float):
    def cut(path: Path) -> None:
        os.truncate(path, int(share * path.stat().st_size))

    return cut


def emptied(path: Path) -> None:
    """As long as before, its second half zeros: in one stroke, so that nobody sees it cut."""
    size = path.stat().st_size
    file = os.open(path, os.O_WRONLY)
    os.pwrite(file, bytes(size - size // 2), size // 2)
    os.close(file)


def appended(path: Path) -> None:
    """What was written stays as it was; an mcap file ends with its end mark, and does so no more."""
    with path.open("ab") as file:
        file.write(b"something else")


def replaced(path: Path) -> None:
    other = path.parent / "other"
    other.write_bytes(path.read_bytes()[:200])
    other.replace(path)


def overwritten(path: Path) -> None:
    path.write_bytes(b"something else, and longer than what was there" * 10_000)


def taken_away(levels: int):
    """At once, unlike `rm -r`, whose end a recorder that looks every hundredth of a second does not wait for."""

    def take_away(path: Path) -> None:
        away = path.parents[2] / "away"
        path.parents[levels].rename(away)
        shutil.rmtree(away)

    return take_away


def moved(path: Path) -> None:
    path.parent.rename(path.parent.parent / "elsewhere")


@pytest.mark.parametrize(
    ("harm", "what", "name", "lost"),
    [
        (Path.unlink, "deleted or moved", "bag_2", 0),
        (taken_away(0), "deleted or moved", "bag", 0),
        (taken_away(1), "deleted or moved", "bag", 0),
        (moved, "deleted or moved", "bag", 0),
        (replaced, "replaced", "bag_2", 0),
        (cut_to(0.99), "cut", "bag_2", 10),
        (cut_to(0.5), "cut", "bag_2", 100),
        (cut_to(0.0), "cut", "bag_2", 200),
        (emptied, "changed", "bag_2", 100),
        (appended, "changed", "bag_2", 0),
        (overwritten, "another program", "bag_2", 200),  # seen while it is cut, or later
    ],
)
def test_what_another_program_does_to_the_file_is_noticed_and_the_recording_goes_on(
    tmp_path: Path, harm: Callable[[Path], object], what: str, name: str, lost: int
) -> None:
    place = tmp_path / "recordings" / "day"
    recorder = Recorder(BagWriter(place / "bag", compression="none"), period=0.01)
    recorder.add_topic(STRING)
    for i in range(20):  # in chunks of ten
        for k in range(10):
            recorder.offer("/chatter", cdr_string(f"message {10 * i + k:03}"), sequence=10 * i + k)
        first = until(recorder, lambda p, n=10 * (i + 1): p.messages == n, "a sync").path
    size = first.stat().st_size
    harm(first)
    told = until(recorder, lambda p: p.rescue, "noticing")
    assert told.path == place / name / f"{name}_0.mcap"
    assert_names(told.rescue, first, "another program", what, told.path)
    if what == "cut":
        assert_names(told.rescue, size, f"{first.stat().st_size} bytes")
    assert (lost - 10) <= told.destroyed <= (lost + 10 if lost else 0)  # chunks are of ten
    assert names(told.rescue, f"{told.destroyed} messages", "lost") == bool(lost)
    for i in range(200, 230):
        recorder.offer("/chatter", cdr_string(f"message {i:03}"), sequence=i)
    ended = recorder.stop()
    assert (ended.state, ended.error, ended.is_whole) == (State.CLOSED, "", False)
    kept = [data for _, data in read_with_rosbags(ended.path)["/chatter"]]
    rest = 200 - told.destroyed
    assert kept == [cdr_string(f"message {i:03}") for i in (*range(rest), *range(200, 230))]
    assert ended.messages == len(kept)
    info = read_info(ended.path, check=True)
    assert (info.messages, info.truncated, info.damage) == (len(kept), "", ())


def test_a_hole_that_is_found_only_at_the_end_is_told_with_the_number_that_can_be_read(
    tmp_path: Path,
) -> None:
    recorder = Recorder(BagWriter(tmp_path / "bag", compression="none"), period=0.01)
    recorder.add_topic(STRING)
    for i in range(100):
        recorder.offer("/chatter", cdr_string(f"message {i:03}"))
        path = until(recorder, lambda p, n=i + 1: p.messages == n, "a sync").path
    with path.open("r+b") as file:
        file.seek(path.stat().st_size // 2)
        file.write(bytes(400))
    failed = recorder.stop()
    assert (failed.state, failed.is_whole) == (State.FAILED, False)
    kept = int(re.search(r"\b(\d+) of 100 messages", failed.error)[1])  # type: ignore[index]
    assert_names(failed.error, path, "changed", "another program")
    assert 90 < kept < 100
    found = read_info(path, check=True)
    assert kept <= found.messages <= kept + 1


def test_a_file_that_is_gone_while_the_disk_is_full_keeps_none_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = started(tmp_path, period=0.01)
    recorder.offer("/chatter", cdr_string("one"))
    path = until(recorder, lambda p: p.messages == 1, "a sync").path

    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "sendfile", full)
    path.unlink()
    told = until(recorder, lambda p: p.error, "noticing")
    reason = (path, "another program", "deleted or moved", "no space left")
    assert_names(told.error, *reason)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bag"]
    recorder.offer("/chatter", cdr_string("two"))
    failed = recorder.stop()
    assert_names(failed.error, *reason, "0 of 2 messages")


def test_recordings_are_readable_by_their_owner_only(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        place = tmp_path / "recordings" / "day"
        check_place(place, 1000)
        recorder = Recorder(BagWriter(place / "bag"), period=0.01)
        recorder.add_topic(STRING)
        recorder.offer("/chatter", cdr_string("one"))
        path = until(recorder, lambda p: p.messages == 1, "a sync").path
        path.unlink()
        until(recorder, lambda p: p.rescue, "noticing")
        recorder.stop()
    finally:
        os.umask(before)
    found = {p.relative_to(tmp_path).as_posix(): p.stat().st_mode & 0o777 for p in tmp_path.rglob("*")}
    assert found == {
        "recordings": 0o700,
        "recordings/day": 0o700,
        "recordings/day/bag": 0o700,
        "recordings/day/bag/metadata.yaml": 0o600,
        "recordings/day/bag_2": 0o700,
        "recordings/day/bag_2/bag_2_0.mcap": 0o600,
        "recordings/day/bag_2/metadata.yaml": 0o600,
    }


# clocks and memory -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", [-3600.0, -0.5, 0.0, 0.5, 3600.0])
def test_a_step_of_the_systems_clock_leaves_order_and_rate_of_both_stamps(
    tmp_path: Path, step: float
) -> None:
    second = 10**9
    true, offset = [START], [0]
    recorder = Recorder(
        BagWriter(tmp_path / "bag"), stamp=lambda: true[0], system_time=lambda: true[0] + offset[0]
    )
    recorder.add_topic(STRING)
    for i in range(100):
        sent = true[0] + offset[0]
        if i == 50:
            offset[0] = int(step * second)  # while this one is on its way
        true[0] += second // 1000
        recorder.offer("/chatter", cdr_string(str(i)), publish_time=sent, sequence=i)
        true[0] += second // 100 - second // 1000
    path = recorder.stop().path
    with path.open("rb") as stream:
        messages = [m for _, _, m in mcap.reader.make_reader(stream).iter_messages(log_time_order=False)]
    received = [m.log_time - START for m in messages]
    published = [m.publish_time - START for m in messages]
    assert received == [i * second // 100 + second // 1000 for i in range(100)]
    known = [i for i in range(100) if i != 50]
    assert [published[i] for i in known] == [i * second // 100 for i in known]
    assert published[49] <= published[50] <= received[50]


def test_a_recording_of_hours_keeps_the_size_of_its_recorder(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag")
    names = [f"/topic_{i}" for i in range(20)]
    for name in names:
        writer.add_topic(dataclasses.replace(STRING, name=name))
    data, turn = cdr_string("x" * 100), itertools.count()

    def record(turns: int) -> None:
        for k in itertools.islice(turn, turns):
            for name in names:
                writer.write(name, data, START + k * 10**9)
            writer.sync()

    assert blocks_grown(lambda: record(1000), warm_up=lambda: record(20)) < 500
    writer.close()
    assert read_info(writer.path).messages == 1020 * 20


# places ----------------------------------------------------------------------------------------------------


def test_a_place_that_will_do_is_made(tmp_path: Path) -> None:
    check_place(tmp_path / "a" / "b", 1000)
    assert list((tmp_path / "a" / "b").iterdir()) == []


def test_a_place_that_will_not_do_is_named_with_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for directory, reason in (
        (tmp_path / "file", errno.EEXIST),
        (tmp_path / "file" / "in", errno.ENOTDIR),
        (Path("/proc/self"), errno.ENOENT),
        (Path("/proc/none"), errno.ENOENT),
    ):
        with raises_naming(RecordError, directory, "another directory", "writable") as raised:
            check_place(directory, 0)
        assert os.strerror(reason) in str(raised.value)


def test_too_little_space_is_told_in_megabytes(tmp_path: Path) -> None:
    remedies = ("delete", "another directory")
    with raises_naming(RecordError, tmp_path, "free", "1000000000000.0 MB", *remedies) as raised:
        check_place(tmp_path, 10**18)
    found, _ = map(float, re.findall(r"([\d.]+) MB", str(raised.value)))
    assert found == pytest.approx(free_space(tmp_path) / 1e6, rel=0.1)


def test_names_of_recordings(tmp_path: Path) -> None:
    now = datetime(2026, 1, 2, 3, 4, 5)
    assert recording_directory(tmp_path, "", now) == tmp_path / "tripod_2026-01-02_03-04-05"
    for expected in ("run", "run_2", "run_3"):
        path = recording_directory(tmp_path, "run", now)
        assert path == tmp_path / expected
        path.mkdir()
    for name in (".", "..", "a/b", "a\n", "/"):
        with raises_naming(RecordError, "recording name", repr(name), "letters, digits"):
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
