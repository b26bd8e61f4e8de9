"""`explain`: the stages of one step and what each costs, memory, sizes, and what is switched off."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import thread_time

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.effects import EFFECTS, absent, named
from tripod_sim.errors import SceneError, StepError
from tripod_sim.integrators.report import StepReport
from tripod_sim.scene import Scene
from tripod_sim.scene.file import load_scene, naming_file
from tripod_sim.simulation import Simulation
from tripod_study.explain.costs import FEWEST, PATIENCE, Cost, cost, from_itself
from tripod_study.explain.linear import LinearUse, linear_use
from tripod_study.explain.memory import Size, memory, size
from tripod_study.explain.sampling import ROUNDS, Sampler, StepTimes, estimate, steps_ahead
from tripod_study.explain.stages import LOOP, OTHER, time_stages
from tripod_study.explain.stopwatch import Stopwatch

Progress = Callable[[float, str], None]
"""Called with the fraction done, 0 to 1, and what comes next."""

LATEST = 1_000_000
"""Steps before those that are timed, at most."""


@dataclass(frozen=True)
class Stage:
    """One stage of a step.

    Attributes:
        name: Of the stage; `other` is what is in no other stage.
        seconds: Of an average timed step [s].
        calls: Of an average timed step; None for kernels of a compiled loop and for `other`.
    """

    name: str
    seconds: float
    calls: float | None = None


@dataclass(frozen=True)
class Explanation:
    """What a scene costs on this machine.

    Attributes:
        scene: What was looked at.
        build: Time to build the simulation, kernels at hand [s].
        first: Simulated time at which the timed steps begin [s].
        count: Number of timed steps.
        step: What one of them takes, without stopwatch.
        stages: Of one step, the most expensive first; their sum is `step.mean`.
        timed: The same step with a stopwatch [s]; what that costs is taken off the stages.
        looped: What a step takes when many are made in one call [s]; None where they cannot be.
        memory: Bytes of the arrays of each part.
        size: Unknowns, nodes, elements, nonzeros.
        linear: The linear solver of the steps; None where they solve no linear system.
        notes: What users should know of the scene.
        named: Effects of the scene.
        absent: Effects that it does not name, with what they would cost; empty where that was not asked for.
    """

    scene: Scene
    build: float
    first: float
    count: int
    step: StepTimes
    stages: tuple[Stage, ...]
    timed: float
    looped: float | None
    memory: dict[str, int]
    size: Size
    linear: LinearUse | None
    notes: tuple[str, ...]
    named: tuple[str, ...]
    absent: tuple[Cost, ...]


def explain(
    source: str | Path,
    overrides: Sequence[str] = (),
    *,
    at: float | None = None,
    costs: bool = True,
    progress: Progress | None = None,
) -> Explanation:
    """Return what the steps of a scene cost, measured on this machine.

    Args:
        source: Name of a shipped scene or path of a scene file.
        overrides: Words `dotted.path=value`.
        at: Simulated time at which the timed steps begin [s]; None: half of the scene's duration, or less where that
            takes long.
        costs: Whether to measure what absent effects would cost, which builds the scene with each.
        progress: See `Progress`.

    Raises:
        SceneError: anything wrong with the input.
        StepError: the scene has no start state, or a step cannot be made.
    """
    tell = progress or (lambda done, text: None)
    scene = load_scene(source, overrides)
    if at is not None and not 0 <= at <= LATEST * scene.dt:
        raise SceneError(f"--at is {at:g} s; it must be 0 to {LATEST * scene.dt:g} s, {LATEST} steps of dt")
    tell(0.0, "building")
    with naming_file(source, overrides):
        twin = Simulation(scene)  # compiles or loads the kernels
    start = thread_time()
    simulation = Simulation(scene)
    build = thread_time() - start
    tell(0.1, "reaching typical steps")
    steps = steps_ahead(simulation, at)
    if unstable := simulation.report.instability:
        raise StepError(unstable)
    sampler = Sampler(simulation)
    tell(0.2, "timing the stages")
    step, stages, timed, looped = _stages(sampler)
    reports = list[StepReport]()
    sampler.one_pass(lambda: reports.append(replace(simulation.report)))
    found: list[Cost] = []
    missing = absent(scene) if costs else []
    alone = build + FEWEST * (sampler.count + 1) * step.mean
    least = 0.0
    if missing and alone <= PATIENCE:  # else nothing is measured with an effect
        tell(0.35, "comparing the scene with itself")
        least = from_itself(twin, sampler, steps)
    for k, effect in enumerate(missing):
        tell(0.4 + 0.6 * k / len(missing), f"switching on {effect}")
        found.append(cost(effect, source, overrides, sampler, steps, alone, least))
    tell(1.0, "")
    return Explanation(
        scene, build, steps * scene.dt, sampler.count, step, stages, timed, looped, memory(simulation),
        size(simulation), linear_use(simulation, reports[1:]), (*simulation.notes, *_seldom(scene)),
        tuple(named(scene)), tuple(found),
    )  # fmt: skip


def _seldom(scene: Scene) -> Iterator[str]:
    """Yield what effects of a scene do too seldom for the timed steps to show."""
    for name in named(scene):
        if seldom := EFFECTS[name].seldom:
            yield f"{name}: {seldom}; these steps do not show it"


def _stages(sampler: Sampler) -> tuple[StepTimes, tuple[Stage, ...], float, float | None]:
    """Return what a step takes, its stages, what it takes with a stopwatch, and in a loop [s]."""
    watch = Stopwatch(OTHER, sampler.clock)
    watch.measure_itself()
    untouched, whole = list[FloatArray](), list[FloatArray]()
    parts, costs = list[FloatArray](), list[FloatArray]()
    start = thread_time()
    for done in range(ROUNDS):
        if done >= FEWEST and thread_time() - start > PATIENCE:
            break
        untouched.append(sampler.one_pass())
        time_stages(sampler.simulation, watch)
        try:
            taken, stages, own, calls = sampler.staged_pass(watch)
        finally:
            watch.unwrap()
        whole.append(taken)
        parts.append(stages)
        costs.append(own)
    step, timed = estimate(untouched), estimate(whole).mean
    at = (
        np.array(whole).argmin(axis=0),
        np.arange(sampler.count),
    )  # for each step the pass that was disturbed least
    spent = np.array(costs)[at].mean(axis=0)
    seconds = np.array(parts)[at].mean(axis=0) - _in_place(timed - step.mean, float(spent.sum())) * spent
    found = [
        Stage(name, float(t), n / sampler.count)
        for name, t, n in zip(watch.stages, seconds, calls, strict=True)
        if n and name not in (OTHER, LOOP)
    ]
    looped = None
    if LOOP in watch.stages:
        loop, looped = float(seconds[watch.stages.index(LOOP)]), sampler.looped()
        found.append(Stage(LOOP, loop if looped is None else looped))
        if looped is not None:
            found.append(Stage(f"{LOOP}: its call for one step", loop - looped))
    found.sort(key=lambda s: -s.seconds)
    found.append(Stage(OTHER, step.mean - sum(s.seconds for s in found)))
    return step, tuple(found), timed, looped


def _in_place(added: float, alone: float) -> float:
    """Return how much more the timing of a call costs among others than alone; `added` and `alone` are of a step [s].

    Alone, everything it touches is at hand; more than three times as much is no cost of timing.
    """
    return float(np.clip(added / alone, 1.0, 3.0)) if alone > 0 else 1.0
