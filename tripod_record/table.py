"""The numbers of a recording as columns over time, whatever the types of its topics."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_record.bag import Bag
from tripod_record.errors import RecordError

WIDEST = 16
"""An array of more numbers than this is no row of a table."""

SHOWN = (
    "sim/joint_states", "robot/joint_states", "sim/effector_pose", "robot/effector_pose", "target_pose",
    "sim/ball_pose", "ball_pose", "sim/status", "ik/status", "robot/status",
)  # fmt: skip
"""Topics of which a table is made unless others are asked for."""

STAMP = "builtin_interfaces/msg/Time"

FIELDLESS = "structure_needs_at_least_one_member"
"""The one field of a message type without fields in CDR."""

STEPS = 200
"""Most calls of a progress function."""

LABELS = ("name", "joint_names")
"""Fields that name the entries of the others."""


@dataclass
class Series:
    """The numbers of one topic.

    Attributes:
        times: From the beginning of the recording [s], shape (k,).
        values: By field, "position.servo_0", shape (k,); NaN where a message has none.
    """

    times: FloatArray
    values: dict[str, FloatArray]


@dataclass
class _Growing:
    times: list[float] = field(default_factory=list)
    values: dict[str, list[float]] = field(default_factory=dict)

    def add(self, time: float, numbers: Iterator[tuple[str, float]]) -> None:
        count = len(self.times)
        self.times.append(time)
        for name, number in numbers:
            column = self.values.setdefault(name, [])
            column.extend([np.nan] * (count - len(column)))
            if len(column) == count:
                column.append(number)

    def done(self) -> Series:
        count = len(self.times)
        columns = {n: np.array(v + [np.nan] * (count - len(v))) for n, v in self.values.items()}
        return Series(np.array(self.times), columns)


def is_shown(topic: str) -> bool:
    """Return whether a table has this topic unless others are asked for."""
    return any(topic.endswith(f"/{name}") for name in SHOWN)


def read_series(
    bag: Bag,
    wanted: Callable[[str], bool] = is_shown,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Series]:
    """Return the numbers of topics by name.

    A topic without any is left out, and so is one that cannot be decoded (`Bag.unread` says why). Of messages without
    fields (std_msgs/Empty) the number is their `count` so far.

    Args:
        bag: The recording.
        wanted: Which topics.
        progress: Is called with the fraction done, 0 to 1.

    Raises:
        RecordError: a message is damaged.
    """
    found: dict[str, _Growing] = {}
    readable = {topic for topic in bag.topics if wanted(topic) and bag.can_decode(topic)}
    duration, shown = bag.info.duration, 0.0
    for heard in bag.messages(readable.__contains__):
        time = 1e-9 * (heard.log_time - bag.start)
        growing = found.setdefault(heard.topic, _Growing())
        message = bag.decoded(heard)
        event = FIELDLESS in vars(message)
        growing.add(time, iter([("count", len(growing.times) + 1.0)]) if event else numbers(message))
        if progress and time >= shown + duration / STEPS:
            shown = time
            progress(min(1.0, time / duration))
    series = {topic: one.done() for topic, one in sorted(found.items())}
    return {topic: s for topic, s in series.items() if s.values}


def table(series: dict[str, Series]) -> dict[str, FloatArray]:
    """Return a column `time` [s] with the times of all messages, and for each field the newest value then, shape (n,).

    NaN: no message yet. Raises RecordError if there is nothing.
    """
    if not series:
        raise RecordError(
            "nothing to write: the requested topics contain no numbers; `tripod bag info` lists the topics"
        )
    times = np.unique(np.concatenate([s.times for s in series.values()]))
    columns = {"time": times}
    for topic, one in series.items():
        newest = np.searchsorted(one.times, times, side="right") - 1
        for name, values in one.values.items():
            columns[f"{topic.lstrip('/')}.{name}"] = np.where(
                newest < 0, np.nan, values[np.maximum(newest, 0)]
            )
    return columns


def numbers(message: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Yield dotted name and value of the numbers in a decoded message, at any depth, but stamps and constants.

    Entries of short arrays are named by a field `name` or `joint_names` of the same message, else by their place.
    """
    # rosbags keeps constants and the type's name beside the fields, whose names alone begin with a small letter
    fields = {name: value for name, value in vars(message).items() if name[0].islower()}
    labels = next((fields[name] for name in LABELS if isinstance(fields.get(name), list)), None)
    for name, value in fields.items():
        if isinstance(value, bool | int | float | np.number):
            yield f"{path}{name}", float(value)
        elif isinstance(value, np.ndarray):
            if len(value) <= WIDEST and value.dtype.kind in "biuf":
                known = labels if labels is not None and len(labels) == len(value) else range(len(value))
                yield from (
                    (f"{path}{name}.{label}", float(v)) for label, v in zip(known, value, strict=True)
                )
        elif getattr(value, "__msgtype__", STAMP) != STAMP:
            yield from numbers(value, f"{path}{name}.")
