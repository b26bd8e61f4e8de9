"""What the effects that a scene does not name would cost a step, measured by building the scene with each of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import thread_time

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.groups import Kind
from tripod_sim.effects import EFFECTS, meaning, words
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene.file import load_scene
from tripod_sim.simulation import Simulation
from tripod_study.explain.sampling import Sampler, StepTimes, advance, estimate

ROUNDS, FEWEST = 5, 2
"""Passes over the scene without and with an effect, alternately; and what is needed at least to tell the noise."""

SURE = 2.0
"""Times the difference that a few passes show, up to which a difference is taken to be noise: in 56 trials scenes
differed from themselves by up to 1.7 times it."""

PATIENCE = 20.0
"""Time that one effect may take: a scene that takes longer for its fewest passes is not tried with it [s]."""

LONGEST = 2.0
"""Time that is spent on reaching typical steps with an effect [s]."""

NEEDS = {
    "obstacles": "it needs the file of a surface, and contact: "
    """--set 'obstacles=[{source="my.obj"}]' --set contact={}""",
}
"""What an effect without defaults needs."""

SLABS = 10
"""Into which the bodies are cut along each axis: a box holds, or moves, one of them where a scene has none."""

MARGIN = 1e-6
"""How far the slabs reach around the bodies [m]."""


@dataclass(frozen=True)
class Cost:
    """What an effect would cost.

    Attributes:
        effect: Its name.
        meaning: What it is, in one line.
        words: Overrides that switch it on.
        seconds: More time of a step [s]; None where the effect cannot be switched on with defaults, or is left out.
        noise: Of that [s].
        why_not: Why, in one sentence; empty where there is a time.
        besides: What it takes besides, too seldom for the timed steps to show; empty for nothing.
    """

    effect: str
    meaning: str
    words: tuple[str, ...]
    seconds: float | None = None
    noise: float = 0.0
    why_not: str = ""
    besides: str = ""

    @property
    def measured(self) -> bool:
        """Whether the time exceeds its noise; else there is nothing to tell of it."""
        return self.seconds is not None and abs(self.seconds) > self.noise


def difference(simulation: Simulation, base: Sampler, steps: int) -> StepTimes | None:
    """Return how much longer steps of `simulation` take than those of `base`, both after `steps` steps.

    None where its fewest passes take more than `PATIENCE`. Raises StepError.
    """
    start = thread_time()  # kernels are compiled
    advance(simulation, steps, LONGEST)
    other = Sampler(simulation)
    count = other.count = min(other.count, base.count)
    without, with_ = [], []
    for done in range(ROUNDS):
        if thread_time() - start > PATIENCE:
            if done < FEWEST:
                return None
            break
        without.append(base.one_pass()[:count])
        with_.append(other.one_pass())
    a, b = estimate(without), estimate(with_)
    return StepTimes(b.mean - a.mean, a.noise + b.noise)


def from_itself(twin: Simulation, base: Sampler, steps: int) -> float:
    """Return by how much steps of a `twin` of the scene of `base` seem to differ [s]: less than that is no cost."""
    found = difference(twin, base, steps)
    return max(abs(found.mean), found.noise) if found else 0.0


def cost(
    effect: str, source: str | Path, overrides: Sequence[str], base: Sampler, steps: int, alone: float,
    least: float = 0.0,
) -> Cost:  # fmt: skip
    """Return what `effect` would cost a scene; it is left out where that takes much more than `PATIENCE`.

    Args:
        effect: A name that the scene does not have.
        source: The scene's name or file.
        overrides: Of the scene.
        base: Of the scene as it is, after `steps` steps.
        steps: Made before those that are timed.
        alone: What building and the fewest passes of the scene as it is take [s]: with an effect it is hardly less.
        least: Of the noise [s].
    """
    added = switched_on(effect, base.simulation)
    if effect in NEEDS:
        return Cost(effect, meaning(effect), (), why_not=NEEDS[effect])
    left_out = Cost(
        effect,
        meaning(effect),
        added,
        why_not=f"left out: it would take longer than {PATIENCE:g} s to measure",
    )
    try:
        scene = load_scene(source, [*overrides, *added])
        if alone > PATIENCE:
            return left_out
        found = difference(Simulation(scene), base, steps)
    except (SceneError, StepError) as error:
        return Cost(effect, meaning(effect), added, why_not=" ".join(str(error).split()))
    if not found:
        return left_out
    noise = SURE * max(found.noise, least)
    return Cost(effect, meaning(effect), added, found.mean, noise, besides=EFFECTS[effect].seldom)


def switched_on(effect: str, simulation: Simulation) -> tuple[str, ...]:
    """Return the overrides that switch `effect` on with defaults in the scene of `simulation`."""
    if effect not in ("fixed", "prescribed"):
        return words(effect)
    low, high = ([round(v, 9) for v in corner.tolist()] for corner in _slab(simulation))
    box = f"low={low}, high={high}"
    if effect == "fixed":
        return (f"fixed=[{{{box}}}]",)
    table, sets = f'{{name="moved", {box}}}', len(simulation.scene.set)
    move = 'prescribed=[{set="moved", move="0: 0,0,0; 1: 0,0,1e-4"}]'
    return (f"set.{sets}={table}" if sets else f"set=[{table}]", move)


def _slab(simulation: Simulation) -> tuple[FloatArray, FloatArray]:
    """Return the corners of a slab of the soft bodies [m]: of those with nodes the first one where fewest are held.

    Where there are none it is empty, and the scene says what it needs.
    """
    groups = simulation._system.groups
    nodes = simulation.mesh.nodes[: len(simulation.mesh.nodes) - sum(simulation.rigid_counts)]
    if not len(nodes):
        return np.zeros(3), np.zeros(3)
    held = (groups.held().any(axis=1) | (groups.kinds()[0] == Kind.RIGID))[: len(nodes)]
    low, high = nodes.min(axis=0) - MARGIN, nodes.max(axis=0) + MARGIN
    depths = np.diag((high - low) / SLABS)
    slabs = [(low + k * d, np.where(d, low + (k + 1) * d, high)) for d in depths for k in range(SLABS)]
    inside = [((nodes >= slab[0]) & (nodes <= slab[1])).all(axis=1) for slab in slabs]
    return slabs[min(range(len(slabs)), key=lambda i: (not inside[i].any(), np.sum(held & inside[i])))]
