"""What a recording keeps about a topic besides its messages: type, definition, quality of service."""

from dataclasses import dataclass

FOREVER = 2**63 - 1
"""A duration without end [ns]."""


@dataclass(frozen=True)
class Qos:
    """Quality of service that one publisher offers, in the words of rosbag2's metadata (version 9).

    Attributes:
        reliability: "reliable", "best_effort" or "unknown".
        durability: "volatile", "transient_local" or "unknown".
        history: "keep_last", "keep_all" or "unknown" (discovery does not carry it).
        depth: Messages kept; 0 if unknown.
        deadline: Longest time between messages promised [ns].
        lifespan: Time after which a message is stale [ns].
        liveliness: "automatic", "manual_by_topic" or "unknown".
        lease: Time after which a silent publisher counts as dead [ns].
    """

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "unknown"
    depth: int = 0
    deadline: int = FOREVER
    lifespan: int = FOREVER
    liveliness: str = "automatic"
    lease: int = FOREVER


@dataclass(frozen=True)
class Topic:
    """A topic as it is recorded.

    Attributes:
        name: Full name, "/sim/status".
        type: Full type, "tripod_msgs/msg/SimStatus".
        definition: Text of the type with everything it is made of (`definitions.definition_text`).
        qos: What its publishers offer.
        type_hash: REP 2011 hash, "RIHS01_...", empty if unknown.
    """

    name: str
    type: str
    definition: str
    qos: tuple[Qos, ...] = ()
    type_hash: str = ""


def qos_yaml(profiles: tuple[Qos, ...], indent: str = "") -> str:
    """Return rosbag2's YAML list of `profiles`, each line after `indent`; "[]" if there are none."""
    if not profiles:
        return f"{indent}[]"
    return "\n".join(_profile_yaml(profile, indent) for profile in profiles)


def _profile_yaml(qos: Qos, indent: str) -> str:
    lines = [
        f"- history: {qos.history}",
        f"  depth: {qos.depth}",
        f"  reliability: {qos.reliability}",
        f"  durability: {qos.durability}",
        *_duration_yaml("deadline", qos.deadline),
        *_duration_yaml("lifespan", qos.lifespan),
        f"  liveliness: {qos.liveliness}",
        *_duration_yaml("liveliness_lease_duration", qos.lease),
        "  avoid_ros_namespace_conventions: false",
    ]
    return "\n".join(indent + line for line in lines)


def _duration_yaml(key: str, nanoseconds: int) -> list[str]:
    seconds, rest = divmod(nanoseconds, 10**9)
    return [f"  {key}:", f"    sec: {seconds}", f"    nsec: {rest}"]
