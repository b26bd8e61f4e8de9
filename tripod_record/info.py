"""What is in a recording: `tripod bag info`."""

import json
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from tripod_graph.names import SCENE
from tripod_record.errors import RecordError
from tripod_record.reading import Reader
from tripod_record.summary import Summary, read_summary

DAMAGED, UNREADABLE = 1, 2
"""Exit codes besides 0."""
FILE_LIMIT = 1000
"""Most files of one recording that are read."""


@dataclass(frozen=True)
class TopicInfo:
    """What a recording holds of one topic.

    Attributes:
        name: Full name.
        type: Full type.
        count: Messages.
        rate: Mean over the whole recording [Hz]; 0 if it has no length.
        qos: QoS offered by each publisher, "reliable, volatile"; empty if unknown.
    """

    name: str
    type: str
    count: int
    rate: float
    qos: tuple[str, ...]


@dataclass(frozen=True)
class BagInfo:
    """What is in a recording.

    Attributes:
        path: What was asked for.
        files: Its mcap files.
        size: Of the files [B].
        library: What wrote it.
        compression: Of the chunks; "none" for no compression.
        start: Stamp of the first message [ns since 1970]; None without messages.
        end: Stamp of the last message [ns since 1970]; None without messages.
        messages: How many there are.
        topics: Sorted by name.
        attachments: Names of files that are attached, sorted.
        truncated: Why the end is missing, empty if it is not.
        damage: What could not be read.
    """

    path: str
    files: tuple[str, ...]
    size: int
    library: str
    compression: tuple[str, ...]
    start: int | None
    end: int | None
    messages: int
    topics: tuple[TopicInfo, ...]
    truncated: str
    damage: tuple[str, ...]
    attachments: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Time from the first to the last message [s]."""
        return 0.0 if self.start is None or self.end is None else (self.end - self.start) / 1e9


@dataclass
class _Tally:
    """Counts over the files of a recording."""

    counts: dict[tuple[str, str], int]
    qos: dict[tuple[str, str], tuple[str, ...]]
    start: int | None = None
    end: int | None = None

    def add(self, reader: Reader, counts: dict[int, int], start: int | None, end: int | None) -> None:
        for number, channel in reader.channels.items():
            key = (channel.topic, channel.type)
            self.counts[key] = self.counts.get(key, 0) + counts.get(number, 0)
            self.qos.setdefault(key, qos_words(channel.qos))
        if start is not None and end is not None:
            self.start = start if self.start is None else min(start, self.start)
            self.end = end if self.end is None else max(end, self.end)


def read_info(path: str | Path, *, check: bool = False) -> BagInfo:
    """Return what is in a recording.

    Args:
        path: An mcap file, or the directory of a recording.
        check: Read every message and compare with the file's summary, instead of believing it.

    Raises:
        RecordError: there is nothing that can be read; one line that names the file and the reason.
    """
    files = recording_files(path)
    tally = _Tally({}, {})
    damage: list[str] = []
    compressions: set[str] = set()
    attachments: set[str] = set()
    truncated, library, size = "", "", 0
    for file in files:
        summary = read_summary(file)
        reader = summary.reader if summary else Reader(file)
        if summary and not check:
            counted = bool(sum(summary.counts.values()))
            tally.add(reader, summary.counts, *((summary.start, summary.end) if counted else (None, None)))
        else:
            reader = Reader(file)
            counts, start, end = _counted(reader)
            tally.add(reader, counts, start, end)
            damage += _contradictions(summary, counts)
        damage += reader.damage
        truncated = truncated or reader.truncated
        compressions |= reader.compressions
        attachments |= reader.attachments
        library = library or reader.library
        size += file.stat().st_size
    length = 0.0 if tally.start is None or tally.end is None else (tally.end - tally.start) / 1e9
    topics = tuple(
        TopicInfo(name, kind, count, max(0, count - 1) / length if length > 0 else 0.0, tally.qos[name, kind])
        for (name, kind), count in sorted(tally.counts.items())
    )
    return BagInfo(
        path=str(path),
        files=tuple(str(f) for f in files),
        size=size,
        library=library,
        compression=tuple(sorted(compressions)),
        start=tally.start,
        end=tally.end,
        messages=sum(tally.counts.values()),
        topics=topics,
        truncated=truncated,
        damage=tuple(damage),
        attachments=tuple(sorted(attachments)),
    )


def recording_files(path: str | Path) -> list[Path]:
    """Return the mcap files of a recording, in order; raises RecordError if there are none."""
    path = Path(path)
    try:
        if not path.is_dir():
            return [path]
        files = sorted(path.glob("*.mcap"), key=lambda p: (len(p.name), p.name))
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror}") from None
    if not files:
        raise RecordError(f"{path} contains no .mcap file; give the directory or file of a recording")
    if len(files) > FILE_LIMIT:
        raise RecordError(
            f"{path} contains {len(files)} mcap files; allowed: at most {FILE_LIMIT}; give one of the files"
        )
    return files


def qos_words(text: str) -> tuple[str, ...]:
    """Return "reliable, volatile" for each profile in rosbag2's text of the QoS offered.

    Older versions of that text have numbers.

    >>> qos_words("- history: 1\\n  depth: 5\\n  reliability: 2\\n  durability: volatile\\n")
    ('best_effort, volatile',)
    """
    reliability = {"0": "system_default", "1": "reliable", "2": "best_effort"}
    durability = {"0": "system_default", "1": "transient_local", "2": "volatile"}
    pairs = zip(
        re.findall(r"\breliability: (\w{1,20})", text),
        re.findall(r"\bdurability: (\w{1,20})", text),
        strict=False,
    )
    return tuple(f"{reliability.get(r, r)}, {durability.get(d, d)}" for r, d in pairs)


def info_text(info: BagInfo) -> str:
    """Return `info` for people."""
    lines = [
        f"recording  {printable(info.path)}",
        f"files      {', '.join(printable(Path(f).name) for f in info.files)}",
        f"size       {info.size / 1e6:.3f} MB",
        f"compressed {printable(', '.join(info.compression)) or 'none'}",
        f"written by {printable(info.library) or 'unknown'}",
    ]
    if info.start is not None and info.end is not None:
        lines.append(f"start      {_date(info.start)}")
        lines.append(f"end        {_date(info.end)}")
    lines.append(f"duration   {info.duration:.3f} s")
    lines.append(f"messages   {info.messages}")
    if info.attachments:
        lines.append(f"attached   {printable(', '.join(info.attachments))}")
    if info.truncated:
        lines.append(f"TRUNCATED  {printable(info.truncated)}")
    lines += [f"DAMAGED    {printable(d)}" for d in info.damage]
    if info.topics:
        lines += ["", *_table(info.topics)]
    return "\n".join(lines) + "\n"


def info_json(info: BagInfo, segments: Sequence[Mapping[str, Any]] = ()) -> str:
    """Return `info` as one JSON object, in the units of BagInfo, with the duration [s] and the segments."""
    values: dict[str, Any] = asdict(info)
    values["duration"], values["segments"] = info.duration, segments
    return json.dumps(values, indent=2) + "\n"


def printable(text: str) -> str:
    """Return `text` without what could command a terminal."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


def info_command(
    path: Path,
    *,
    as_json: bool = False,
    check: bool = False,
    reading: Callable[[], AbstractContextManager[None]] = nullcontext,
) -> int:
    """Print what is in a recording; return 0, `DAMAGED`, or, with one line on stderr, `UNREADABLE`.

    That the end is missing counts as damage for who asks for a check: a recording goes on, or was killed. `reading`
    returns the context in which the recording is read, which may take long.
    """
    try:
        with reading():
            info = read_info(path, check=check)
    except (RecordError, OSError) as error:
        print(f"tripod bag info: {printable(str(error))}", file=sys.stderr)
        return UNREADABLE
    segments = _segments(info)
    if as_json:
        print(info_json(info, segments), end="")
    else:
        print(info_text(info), end="")
        if len(segments) > 1:
            print("\n" + "\n".join(printable(one["line"]) for one in segments))
    return DAMAGED if info.damage or (check and info.truncated) else 0


def _segments(info: BagInfo) -> list[dict[str, Any]]:
    """Return the segments of each simulator; to find them, the recording is read where it holds several scenes."""
    if not any(t.count > 1 and t.name.endswith(f"/{SCENE}") for t in info.topics):
        return []
    from tripod_record.bag import Bag  # noqa: PLC0415 - which reads what is in it by this module
    from tripod_record.segments import read_segments, segment_lines, simulators  # noqa: PLC0415

    bag, found = Bag(info.path), []
    try:
        for namespace in simulators(bag):
            segments = read_segments(bag, namespace)
            for one, line in zip(segments, segment_lines(bag, segments), strict=True):
                place = {"start": one.start, "end": one.end, "steps": one.steps, "line": line}
                found.append({"namespace": namespace, "number": one.number, **place})
    except RecordError:
        return []  # what it holds is told; that it is no session, whoever plays it is told
    return found


def _counted(reader: Reader) -> tuple[dict[int, int], int | None, int | None]:
    counts: dict[int, int] = {}
    start: int | None = None
    end: int | None = None
    for message in reader.messages():
        counts[message.channel] = counts.get(message.channel, 0) + 1
        start = message.log_time if start is None else min(start, message.log_time)
        end = message.log_time if end is None else max(end, message.log_time)
    return counts, start, end


def _contradictions(summary: Summary | None, counts: dict[int, int]) -> Iterator[str]:
    if summary is None:
        return
    for number, said in summary.counts.items():
        if (found := counts.get(number, 0)) != said:
            yield (
                f"{summary.reader.channels[number].topic}: {found} messages were found, but the summary of "
                f"the file says {said}"
            )


def _date(nanoseconds: int) -> str:
    try:
        return (
            datetime.fromtimestamp(nanoseconds / 1e9).astimezone().isoformat(sep=" ", timespec="milliseconds")
        )
    except (OverflowError, OSError, ValueError):
        return f"{nanoseconds} ns"


def _table(topics: Sequence[TopicInfo]) -> list[str]:
    rows = [("topic", "type", "count", "rate [Hz]", "QoS")]
    for t in topics:
        words = " | ".join(dict.fromkeys(t.qos))
        rows.append((printable(t.name), printable(t.type), str(t.count), f"{t.rate:.1f}", words))
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    return [
        f"{n:<{widths[0]}}  {k:<{widths[1]}}  {c:>{widths[2]}}  {r:>{widths[3]}}  {q}".rstrip()
        for n, k, c, r, q in rows
    ]
