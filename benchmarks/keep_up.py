"""How long the steps wait while a simulation comes down to cheaper settings and goes up again.

    python benchmarks/keep_up.py [--scene tripod] [--rest]

The robot goes round in its working pose, or rests, in real time. What is slow is not the machine: the looks say so, so
that what is measured is the change itself: the longest time between two steps before it, while the other simulation is
built and brought to the joints, and at the change (the time from the last step of the one to the first of the other).
"""

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim import Simulation, load_scene
from tripod_sim.accuracy.pace import Look
from tripod_sim.keep_up import KeepUp, Meter, Settings
from tripod_sim.realtime import RealTime, Snapshot

PATIENCE = 120.0
"""For a change [s]."""

WORK = np.array([-1.4965, -1.4965, -1.4965, 0.035])
ROUND = 0.3
"""Of each servo about the working pose [rad], once in a second."""


@dataclass(frozen=True)
class Step:
    """When a step was made, of a body of how many nodes, and where the effector was then [m], (3,)."""

    time: float
    nodes: int
    effector: FloatArray


def told(steps: Sequence[Step], begin: float, end: float) -> str:
    """Return the time between steps within a time, in words."""
    gaps = np.diff([step.time for step in steps if begin <= step.time <= end])
    return f"median {1e3 * np.median(gaps):5.2f} ms, longest {1e3 * gaps.max():6.1f} ms"


class Said(Meter):
    """Says that the machine is as fast as it is told to say."""

    def __init__(self, physics: RealTime) -> None:
        super().__init__(physics)
        self.factor, self.cost, self.idle = 1.0, 0.5, 2.0

    def look(self) -> Look:
        """Return what it is told to say."""
        return Look(time.monotonic(), self.factor, self.cost, self.idle)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scene", default="tripod")
    parser.add_argument("--rest", action="store_true", help="the robot rests in its working pose")
    options = parser.parse_args()
    simulation = Simulation(load_scene(options.scene))
    simulation.rehearse()
    steps, began = list[Step](), time.monotonic()

    def command(now: float) -> FloatArray:
        share = min(1.0, (now - began) / 2)
        turn = 0.0 if options.rest else share * ROUND
        angles = [turn * math.sin(2 * math.pi * (now - began + k / 3)) for k in range(3)]
        return WORK * share + np.array([*angles, 0.0])

    def keep(snapshot: Snapshot) -> None:
        assert snapshot.effector
        steps.append(Step(time.monotonic(), len(snapshot.positions), snapshot.effector.position))

    physics = RealTime(simulation, command, on_snapshot=keep)
    said, words, changes = Said(physics), list[str](), list[float]()
    settings = Settings(options.scene)
    keeper = KeepUp(physics, settings, words.append, lambda _: changes.append(time.monotonic()), said)
    physics.start()
    time.sleep(4.0)
    print(f"{'before':10}{told(steps[:], began + 2.5, time.monotonic())}")
    for factor, cost in ((0.3, 0.5), (1.0, 0.1)):  # down, up
        said.factor, said.cost = factor, cost
        start, count, end = time.monotonic(), len(changes), time.monotonic() + PATIENCE
        skipped = physics.speed().missed
        while len(changes) == count and time.monotonic() < end:
            keeper.look()
            time.sleep(0.2)
        said.factor = 1.0
        time.sleep(2.0)
        k = next(k for k, step in enumerate(steps) if step.time > changes[-1])
        wait = steps[k].time - steps[k - 1].time
        move = np.linalg.norm(steps[k].effector - steps[k - 1].effector)
        print(words[-1])
        print(f"{'skipped':12}{physics.speed().missed - skipped} steps until 2 s after the change")
        print(f"{'until then':12}{told(steps[:k], start, changes[-1])}")
        print(f"{'change':12}{1e3 * wait:.1f} ms from step to step, effector moves {1e3 * move:.2f} mm in it")
        print(f"{'after':12}{told(steps[k:], changes[-1], time.monotonic())}")
    keeper.close()
    physics.stop()
    if physics.failure:
        raise SystemExit(physics.failure)


if __name__ == "__main__":
    main()
