"""Which topics are recorded, and with which quality of service one listens to them."""

from collections.abc import Sequence
from fnmatch import fnmatchcase

from tripod_record.topic import Qos

ALWAYS = frozenset({"/diagnostics", "/tf", "/tf_static", "/clock"})
"""Absolute topics that belong to every namespace."""


def patterns(words: str, namespace: str) -> tuple[str, ...]:
    """Return the full names or patterns (`*`, `?`) in a list parted by spaces or commas; relative ones in
    `namespace`.

    >>> patterns("sim/*, /tf", "/robot")
    ('/robot/sim/*', '/tf')
    """
    root = namespace.rstrip("/")
    return tuple(w if w.startswith("/") else f"{root}/{w}" for w in words.replace(",", " ").split())


def is_selected(topic: str, namespace: str, wanted: Sequence[str], unwanted: Sequence[str]) -> bool:
    """Whether `topic` is recorded.

    Args:
        topic: Full name.
        namespace: Of the recording node; without `wanted`, what lies in it is recorded, and what is in
            `ALWAYS`.
        wanted: Patterns of which one must match; none means all.
        unwanted: Patterns of which none may match, unless the topic is named in `wanted` word by word.
    """
    if topic in wanted:
        return True
    if any(fnmatchcase(topic, p) for p in unwanted) or any(w.startswith("_") for w in topic.split("/")):
        return False  # a leading underscore hides a topic
    if wanted:
        return any(fnmatchcase(topic, p) for p in wanted)
    return topic in ALWAYS or topic.startswith(namespace.rstrip("/") + "/")


def listening(offered: Sequence[Qos]) -> tuple[bool, bool]:
    """Return whether to ask for reliable delivery, and for latched messages: what every publisher can give.

    A reader that asks for more than a writer offers receives nothing from it.
    """
    reliable = all(q.reliability == "reliable" for q in offered)
    latched = all(q.durability == "transient_local" for q in offered)
    return reliable and bool(offered), latched and bool(offered)
