"""Times of typical steps: the same steps again and again from one saved state, the least time of each counts.

What a machine shared with others adds to a time is never negative, so the least of several is the best estimate. Long
steps are timed by the CPU time of this thread, which stands still while another process runs; short ones, which are
seldom interrupted, by the wall clock, which is read several times faster. The typical step of a scene with servos is
one during which they turn.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter, thread_time

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.simulation import Simulation
from tripod_study.explain.stopwatch import Stopwatch

SWING, FREQUENCY = 0.1, 1.0
"""Of the servos during the steps that are timed: from where they start by so much [rad] and back, times a second."""

AHEAD = 1.0
"""Time of this machine that is spent on reaching typical steps [s]."""

FEWEST_AHEAD = 5
"""Steps made before those that are timed."""

SHORT = 2e-3
"""Steps that take less are timed by the wall clock [s]."""

LENGTH, FEWEST, MOST = 0.05, 4, 200
"""Of one pass over the timed steps [s], and in steps."""

ROUNDS = 7
"""Passes without and with a stopwatch, alternately."""


@dataclass(frozen=True)
class StepTimes:
    """What one step takes.

    Attributes:
        mean: Of the timed steps [s].
        noise: Difference of `mean` as seen by every other pass [s].
    """

    mean: float
    noise: float


def swing(simulation: Simulation, step: int) -> FloatArray | None:
    """Return the joints to ask for in a step, shape (s + 1,): servos swing by `SWING` one after the other."""
    joints = simulation.joints
    if not joints:
        return None
    count = len(simulation.efforts)
    phase = 2 * np.pi * (FREQUENCY * step * simulation.scene.dt + np.arange(count) / count)
    start, middle = joints.start[:-1], 0.5 * (joints.low + joints.high)
    move = 0.5 * SWING * (1 - np.cos(phase)) * np.where(start < middle, 1.0, -1.0)
    return np.append(np.clip(start + move, joints.low, joints.high), joints.slide)


class Sampler:
    """Repeats the same steps of one simulation.

    Attributes:
        simulation: Each pass begins where it stood when the sampler was made.
        count: Steps of a pass.
        clock: What times them [s].
    """

    def __init__(self, simulation: Simulation, count: int = 0) -> None:
        """`count`: steps of a pass; 0: by the time that they take."""
        self.simulation = simulation
        self._saved = simulation.save()
        self.count, self.clock, self._reading = 3, thread_time, 0.0
        taken = float(self.one_pass().min())
        if taken < SHORT:
            self.clock = perf_counter
        self._reading = _reading(self.clock)
        self.count = count or int(np.clip(LENGTH / max(taken, 1e-9), FEWEST, MOST))

    def _begin(self) -> None:
        """Return to where the steps begin; the step before them is made, untimed."""
        self.simulation.restore(self._saved)
        self._step()

    def _step(self) -> None:
        advance(self.simulation, 1)

    def one_pass(self, between: Callable[[], None] | None = None) -> FloatArray:
        """Return what each of the steps took [s], shape (count,); `between` is called after each, untimed."""
        self._begin()
        taken = np.empty(self.count)
        if between:
            between()
        for k in range(self.count):
            joints = swing(self.simulation, self.simulation.state.step)
            start = self.clock()
            self.simulation.step(joints)
            taken[k] = self.clock() - start - self._reading
            if between:
                between()
        return taken

    def staged_pass(self, watch: Stopwatch) -> tuple[FloatArray, FloatArray, FloatArray, list[int]]:
        """Make a pass with the methods wrapped.

        Returns:
            What each step took [s], shape (count,); that of each stage, and what timing cost there (see `Stopwatch`),
            shape (count, stages); calls of each stage in all.
        """
        times, costs, calls = list[list[float]](), list[list[float]](), [0] * len(watch.stages)

        def between() -> None:
            times.append(watch.times)
            costs.append(watch.costs)
            if len(times) > 1:
                calls[:] = [a + b for a, b in zip(calls, watch.calls, strict=True)]
            watch.clear()

        watch.clear()
        taken = self.one_pass(between)
        return taken, np.array(times[1:]), np.array(costs[1:]), calls  # the first is of the step before

    def looped(self) -> float | None:
        """Return what a step takes when a pass is one call [s]; None where the steps are no compiled loop."""
        if self.simulation.driven_frames or not hasattr(self.simulation._stepper, "advance"):
            return None
        best = np.inf
        for _ in range(ROUNDS):
            self._begin()
            start = self.clock()
            self.simulation.advance(self.count)
            best = min(best, self.clock() - start)
        return best / self.count


def steps_ahead(simulation: Simulation, at: float | None) -> int:
    """Return how many steps come before typical ones, and make them.

    Args:
        simulation: In its start state.
        at: When they begin [s]; None: half way through the scene's duration, or as far as `AHEAD` goes.
    """
    scene = simulation.scene
    wanted = (0.5 * scene.duration if at is None else at) / scene.dt
    start, done = thread_time(), 0
    while done < wanted or done < FEWEST_AHEAD:
        if at is None and done >= FEWEST_AHEAD and thread_time() - start > AHEAD:
            break
        simulation.step(swing(simulation, simulation.state.step))
        done += 1
    return done


def advance(simulation: Simulation, steps: int, longest: float = np.inf) -> None:
    """Make `steps` steps as `steps_ahead` does; fewer if they take more than `longest` of the machine's time [s]."""
    start = thread_time()
    for _ in range(steps):
        simulation.step(swing(simulation, simulation.state.step))
        if thread_time() - start > longest:
            return


def _reading(clock: Callable[[], float]) -> float:
    """Return what reading a clock takes [s]."""
    best = np.inf
    for _ in range(1000):
        start = clock()
        best = min(best, clock() - start)
    return best


def estimate(passes: list[FloatArray]) -> StepTimes:
    """Return the mean of the least time of each step, from passes of shape (count,)."""
    least = [np.min(part, axis=0).mean() for part in (passes[::2], passes[1::2]) if part]
    mean = float(np.min(passes, axis=0).mean())
    return StepTimes(mean, float(max(least) - min(least)))
