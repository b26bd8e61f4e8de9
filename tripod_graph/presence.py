"""Who publishes a topic already: two that publish the same would mix."""

import time
from collections.abc import Collection
from typing import Any

DISCOVERY = 1.5
"""Time within which nodes of a graph find each other, unless the machine is very busy [s]."""


def publisher_elsewhere(
    node: Any, topics: Collection[str], patience: float = DISCOVERY
) -> tuple[str, str] | None:
    """Return a topic and the full name of another node that publishes it; None if nobody did for `patience` [s]."""
    own = node.get_fully_qualified_name()
    deadline = time.monotonic() + patience
    while True:
        for topic in topics:
            for p in node.get_publishers_info_by_topic(topic):
                name = f"{p.node_namespace.rstrip('/')}/{p.node_name}"
                if name != own:
                    return topic, name
        if time.monotonic() >= deadline:
            return None
        time.sleep(0.05)
