"""Records the topics of the graph to an mcap file.

Prints `recording PATH` when it begins, and again when it has to go on elsewhere, and `recorded PATH` with a count when
it ends. The exit code is 1 if any recording is not whole, or not where it began.
"""

import sys
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from fnmatch import fnmatchcase
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_msgs.msg import String
from std_srvs.srv import Trigger

from tripod_graph import diagnostic_keys as keys
from tripod_graph import names
from tripod_graph.diagnostic_keys import Recording
from tripod_graph.diagnostics import Diagnostics, Level, Report
from tripod_graph.executor import Patient
from tripod_graph.parameters import declare
from tripod_graph.run import FAILED, run_node
from tripod_host.priority import stand_back
from tripod_record.definitions import definition_text, message_class
from tripod_record.errors import RecordError
from tripod_record.losses import Losses
from tripod_record.place import check_place, recording_directory
from tripod_record.recorder import Progress, Recorder, State
from tripod_record.selection import is_selected, listening, patterns
from tripod_record.settings import DERIVED, PARAMETERS
from tripod_record.topic import Qos, Topic
from tripod_record.versions import versions_json
from tripod_record.writer import BagWriter

ATTACHED = {names.SCENE: ".toml", names.CALIBRATION: ".yaml"}
"""Topics of which the text is a file of the recording, too, and how its name ends."""

LOOK_PERIOD = 0.25
"""Time between two looks for new topics [s]."""
LOOKS = 8
"""Every which of them also asks those topics that have as many publishers as before who these are."""
FOUND_BY = 20
"""After how many looks, 5 s, what is asked for should have been found."""
TAKE_PERIOD = 0.02
"""Time between two takes of what has come [s]: it is stamped as it came, and one wake-up for each would be most of the
work."""
DEPTH = 200
"""Messages of one topic that may wait to be taken from the middleware."""


UNKNOWN = ""
"""Stands for the type of a topic whose type is not installed."""


@dataclass(frozen=True)
class Listener:
    """A subscription and what it asks for; it hears only publishers that offer as much."""

    subscription: Subscription
    reliable: bool
    latched: bool


class _Taken(NamedTuple):
    """A message, and when it came and was sent, by the system's clock [ns]."""

    received: int
    topic: str
    data: bytes
    publish_time: int
    sequence: int


class RecordNode(Node):
    """Listens to the topics of the graph and hands their bytes to a `Recorder`.

    Attributes:
        whole: Whether every recording that has ended holds all that was heard, where it began.
    """

    def __init__(self) -> None:
        super().__init__("record")
        values = declare(self, PARAMETERS)
        self._directory = Path(values["directory"]).expanduser()
        self._name: str = values["name"]
        self._wanted = patterns(values["topics"], self.get_namespace())
        excluded = values["exclude"] if values["derived"] else " ".join((values["exclude"], *DERIVED))
        self._unwanted = patterns(excluded, self.get_namespace())
        self._values = values
        self._recorder: Recorder | None = None
        self._ended: Progress | None = None
        self._told: Progress | None = None
        self.whole = True
        self._listeners: dict[str, Listener] = {}
        self._types: dict[str, str] = {}
        self._refused: dict[str, str] = {}
        self._seen: dict[str, tuple[int, tuple[str, ...]]] = {}
        self._looks = 0
        self._taken: list[_Taken] = []
        self._losses: defaultdict[str, Losses] = defaultdict(Losses)
        self._warned = dict[str, int]()
        self.create_service(Trigger, names.RECORD_START, self._on_start)
        self.create_service(Trigger, names.RECORD_STOP, self._on_stop)
        self.create_service(Trigger, names.RECORD_SPLIT, self._on_split)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._patient = Patient()
        self._take_timer = self.create_timer(TAKE_PERIOD, self._offer, clock=steady, autostart=False)
        self.create_timer(LOOK_PERIOD, self._look, clock=steady)
        self._diagnostics = Diagnostics(self, self._report)
        if values["autostart"]:
            self.start()

    def start(self) -> Path:
        """Begin a recording and return its mcap file; raises RecordError."""
        if self._recorder is not None:
            raise RecordError(f"already recording {self._recorder.progress.path}")
        min_free: int = self._values["min_free"]
        check_place(self._directory, min_free)
        directory = recording_directory(self._directory, self._name, datetime.now())
        writer = BagWriter(directory, compression=self._values["compression"])
        self._losses.clear()
        self._warned.clear()
        self._types.clear()
        self._refused.clear()
        self._seen.clear()
        self._taken.clear()
        self._looks = 0
        self._recorder = Recorder(
            writer,
            period=self._values["sync_period"],
            queue_size=self._values["queue_size"],
            low_space=min_free // 10,
            max_size=self._values["max_size"],
            max_duration=self._values["max_duration"],
        )
        self._recorder.attach("versions.json", versions_json().encode())
        self._told = self._recorder.progress
        print(f"recording {writer.path}", flush=True)
        self._look()
        self._take_timer.reset()
        return writer.path

    def stop(self) -> Progress | None:
        """End the recording and return how it ended; None if there is none."""
        if self._recorder is None:
            return None
        self._take_timer.cancel()
        self._offer()
        for listener in self._listeners.values():
            self.destroy_subscription(listener.subscription)
        self._listeners.clear()
        self._ended, self._recorder = self._recorder.stop(), None
        self.whole &= self._ended.is_whole
        if self._ended.state is State.FAILED:
            self.get_logger().error(f"the recording ended: {self._ended.error}")
        else:
            print(f"recorded {self._ended.path} {self._summary(self._ended)}", flush=True)
        return self._ended

    def close(self) -> None:
        """End the recording."""
        self.stop()

    def _look(self) -> None:
        """Listen to new topics; subscribe again to those that offer less by now; notice that writing failed."""
        if self._recorder is None:
            return
        if self._tell(self._recorder.progress):
            self._diagnostics.publish()
        if self._recorder.progress.state is State.FAILED:
            self.stop()
            return
        self._warn_of_losses()
        self._looks += 1
        for name, types in self.get_topic_names_and_types():
            if not is_selected(name, self.get_namespace(), self._wanted, self._unwanted):
                continue
            seen = self.count_publishers(name), tuple(types)
            if seen != self._seen.get(name) or self._looks % LOOKS == 0:
                self._look_at(self._recorder, name, types)
                self._seen[name] = seen
        if self._looks == FOUND_BY and (absent := self._absent):
            self.get_logger().warning(
                f"nothing is published yet on {', '.join(absent)}; check the names with `ros2 topic list`, or "
                "start what publishes them"
            )

    def _tell(self, now: Progress) -> bool:
        """Say on the screen what went wrong with the file and what was mended; return whether there was news."""
        before, self._told = self._told, now
        if before is None or (now.error, now.rescue) == (before.error, before.rescue):
            return False
        if now.path != before.path:
            print(f"recording {now.path}", flush=True)
        if now.rescue != before.rescue:
            self.get_logger().error(f"recording: {now.rescue}")
        if now.state is State.RECORDING and now.error != before.error:
            if now.error:
                self.get_logger().error(f"recording: {now.error}")
            else:
                self.get_logger().warning(f"the recording continues; {now.dropped} messages were dropped")
        return True

    def _look_at(self, recorder: Recorder, name: str, types: list[str]) -> None:
        kind = self._types.get(name, types[0])
        if kind == UNKNOWN:
            return
        if others := [t for t in types if t != kind]:
            self._refuse(name, f"recorded as {kind}; another node publishes it as {others[0]}")
        publishers = [p for p in self.get_publishers_info_by_topic(name) if p.topic_type == kind]
        if not publishers:
            return
        self._losses[name].publishers |= {bytes(p.endpoint_gid) for p in publishers}
        offered = tuple(dict.fromkeys(offered_qos(p) for p in publishers))
        reliable, latched = listening(offered)
        if (listener := self._listeners.get(name)) is not None:
            if listener.reliable <= reliable and listener.latched <= latched:
                return
            reliable, latched = reliable and listener.reliable, latched and listener.latched
            self.destroy_subscription(listener.subscription)
        try:
            topic = Topic(name, kind, definition_text(kind), offered, type_hash(publishers[0]))
            subscription = self._subscribe(recorder, topic, reliable=reliable, latched=latched)
        except RecordError as error:
            self._types[name] = UNKNOWN
            self._refuse(name, str(error))
            return
        self._types[name] = kind
        self._listeners[name] = Listener(subscription, reliable, latched)

    def _subscribe(self, recorder: Recorder, topic: Topic, *, reliable: bool, latched: bool) -> Subscription:
        profile = QoSProfile(
            depth=DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        recorder.add_topic(topic)
        losses = self._losses[topic.name]
        losses.reliable = reliable

        def count(event: Any) -> None:
            losses.told += event.total_count_change

        events = SubscriptionEventCallbacks(message_lost=count, use_default_callbacks=False)
        take = self._taker(recorder, topic.name)
        message_type = message_class(topic.type)
        try:
            return self.create_subscription(
                message_type, topic.name, take, profile, event_callbacks=events, raw=True,
                callback_group=self._patient,
            )  # fmt: skip
        except Exception as error:  # rosidl raises several kinds where the library of a type is missing
            raise RecordError(f"type {topic.type!r} cannot be loaded: {error}") from error

    def _taker(self, recorder: Recorder, name: str) -> Callable[[bytes, dict[str, Any]], None]:
        attachment = next(
            (name + end for topic, end in ATTACHED.items() if name == self.resolve_topic_name(topic)), ""
        )

        losses = self._losses[name]

        def take(data: bytes, info: dict[str, Any]) -> None:
            if attachment:
                recorder.attach(attachment.lstrip("/"), deserialize_message(data, String).data.encode())
            sent, sequence = info["source_timestamp"], info["publication_sequence_number"]
            received = info["received_timestamp"] or time.time_ns()
            losses.take(sequence or 0)
            self._taken.append(_Taken(received, name, data, sent or 0, sequence or 0))

        return take

    def _offer(self) -> None:
        """Hand to the recorder what was taken, in the order in which it came."""
        taken, self._taken = self._taken, []
        if self._recorder is None:
            return
        taken.sort(key=attrgetter("received"))
        for t in taken:
            self._recorder.offer(
                t.topic, t.data, publish_time=t.publish_time, sequence=t.sequence, received=t.received
            )

    def _refuse(self, name: str, reason: str) -> None:
        if self._refused.get(name) != reason:
            self._refused[name] = reason
            self.get_logger().warning(f"topic {name}: {reason}")

    def _on_start(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            response.message, response.success = f"recording {self.start()}", True
        except RecordError as error:
            response.message, response.success = str(error), False
        return response

    def _on_stop(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        ended = self.stop()
        if ended is None:
            response.message, response.success = "not recording", False
        elif ended.state is State.FAILED:
            response.message, response.success = ended.error, False
        else:
            response.message = f"recorded {ended.path} {self._summary(ended)}"
            response.success = True
        return response

    def _on_split(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._recorder is None:
            response.message, response.success = "not recording", False
        elif self._recorder.split():
            response.message, response.success = f"recording {self._recorder.progress.path}", True
        else:
            response.message = self._recorder.progress.error or "the disk does not answer"
            response.success = False
        return response

    @property
    def _absent(self) -> list[str]:
        """Topics and patterns that are asked for and that nobody has published so far."""
        return [word for word in self._wanted if not any(fnmatchcase(name, word) for name in self._types)]

    @property
    def _lost(self) -> int:
        return sum(losses.lost for losses in self._losses.values())

    def _why_lost(self, progress: Progress) -> dict[str, str]:
        """Return how many messages of each topic are lost and why, in words."""
        words = defaultdict[str, list[str]](list)
        for name, count in progress.dropped_of.items():
            words[name].append(f"{count} of {name}: the disk was too slow or too full")
        for name, losses in self._losses.items():
            if losses.lost:
                words[name].append(f"{losses.lost} of {name}: {losses.reason}")
        return {name: "; ".join(told) for name, told in words.items()}

    def _warn_of_losses(self) -> None:
        """Name the topics of which messages get lost in the log, each again when twice as many are."""
        assert self._recorder
        progress = self._recorder.progress
        for name, words in self._why_lost(progress).items():
            lost = progress.dropped_of.get(name, 0) + self._losses[name].lost
            if lost >= 2 * self._warned.get(name, 0):
                self._warned[name] = lost
                self.get_logger().warning(f"messages lost, {words}")

    def _summary(self, progress: Progress) -> str:
        lost = progress.dropped + progress.destroyed + self._lost
        notes = [
            *self._why_lost(progress).values(),
            progress.rescue,
            f"nobody published {', '.join(absent)}" if (absent := self._absent) else "",
        ]
        return "; ".join([f"{progress.messages} messages, {lost} lost", *filter(None, notes)])

    def _report(self) -> Report:
        progress = self._ended if self._recorder is None else self._recorder.progress
        if progress is None:
            return Level.OK, "not recording", {keys.STATE: Recording.OFF}
        if self._recorder:
            self._tell(progress)  # what the diagnostics say is on the screen as well, however short it lasts
        values = {
            keys.STATE: _word(progress.state),
            keys.PATH: progress.path,
            "messages": progress.messages,
            "topics": len(self._listeners),
            "dropped, disk too slow or full": progress.dropped,
            "destroyed by another program": progress.destroyed,
            "lost, recorder too slow": self._lost,
            "waiting [B]": progress.waiting,
            **{f"refused {name}": reason for name, reason in self._refused.items()},
        }
        return *self._condition(progress), values

    def _condition(self, progress: Progress) -> tuple[Level, str]:
        level, text = Level.OK, "recording"
        if progress.state is State.FAILED:
            level, text = Level.ERROR, f"recording ended: {progress.error}"
        elif progress.state is State.CLOSED:
            text = "not recording"
        elif progress.error:
            level, text = Level.ERROR, progress.error
        elif progress.rescue:
            level, text = Level.WARN, progress.rescue
        elif progress.dropped or self._lost:
            level, text = Level.WARN, f"recording, {progress.dropped + self._lost} messages lost"
        elif without := sorted({*self._refused, *self._absent}):
            level, text = Level.WARN, f"recording without {', '.join(without)}"
        return level, text


def _word(state: State) -> Recording:
    """Return the state of a recording as diagnostics name it."""
    return {State.FAILED: Recording.ENDED, State.CLOSED: Recording.OFF}.get(state, Recording.ON)


def offered_qos(publisher: TopicEndpointInfo) -> Qos:
    """Return the quality of service that a publisher offers, as it is recorded."""
    profile = publisher.qos_profile
    return Qos(
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        history=profile.history.name.lower(),
        depth=profile.depth,
        deadline=profile.deadline.nanoseconds,
        lifespan=profile.lifespan.nanoseconds,
        liveliness=profile.liveliness.name.lower(),
        lease=profile.liveliness_lease_duration.nanoseconds,
    )


def type_hash(publisher: TopicEndpointInfo) -> str:
    """Return the REP 2011 hash of the type that a publisher has, empty if it does not tell."""
    text = str(publisher.topic_type_hash)
    return text if text.startswith("RIHS") else ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node; returns its exit code."""
    stand_back()
    nodes: list[RecordNode] = []

    def make() -> RecordNode:
        nodes.append(RecordNode())
        return nodes[0]

    code = run_node("record", make, arguments)
    return code or (0 if all(node.whole for node in nodes) else FAILED)


if __name__ == "__main__":
    sys.exit(main())
