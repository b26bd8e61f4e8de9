"""The stages of springs: their steps are compiled loops, so each kernel is timed apart and counted as often as it ran.

What the kernels do not account for is the rest: copies, the scheme's own sums, and the call from Python, which steps
made many at a time (`Simulation.advance`) share.
"""

from collections.abc import Callable
from time import thread_time
from typing import Any

from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.scheme import ExplicitScheme
from tripod_sim.integrators.schemes import implicit_euler
from tripod_sim.simulation import Simulation
from tripod_study.explain.objects import walk

LONG, REPEATS = 1e-3, 5
"""Time of one repetition of a kernel [s]; the least of so many counts."""

IMPLICIT_SPRINGS = (
    "tripod_sim.springs.stage.SpringNewton",
    "tripod_sim.springs.implicit.StaticSprings",
)
EXPLICIT_SPRINGS = "tripod_sim.springs.explicit.ExplicitSprings"
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
        if kind in IMPLICIT_SPRINGS:
            return _implicit(value, simulation, report, steps)
        if kind == EXPLICIT_SPRINGS:
            return _explicit(value, simulation, report, steps)
        if kind == AUTOMATIC:
            return _automatic(value, simulation, report, steps)
    return {}


def _implicit(stepper: Any, simulation: Simulation, report: StepReport, steps: int) -> dict[str, float]:
    from tripod_study.explain import repeat_kernels as kernels  # noqa: PLC0415 - springs are an effect that may be absent

    solver, state, dt = stepper.solver, simulation.state, simulation.scene.dt
    body, work, factor, options = solver.problem, solver.work, solver.factor, solver.options
    x, v, links = state.positions, state.velocities, body.links
    scheme = simulation.scene.inertia.implicit if simulation.scene.inertia else implicit_euler.SCHEME
    of_step = scheme.stages(dt, dt)
    s, stages = of_step[0].s, len(of_step) * max(1, report.parts)
    solves, renewals = report.iterations / steps, report.factorisations / steps
    work.z[:], work.u[:] = x - s * v, v
    rate = 1.0 / s if body.damped else 0.0
    found = {
        "gradient": (stages / steps + solves) * _least(lambda n: kernels.evaluate(n, x, v, s, body, work)),
        "Hessian: springs": renewals
        * _least(lambda n: kernels.tangents(n, x, links, rate, work.reference, work.blocks)),
        "moving the nodes": solves * _least(lambda n: kernels.walk(n, v, 0.0, s, body, work)),
    }
    work.weight[body.free] = body.mass[body.free] / s**2
    if not options.direct:
        found["preconditioner"] = renewals * _least(
            lambda n: kernels.prepare(
                n, links.ends, work.blocks, work.weight, body.free, body.number, work.sweep
            )
        )
        limit = 1000 + 12 * len(body.free)

        def iterate(count: int) -> int:
            return int(
                kernels.iterate(count, work.sweep, work.g, body.free, options.linear_tolerance, limit, work.p)
            )

        taken = _least(iterate) / max(1, iterate(1))
        found["conjugate gradients"] = report.linear_iterations / steps * taken
        stepper.forget()
        return found
    found["Hessian assembly"] = renewals * _least(
        lambda n: kernels.assemble(
            n, links.ends, work.blocks, work.weight, body.free, body.number, factor.slots
        )
    )
    found["factorisation"] = renewals * _least(lambda n: kernels.factorise(n, factor))
    found["back-substitution"] = solves * _least(
        lambda n: kernels.solve(n, factor, work.g, body.free, work.p)
    )
    stepper.forget()
    return found


def _explicit(stepper: Any, simulation: Simulation, report: StepReport, steps: int) -> dict[str, float]:
    from tripod_study.explain import repeat_kernels as kernels  # noqa: PLC0415

    state, system, load, scratch = simulation.state, stepper._system, stepper._load, stepper._scratch
    x, v, links, origin = state.positions, state.velocities, system.links, system.body.nodes
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

    state, links = simulation.state, stepper._system.links
    x, v, load, a = state.positions, state.velocities, stepper._load, stepper._scratch[0]
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
