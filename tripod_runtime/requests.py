"""What may be asked of a running simulator by a message of one line, checked. Pure."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tripod_sim.effects import EFFECTS, words
from tripod_sim.errors import SceneError, shown
from tripod_study.accuracy.choice import asked

LONGEST = 1000
"""Of a request [characters]."""

LARGEST = 1e9
"""Number in a request."""

PLAIN = ("reset", "pause", "run", "step", "drop", "unload", "figures", "as_shipped")
"""Requests of one word."""

SLOWEST, FASTEST = 0.1, 10.0
"""Speeds: simulated time over wall time."""


@dataclass(frozen=True)
class Request:
    """A request.

    Attributes:
        do: One of `PLAIN`, `effect`, `accuracy`, `pull`, `let_go`, `load` or `speed`.
        effect, on: Which effect to start again with, or without.
        accuracy: Which accuracy to start again with.
        who: Whose hand pulls, or lets go.
        vertex: Of the skin, which is pulled or loaded.
        hold: Where a pull takes hold [m].
        vector: Where that place is pulled to [m], or the load [N].
        stiffness: Of the pull [N/m]; None: the usual one.
        speed: Simulated time over wall time.
    """

    do: str
    effect: str = ""
    on: bool = False
    accuracy: str = ""
    who: int = 0
    vertex: int = 0
    hold: tuple[float, float, float] = (0.0, 0.0, 0.0)
    vector: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stiffness: float | None = None
    speed: float = 1.0


def request_of(text: str) -> Request:
    """Return the request that a message holds: JSON such as {"do": "reset"}, {"effect": "sleep", "on": true},
    {"accuracy": "5%"}, {"pull": {"who": 1, "vertex": 17, "from": [0, 0, 0.02], "to": [0.01, 0, 0.02]}},
    {"let_go": 1},
    {"load": {"vertex": 17, "force": [0, 0, -0.1]}}, {"speed": 0.5}. Raises SceneError."""
    if len(text) > LONGEST:
        raise SceneError(f"sim/request has {len(text)} characters; allowed: at most {LONGEST}")
    try:
        table: Any = json.loads(text)
    except (ValueError, RecursionError):
        raise SceneError(f"sim/request {shown(text)} is not JSON") from None
    if not isinstance(table, dict):
        raise SceneError(f"sim/request {shown(text)} is not a JSON object")
    if (effect := table.get("effect")) is not None:
        if effect not in EFFECTS:
            raise SceneError(f"sim/request: effect {shown(effect)} is unknown; effects: {', '.join(EFFECTS)}")
        if not isinstance(table.get("on"), bool):
            raise SceneError(f"sim/request: on is {shown(table.get('on'))}; it must be true or false")
        return Request("effect", effect=effect, on=table["on"])
    if (accuracy := table.get("accuracy")) is not None:
        asked(str(accuracy))
        return Request("accuracy", accuracy=str(accuracy))
    if (by_hand := _by_hand(table)) is not None:
        return by_hand
    if table.get("do") not in PLAIN:
        raise SceneError(f"sim/request: do is {shown(table.get('do'))}; allowed: {', '.join(PLAIN)}")
    return Request(str(table["do"]))


def _by_hand(table: dict[str, Any]) -> Request | None:
    """Return a request of a hand or for another speed; None: it is another one. Raises SceneError."""
    match table:
        case {"speed": value}:
            speed = _number("speed", value)
            if not SLOWEST <= speed <= FASTEST:
                raise SceneError(f"sim/request: speed is {speed:g}; allowed: {SLOWEST:g} to {FASTEST:g}")
            return Request("speed", speed=speed)
        case {"pull": {"who": who, "vertex": vertex, "from": hold, "to": to, **more}}:
            stiffness = more.get("stiffness")
            return Request(
                "pull",
                who=_whole("who", who),
                vertex=_whole("vertex", vertex),
                hold=_vector("from", hold),
                vector=_vector("to", to),
                stiffness=None if stiffness is None else _number("stiffness", stiffness),
            )
        case {"load": {"vertex": vertex, "force": force}}:
            return Request("load", vertex=_whole("vertex", vertex), vector=_vector("force", force))
        case {"let_go": who}:
            return Request("let_go", who=_whole("let_go", who))
    return None


def changed(changes: Sequence[str], request: Request) -> list[str]:
    """Return `changes`, overrides of a scene, with an effect switched on with its defaults, or off."""
    kept = [word for word in changes if word.partition("=")[0].partition(".")[0].strip() != request.effect]
    return [*kept, *(words(request.effect) if request.on else (f"{request.effect}=off",))]


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LARGEST:  # NaN, too
        raise SceneError(f"sim/request: {name} is {shown(value)}; it must be a finite number")
    return float(value)


def _whole(name: str, value: Any) -> int:
    if type(value) is not int or not 0 <= value < LARGEST:
        raise SceneError(f"sim/request: {name} is {shown(value)}; it must be a whole number, at least 0")
    return value


def _vector(name: str, value: Any) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise SceneError(f"sim/request: {name} is {shown(value)}; it must be a list of three numbers")
    x, y, z = (_number(name, part) for part in value)
    return x, y, z
