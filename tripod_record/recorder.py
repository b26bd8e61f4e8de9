"""Records in a thread of its own: offering a message never waits, and what cannot be kept is counted."""

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from enum import IntEnum
from pathlib import Path

from tripod_record.errors import FileLostError
from tripod_record.place import MEGABYTE, free_space, recording_directory
from tripod_record.structure import messages_kept
from tripod_record.topic import Topic
from tripod_record.writer import BagWriter

LOOK = 0.1
"""Between two looks whether a recorder that is to stop still works [s]."""


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
        error: Why it failed, or why it cannot write at present; empty otherwise.
        path: The mcap file.
        messages: Messages on the disk.
        dropped: Messages lost because the disk was too slow or too full for the queue.
        waiting: Size of the messages not yet written [B].
        destroyed: Messages lost because another program destroyed them in the file.
        rescue: What another program did to the file and what was done about it; empty if nothing.
        dropped_of: The dropped messages by topic.
    """

    state: State
    error: str
    path: Path
    messages: int
    dropped: int = 0
    waiting: int = 0
    destroyed: int = 0
    rescue: str = ""
    dropped_of: Mapping[str, int] = field(default_factory=dict)

    @property
    def is_whole(self) -> bool:
        """Whether all that was offered is, or will be, where the recording began."""
        return self.state is not State.FAILED and not self.dropped and not self.rescue


@dataclass(frozen=True)
class _Message:
    topic: str
    data: bytes
    stamp: int
    publish_time: int
    sequence: int


@dataclass(frozen=True)
class _Attachment:
    name: str
    data: bytes
    stamp: int


def steady_stamps() -> Callable[[], int]:
    """Return a clock [ns since 1970] that starts from the system's and never goes back, even if that does."""
    offset = time.time_ns() - time.monotonic_ns()
    return lambda: offset + time.monotonic_ns()


class Recorder:
    """Writes what it is offered until it is stopped.

    Everything offered is on the disk after at most `period` and the time that the disk takes. What a full disk does
    not take waits in the queue and is tried again each `period`. The queue is bounded: when the disk is too slow or
    too full for it, messages are dropped and counted, and recording goes on. A file that another program deletes,
    moves, replaces or cuts goes on in a new directory beside, with all that can still be read of it.
    """

    def __init__(
        self,
        writer: BagWriter,
        *,
        period: float = 0.5,
        queue_size: int = 64 * MEGABYTE,
        low_space: int = 0,
        max_size: int = 0,
        max_duration: float = 0.0,
        stamp: Callable[[], int] | None = None,
        system_time: Callable[[], int] = time.time_ns,
        free: Callable[[Path], int] = free_space,
    ) -> None:
        """Begin.

        Args:
            writer: Belongs to the recorder from now on.
            period: Time between two syncs to the disk [s].
            queue_size: Size of messages that may wait for the disk [B].
            low_space: Only the end of the recording is written when less is free [B].
            max_size: A file of this size is followed by the next, within a period [B]; 0: one file.
            max_duration: A file of this length is followed by the next, within a period [s]; 0: one file.
            stamp: Clock of the messages [ns since 1970]; None takes `steady_stamps()`.
            system_time: Clock of the publishers [ns since 1970].
            free: Measures the space left.
        """
        self._writer, self._period, self._queue_size = writer, period, queue_size
        self._low_space, self._free = low_space, free
        self._max_size, self._max_duration = max_size or float("inf"), max_duration or float("inf")
        self._split_wanted = False
        self._stamp, self._system_time = stamp or steady_stamps(), system_time
        self._queue: deque[_Message | Topic | _Attachment] = deque()
        self._waiting = 0
        self._offered = self._destroyed = 0
        self._dropped = Counter[str]()
        self._state, self._error, self._rescued = State.RECORDING, "", ""
        self._stopping = False
        self._clock: int | None = None  # of the thread's processor time
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    @property
    def progress(self) -> Progress:
        """How far the recording is, now."""
        with self._changed:
            return Progress(
                self._state,
                self._error,
                self._writer.path,
                self._writer.kept,
                self._dropped.total(),
                self._waiting,
                self._destroyed,
                self._rescued,
                dict(self._dropped),
            )

    def add_topic(self, topic: Topic) -> None:
        """Announce a topic before its first message."""
        with self._changed:
            if self._state is State.RECORDING:
                self._queue.append(topic)
            self._changed.notify()

    def attach(self, name: str, data: bytes) -> None:
        """Add a file of its own to the recording; see `BagWriter.attach`."""
        with self._changed:
            if self._state is State.RECORDING:
                self._queue.append(_Attachment(name, data, self._stamp()))
            self._changed.notify()

    def split(self, timeout: float = 10.0) -> bool:
        """Go on in a new file and wait for it; return whether it is there. A file without messages is not left."""
        with self._changed:
            if self._state is not State.RECORDING:
                return False
            self._split_wanted = True
            self._changed.notify()
            return self._changed.wait_for(lambda: not self._split_wanted, timeout) and not self._error

    def offer(
        self, topic: str, data: bytes, *, publish_time: int = 0, sequence: int = 0, received: int = 0
    ) -> bool:
        """Take one message and return at once; False if it is lost (see `dropped`).

        `received` and `publish_time`, by the system's clock, become times of the clock of the stamps, which no step of
        the former disturbs: now less the time since then. 0 if unknown: then it was received now.
        """
        with self._changed:
            if self._state is not State.RECORDING or self._stopping:
                return False
            self._offered += 1
            if self._waiting + len(data) > self._queue_size:
                self._dropped[topic] += 1
                return False
            now, system = self._stamp(), self._system_time()
            stamp = now - max(0, system - received) if received else now
            sent = now - max(0, system - publish_time) if publish_time else 0
            self._queue.append(_Message(topic, data, stamp, sent, sequence))
            self._waiting += len(data)
            if self._is_crowded():
                self._changed.notify()
            return True

    def stop(self, timeout: float = 10.0) -> Progress:
        """Write what waits, finish the file and return how it ended.

        A disk that is stuck for `timeout` [s] is given up; a thread that works is waited for, as long as it takes on a
        busy machine.
        """
        with self._changed:
            self._stopping = True
            self._changed.notify()
        spent, left = -1.0, timeout
        while self._thread.is_alive() and left > 0:
            self._thread.join(LOOK)
            left -= LOOK
            with suppress(OSError):  # it has just ended
                if self._clock is not None and (now := time.clock_gettime(self._clock)) > spent:
                    spent, left = now, timeout
        if self._thread.is_alive():
            with self._changed:
                self._state, self._error = (
                    State.FAILED,
                    f"{self._writer.path}: the disk does not respond; check it, or record elsewhere",
                )
        return self.progress

    def _run(self) -> None:
        self._clock = time.pthread_getcpuclockid(threading.get_ident())
        try:
            while not self._is_stopping():
                self._step()
            self._keep(last=True)
            self._writer.close()
            self._end(State.CLOSED, "")
        # a full disk or a bug: the recording ends in order and says why
        except Exception as error:  # noqa: BLE001
            with suppress(Exception):
                self._writer.abandon()
            kept = messages_kept(self._writer.path)
            self._end(State.FAILED, f"{self._reason(error)}; {kept} of {self._offered} messages are kept")

    def _is_stopping(self) -> bool:
        """Wait for the next turn; return whether it is the last."""
        with self._changed:
            stuck = bool(self._error)
            self._changed.wait_for(
                lambda: self._stopping or self._split_wanted or (self._is_crowded() and not stuck),
                self._period,
            )
            return self._stopping

    def _is_crowded(self) -> bool:
        return self._waiting > self._queue_size // 2

    def _step(self) -> None:
        """Write and sync what came in one period, or note why that is not possible."""
        try:
            self._keep()
            error = ""
        except OSError as reason:
            error = f"{self._reason(reason)}; new messages wait in memory"
        with self._changed:
            self._error = error

    def _keep(self, *, last: bool = False) -> None:
        self._sync()
        if not last and self._low_space and (left := self._free(self._writer.directory)) < self._low_space:
            raise OSError(
                0, f"the disk is full: {left / MEGABYTE:.1f} MB are left; free some space or record elsewhere"
            )
        with self._changed:
            batch, self._queue = self._queue, deque()
        for item in batch:
            if isinstance(item, Topic):
                self._writer.add_topic(item)
            elif isinstance(item, _Attachment):
                self._writer.attach(item.name, item.data, item.stamp)
            else:
                self._writer.write(
                    item.topic, item.data, item.stamp, publish_time=item.publish_time, sequence=item.sequence
                )
                with self._changed:
                    self._waiting -= len(item.data)
        self._sync()
        full = self._writer.size >= self._max_size or self._writer.duration >= self._max_duration
        if (full or self._split_wanted) and not last:
            self._sync(self._writer.split)
            with self._changed:
                self._split_wanted = False
                self._changed.notify_all()

    def _sync(self, sync: Callable[[], None] | None = None) -> None:
        try:
            (sync or self._writer.sync)()
        except FileLostError as lost:
            self._rescue(f"{self._writer.path} {lost}")

    def _rescue(self, reason: str) -> None:
        directory = self._writer.directory
        try:
            gone = self._writer.rescue(recording_directory(directory.parent, directory.name, datetime.now()))
        except OSError as error:
            raise OSError(
                error.errno, f"{reason}, and no new file can be made beside it: {error.strerror}"
            ) from None
        with self._changed:
            self._destroyed += gone
            what = f"{gone} messages are lost, all others are" if gone else "all messages are"
            self._rescued = f"{reason}; {what} in {self._writer.path}, where the recording continues"

    def _reason(self, error: Exception) -> str:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        path = str(self._writer.path)
        return reason if reason.startswith(path) else f"{path}: {reason}"

    def _end(self, state: State, error: str) -> None:
        with self._changed:
            self._state, self._error = state, error
            self._split_wanted = False
            self._changed.notify_all()
            self._queue.clear()
            self._waiting = 0
