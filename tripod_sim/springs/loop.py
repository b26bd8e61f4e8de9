"""Systems that the compiled explicit loops advance: springs, constant forces, drag and fixed nodes, nothing else."""

from typing import NamedTuple

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.groups import Kind
from tripod_sim.forces.spring_kernels import Links, nets_of
from tripod_sim.forces.term import ForceTerm, Term
from tripod_sim.springs.explicit_kernels import Load
from tripod_sim.system import System


class SpringLoop(NamedTuple):
    """Arrays of the loops. links: all springs; load: what else acts; origin: where its potential is zero, (n, 3)."""

    links: Links
    load: Load
    origin: FloatArray


def spring_loop(
    system: System, mass: FloatArray, drag: float, inertia: Term | None = None
) -> SpringLoop | None:
    """Return the arrays with which compiled loops advance `system`; None if it has a term or constraint they lack.

    Args:
        system: The sum of terms.
        mass: Of nodes [kg], shape (n,).
        drag: a of the force -a M v [1/s].
        inertia: The term of implicit schemes, which the loops do not need; None if the system has none.
    """
    terms = [term for term in system.terms if term is not inertia]
    springs = [term.links for term in system.elastic.terms if term.links]
    constant = [term for term in terms if isinstance(term, ForceTerm) and not term.works]
    kinds, groups = system.reduction.kind, system.groups
    free = kinds == Kind.FREE
    if not (
        springs
        and len(springs) == len(system.elastic.terms)
        and len({links.slack for links in springs}) == 1
        and len(constant) == len(terms)
        and (free | (kinds == Kind.FIXED)).all()
        and not (groups.prescribed or len(groups.pinned))
        and (mass[free] > 0).all()
    ):
        return None
    links = nets_of(springs)[springs[0].slack]
    moving = np.where(free, mass, 0.0)
    inverse = np.divide(1.0, moving, out=np.zeros_like(moving), where=moving > 0)
    force = sum((term.force for term in constant), start=np.zeros_like(system.rest))
    return SpringLoop(links, Load(np.ascontiguousarray(force), inverse, moving, drag), system.rest)
