"""What people do on the page, handed from the threads of the page to the one of ROS."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from threading import Lock
from typing import Any


class Button(Enum):
    """The buttons of the page."""

    STOP = "STOP"
    TELEOP = "TELEOP"
    IK = "IK"
    WORKING_POSE = "working pose"
    PARK = "park"
    FETCH_TARGET = "bring target to effector"


@dataclass(frozen=True)
class Pressed:
    """A button was pressed."""

    button: Button


@dataclass(frozen=True)
class SliderMoved:
    """A slider was moved: `servo` 0..2 to `degrees`, as the browser sent it (unchecked)."""

    servo: int
    degrees: Any

    @property
    def radians(self) -> float:
        """The angle [rad], NaN for what is not a number."""
        try:
            return math.radians(float(self.degrees))
        except (TypeError, ValueError, OverflowError):
            return math.nan


@dataclass(frozen=True)
class Grabbed:
    """The handle was taken by `client`."""

    client: int


@dataclass(frozen=True)
class Dragged:
    """The handle was dragged by `client` to `position` [m], as the browser sent it (unchecked)."""

    client: int
    position: Any


@dataclass(frozen=True)
class Dropped:
    """The handle was let go by `client`."""

    client: int


@dataclass(frozen=True)
class Joined:
    """A browser opened the page."""

    client: int


@dataclass(frozen=True)
class Left:
    """A browser closed the page or lost its connection."""

    client: int


Event = Pressed | SliderMoved | Grabbed | Dragged | Dropped | Joined | Left


class Inbox:
    """Events from any thread, in order; the reader is woken for the first of a batch.

    Bounded, because a browser may send what it likes: of drags, slider moves and equal presses in a row only
    the newest is kept; beyond `capacity` only STOP and the coming and going of hands and browsers are still
    taken.

    Attributes:
        lost: Events refused since start.
    """

    def __init__(self, wake: Callable[[], object], capacity: int = 1000) -> None:
        """`wake`: called on the writer's thread when the reader should `drain`; quick and thread-safe."""
        self._wake, self._capacity, self._lock = wake, capacity, Lock()
        self._events: deque[Event] = deque()
        self.lost = 0

    def put(self, event: Event) -> None:
        """Add an event; any thread."""
        with self._lock:
            first = not self._events
            if self._events and _supersedes(event, self._events[-1]):
                self._events[-1] = event
            elif len(self._events) < self._capacity or _essential(event):
                self._events.append(event)
            else:
                self.lost += 1
        if first:
            self._wake()

    def drain(self) -> list[Event]:
        """Take all events, oldest first."""
        with self._lock:
            events = list(self._events)
            self._events.clear()
        return events


def _supersedes(new: Event, old: Event) -> bool:
    if isinstance(new, Pressed):
        return new == old
    if isinstance(new, Dragged) and isinstance(old, Dragged):
        return new.client == old.client
    return isinstance(new, SliderMoved) and isinstance(old, SliderMoved) and new.servo == old.servo


def _essential(event: Event) -> bool:
    return event == Pressed(Button.STOP) or isinstance(event, Joined | Left | Dropped)
