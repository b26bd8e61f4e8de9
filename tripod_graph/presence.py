"""Who publishes a topic already: two that publish the same would mix."""

import time
from collections import Counter
from collections.abc import Collection
from typing import Any

DISCOVERY = 3.5
"""Time within which nodes of a graph find each other, unless the machine is very busy [s]: each announces itself every
three seconds."""

NAMELESS = "_NODE_NAME_UNKNOWN_"
"""What ROS calls a node whose topics are known sooner than its name."""


def publisher_elsewhere(
    node: Any, topics: Collection[str], patience: float = DISCOVERY
) -> tuple[str, str] | None:
    """Return a topic and the full name of another node that publishes it; None if nobody did for `patience` [s].

    Another node may have the name of this one. One whose name does not come in time is "another node".
    """
    full = node.get_fully_qualified_name()
    own = Counter((publisher.topic_name, full) for publisher in node.publishers)
    deadline = time.monotonic() + patience
    while True:
        found = None
        for topic in topics:
            names = Counter(
                f"{p.node_namespace.rstrip('/')}/{p.node_name}"
                for p in node.get_publishers_info_by_topic(topic)
            )
            for name, count in names.items():
                if count > own[node.resolve_topic_name(topic), name]:
                    found = topic, name
        if found and NAMELESS not in found[1]:
            return found
        if time.monotonic() >= deadline:
            return found and (found[0], "another node")
        time.sleep(0.05)
