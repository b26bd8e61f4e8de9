"""Memory of a simulation: the arrays of each part, and how large its matrices are."""

from dataclasses import dataclass

import numpy as np

from tripod_sim.simulation import Simulation
from tripod_study.explain.objects import walk
from tripod_study.explain.stages import statics

PARTS = {
    "state": "states",
    "simulation": "states",
    "mesh": "mesh",
    "forces.solid": "solid",
    "forces.solid_arrays": "solid",
    "forces.elastic": "solid",
    "forces.spring_force": "springs",
    "elements": "solid",
    "bodies": "mesh",
    "constraints": "constraints and reduction",
    "linear": "linear solver",
    "integrators": "time scheme and Newton",
    "system": "system: gradient and residual",
    "forces.gravity": "gravity",
    "forces.anchor": "inertia",
    "forces.foundation": "clamp",
    "forces.loads": "ball",
    "robot.servo": "servo dynamics",
    "ball": "ball",
    "maze": "maze",
    "contact": "contact",
    "contact.rigid_set": "rigid bodies",
    "integrators.time_error": "time error",
    "steps.doubling": "time error",
    "mesh_error": "mesh error",
    "steps.sleep": "sleep",
    "integrators.strain_limit": "strain limit",
    "forces.strain_bound": "strain limit",
    "springs": "springs",
}
"""Name of a part by the module, below `tripod_sim`, of the object that holds an array; the longest one counts."""

STATICS = "statics: start pose and compliance"


@dataclass(frozen=True)
class Size:
    """How large a problem is.

    Attributes:
        unknowns: Of a step.
        nodes, elements: Of the body; elements of springs are springs.
        nonzeros: Of the upper triangle of the reduced Hessian; 0 where there is none.
        factor_entries: Of its factor; 0 for an iterative solver.
    """

    unknowns: int
    nodes: int
    elements: int
    nonzeros: int
    factor_entries: int


def memory(simulation: Simulation) -> dict[str, int]:
    """Return the bytes of all arrays by part, the largest first; what compiled libraries allocate is not seen."""
    found: dict[str, int] = {}
    others = statics(simulation)
    for value, owner in walk(simulation, skip=(others,)):
        if isinstance(value, np.ndarray):
            part = part_of(owner)
            found[part] = found.get(part, 0) + value.nbytes
    mine = {id(v) for v, _ in walk(simulation, skip=(others,))}
    extra = sum(v.nbytes for v, _ in walk(others) if isinstance(v, np.ndarray) and id(v) not in mine)
    if extra:
        found[STATICS] = extra
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def part_of(module: str) -> str:
    """Return the part to which what a class of `module` holds belongs."""
    name = module.removeprefix("tripod_sim.")
    fits = [key for key in PARTS if name == key or name.startswith(key + ".")]
    return PARTS[max(fits, key=len)] if fits else name


def size(simulation: Simulation) -> Size:
    """Return how large the problem of a step is."""
    nonzeros = entries = 0
    for value, _ in walk(simulation, skip=(statics(simulation),)):
        if hasattr(value, "panel") and hasattr(value, "order"):  # plan or numbers of a factorisation
            entries = max(entries, int(value.panel[-1]) if len(value.panel) else 0)
        for pattern in (getattr(value, "pattern", None), getattr(value, "_pattern", None)):
            nonzeros = max(nonzeros, int(getattr(pattern, "nnz", 0)))
        if hasattr(value, "diagonal") and hasattr(value, "off") and hasattr(value, "data"):
            nonzeros = max(nonzeros, len(value.data))
    body = simulation.mesh
    return Size(simulation.unknowns, len(body.nodes), body.count, nonzeros, entries)
