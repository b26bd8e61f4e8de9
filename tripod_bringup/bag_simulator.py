"""The simulator that makes a recorded session again."""

from rclpy.clock import Clock, ClockType

from tripod_bringup.bag_session import Session
from tripod_graph import names
from tripod_graph.liveliness import publisher_elsewhere
from tripod_record.errors import RecordError
from tripod_runtime.node import SimNode
from tripod_runtime.realtime import Activity
from tripod_runtime.resimulation import Ended, Outcome, Resimulation
from tripod_sim.simulation import Simulation

PERIOD = 0.05
"""Time between two looks whether it has ended [s]."""


class SimPlayer(SimNode):
    """A simulator that steps with what was recorded, and says in the end how the bodies compare.

    Attributes:
        done: How it ended, empty while it has not.
        duration: Of the recording [s].
        failed: Whether a body is not the recorded one.
        waiting: What it waits for: nothing.
    """

    waiting = ""

    def __init__(self, session: Session, resimulation: Resimulation, *, start: float, rate: float) -> None:
        """Make the steps before `start` [s] at once. Raises RecordError where another simulator runs."""
        self._begin, self.duration = session.bag.start, session.bag.info.duration
        self._session, self._recording = session, resimulation
        self.done, self.failed = "", False
        while start and self.place < start:
            try:
                joints = resimulation.joints()
            except Ended:
                break
            resimulation.simulation.step(joints)
            resimulation.compare()
        super().__init__(resimulation, rate=rate)
        self.create_timer(PERIOD, self._watch, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def paused(self) -> bool:
        """Whether it stands still."""
        return self._physics.activity is Activity.PAUSED

    @property
    def place(self) -> float:
        """Place in the recording [s]."""
        return max(0.0, 1e-9 * (self._recording.stamp - self._begin))

    def toggle(self) -> None:
        """Pause, or go on."""
        self._physics.pause(not self.paused)

    def step(self) -> None:
        """While paused: make one step."""
        self._physics.request_steps()

    def close(self) -> None:
        """End the physics and leave the graph: the simulator of the next segment may follow."""
        super().close()
        self.destroy_node()

    def _join_graph(self, simulation: Simulation) -> None:
        topic = self.resolve_topic_name(names.BODY_STATE)
        if found := publisher_elsewhere(self, [topic]):
            raise RecordError(
                f"{found[1]} is already simulating here, and the two would mix: stop it, or set another "
                "ROS_DOMAIN_ID; `tripod view` shows what is played"
            )
        super()._join_graph(simulation)

    def _watch(self) -> None:
        if self._physics.failure:
            self.done, self.failed = self._physics.failure, True
        elif self._physics.ended and not self.done:
            self.done = outcome_text(self._recording.outcome)
            self.failed = self._recording.outcome.different > 0


def outcome_text(found: Outcome) -> str:
    """Return how the bodies compare, in one line."""
    gaps = [
        *([f"{found.lost} steps whose beginning was not recorded"] if found.lost else []),
        *([f"{found.unknown} bodies without their steps"] if found.unknown else []),
    ]
    left = f"; left out: {', '.join(gaps)}" if gaps else ""
    if found.different:
        count = found.equal + found.different
        return (
            f"{found.different} of {count} bodies differ, first at {found.parted}, at most by {found.largest:.2g} m"
            f"{left}; was it recorded by this version, on this machine?"
        )
    if not found.equal:
        return f"{found.steps} steps made again; no recorded body to compare with{left}"
    return f"{found.steps} steps made again, {found.equal} bodies equal bit for bit{left}"
