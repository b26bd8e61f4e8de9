"""Physics in a thread of its own, at a fixed step on the steady clock.

Other threads exchange only the latest command and the latest state with it.
"""

import threading
import time as clock
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_runtime.checkpoint import Checkpoint
from tripod_runtime.hands import Hands
from tripod_runtime.input_log import InputLog
from tripod_runtime.resimulation import Ended
from tripod_sim.acting_forces import Forces
from tripod_sim.compliance import Compliance
from tripod_sim.errors import StepError
from tripod_sim.integrators.report import StepReport
from tripod_sim.simulation import Energies, Pose, Simulation

WINDOW = 1.0
"""Time over which rates are measured [s]."""

ENERGY_PERIOD = 0.05
"""Shortest time between two looks at the energies while the physics runs [s]; they cost a fifth of a step."""

WANTED_PERIOD = 0.1
"""Shortest time between two snapshots with forces or mesh error while the physics runs [s]: these may cost more than a
step."""

BEHIND = 0.95
"""Real-time factor below which the physics is too slow; a replay may have asked for less."""

LATE = 0.1
"""Delay after which missed periods are skipped instead of made up for [s]."""


class Activity(IntEnum):
    """What the thread is doing."""

    RUNNING = 0
    PAUSED = 1
    FAILED = 2


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The state after one step, never changed once made.

    Attributes:
        stamp: When it was made [ns since the epoch].
        step, time: Completed steps and simulated time [s] since the last reset.
        positions: [m], shape (n, 3).
        joints: Angles [rad] and slide [m], shape (s + 1,).
        efforts: [N m], shape (s,).
        effector: Pose, or None.
        compliance: If it was due at this step.
        report: Of this step.
        energies: Of this step, or of one at most `ENERGY_PERIOD` ago: then it is the same object.
        ball: Pose of the ball, or None.
        event: What has become of the ball, in words; empty while nothing has.
        left_out: Rigid bodies that the last compliance leaves out; empty while nobody needs any.
        pushed: Whether somebody applied forces in this step.
        forces: What acts on the bodies, every `WANTED_PERIOD` while it is wanted; else empty.
        mesh_error: See `Simulation.mesh_error_field` [m], every `WANTED_PERIOD` while it is wanted; else None.
    """

    stamp: int
    step: int
    time: float
    positions: FloatArray
    joints: FloatArray
    efforts: FloatArray
    effector: Pose | None
    compliance: Compliance | None
    report: StepReport
    energies: Energies
    ball: Pose | None = None
    event: str = ""
    left_out: tuple[int, ...] = ()
    pushed: bool = False
    forces: tuple[Forces, ...] = ()
    mesh_error: FloatArray | None = None


@dataclass(frozen=True)
class Wanted:
    """What snapshots have only on request: forces on the bodies, the field of the mesh error."""

    forces: bool = False
    mesh_error: bool = False


@dataclass(frozen=True)
class Speed:
    """How fast the physics runs, over the last second.

    Attributes:
        real_time_factor: Simulated time over wall time.
        median: Wall time of a step [s].
        p99: 99th percentile of it [s].
        missed: Periods skipped because the machine was late, since start.
        load: CPU time of the physics thread over simulated time; above 1 no machine of this speed keeps real time.
        behind: Whether the thread runs, and slower than real time, or than the speed that was chosen if that is less.
        rate: The speed that was chosen: simulated time over wall time.
    """

    real_time_factor: float
    median: float
    p99: float
    missed: int
    load: float = 0.0
    behind: bool = False
    rate: float = 1.0


class RealTime(threading.Thread):
    """Steps a simulation once per dt of wall time.

    Attributes:
        latest: The newest snapshot.
        observed: The newest snapshot that has something of `wanted`; None before the first.
        compliance_period: Shortest time between two compliances [s]; may change at any time.
        activity: What the thread is doing.
        failure: Why it failed, empty if it did not.
        want_compliance: Whether anyone needs compliances now.
        watched: Whether anyone looks at the run: each step then keeps what the forces need.
        hands: What pulls at the bodies and loads them.
        input_log: What the steps were made with.
        ended: Whether there is nothing more to step with.
    """

    def __init__(
        self,
        simulation: Simulation,
        command: Callable[[float], FloatArray | None],
        *,
        rate: float = 1.0,
        stamp: Callable[[], int] = clock.time_ns,
        compliance_period: float = 0.02,
        on_snapshot: Callable[[Snapshot], None] | None = None,
        on_reset: Callable[[], None] | None = None,
    ) -> None:
        """Prepare the thread; `start` starts it.

        Args:
            simulation: Belongs to the thread from `start` on.
            command: Gives the joints (s + 1,) for the steady time [s] of a step, or raises `Ended`; called in the
                thread.
            rate: Simulated time over wall time; infinite: as fast as it can.
            stamp: Gives the stamp of a state when that is made [ns].
            compliance_period: Shortest time between two compliances [s].
            on_snapshot: Called in the thread after each step; it must be short.
            on_reset: Called in the thread when the simulation is back in its start state, before its next step.
        """
        super().__init__(name="physics", daemon=True)
        self._command, self._rate = command, rate
        self._on_snapshot, self._on_reset, self._stamp = on_snapshot, on_reset, stamp
        self._simulation, dt = simulation, simulation.scene.dt
        self._period = dt / rate
        self._taken: deque[float] = deque(maxlen=max(10, round(WINDOW / dt)))
        self._done: deque[tuple[float, float]] = deque(maxlen=self._taken.maxlen)
        self._energies_due = self._wanted_due = float("-inf")
        self.compliance_period = compliance_period
        self._missed = 0
        self._requests = threading.Condition()
        self._reset_wanted = self._stopping = self._stepping = False
        self._between: list[Callable[[Simulation], None]] = []
        self._steps_wanted = 0
        self._checkpoint: Checkpoint | None = None
        self._checkpoint_wanted = self.ended = False
        self.input_log, self.hands = InputLog(), Hands(simulation)
        self.activity, self.failure = Activity.RUNNING, ""
        self.want_compliance = self.watched = self._pushed = False
        self._wanted = Wanted()
        self.observed: Snapshot | None = None
        self.latest: Snapshot = self._snapshot(compliance=False)

    @property
    def simulation(self) -> Simulation:
        """What is stepped."""
        return self._simulation

    @property
    def rate(self) -> float:
        """Simulated time over wall time that is aimed at; infinite: as fast as it can."""
        return self._rate

    @rate.setter
    def rate(self, rate: float) -> None:
        self._rate, self._period = rate, self._simulation.scene.dt / rate
        self._done.clear()

    @property
    def wanted(self) -> Wanted:
        """What snapshots have on request. What is new is taken at once where no step comes."""
        return self._wanted

    @wanted.setter
    def wanted(self, wanted: Wanted) -> None:
        before, self._wanted = self._wanted, wanted
        more = (wanted.forces and not before.forces) or (wanted.mesh_error and not before.mesh_error)
        if more and self.activity is not Activity.RUNNING:
            self.between_steps(lambda _: None)  # a snapshot follows

    def run(self) -> None:
        """Step until `stop`."""
        due = clock.monotonic()
        while not self._stopping:
            if self._reset_wanted:
                self._reset()
                due = clock.monotonic()
            self._do_between()
            if self._begin():
                self._advance()
            with self._requests:
                self._stepping = False
                self._requests.notify_all()
                if self.activity is not Activity.RUNNING:
                    self._requests.wait_for(self._is_wanted)
                    due = clock.monotonic()
                    continue
            due += self._period
            ahead = due - clock.monotonic()
            if ahead > 0:
                clock.sleep(ahead)
            elif ahead < -LATE and self._period:
                skipped = int(-ahead / self._period)
                self._missed += skipped
                due += skipped * self._period

    def _is_wanted(self) -> bool:
        single = self.activity is Activity.PAUSED and self._steps_wanted > 0
        waits = bool(self._reset_wanted or self._between)
        return self._stopping or waits or single or self.activity is Activity.RUNNING

    def _do_between(self) -> None:
        if not self._between:  # the rule
            return
        with self._requests:
            asked, self._between = self._between, []
        for act in asked:
            act(self._simulation)
        if asked:
            self.latest = self._snapshot(compliance=False)

    def _begin(self) -> bool:
        """Return whether a step is due, and take a requested one from the count."""
        with self._requests:
            single = self.activity is Activity.PAUSED and self._steps_wanted > 0
            if single:
                self._steps_wanted -= 1
            self._stepping = single or self.activity is Activity.RUNNING
            return self._stepping

    def _advance(self) -> None:
        try:
            joints = self._command(clock.monotonic())
            if self._checkpoint_wanted:
                self._save()
            forces = self._apply_hands()
            if self.watched or self._wanted.forces:
                self._simulation.keep_forces()
            start = clock.perf_counter()
            report = self._simulation.step(joints)
            self._taken.append(clock.perf_counter() - start)
            self._done.append((clock.perf_counter(), clock.thread_time()))
            every = max(1, round(self.compliance_period / self._simulation.scene.dt))
            due = self.want_compliance and self._simulation.state.step % every == 0
            snapshot = self._snapshot(compliance=due)
            self.input_log.add(snapshot.step, snapshot.stamp, joints, forces)
            self.latest = snapshot  # nobody sees a state without the steps to it
            if self._on_snapshot:
                self._on_snapshot(self.latest)
            if report.instability:
                raise StepError(report.instability)
            self._simulation.renew()
        except Ended:
            with self._requests:
                self.activity, self.ended = Activity.PAUSED, True
        except Exception as error:  # noqa: BLE001 - a thread that just died would look alive from outside
            expected = isinstance(
                error, StepError | ValueError
            )  # ValueError: a command that the scene refuses
            with self._requests:
                self.activity = Activity.FAILED
                self.failure = str(error) if expected else f"{type(error).__name__}: {error}"

    def _apply_hands(self) -> dict[int, FloatArray]:
        """Let the hands work on the next step; return their forces by node [N]."""
        forces = self.hands.forces(clock.monotonic())
        if forces or self._pushed:  # a recording that is played applies its own
            self._simulation.apply_forces(forces)
        self._pushed = bool(forces)
        return forces

    def _save(self) -> None:
        """Drop what is kept from earlier steps, so that from here on a copy of the state is enough to go on from."""
        self._checkpoint_wanted = False
        saved = self._simulation.save()
        self._simulation.restore(saved)
        self.input_log.cut()
        self._checkpoint = Checkpoint(self.input_log.epoch, *saved)

    def request_checkpoint(self) -> None:
        """Make a checkpoint before the next step; `take_checkpoint` returns it."""
        self._checkpoint_wanted = True

    def take_checkpoint(self) -> Checkpoint | None:
        """Return the newest checkpoint, once."""
        checkpoint, self._checkpoint = self._checkpoint, None
        return checkpoint

    def _reset(self) -> None:
        self.hands.clear()
        self._simulation.reset()
        self._done.clear()
        self._energies_due = float("-inf")
        self.input_log.reset()
        self.latest = self._snapshot(compliance=False)
        if self._on_reset:
            self._on_reset()
        with self._requests:
            if self.activity is Activity.FAILED:
                self.activity = Activity.RUNNING
            self.failure = ""
            self._reset_wanted = False
            self._requests.notify_all()

    def _snapshot(self, *, compliance: bool) -> Snapshot:
        simulation = self._simulation
        state = simulation.state
        answer = None
        if compliance:
            try:
                answer = simulation.compliance()
            except StepError:
                answer = None  # singular just here; the next one follows
        forces: tuple[Forces, ...] = ()
        mesh_error, wanted = None, self._wanted
        now = clock.monotonic()
        if wanted != Wanted() and (self.activity is not Activity.RUNNING or now >= self._wanted_due):
            if wanted.forces:
                simulation.keep_forces()
                forces = simulation.forces()
            if wanted.mesh_error:
                mesh_error = simulation.mesh_error_field()
            self._wanted_due = now + WANTED_PERIOD if forces or not wanted.forces else now
        if self.activity is not Activity.RUNNING or now >= self._energies_due:
            self._energies, self._energies_due = simulation.energies(), now + ENERGY_PERIOD
        snapshot = Snapshot(
            self._stamp(), state.step, state.time, simulation.positions.copy(), state.joints.copy(),
            simulation.efforts.copy(), simulation.effector, answer, simulation.report, self._energies,
            simulation.ball, simulation.ball_event, simulation.left_out if self.want_compliance else (),
            simulation.pushed, forces, mesh_error,
        )  # fmt: skip
        if forces or mesh_error is not None:
            self.observed = snapshot
        return snapshot

    def speed(self) -> Speed:
        """Return how fast the physics runs; callable from any thread."""
        taken, done, dt = list(self._taken), list(self._done), self._simulation.scene.dt
        if len(done) < 2:
            return Speed(0.0, 0.0, 0.0, self._missed)
        now, running = clock.perf_counter(), self.activity is Activity.RUNNING
        recent = [row for row in done if row[0] > now - WINDOW]
        begun = recent[0] if len(recent) > 1 else done[-2]
        wall, cpu = np.subtract(done[-1], begun).tolist()
        simulated = max(1, len(recent) - 1) * dt
        if len(recent) > 1:
            factor = simulated / max(wall, 1e-9)
        else:  # steps that take longer than the window, or none at all
            factor = dt / max(wall, now - done[-1][0]) if running else 0.0
        ranks = np.multiply((0.5, 0.99), len(taken) - 1)
        median, p99 = np.interp(ranks, np.arange(len(taken)), np.sort(taken)).tolist()
        behind = running and 0 < factor < BEHIND * min(1.0, self._rate)
        return Speed(factor, median, p99, self._missed, cpu / simulated, behind, self._rate)

    def pause(self, paused: bool, timeout: float = 2.0) -> None:
        """Pause, and wait for the end of the step at hand, or go on; a failure stays until the next reset."""
        with self._requests:
            if self.activity is not Activity.FAILED:
                self.activity = Activity.PAUSED if paused else Activity.RUNNING
            if not paused:
                self._done.clear()  # the pause is no lack of speed
            self._requests.notify_all()
            if paused:
                self._requests.wait_for(lambda: not self._stepping, timeout)

    def request_steps(self, count: int = 1, timeout: float = 2.0) -> int:
        """Make steps while paused and wait for them, no longer than `timeout` [s]; return how many were made."""
        with self._requests:
            if self.activity is not Activity.PAUSED:
                return 0
            before = self.latest.step
            self._steps_wanted += count
            self._requests.notify_all()
            self._requests.wait_for(self._are_made, timeout)
            self._steps_wanted = 0
            self._requests.wait_for(self._are_made, timeout)  # the step at hand counts
            return self.latest.step - before

    def _are_made(self) -> bool:
        over = self._steps_wanted == 0 or self.activity is not Activity.PAUSED
        return over and not self._stepping

    def request_reset(self, timeout: float = 2.0) -> bool:
        """Return to the start state and wait for it; return whether it happened in time."""
        with self._requests:
            self._reset_wanted = True
            self._requests.notify_all()
            return self._requests.wait_for(lambda: not self._reset_wanted, timeout)

    def between_steps(self, act: Callable[[Simulation], None]) -> None:
        """Have `act` called in the thread before the next step, paused or not; it must not raise."""
        with self._requests:
            self._between.append(act)
            self._requests.notify_all()

    def stop(self, timeout: float = 5.0) -> None:
        """End the thread after the step at hand."""
        with self._requests:
            self._stopping = True
            self._requests.notify_all()
        if self.is_alive():
            self.join(timeout)
