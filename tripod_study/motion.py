"""A scene with a point's settings, and its motion: what it shows and what it costs."""

import math
import time
from collections.abc import Callable, Iterable, Mapping

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene
from tripod_sim.scene.file import load_scene, words_of
from tripod_sim.simulation import Simulation
from tripod_study.plan import Settings
from tripod_study.task import Measured, repeated

Watch = Callable[[], Mapping[str, Iterable[float]]]
"""Gives one row for each quantity."""


def scene_of(name: str, settings: Settings) -> Scene:
    """Return a shipped scene with a point's settings. Raises SceneError."""
    return load_scene(name, words_of(settings))


def motion(
    scene: Scene,
    duration: float,
    interval: float,
    watch: Callable[[Simulation], Watch],
    command: Callable[[float], FloatArray] | None = None,
) -> Measured:
    """Run a motion and observe it every `interval` [s].

    Args:
        scene: Its dt must divide `interval`.
        duration: Of the motion [s], a multiple of `interval`.
        interval: Between observations [s].
        watch: Called at the start, returns what gives one row for each quantity whenever it is called.
        command: Joints at a time [s]; None leaves them.

    Raises:
        SceneError: dt does not divide `interval`.
        StepError: the motion broke off, grew without cause or is not finite.
    """
    steps, samples = round(interval / scene.dt), round(duration / interval)
    if steps < 1 or abs(steps * scene.dt - interval) > 1e-9 * interval:
        raise SceneError(f"dt is {scene.dt:g} s; in this study {interval:g} s must be a multiple of it")
    simulation = Simulation(scene)
    found: list[Mapping[str, list[float]]] = []

    def run() -> float:
        simulation.reset()
        observe = watch(simulation)
        rows, cpu = [], 0.0
        for k in range(samples):
            start = time.thread_time()
            if command is None:
                reports = [simulation.advance(steps)]
            else:
                reports = [simulation.step(command((k * steps + i + 1) * scene.dt)) for i in range(steps)]
            cpu += time.thread_time() - start
            if unstable := next((r.instability for r in reports if r.grew_at), ""):
                raise StepError(unstable)
            rows.append({name: [float(v) for v in row] for name, row in observe().items()})
        if not all(math.isfinite(v) for row in rows for values in row.values() for v in values):
            raise StepError("the motion is not finite; take a smaller dt")
        found[:] = rows
        return cpu

    cpu = repeated(run)
    observed = {name: [row[name] for row in found] for name in found[0]}
    return Measured(observed, cpu, duration, simulation.unknowns)


def nodes(simulation: Simulation) -> Watch:
    """Watch the positions of all nodes."""
    return lambda: {"nodes": simulation.positions.ravel().tolist()}
