"""What people do on the page, handed from the threads of the page to the one of ROS."""

import json
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from threading import Lock
from typing import Any


class EventError(ValueError):
    """What a browser sent and no page would; the message says what."""


class Button(Enum):
    """The buttons of the page."""

    STOP = "STOP"
    TELEOP = "TELEOP"
    IK = "IK"
    WORKING_POSE = "working pose"
    PARK = "park"
    FETCH_TARGET = "bring target to effector"
    RECORD = "record"
    STOP_RECORDING = "stop recording"


MOST_SERVOS = 64
"""Of a message of the page."""

LONGEST = 1000
"""Of a message of a browser [characters]; a longer one is refused unread."""

WISHES = ("reset", "pause", "run", "step", "drop", "unload", "as_shipped")
"""What is asked of the simulator by one word."""


@dataclass(frozen=True)
class Pressed:
    """A button was pressed."""

    button: Button


@dataclass(frozen=True)
class SliderMoved:
    """A servo is asked to be at an angle [rad]."""

    servo: int
    radians: float


@dataclass(frozen=True)
class JointMoved:
    """A joint that is no servo is asked for a value, in the unit of its slider."""

    joint: int
    shown: float


@dataclass(frozen=True)
class SlideMoved:
    """The slide is asked to be at a place [m]."""

    metres: float


@dataclass(frozen=True)
class KeysHeld:
    """Keys are down: +1, -1 or 0 for each servo; a page repeats it while they are."""

    signs: tuple[int, ...]


@dataclass(frozen=True)
class Wish:
    """Something is asked of the simulator: the text of a `sim/request`."""

    text: str


@dataclass(frozen=True)
class Reset(Wish):
    """A wish that the simulation starts again."""


@dataclass(frozen=True)
class Pull(Wish):
    """A wish that a body is pulled: the newest of hand `who` counts."""

    who: int


@dataclass(frozen=True)
class Replayed:
    """The past is to be shown from `age` [s] ago on, running or not; None: the present."""

    age: float | None
    running: bool = False


@dataclass(frozen=True)
class Nonsense:
    """A browser sent what no page would."""

    what: str


@dataclass(frozen=True)
class Grabbed:
    """The handle was taken by `client`."""

    client: int


@dataclass(frozen=True)
class Dragged:
    """The handle was dragged by `client` to `position` [m] and turned to `quaternion` (x, y, z, w), unchecked lists."""

    client: int
    position: Any
    quaternion: Any = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Dropped:
    """The handle was let go by `client`, or `client` left."""

    client: int


@dataclass(frozen=True)
class Shows:
    """The browser `client` colours the bodies by a field, empty for none, and shows forces or not."""

    client: int
    field: str
    forces: bool


@dataclass(frozen=True)
class Took:
    """A browser took a picture."""


@dataclass(frozen=True)
class Joined:
    """A browser opened the page."""

    client: int


@dataclass(frozen=True)
class Left:
    """A browser closed the page or lost its connection."""

    client: int


Event = (
    Pressed | SliderMoved | JointMoved | SlideMoved | KeysHeld | Wish | Replayed | Nonsense
    | Grabbed | Dragged | Dropped | Shows | Joined | Left
)  # fmt: skip


def event_of(text: str | bytes) -> Event:  # noqa: PLR0911 - one for each kind
    """Return the event that a message of the page is, in degrees and millimetres there. Raises EventError.

    {"press": "STOP"}, {"servo": 1, "degrees": -30}, {"joint": 1, "value": 12.5}, {"slide": 35}, {"keys": [0, 1, -1]},
    {"sim": "reset"},
    {"pull": {"who": 7, "vertex": 3, "from": [..], "to": [..], "stiffness": 50}}, {"let_go": 7}, {"speed": 0.5},
    {"load": {"vertex": 3, "force": [x, y, z]}}, in m and N,
    {"effect": "sleep", "on": true}, {"accuracy": "5%"}, {"replay": 12.5, "running": true}, {"replay": null}
    """
    table = _table(text)
    if wish := _wish_of(table):
        return wish
    match table:
        case {"press": str(name)} if name in {b.value for b in Button}:
            return Pressed(Button(name))
        case {"servo": servo, "degrees": degrees} if type(servo) is int and 0 <= servo < MOST_SERVOS:
            return SliderMoved(servo, math.radians(_number("degrees", degrees)))
        case {"joint": joint, "value": value} if type(joint) is int and 0 <= joint < MOST_SERVOS:
            return JointMoved(joint, _number("value", value))
        case {"slide": value}:
            return SlideMoved(1e-3 * _number("slide", value))
        case {"keys": [*signs]} if len(signs) <= MOST_SERVOS and all(
            type(k) is int and abs(k) <= 1 for k in signs
        ):
            return KeysHeld(tuple(signs))
        case {"replay": None}:
            return Replayed(None)
        case {"replay": age, "running": bool(running)}:
            return Replayed(_number("replay", age), running)
    raise EventError(f"{text!r:.60} is not a known action")


def _wish_of(table: Any) -> Wish | None:  # noqa: PLR0911 - one for each kind
    """Return the request to the simulator in a message; None: there is none. Raises EventError."""
    match table:
        case {"sim": str(word)} if word in WISHES:
            return (Reset if word == "reset" else Wish)(json.dumps({"do": word}))
        case {"pull": {"who": who, "vertex": vertex, "from": [a, b, c], "to": [x, y, z], "stiffness": k}}:
            hand, hold, to = _count("who", who), _three("from", a, b, c), _three("to", x, y, z)
            pull = {"who": hand, "vertex": _count("vertex", vertex), "from": hold, "to": to}
            more = {} if k is None else {"stiffness": _number("stiffness", k)}
            return Pull(json.dumps({"pull": pull | more}), hand)
        case {"let_go": who}:
            return Wish(json.dumps({"let_go": _count("let_go", who)}))
        case {"load": {"vertex": vertex, "force": [x, y, z]}}:
            load = {"vertex": _count("vertex", vertex), "force": _three("force", x, y, z)}
            return Wish(json.dumps({"load": load}))
        case {"speed": speed}:
            return Wish(json.dumps({"speed": _number("speed", speed)}))
        case {"effect": str(effect), "on": bool(on)}:
            return Wish(json.dumps({"effect": effect, "on": on}))
        case {"accuracy": str(accuracy)}:
            return Wish(json.dumps({"accuracy": accuracy}))
    return None


def hand_of(text: str | bytes, client: int) -> Grabbed | Dragged | Dropped | Shows | Took:
    """Return what a message of the 3-D view of `client` means. Raises EventError.

    {"took": true}, {"grab": true}, {"drag": [x, y, z], "turn": [x, y, z, w]} [m], {"drop": true},
    {"show": "von_mises", "forces": true}
    """
    match _table(text):
        case {"took": True}:
            return Took()
        case {"grab": True}:
            return Grabbed(client)
        case {"drag": [*position], "turn": [*quaternion]}:
            return Dragged(client, position, quaternion)
        case {"drop": True}:
            return Dropped(client)
        case {"show": str(field), "forces": bool(forces)}:
            return Shows(client, field, forces)
    raise EventError(f"{text!r:.60} is not a known action")


def _table(text: str | bytes) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise EventError(f"{text!r:.60} is not JSON") from None


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e12:  # NaN, too
        raise EventError(f"{name} is {value!r:.40}; it must be a finite number")
    return float(value)


def _count(name: str, value: Any) -> int:
    if type(value) is not int or not 0 <= value < 2**31:
        raise EventError(f"{name} is {value!r:.40}; it must be a whole number")
    return value


def _three(name: str, *values: Any) -> list[float]:
    return [_number(name, value) for value in values]


class Inbox:
    """Events from any thread, in order; the reader is woken for the first of a batch.

    Bounded, because a browser may send what it likes: of drags, slider moves, keys and equal presses in a row only
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
    if isinstance(new, Dragged | Shows) and isinstance(old, Dragged | Shows):
        return type(new) is type(old) and new.client == old.client
    if isinstance(new, Pull) and isinstance(old, Pull):
        return new.who == old.who
    if isinstance(new, SliderMoved) and isinstance(old, SliderMoved):
        return new.servo == old.servo
    if isinstance(new, JointMoved) and isinstance(old, JointMoved):
        return new.joint == old.joint
    return type(new) is type(old) and isinstance(new, SlideMoved | KeysHeld | Replayed)


def _essential(event: Event) -> bool:
    return (
        event == Pressed(Button.STOP)
        or isinstance(event, Joined | Left | Dropped)
        or (isinstance(event, Shows) and not event.field)
    )
