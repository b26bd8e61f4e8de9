"""Which linear solver the steps of a simulation use and why, with its size and its work in a step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.one_newton_step import OneNewtonStep
from tripod_sim.integrators.one_solve import OneSolve
from tripod_sim.integrators.quasi_newton import QuasiNewton
from tripod_sim.integrators.report import StepReport
from tripod_sim.linear import choice
from tripod_sim.linear.ldl import Ldl
from tripod_sim.linear.multigrid import Multigrid
from tripod_sim.linear.solver import LinearSolver
from tripod_sim.simulation import Simulation
from tripod_study.explain.objects import walk
from tripod_study.explain.stages import beside, statics

REUSE: tuple[tuple[type[Newton], str], ...] = (
    (QuasiNewton, "one Hessian serves many steps: it turns with the body, and L-BFGS updates improve it"),
    (OneSolve, "one Hessian serves several steps, as long as the estimated error is small"),
    (OneNewtonStep, "each stage of a step is solved once, with a Hessian of its own"),
    (Newton, "one Hessian serves until a solution no longer halves the residual"),
)
"""How a Hessian serves several solutions, by what solves the steps; the first that fits."""


@dataclass(frozen=True)
class LinearUse:
    """How the steps of a simulation solve their linear systems.

    Attributes:
        solver: `ldl` or `cholmod`, which factor, or `cg` or `multigrid`, which iterate.
        why: Why it is this one, in words.
        entries: Of the factor L; of `cholmod` about as many, of others as L would have. None: not counted.
        memory: Of these solvers, with their factors [B].
        reuse: How a Hessian serves several solutions, in words; empty with contact.
        solutions: Of linear systems in an average step.
        hessians: Assembled and factored in an average step; `cg` factors its preconditioner alone.
        iterations: Of those that iterate, in an average step; 0 of direct solvers.
    """

    solver: str
    why: str
    entries: int | None
    memory: int
    reuse: str
    solutions: float
    hessians: float
    iterations: float


def linear_use(simulation: Simulation, reports: Sequence[StepReport]) -> LinearUse | None:
    """Return how steps solve their linear systems, or None if they solve none.

    Args:
        simulation: Has made steps.
        reports: Of the steps to count in, at least one.
    """
    held = [value for value, _ in walk(simulation, skip=(statics(simulation), *beside(simulation)))]
    solvers = [value for value in held if isinstance(value, LinearSolver) and hasattr(value, "_data")]
    if not solvers:
        return None
    used = max(solvers, key=lambda solver: len(solver._data))  # of contact the one with all bodies
    name = "cg" if used.iterates and not isinstance(used, Multigrid) else type(used).__name__.lower()
    nets, contact = simulation._model.only_springs, bool(simulation._model.contact)
    entries = used.entries if isinstance(used, Ldl) else None
    if entries is None and not nets:
        entries = Ldl(simulation._system.reduction.pattern).entries
    memory = sum({id(a): a.nbytes for a, _ in walk(*solvers) if isinstance(a, np.ndarray)}.values())
    if name == "cholmod" and entries:
        memory += 8 * entries  # of a compiled library, which allocates them
    solutions, hessians, iterations = np.mean(
        [(r.iterations, r.factorisations, r.linear_iterations) for r in reports], axis=0
    )
    return LinearUse(
        solver=name,
        why=_why(name, simulation.scene.solver.linear, nets=nets, contact=contact, entries=entries or 0),
        entries=entries,
        memory=memory,
        reuse="" if contact else next((words for kind, words in REUSE if any(isinstance(v, kind) for v in held)), ""),
        solutions=float(solutions),
        hessians=float(hessians),
        iterations=float(iterations),
    )  # fmt: skip


def _why(name: str, wanted: str, *, nets: bool, contact: bool, entries: int) -> str:
    """Return why steps use the solver `name`.

    Args:
        name: As `LinearUse.solver`.
        wanted: `solver.linear`.
        nets: Whether there are springs alone.
        contact: Whether bodies touch.
        entries: Of L.
    """
    if contact:
        return "contact changes the pattern of the matrix, and needs a factor"
    if wanted != "auto":
        return f"solver.linear is {wanted!r}"
    small, large = (f"{most / 1e6:g} million entries of L" for most in (choice.SMALL, choice.LARGE))
    if nets and name == "cg":
        why = f"auto takes it for nets of more than {choice.LARGE_NET} unknowns"
    elif nets:
        why = f"auto factors nets of at most {choice.LARGE_NET} unknowns"
    elif name in ("cg", "multigrid"):
        why = f"auto takes it above {large}, whose factorisation takes longer"
    elif entries <= choice.SMALL:
        why = f"auto takes it up to {small}, where it is the fastest"
    elif name == "cholmod":
        why = f"auto takes it from {small} to {large}, where it is the fastest"
    else:
        why = f"auto factors up to {large}; cholmod would be faster here: pip install 'tripod[cholmod]'"
    return why
