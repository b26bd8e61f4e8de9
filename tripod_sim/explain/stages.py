"""Which methods of which classes are the stages of a step. Classes go by name, so that looking imports no effect."""

from tripod_sim.explain.objects import walk
from tripod_sim.explain.stopwatch import Stopwatch
from tripod_sim.simulation import Simulation

OTHER = "other"

LOOP = "compiled loop"
"""Of springs: all stages of a step, or of many, in one compiled function."""

ELASTIC, ASSEMBLY, REDUCTION = "elastic forces", "Hessian assembly", "reduction"
FACTORISATION, SOLUTION = "factorisation", "back-substitution"
ITERATION, SCHEME, MOVES = "Newton and line search", "time scheme", "moving the nodes"
ARMS, BALL, CONTACT = "servo arms", "ball", "contact"

STAGES: dict[str, dict[str, str]] = {
    "system.System": {
        "_evaluate_elastic": ELASTIC,
        "evaluate": "gradient",
        "update_levers": REDUCTION,
        "assemble": ASSEMBLY,
        "factor": REDUCTION,
        "move": MOVES,
        "drive": ARMS,
        "add_driven": ARMS,
    },
    "constraints.reduction.Reduction": {"gradient": REDUCTION, "hessian": REDUCTION, "moves": MOVES},
    "forces.gravity.GravityForce": {"add_gradient": "gravity"},
    "forces.anchor.Anchor": {"add_gradient": "inertia"},
    "forces.rayleigh.StiffnessDamping": {"add_gradient": "damping", "hold": "damping"},
    "forces.spring_force.SpringDampers": {"add_gradient": "dampers", "stiffness": ASSEMBLY},
    "forces.foundation.Foundation": {"add_gradient": "clamp"},
    "forces.loads.NodalLoads": {"add_gradient": BALL},
    "linear.ldl.Ldl": {"factor": FACTORISATION, "is_positive": FACTORISATION, "solve": SOLUTION},
    "linear.cholmod.Cholmod": {"factor": FACTORISATION, "is_positive": FACTORISATION, "solve": SOLUTION},
    "linear.cg.ConjugateGradients": {"factor": "preconditioner", "solve": "conjugate gradients"},
    "integrators.newton.Newton": {"solve": ITERATION},
    "integrators.load_steps.LoadSteps": {"carry": "load increments"},
    "integrators.stage.ImplicitStage": {"read": SCHEME, "solve": SCHEME},
    "integrators.substeps.Substeps": {"step": SCHEME},
    "integrators.explicit.ExplicitSteps": {
        "step": SCHEME,
        "_longest_part": "stability limit",
        "_advance": "explicit parts",
        "_energy": "watch over the energy",
    },
    "integrators.frequency.LargestFrequency": {"largest": "stability limit"},
    "integrators.time_error.ErrorTransport": {
        "keep_residual": "time error",
        "euler": "time error",
        "bdf2": "time error",
        "tr_bdf2": "time error",
        "would_add": "time error",
        "report": "time error",
    },
    "integrators.doubling.Doubling": {"step": "time error"},
    "mesh_error.MeshError": {"follow": "mesh error"},
    "integrators.sleep.Sleeping": {"step": "sleep"},
    "robot.servo.ServoMotion": {"advance": "servo dynamics", "stalled": "servo dynamics"},
    "maze.play.MazeBall": {"load": BALL, "follow": BALL},
    "ball.body_ball.BodyBall": {"load": BALL, "follow": BALL},
    "contact.stepper.ContactStepper": {"step": f"{CONTACT}: bookkeeping"},
    "contact.world.World": {"step": f"{CONTACT}: bookkeeping", "_finish": f"{CONTACT}: end of the step"},
    "contact.detection.Detector": {
        "near": f"{CONTACT}: near pairs",
        "met": f"{CONTACT}: continuous detection",
    },
    "contact.response.Response": {"solve": f"{CONTACT}: response"},
    "contact.few.FewContacts": {"solve": f"{CONTACT}: compliance"},
    "contact.problem.StepProblem": {
        "descend": ITERATION,
        "_evaluate": f"{CONTACT}: gradient",
        "gradient": "gradient",
        "_assemble": ASSEMBLY,
        "_factor": f"{CONTACT}: Hessian",
        "_solve": SOLUTION,
        "solve_bodies": SOLUTION,
        "rows": SOLUTION,
    },
    "springs.stage.SpringNewton": {"solve_stage": LOOP},
    "springs.implicit.StaticSprings": {"step": LOOP},
    "springs.automatic.AutomaticSprings": {"step": LOOP},
    "springs.explicit.ExplicitSprings": {"step": LOOP},
    "forces.strain_bound.StrainBound": {
        "add_gradient": "strain limit",
        "stiffness": "strain limit",
        "settle": "strain limit",
    },
    "integrators.strain_limit.StrainLimited": {"step": "strain limit"},
}
"""Methods by class, below `tripod_sim`, with the name of their stage. A method's time counts without that of the stages
called by it."""


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
