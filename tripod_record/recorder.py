"""Records in a thread of its own: offering a message never waits, and what cannot be kept is counted."""

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

from tripod_record.place import MEGABYTE, free_space
from tripod_record.topic import Topic
from tripod_record.writer import BagWriter


class State(IntEnum):
    """What a recorder is doing."""

    RECORDING = 0
    CLOSED = 1
    FAILED = 2


@dataclass(frozen=True)
class Progress:
    """How far a recording is.

    Attributes:
        state: What the recorder is doing.
        error: Why it failed, empty otherwise.
        path: The mcap file.
        messages: Messages on the disk.
        dropped: Messages lost because the disk was too slow for the queue.
        waiting: Size of the messages not yet written [B].
    """

    state: State
    error: str
    path: Path
    messages: int
    dropped: int
    waiting: int


@dataclass(frozen=True)
class _Message:
    topic: str
    data: bytes
    stamp: int
    publish_time: int
    sequence: int


def steady_stamps() -> Callable[[], int]:
    """Return a clock [ns since 1970] that starts from the system's and never goes back, even if that does."""
    offset = time.time_ns() - time.monotonic_ns()
    return lambda: offset + time.monotonic_ns()


class Recorder:
    """Writes what it is offered until it is stopped, the disk is full, or writing fails.

    Everything offered is on the disk after at most `period` and the time that the disk takes. The queue is
    bounded: when the disk is too slow for it, messages are dropped and counted, and recording goes on.
    """

    def __init__(
        self,
        writer: BagWriter,
        *,
        period: float = 0.5,
        queue_size: int = 64 * MEGABYTE,
        low_space: int = 0,
        stamp: Callable[[], int] | None = None,
        free: Callable[[Path], int] = free_space,
    ) -> None:
        """Begin.

        Args:
            writer: Belongs to the recorder from now on.
            period: Time between two syncs to the disk [s].
            queue_size: Size of messages that may wait for the disk [B].
            low_space: The recording ends in order when less is free [B].
            stamp: Clock of the messages [ns since 1970]; None takes `steady_stamps()`.
            free: Measures the space left.
        """
        self._writer, self._period, self._queue_size = writer, period, queue_size
        self._low_space, self._stamp, self._free = low_space, stamp or steady_stamps(), free
        self._queue: deque[_Message | Topic] = deque()
        self._waiting = 0
        self._dropped = 0
        self._state, self._error = State.RECORDING, ""
        self._stopping = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    @property
    def progress(self) -> Progress:
        """How far the recording is, now."""
        with self._changed:
            return Progress(
                self._state, self._error, self._writer.path, self._writer.kept, self._dropped, self._waiting
            )

    def add_topic(self, topic: Topic) -> None:
        """Announce a topic before its first message."""
        with self._changed:
            if self._state is State.RECORDING:
                self._queue.append(topic)
            self._changed.notify()

    def offer(self, topic: str, data: bytes, *, publish_time: int = 0, sequence: int = 0) -> bool:
        """Take one message, stamped now, and return at once; False if it is lost (see `dropped`)."""
        with self._changed:
            if self._state is not State.RECORDING or self._stopping:
                return False
            if self._waiting + len(data) > self._queue_size:
                self._dropped += 1
                return False
            self._queue.append(_Message(topic, data, self._stamp(), publish_time, sequence))
            self._waiting += len(data)
            if self._is_crowded():
                self._changed.notify()
            return True

    def stop(self, timeout: float = 10.0) -> Progress:
        """Write what waits, finish the file and return how it ended.

        A disk that is stuck for `timeout` [s] is given up.
        """
        with self._changed:
            self._stopping = True
            self._changed.notify()
        self._thread.join(timeout)
        if self._thread.is_alive():
            with self._changed:
                self._state, self._error = State.FAILED, f"{self._writer.path}: the disk does not answer"
        return self.progress

    def _is_crowded(self) -> bool:
        return self._waiting > self._queue_size // 2

    def _run(self) -> None:
        try:
            while self._step():
                pass
            self._writer.close()
            self._end(State.CLOSED, "")
        # a full disk or a bug: the recording ends in order and says why
        except Exception as error:  # noqa: BLE001
            with suppress(Exception):
                self._writer.abandon()
            reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            self._end(State.FAILED, f"{self._writer.path}: {reason}; {self._writer.kept} messages are kept")

    def _step(self) -> bool:
        """Write and sync what came in one period; return whether to go on."""
        with self._changed:
            self._changed.wait_for(lambda: self._stopping or self._is_crowded(), self._period)
            batch, self._queue = self._queue, deque()
            stopping = self._stopping
        for item in batch:
            if isinstance(item, Topic):
                self._writer.add_topic(item)
            else:
                self._writer.write(
                    item.topic, item.data, item.stamp, publish_time=item.publish_time, sequence=item.sequence
                )
                with self._changed:
                    self._waiting -= len(item.data)
        self._writer.sync()
        if self._low_space and (left := self._free(self._writer.directory)) < self._low_space:
            self._writer.close()
            raise OSError(0, f"the disk is full: {left / MEGABYTE:.1f} MB are left")
        return not stopping

    def _end(self, state: State, error: str) -> None:
        with self._changed:
            self._state, self._error = state, error
            self._queue.clear()
            self._waiting = 0
