"""The stages of explicit steps of springs: these are compiled loops, so each kernel is timed apart.

It is counted as often as it ran.

What the kernels do not account for is the rest: copies, the scheme's own sums, and the call from Python, which steps
made many at a time (`Simulation.advance`) share.
"""

from collections.abc import Callable
from time import thread_time
from typing import Any

from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.scheme import ExplicitScheme
from tripod_sim.simulation import Simulation
from tripod_study.explain.objects import walk

LONG, REPEATS = 1e-3, 5
"""Time of one repetition of a kernel [s]; the least of so many counts."""

EXPLICIT = "tripod_sim.springs.explicit.ExplicitSprings"
AUTOMATIC = "tripod_sim.springs.automatic.AutomaticSprings"


def kernel_stages(simulation: Simulation, report: StepReport, steps: int) -> dict[str, float]:
    """Return what the kernels of a compiled loop take in a step [s], by stage; empty where there is no loop.

    Args:
        simulation: In a typical state.
        report: What `steps` steps took together.
        steps: Their number.
    """
    for value, _ in walk(simulation):
        kind = f"{type(value).__module__}.{type(value).__qualname__}"
        if kind == EXPLICIT:
            return _explicit(value, simulation, report, steps)
        if kind == AUTOMATIC:
            return _automatic(value, simulation, report, steps)
    return {}


def _explicit(stepper: Any, simulation: Simulation, report: StepReport, steps: int) -> dict[str, float]:
    from tripod_study.explain import repeat_kernels as kernels  # noqa: PLC0415

    state, (links, load, origin), scratch = simulation.state, stepper.loop, stepper._scratch
    x, v = state.positions, state.velocities
    scheme = simulation.scene.inertia.integrator if simulation.scene.inertia else None
    assert isinstance(scheme, ExplicitScheme)
    calls = scheme.forces * report.parts / steps
    return {
        "spring forces": calls * _forces(stepper, simulation),
        "watch over the energy": _least(lambda n: kernels.watch(n, x, v, origin, links, load, scratch[0])),
    }


def _automatic(stepper: Any, simulation: Simulation, report: StepReport, steps: int) -> dict[str, float]:
    return {"spring forces": stepper.forces * report.parts / steps * _forces(stepper, simulation)}


def _forces(stepper: Any, simulation: Simulation) -> float:
    """Return the time of one evaluation of the springs' forces [s]."""
    from tripod_study.explain import repeat_kernels as kernels  # noqa: PLC0415

    state, (links, load, _) = simulation.state, stepper.loop
    x, v, a = state.positions, state.velocities, stepper._scratch[0]
    return _least(lambda n: kernels.accelerations(n, x, v, links, load, a))


def _least(run: Callable[[int], object]) -> float:
    """Return the time of one of many calls made in one compiled loop [s]."""
    run(1)  # compiles
    count = 1
    while True:
        start = thread_time()
        run(count)
        taken = thread_time() - start
        if taken > LONG / 4 or count > 1e7:
            break
        count *= 4
    best = taken
    for _ in range(REPEATS - 1):
        start = thread_time()
        run(count)
        best = min(best, thread_time() - start)
    return best / count
