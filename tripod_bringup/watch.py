"""The ear and mouth of `tripod up` in the graph: hears every status, can say STOP."""

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from tripod_msgs.msg import IkStatus, RobotStatus, SimStatus

from tripod_bringup.status_line import ChainStatus
from tripod_graph import diagnostic_keys as keys
from tripod_graph import names
from tripod_graph.authority import OperatorAuthority
from tripod_graph.control_mode import Speaker, clocks, listen
from tripod_graph.diagnostics import Diagnostics, Level, Report
from tripod_graph.executor import Patient
from tripod_graph.liveliness import Mix
from tripod_graph.mode import Decision, Mode
from tripod_graph.qos import NEWEST, RELIABLE
from tripod_graph.source import new_source

SILENT_AFTER = 2.0
"""A status older than this is not shown [s]."""

SIM_STATES: Mapping[int, str] = {
    getattr(SimStatus, n): n for n in ("RUNNING", "PAUSED", "HOLDING", "PARKED", "FAILED")
}
IK_STATES: Mapping[int, str] = {
    getattr(IkStatus, n): n for n in ("IDLE", "TRACKING", "CLOSEST", "STALE", "SOLVER_FAILED", "SEARCHING")
}
SOLVED = (IkStatus.TRACKING, IkStatus.CLOSEST, IkStatus.SEARCHING)
ROBOT_STATES: Mapping[int, str] = {
    getattr(RobotStatus, n): n
    for n in ("DISCONNECTED", "CONNECTING", "READY", "ACTIVE", "HOLDING", "PARKED", "FAULT")
}

ANSWERED = (RobotStatus.READY, RobotStatus.ACTIVE, RobotStatus.HOLDING, RobotStatus.PARKED)
"""States of a driver whose board has answered."""


class Watch(Node):
    """Hears the status of every node and publishes STOP; its methods may be called from any thread.

    Attributes:
        absence: Why no board has ever answered the driver; empty if one has, or none was waited for long enough.
    """

    def __init__(self) -> None:
        super().__init__("bringup")
        self._lock = threading.Lock()
        self._heard: dict[
            str, tuple[float, Any, type | None]
        ] = {}  # when, what, and of which kind if it is serialised
        self._mixes = {
            topic: Mix(self, topic) for topic in (names.SIM_STATUS, names.IK_STATUS, names.ROBOT_STATUS)
        }
        self._authority = OperatorAuthority(new_source("up", self.get_namespace()))
        self._processes: Callable[[], Mapping[str, str]] = dict
        self._patient = Patient()
        self._speaker = Speaker(self, self._authority)
        listen(self, self._on_decision)
        for topic, kind in (
            (names.SIM_STATUS, SimStatus),
            (names.IK_STATUS, IkStatus),
            (names.ROBOT_STATUS, RobotStatus),
        ):
            self.create_subscription(
                kind, topic, self._keeper(topic, kind), NEWEST, raw=True, callback_group=self._patient
            )
        self.absence, self._answered = "", False
        self._recorder, self._driver = (
            f"{self.get_namespace().rstrip('/')}/{name}" for name in ("record", "driver")
        )
        self.create_subscription(
            DiagnosticArray, names.DIAGNOSTICS, self._on_diagnostics, RELIABLE, callback_group=self._patient
        )
        self._diagnostics = Diagnostics(self, self._report)
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)

    def describe_processes(self, describe: Callable[[], Mapping[str, str]]) -> None:
        """Let diagnostics show what `describe` says of each supervised process."""
        self._processes = describe

    def heard(self, topic: str) -> bool:
        """Whether the status `topic` was ever heard."""
        with self._lock:
            return topic in self._heard

    def is_published(self, topic: str) -> bool:
        """Whether anybody offers `topic`."""
        return bool(self.count_publishers(topic) > 0)

    def is_recorded(self, topic: str) -> bool:
        """Whether the recorder listens to `topic`: it may find a publisher seconds later than others do."""
        listeners = self.get_subscriptions_info_by_topic(topic)
        here = self.get_namespace()
        return any((of.node_name, of.node_namespace) == ("record", here) for of in listeners)

    def status(self) -> ChainStatus:
        """Return the newest status of the chain; what fell silent is None, and the note says so."""
        sim, ik, robot = (self._fresh(t) for t in (names.SIM_STATUS, names.IK_STATUS, names.ROBOT_STATUS))
        return ChainStatus(
            mode=self._authority.mode.name,
            sim_state=None if sim is None else SIM_STATES.get(sim.state, str(sim.state)),
            real_time_factor=None if sim is None else sim.real_time_factor,
            step_time=None if sim is None else sim.step_time_median,
            ik_state=None if ik is None else IK_STATES.get(ik.state, str(ik.state)),
            ik_error=ik.error if ik is not None and ik.state in SOLVED else None,
            robot_state=None if robot is None else ROBOT_STATES.get(robot.state, str(robot.state)),
            packets=None if robot is None else robot.packets_sent,
            note=self._note(sim, ik, robot),
        )

    def say_stop(self, timeout: float = 0.5) -> None:
        """Publish STOP and wait until the receivers have it, at most `timeout` [s]."""
        self._speaker.decide(Mode.STOP)
        self._speaker.wait(timeout)

    def close(self) -> None:
        """Leave the graph."""
        self.destroy_node()

    def _keeper(self, topic: str, kind: type) -> Callable[[bytes, Mapping[str, Any]], None]:
        """Return what keeps a status, which is read where it is told."""

        def keep(data: bytes, info: Mapping[str, Any]) -> None:
            self._mixes[topic].hear(info)
            with self._lock:
                self._heard[topic] = (time.monotonic(), data, kind)
            if kind is RobotStatus and not self._answered:
                self._look_for_board(deserialize_message(data, kind))

        return keep

    def _look_for_board(self, robot: Any) -> None:
        self._answered = robot.state in ANSWERED
        if self._answered:
            self.absence = ""

    def _fresh(self, topic: str) -> Any | None:
        with self._lock:
            seen, message, kind = self._heard.get(topic, (float("-inf"), None, None))
        if time.monotonic() - seen >= SILENT_AFTER:
            return None
        return message if kind is None else deserialize_message(message, kind)

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            if status.name == self._recorder:
                with self._lock:
                    self._heard[self._recorder] = (time.monotonic(), status, None)
            elif status.name == self._driver and not self._answered:
                values = {pair.key: pair.value for pair in status.values}
                self.absence = values.get(keys.CONNECTION_ERROR, "") or self.absence

    def _note(self, sim: Any | None, ik: Any | None, robot: Any | None) -> str:
        record = self._fresh(self._recorder)
        said = "" if record is None or record.level == bytes([Level.OK]) else f"record: {record.message}"
        if record is not None and record.level == bytes([Level.ERROR]):
            return said
        for name, topic in (("sim", names.SIM_STATUS), ("driver", names.ROBOT_STATUS)):
            if self._mixes[topic].mixed:
                return (
                    f"{name} runs more than once here: stop all but one, or give one another namespace "
                    "(__ns:=/NAME)"
                )
        nodes = [("ik", ik), ("driver", robot)]
        failed = sim is not None and sim.state == SimStatus.FAILED
        nodes.insert(0 if failed else len(nodes), ("sim", sim))  # what else it says may hold for long
        for name, message in nodes:
            if message is not None and message.message:
                return f"{name}: {message.message}"
        for name, topic, message in (
            ("sim", names.SIM_STATUS, sim),
            ("driver", names.ROBOT_STATUS, robot),
        ):
            if message is None and self.heard(topic):
                return f"{name} is silent"
        return said  # what is over is said where nobody else complains

    def _on_decision(self, decision: Decision) -> None:
        with suppress(ValueError):  # one that cannot be is reported by those who obey
            self._authority.hear(decision, *clocks(self))

    def _report(self) -> Report:
        processes = self._processes()
        bad = [f"{name} {state}" for name, state in processes.items() if state != "is running"]
        return (Level.ERROR, ", ".join(bad), processes) if bad else (Level.OK, "all run", processes)
