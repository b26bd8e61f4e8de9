"""Which methods of which classes are the stages of a step. Classes go by name, so that looking imports no effect."""

from tripod_sim.effects import EFFECTS
from tripod_sim.simulation import Simulation
from tripod_study.explain.objects import walk
from tripod_study.explain.stopwatch import Stopwatch

OTHER = "other"

LOOP = "compiled loop"
"""Of explicit schemes of springs: all stages of a step, or of many, in one compiled function."""

ELASTIC, ASSEMBLY, REDUCTION = "elastic forces", "Hessian assembly", "reduction"
FACTORISATION, SOLUTION = "factorisation", "back-substitution"
ITERATION, SCHEME, MOVES = "Newton and line search", "time scheme", "moving the nodes"

CORE: dict[str, dict[str, str]] = {
    "system.System": {
        "_evaluate_elastic": ELASTIC,
        "evaluate": "gradient",
        "update_levers": REDUCTION,
        "assemble": ASSEMBLY,
        "factor": REDUCTION,
        "move": MOVES,
    },
    "constraints.reduction.Reduction": {"gradient": REDUCTION, "hessian": REDUCTION, "moves": MOVES},
    "forces.elastic.Elastic": {"add_damper_gradient": "dampers", "remember": "dampers", "aim": "dampers"},
    "linear.ldl.Ldl": {"factor": FACTORISATION, "is_positive": FACTORISATION, "solve": SOLUTION},
    "linear.cholmod.Cholmod": {"factor": FACTORISATION, "is_positive": FACTORISATION, "solve": SOLUTION},
    "linear.cg.ConjugateGradients": {"factor": "preconditioner", "solve": "conjugate gradients"},
    "integrators.newton.Newton": {"solve": ITERATION},
    "integrators.load_steps.LoadSteps": {"carry": "load increments"},
    "integrators.stage.ImplicitStage": {"read": SCHEME, "solve": SCHEME},
    "integrators.substeps.Substeps": {"step": SCHEME},
    "integrators.explicit.ExplicitSteps": {"step": SCHEME, "_energy": "watch over the energy"},
    "integrators.static_descent.StaticDescent": {"advance": ITERATION},
    "springs.automatic.AutomaticSprings": {"step": LOOP},
    "springs.explicit.ExplicitSprings": {"step": LOOP},
}
"""What no effect brings: methods by class, below `tripod_sim`, with the name of their stage."""

STAGES: dict[str, dict[str, str]] = {
    name: dict(pair for table in (CORE, *(e.stages for e in EFFECTS.values())) for pair in table.get(name, {}).items())
    for name in dict.fromkeys([*CORE, *(name for e in EFFECTS.values() for name in e.stages)])
}  # fmt: skip
"""With those of effects. A method's time counts without that of the stages called by it."""


def time_stages(simulation: Simulation, watch: Stopwatch) -> None:
    """Wrap every stage of the steps of `simulation`; what only its static start pose needs is left alone."""
    for value, _ in walk(simulation, skip=(statics(simulation), *beside(simulation))):
        for kind in type(value).__mro__:
            for method, stage in STAGES.get(_key(kind), {}).items():
                watch.wrap(value, method, stage)


def statics(simulation: Simulation) -> object:
    """Return what finds the static start pose where that is not what makes the steps, else an object of no meaning."""
    return simulation._static if simulation._static is not simulation._parts else object()


def beside(simulation: Simulation) -> tuple[object, ...]:
    """Return what tells the error of the mesh: a body of its own, none of whose stages are those of the step."""
    return tuple(v for v in vars(simulation._mesh_error or object).values() if hasattr(v, "__dict__"))


def _key(kind: type) -> str:
    return f"{kind.__module__}.{kind.__qualname__}".removeprefix("tripod_sim.")
