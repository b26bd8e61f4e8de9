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

PLAIN = ("reset", "pause", "run", "step", "drop", "figures", "as_shipped")
"""Requests of one word."""


@dataclass(frozen=True)
class Request:
    """A request.

    Attributes:
        do: One of `PLAIN`, `effect` or `accuracy`.
        effect, on: Which effect to start again with, or without.
        accuracy: Which accuracy to start again with.
    """

    do: str
    effect: str = ""
    on: bool = False
    accuracy: str = ""


def request_of(text: str) -> Request:
    """Return the request that a message holds: JSON such as {"do": "reset"}, {"effect": "sleep", "on": true},
    {"accuracy": "5%"}. Raises SceneError."""
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
    if table.get("do") not in PLAIN:
        raise SceneError(f"sim/request: do is {shown(table.get('do'))}; allowed: {', '.join(PLAIN)}")
    return Request(str(table["do"]))


def changed(changes: Sequence[str], request: Request) -> list[str]:
    """Return `changes`, overrides of a scene, with an effect switched on with its defaults, or off."""
    kept = [word for word in changes if word.partition("=")[0].partition(".")[0].strip() != request.effect]
    return [*kept, *(words(request.effect) if request.on else (f"{request.effect}=off",))]
