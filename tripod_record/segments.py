"""Segments of a recording: from each start of the simulator, or change of its scene, to the next."""

import tomllib
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tripod_graph import names
from tripod_host.arrays import FloatArray
from tripod_record.bag import Bag, Heard
from tripod_record.errors import RecordError

HEAD = 4
"""Columns of a simulator's commands before its joints: number of resets, first and last step, stamp [ns]."""

LATE = 10**9
"""Time by which a scene may be received after the first commands of its simulator [ns]: their topics connect apart."""

CHANGES = 3
"""Most changed settings that are named."""


@dataclass(frozen=True)
class Segment:
    """What a recording holds of a simulator while it ran without a restart, and with one scene.

    Attributes:
        number: From 1.
        scene: Its scene, as TOML.
        start, end: Log times of its first and last commands [ns since 1970].
        first, last: Numbers of the messages with its commands, counted from 0 in the recording.
        stamps: Stamps of its bodies are above the first, and at most the second [ns].
        steps: How many steps were recorded.
    """

    number: int
    scene: str
    start: int
    end: int
    first: int
    last: int
    stamps: tuple[float, float]
    steps: int


@dataclass(frozen=True)
class _Batch:
    """A message of commands: its number, log time, first and last row, and the steps in it."""

    number: int
    time: int
    first: FloatArray
    last: FloatArray
    steps: int

    def follows(self, other: "_Batch") -> bool:
        """Return whether it goes on where `other` ended: resets and steps only count up."""
        return (self.first[0], self.first[1]) > (other.last[0], other.last[2])


def command_rows(bag: Bag, heard: Heard) -> FloatArray:
    """Return the rows of a message with a simulator's commands, shape (n, `HEAD` + joints). Raises RecordError."""
    return rows_of(bag, heard, HEAD)


def rows_of(bag: Bag, heard: Heard, least: int) -> FloatArray:
    """Return the rows of a message with numbers, shape (n, k), k at least `least`. Raises RecordError."""
    message = bag.decoded(heard)
    shape = tuple(dim.size for dim in message.layout.dim)
    rows = np.asarray(message.data, dtype=np.float64)
    if len(shape) != 2 or shape[0] * shape[1] != len(rows) or shape[1] < least:
        raise RecordError(f"{heard.topic} contains messages that are not those of a simulator")
    return rows.reshape(shape)


def simulators(bag: Bag) -> list[str]:
    """Return the namespaces, with a slash at the end, of the simulators whose scene and commands were recorded."""
    found = [t.removesuffix(names.SCENE) for t in bag.topics if t.endswith(f"/{names.SCENE}")]
    return [namespace for namespace in found if namespace + names.COMMANDS in bag.topics]


def read_segments(bag: Bag, namespace: str) -> list[Segment]:
    """Return the segments of the simulator in `namespace` (with a slash at the end), in their order.

    One begins where the count of resets or steps falls, or where another scene was received. Its scene is the last one
    received before its first commands, or, if none came since the segment before, the next within `LATE`. A scene
    without commands has none.

    Raises:
        RecordError: the recording holds commands that are none of a simulator.
    """
    scenes: list[tuple[int, str]] = []
    batches: list[_Batch] = []
    count = 0
    for heard in bag.messages({namespace + names.SCENE, namespace + names.COMMANDS}.__contains__):
        if heard.topic == namespace + names.SCENE:
            scenes.append((heard.log_time, bag.decoded(heard).data))
            continue
        rows = command_rows(bag, heard)
        if len(rows):
            steps = int((rows[:, 2] - rows[:, 1] + 1).sum())
            batches.append(_Batch(count, heard.log_time, rows[0], rows[-1], steps))
        count += 1
    return list(_segments(scenes, batches))


def _segments(scenes: Sequence[tuple[int, str]], batches: Sequence[_Batch]) -> Iterator[Segment]:
    received = [time for time, _ in scenes]
    groups: list[tuple[int, list[_Batch]]] = []  # number of the scene, batches
    for batch in batches:
        here = max(0, bisect_right(received, batch.time) - 1)
        if groups and batch.follows(groups[-1][1][-1]):
            scene, group = groups[-1]
            if here <= scene or scenes[here][1] == scenes[scene][1]:
                group.append(batch)
                continue
        if groups and here == groups[-1][0]:  # no scene since the last restart: its own may come late
            here = min(here + 1, max(0, bisect_right(received, batch.time + LATE) - 1))
        groups.append((here, [batch]))
    before = -np.inf
    for number, (scene, group) in enumerate(groups, 1):
        first, last = group[0], group[-1]
        stamps = (before, float(last.last[3]) if number < len(groups) else np.inf)
        steps = sum(batch.steps for batch in group)
        yield Segment(
            number, scenes[scene][1], first.time, last.time, first.number, last.number, stamps, steps
        )
        before = stamps[1]


def chosen_segment(bag: Bag, segments: Sequence[Segment], number: int | None) -> Segment:
    """Return the segment of this number; None: the longest, the first of several. Raises RecordError."""
    if number is None:
        return max(segments, key=lambda one: one.steps)
    if not 1 <= number <= len(segments):
        raise RecordError(
            f"{bag.info.path} has no segment {number}; it has {len(segments)}: `tripod bag info` lists them"
        )
    return segments[number - 1]


def log_times(segments: Sequence[Segment], number: int) -> tuple[float, float]:
    """Return from when on, and before when, messages belong to a segment [ns].

    It begins after the last commands of the one before. What comes before the first segment, or after the last, belongs
    to that.
    """
    begin = segments[number - 2].end + 1 if number > 1 else -np.inf
    return begin, segments[number - 1].end + 1 if number < len(segments) else np.inf


def segment_lines(bag: Bag, segments: Sequence[Segment]) -> list[str]:
    """Return a line for each segment: its place, steps and scene, and which settings differ from the one before."""
    lines, before = [], dict[str, Any]()
    for one in segments:
        begin, end = (1e-9 * (time - bag.start) for time in (one.start, one.end))
        settings = _flat(tomllib.loads(one.scene))
        changed = [k for k in {**before, **settings} if before.get(k) != settings.get(k)] if before else []
        words = [f"{key} = {settings.get(key, 'absent')}" for key in changed[:CHANGES]]
        more = len(changed) - len(words)
        told = f"; {', '.join(words)}{f' and {more} more' if more else ''}" if words else ""
        place = f"segment {one.number}: {begin:.2f} to {end:.2f} s, {one.steps} steps"
        lines.append(f"{place}, scene {settings.get('name', '?')}{told}")
        before = settings
    return lines


def _flat(table: Any, path: str = "") -> dict[str, Any]:
    """Return the values of nested tables by dotted name."""
    if not isinstance(table, dict):
        return {path: table}
    return {k: v for name, part in table.items() for k, v in _flat(part, f"{path}.{name}".strip(".")).items()}
