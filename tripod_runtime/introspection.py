"""Introspection: the simulator's node publishes its scene and summaries of the run, and hears requests."""

import json
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import String

from tripod_graph import names
from tripod_graph.qos import LATCHED, RELIABLE
from tripod_host.arrays import FloatArray
from tripod_runtime.realtime import Snapshot
from tripod_runtime.requests import Request, request_of
from tripod_sim.errors import SceneError
from tripod_sim.simulation import Simulation
from tripod_study.accuracy.machine import product_time
from tripod_study.summary.accuracy import accuracy_summary, as_table
from tripod_study.summary.effects import effect_summary
from tripod_study.summary.energy import EnergyBooks
from tripod_study.summary.errors import errors_line
from tripod_study.summary.picture import picture
from tripod_study.summary.stability import stability, stability_lines

PERIOD = 0.2
"""Time between two messages of figures [s]; none while nobody listens."""


class Introspection:
    """Publishes `sim/picture` when it changes and `sim/figures` while somebody listens; hears `sim/request`.

    Attributes:
        stability_margin: The last that somebody asked for (see `stability_margin`), and when [s]; None before.
        notice: What became of the newest request; empty: nothing to say.
        standing: Tells what else is to be said where that is empty.
        hands: Returns entries of the figures: what pulls at the bodies, and the speed.
    """

    def __init__(
        self, node: Node, source: str, simulation: Simulation, first: Snapshot, changes: Sequence[str]
    ) -> None:
        """Publish about `simulation`: of the scene `source` with the overrides `changes`, at its start `first`."""
        self._source, self._simulation, self._changes = source, simulation, list(changes)
        self._picture = picture(simulation)
        self._effects = [asdict(f) for f in effect_summary(simulation.scene)]
        self._speed: float | None = None
        self._measuring: threading.Thread | None = None
        self._told: float | None = None
        self.notice = ""
        self.standing: Callable[[], str] = str
        self.hands: Callable[[], dict[str, Any]] = dict
        self._lock = threading.Lock()
        self.reset(first)
        self._scenes = node.create_publisher(String, names.SIM_PICTURE, LATCHED)
        self._figures = node.create_publisher(String, names.SIM_FIGURES, RELIABLE)
        node.create_timer(PERIOD, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def hear(self, node: Node, act: Callable[[Request], None], refuse: Callable[[ValueError], None]) -> None:
        """Call `act` with each request but for figures, `refuse` with why another is none."""

        def on_message(message: String) -> None:
            try:
                request = request_of(message.data)
                if request.do == "figures":
                    self._measure()
                else:
                    act(request)
            except SceneError as error:
                self.say(str(error))
                refuse(error)

        node.create_subscription(String, names.SIM_REQUEST, on_message, RELIABLE)

    def say(self, notice: str) -> None:
        """Tell what became of a request, or nothing any more; any thread."""
        self.notice = notice

    def reset(self, first: Snapshot) -> None:
        """Restart the energy books: the simulation is back in its start state."""
        with self._lock:
            self._books = EnergyBooks(first.energies, *self._work(first), first.time)
            self._halvings, self._latest = 0, first
            self.stability_margin: list[float] | None = None

    def keep(self, snapshot: Snapshot) -> None:
        """Enter a step into the books; called in the thread of the physics."""
        with self._lock:
            self._books.add(snapshot.energies, *self._work(snapshot), snapshot.time, untold=snapshot.pushed)
            self._halvings += snapshot.report.halvings
            self._latest = snapshot
            if snapshot.compliance and (soft := snapshot.compliance.stability_margin):
                self.stability_margin = [soft.value, snapshot.time]

    def _work(self, snapshot: Snapshot) -> tuple[FloatArray, FloatArray]:
        """Return where joints are and what they do there."""
        return self._simulation.joint_work(snapshot.joints, snapshot.efforts)

    @property
    def is_watched(self) -> bool:
        """Whether somebody looks at the run."""
        return bool(self._figures.get_subscription_count())

    def publish_scene(self) -> None:
        """Publish what there is to draw, what accuracies cost, and which effects there are."""
        accuracy = as_table(accuracy_summary(self._source, self._simulation.scene, self._speed))
        table = {**self._picture, "changes": self._changes, "accuracy": accuracy, "effects": self._effects}
        self._scenes.publish(String(data=as_json(table)))

    def _measure(self) -> None:
        """Time this machine, in a thread and once: figures of a study's machine then become those of this one."""
        if self._measuring is None:
            self._measuring = threading.Thread(target=self._time_machine, name="machine", daemon=True)
            self._measuring.start()

    def _time_machine(self) -> None:
        self._speed = product_time()

    def _on_timer(self) -> None:
        if self._speed != self._told:
            self._told = self._speed
            self.publish_scene()
        if not self.is_watched:
            return
        with self._lock:
            latest, balance, halvings = self._latest, self._books.balance, self._halvings
        rest = not self._simulation.scene.inertia
        figures = asdict(
            stability(
                latest.report,
                halvings,
                balance,
                self._simulation.scene.dt,
                self.stability_margin,
                at_rest=rest,
            )
        )
        lines = stability_lines(figures)
        told = {
            "errors": errors_line(latest.report),
            "event": latest.event,
            "notice": self.notice or self.standing(),
            "notes": list(self._simulation.notes),
            **self.hands(),
        }
        table = {**figures, "lines": lines, **told}
        self._figures.publish(String(data=as_json(table)))


def as_json(value: Any) -> str:
    """Return JSON; NaN and infinity, which it lacks, become null."""
    return json.dumps(_plain(value), allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
