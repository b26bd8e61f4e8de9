"""What `tripod bag info` says of whole, torn, damaged and hostile files."""

import json
import random
import struct
import subprocess
import sys
import zlib
from io import BytesIO
from pathlib import Path

import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st

from tests.messages import assert_names, line_naming, lines_naming, names
from tests.record.bags import START, cdr_string, new_bag, write_some
from tripod_record.append_file import MAGIC, TAIL
from tripod_record.bag import Bag
from tripod_record.errors import RecordError
from tripod_record.info import BagInfo, info_command, info_json, info_text, qos_words, read_info
from tripod_record.next_chunk import next_chunk
from tripod_record.reading import RECORD_LIMIT, Reader

CHUNK_SIZE = 2000  # [B], several chunks in a small file


@pytest.fixture(scope="session")
def closed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The mcap file of a recording that was closed: 100 and 10 messages."""
    writer = new_bag(tmp_path_factory.mktemp("closed") / "bag", chunk_size=CHUNK_SIZE)
    write_some(writer, 100)
    writer.close()
    return writer.path


@pytest.fixture(scope="session")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same, of a recorder that was killed after 60 messages of the one and 6 of the other were synced."""
    writer = new_bag(tmp_path_factory.mktemp("killed") / "bag", chunk_size=CHUNK_SIZE)
    write_some(writer, 60)
    writer.sync()
    write_some(writer, 40, first=60)
    return writer.path


def counts(info: BagInfo) -> dict[str, int]:
    return {t.name: t.count for t in info.topics}


@pytest.mark.parametrize("check", [False, True])
def test_a_closed_recording(closed: Path, check: bool) -> None:
    for path in (closed, closed.parent):
        info = read_info(path, check=check)
        assert counts(info) == {"/chatter": 100, "/mesh": 10}
        assert (info.start, info.end, info.messages) == (START, START + 99 * 10**7, 110)
        assert info.duration == pytest.approx(0.99)
        assert {t.name: t.rate for t in info.topics} == pytest.approx({"/chatter": 100.0, "/mesh": 9 / 0.99})
        assert {t.type for t in info.topics} == {"std_msgs/msg/String"}
        assert {t.name: t.qos for t in info.topics} == {
            "/chatter": ("reliable, volatile",),
            "/mesh": ("reliable, transient_local", "best_effort, volatile"),
        }
        assert (info.truncated, info.damage, info.compression, info.library) == ("", (), ("zstd",), "tripod")
        assert info.size == closed.stat().st_size


def test_a_recording_may_be_named_by_a_text(closed: Path) -> None:
    assert read_info(str(closed)) == read_info(closed)
    assert Bag(str(closed)).topics == Bag(closed).topics


def test_the_text_for_people(closed: Path) -> None:
    lines = info_text(read_info(closed.parent)).splitlines()
    rows = dict(line.split(maxsplit=1) for line in lines if line.partition(" ")[2].strip())
    assert rows["recording"] == str(closed.parent)
    assert rows["files"] == "bag_0.mcap"
    assert rows["duration"] == "0.990 s"
    assert rows["messages"] == "110"
    chatter = next(line for line in lines if line.startswith("/chatter"))
    assert chatter.split(maxsplit=4) == [
        "/chatter",
        "std_msgs/msg/String",
        "100",
        "100.0",
        "reliable, volatile",
    ]
    assert not any(line.startswith(("TRUNCATED", "DAMAGED")) for line in lines)


def test_json_has_the_same(closed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert info_command(closed, as_json=True) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["messages"] == 110
    assert values["duration"] == pytest.approx(0.99)
    assert values["truncated"] == ""
    assert [(t["name"], t["count"]) for t in values["topics"]] == [("/chatter", 100), ("/mesh", 10)]
    assert json.loads(info_json(read_info(closed))) == values


def test_several_files_of_one_recording_are_added(closed: Path, killed: Path, tmp_path: Path) -> None:
    (tmp_path / "b_2.mcap").write_bytes(closed.read_bytes())
    (tmp_path / "b_10.mcap").write_bytes(killed.read_bytes())
    info = read_info(tmp_path)
    assert [Path(f).name for f in info.files] == ["b_2.mcap", "b_10.mcap"]
    assert counts(info) == {"/chatter": 160, "/mesh": 16}
    assert info.truncated


# torn ------------------------------------------------------------------------------------------------------


def test_a_killed_recording_is_read_and_called_truncated(
    killed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert counts(read_info(killed)) == {"/chatter": 60, "/mesh": 6}
    assert info_command(killed) == 0
    assert info_command(killed, check=True) == 1
    for out in capsys.readouterr().out.split("recording  ")[1:]:
        line_naming(out, "TRUNCATED", "not closed", "killed")


def test_a_recording_that_goes_on_while_it_is_read_is_not_torn(tmp_path: Path) -> None:
    writer = new_bag(tmp_path / "bag", chunk_size=CHUNK_SIZE)
    noise = random.Random(0)
    for i in range(200):  # much more than a reader takes from the file at once
        writer.write("/chatter", cdr_string(noise.randbytes(500).hex()), START + i)
    writer.sync()
    reader = Reader(writer.path)
    messages = reader.messages()
    next(messages)
    writer.write("/chatter", cdr_string(noise.randbytes(5000).hex()), START + 200)
    writer.sync()
    assert 1 + len(list(messages)) == 200
    assert_names(reader.truncated, "not closed", "still running")
    assert reader.damage == []
    writer.close()


@given(cut=st.integers(min_value=0, max_value=10**6))
def test_any_torn_file_gives_the_beginning_of_its_messages(closed: Path, cut: int, tmp_path_factory) -> None:
    whole = closed.read_bytes()
    torn = tmp_path_factory.mktemp("torn") / "bag.mcap"
    torn.write_bytes(whole[: cut % len(whole)])
    try:
        info = read_info(torn)
    except RecordError as error:
        assert cut % len(whole) <= len(MAGIC)
        assert str(torn) in str(error)
        return
    assert info.truncated
    assert info.damage == ()
    reader = Reader(torn)
    found = [bytes(m.data) for m in reader.messages() if reader.channels[m.channel].topic == "/chatter"]
    assert found == [cdr_string(f"message {i}") for i in range(len(found))]
    assert len(found) == counts(info).get("/chatter", 0)


def test_only_the_last_chunk_of_a_torn_file_is_lost(closed: Path, tmp_path: Path) -> None:
    whole = closed.read_bytes()
    torn = tmp_path / "bag.mcap"
    torn.write_bytes(whole[: len(whole) // 3])
    info = read_info(torn)
    assert 20 < counts(info)["/chatter"] < 80
    assert_names(info.truncated, "ends", f"byte {len(whole) // 3}")


def test_zeros_that_a_power_loss_leaves_are_a_torn_end(killed: Path, tmp_path: Path) -> None:
    torn = tmp_path / "bag.mcap"
    torn.write_bytes(killed.read_bytes()[: -len(TAIL)] + bytes(5000))
    info = read_info(torn)
    assert counts(info) == {"/chatter": 60, "/mesh": 6}
    assert_names(info.truncated, "ends", "zeros")
    assert info.damage == ()


# damaged ---------------------------------------------------------------------------------------------------


def flipped(whole: bytes, at: int, path: Path) -> Path:
    data = bytearray(whole)
    data[at] ^= 0x40
    path.write_bytes(data)
    return path


def test_a_damaged_chunk_is_named_and_the_others_are_read(
    closed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = closed.read_bytes()
    path = flipped(whole, len(whole) // 2, tmp_path / "bag.mcap")
    assert read_info(path).damage == ()  # the summary is whole, and is believed
    assert info_command(path, check=True) == 1
    out = capsys.readouterr().out
    found = counts(read_info(path, check=True))["/chatter"]
    assert 0 < found < 100
    assert lines_naming(out, "DAMAGED", "byte")
    line_naming(out, "DAMAGED", "/chatter", f"{found} messages", "summary", 100)


@pytest.mark.parametrize(
    "damage", [b"\x06" + b"\xff" * 8, b"\x06\0\0\0\x02" + bytes(4), b"\x07" * 40, bytes(400)]
)
def test_behind_a_damaged_head_of_a_record_the_next_chunks_are_read(
    killed: Path, closed: Path, tmp_path: Path, damage: bytes
) -> None:
    for source, messages in ((closed, 100), (killed, 60)):
        whole = source.read_bytes()
        at = next_chunk(BytesIO(whole), len(whole) // 3, len(whole))
        assert at
        path = tmp_path / "bag.mcap"
        path.write_bytes(whole[:at] + damage + whole[at + len(damage) :])
        info = read_info(path, check=True)
        assert messages - 40 < counts(info)["/chatter"] < messages
        assert any(names(line, f"byte {at}", "not a record") for line in info.damage)
        reader = Reader(path)
        texts = [bytes(m.data) for m in reader.messages() if reader.channels[m.channel].topic == "/chatter"]
        assert texts[-1] == cdr_string(f"message {messages - 1}")


def test_a_chunk_is_found_wherever_the_pieces_that_are_read_part(
    closed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = closed.read_bytes()
    places, at = [], next_chunk(BytesIO(whole), 0, len(whole))
    while at is not None:
        places.append(at)
        at = next_chunk(BytesIO(whole), at + 1, len(whole))
    assert len(places) > 3
    for searched in range(60, 200, 7):
        monkeypatch.setattr("tripod_record.next_chunk.SEARCHED", searched)
        assert next_chunk(BytesIO(whole), places[1] + 1, len(whole)) == places[2]
        assert next_chunk(BytesIO(whole), places[-1] + 1, len(whole)) is None
        assert next_chunk(BytesIO(whole), places[-1], places[-1] + 60) is None


def test_a_damaged_summary_is_not_believed(closed: Path, tmp_path: Path) -> None:
    whole = closed.read_bytes()
    (start,) = struct.unpack_from("<Q", whole, len(whole) - len(MAGIC) - 20)
    assert len(whole) - start > 1000
    for at in range(start, len(whole), 3):
        info = read_info(flipped(whole, at, tmp_path / "bag.mcap"))
        assert counts(info) == {"/chatter": 100, "/mesh": 10}


@given(seed=st.integers(), flips=st.integers(1, 20), whole_file=st.booleans())
def test_no_damage_raises_anything_else(
    closed: Path, killed: Path, seed: int, flips: int, whole_file: bool, tmp_path_factory
) -> None:
    source = closed if whole_file else killed
    data, rng = bytearray(source.read_bytes()), random.Random(seed)
    for _ in range(flips):
        data[rng.randrange(len(data))] = rng.randrange(256)
    path = tmp_path_factory.mktemp("damaged") / "bag.mcap"
    path.write_bytes(data)
    for check in (False, True):
        try:
            info = read_info(path, check=check)
        except RecordError as error:
            assert "\n" not in str(error)
            continue
        assert info.messages <= 2**64
        info_text(info).encode()
        info_json(info)


def test_a_summary_that_counts_topics_it_does_not_name_is_not_believed(tmp_path: Path) -> None:
    path = tmp_path / "bag.mcap"
    counts_of_channel_9 = struct.pack("<IHQ", 10, 9, 1000)
    statistics = record(11, struct.pack("<QHIIIIQQ", 1000, 0, 0, 0, 0, 0, 0, 1) + counts_of_channel_9)
    footer = record(2, struct.pack("<QQI", len(HEADER), 0, 0))
    path.write_bytes(HEADER + statistics + footer + MAGIC)
    for check in (False, True):
        assert read_info(path, check=check).messages == 0


# not a recording -------------------------------------------------------------------------------------------


def record(opcode: int, body: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


HEADER = MAGIC + record(1, text(b"ros2") + text(b"evil"))


def chunk(packed: bytes, compression: bytes, size: int, checksum: int = 0) -> bytes:
    fields = struct.pack("<QQQI", 0, 0, size, checksum) + text(compression)
    return record(6, fields + struct.pack("<Q", len(packed)) + packed)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "empty"),
        (b"garbage" * 100, "mcap"),
        (MAGIC, "mcap"),
        (MAGIC + bytes(random.Random(1).randbytes(5000)), "mcap"),
        (b"SQLite format 3\0" * 10, "mcap"),
    ],
)
def test_what_is_no_recording_gives_one_line_and_exit_code_2(
    data: bytes, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bag.mcap"
    path.write_bytes(data)
    for place in (path, tmp_path):
        assert info_command(place) == 2
        out, error = capsys.readouterr()
        assert (out, error.count("\n")) == ("", 1)
        assert_names(error, "tripod bag info: ", path, reason)


def test_what_is_no_file_gives_one_line_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for path, named in (
        (tmp_path / "none", (f"{tmp_path}/none", "exist")),
        (tmp_path, (tmp_path, "no .mcap file")),
        (Path("/dev/zero"), ("/dev/zero", "device")),
        (tmp_path / "a\x1b[31m", (f"{tmp_path}/a�[31m", "exist")),
    ):
        assert info_command(path) == 2
        out, error = capsys.readouterr()
        assert (out, error.count("\n")) == ("", 1)
        assert "\x1b" not in error
        assert_names(error, "tripod bag info: ", *named)


@pytest.mark.parametrize(
    ("data", "named"),
    [
        (HEADER + record(6, b"", 2**63), ("record", "9223372036854775808 bytes", RECORD_LIMIT)),
        (HEADER + record(6, b"xy"), ("record", "shorter")),
        (HEADER + chunk(b"", b"", 2**40), ("chunk", "1099511627776 bytes", RECORD_LIMIT)),
        (HEADER + chunk(b"abc", b"zstd", 10), ("chunk", "unpack")),
        (HEADER + chunk(b"garbage!", b"lz4", 10), ("chunk", "unpack")),
        (HEADER + chunk(b"abc", b"rar\x1b[2J", 3), ("chunk", "compression", "'rar\\x1b[2J'")),
        (HEADER + chunk(b"abc", b"", 3, zlib.crc32(b"abd")), ("chunk", "checksum")),
        (HEADER + chunk(b"abc", b"", 3), ("chunk", "ends", "record")),
        (HEADER + chunk(b"abc", b"", 4), ("chunk", "3 bytes", 4)),
        (HEADER + chunk(record(5, bytes(3)), b"", 12), ("message", "too short")),
        (HEADER + chunk(record(5, bytes(22)), b"", 31), ("message", "channel 0")),
        (HEADER + chunk(chunk(b"", b"", 0), b"", 49), ("chunk within", "chunk")),
        (HEADER + record(4, bytes(4) + struct.pack("<I", 2**31)), ("text", "2147483648 bytes", "allowed")),
    ],
)
def test_hostile_records_are_named(data: bytes, named: tuple[object, ...], tmp_path: Path, capsys) -> None:
    path = tmp_path / "bag.mcap"
    path.write_bytes(data)
    assert info_command(path) == 1
    out, error = capsys.readouterr()
    assert error == ""
    line_naming(out, "DAMAGED", f"byte {len(HEADER)}", *named)
    assert "\x1b" not in out


LIMITED = """
import resource, sys
from pathlib import Path
from tripod_record.info import info_command
resource.setrlimit(resource.RLIMIT_AS, (700_000_000, 700_000_000))
resource.setrlimit(resource.RLIMIT_CPU, (20, 20))  # [s]: however busy the machine
code = info_command(Path(sys.argv[1]))
status = Path("/proc/self/status").read_text()  # ru_maxrss would count the process that forked this one
print("peak", status.split("VmHWM:")[1].split()[0], file=sys.stderr)
sys.exit(code)
"""


def test_a_bomb_is_not_unpacked(tmp_path: Path) -> None:
    """A gigabyte of zeros in a few kilobytes, honest and not about its size, again and again."""
    packer = zstandard.ZstdCompressor(level=1).compressobj()
    bomb = b"".join(packer.compress(bytes(2**20)) for _ in range(1024)) + packer.flush()
    assert len(bomb) < 200_000
    path = tmp_path / "bag.mcap"
    path.write_bytes(HEADER + chunk(bomb, b"zstd", 1000) * 50 + chunk(bomb, b"zstd", 2**30) * 50 + TAIL)
    root = Path(__file__).parents[2]
    command = [sys.executable, "-c", LIMITED, str(path)]
    run = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert run.returncode == 1, run.stderr
    damage = lines_naming(run.stdout, "DAMAGED")
    assert 1 < len(damage) < 100
    assert all(names(line, "1001 bytes", 1000) for line in damage[:-1])
    assert_names(damage[-1], "more damage")
    assert int(run.stderr.split()[1]) < 150_000  # [kB]


def test_names_cannot_command_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    channel = record(4, struct.pack("<HH", 1, 0) + text(b"/a\x1b[2J\n/b") + text(b"cdr") + text(b""))
    path = tmp_path / "bag.mcap"
    path.write_bytes(HEADER + channel + TAIL)
    assert info_command(path) == 0
    out = capsys.readouterr().out
    assert "/a�[2J�/b" in out
    assert "\x1b" not in out


def test_qos_of_other_versions_of_rosbag2() -> None:
    numbered = (
        "- history: 3\n  depth: 0\n  reliability: 1\n  durability: 1\n- reliability: 2\n  durability: 2\n"
    )
    assert qos_words(numbered) == ("reliable, transient_local", "best_effort, volatile")
    assert qos_words("") == ()


def packed_file(path: Path, record: bytes, chunks: int) -> Path:
    """Write a file whose chunks unpack to 16 MB each of one record, again and again."""

    def part(opcode: int, body: bytes) -> bytes:
        return struct.pack("<BQ", opcode, len(body)) + body

    def text(value: bytes) -> bytes:
        return struct.pack("<I", len(value)) + value

    channel = part(3, struct.pack("<H", 1) + text(b"t") + text(b"ros2msg") + text(b""))
    channel += part(4, struct.pack("<HH", 1, 1) + text(b"/t") + text(b"cdr") + text(b""))
    data = record * (2**24 // len(record))
    packed = zstandard.ZstdCompressor(level=1).compress(data)
    head = struct.pack("<QQQI", 0, 1, len(data), 0) + text(b"zstd") + struct.pack("<Q", len(packed))
    begin = MAGIC + part(1, text(b"ros2") + text(b"x")) + channel
    path.write_bytes(begin + part(6, head + packed) * chunks)
    return path


EMPTY_MESSAGE = struct.pack("<BQHIQQ", 5, 22, 1, 0, 5, 5)
LARGE_MESSAGE = struct.pack("<BQHIQQ", 5, 22 + 2**20, 1, 0, 5, 5) + bytes(2**20)


@pytest.mark.parametrize(
    ("record", "chunks", "named", "most"),
    [
        (bytes(9), 3, ("zeros", "records"), 0),
        (EMPTY_MESSAGE, 3, ("more records", "size", "rest"), 600_000),
        (LARGE_MESSAGE, 50, ("unpack", "100 times", "rest"), 700),
    ],
)
def test_what_is_packed_to_do_harm_is_read_no_further_than_its_size_allows(
    record: bytes, chunks: int, named: tuple[str, ...], most: int, tmp_path: Path
) -> None:
    info = read_info(packed_file(tmp_path / "bomb.mcap", record, chunks))
    assert info.messages <= most
    assert_names(info.damage[-1], *named)
