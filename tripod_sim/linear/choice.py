"""Which linear solver a scene gets: the one that it names, or by size."""

from collections.abc import Callable
from importlib.util import find_spec

from tripod_host.arrays import IndexArray
from tripod_sim.errors import SceneError
from tripod_sim.linear.ldl import Ldl
from tripod_sim.linear.solver import LinearSolver, Pattern

LinearFactory = Callable[[Pattern, IndexArray], LinearSolver]
"""Makes a solver for a pattern (see `LinearSolver`) and its diagonal blocks (see `ConjugateGradients`)."""

SMALL = 1_000_000
"""Entries of L (8 MB) up to which `ldl` is the fastest; above, CHOLMOD's dense kernels are, up to twice."""

LARGE = 150_000_000
"""Entries of L (160 MB) above which `auto` iterates: a cube of 20,000 unknowns. There one factorisation takes as long
as four solutions by conjugate gradients, which is what a renewed Hessian needs. Not the unknowns but the factor
decides: thin bodies of as many unknowns have a factor ten times smaller and take ten times the iterations."""


LARGE_NET = 60_000
"""Unknowns of nets of springs above which `auto` iterates: there an incomplete factorisation serves well."""


def linear_factory(name: str, tolerance: float, *, springs: bool = False) -> LinearFactory:
    """Return what makes the solver `name`; the thresholds are those of `benchmarks/linear.py`.

    Args:
        name: `auto`, `ldl`, `cholmod` or `cg`.
        tolerance: Relative residual of conjugate gradients.
        springs: Whether the matrices are of nets of springs alone.

    Raises:
        SceneError: `cholmod` is named and not installed.
    """
    if name == "cholmod" and not _has_cholmod():
        raise SceneError(
            "solver.linear is 'cholmod', which is not installed: pip install 'tripod[cholmod]'; or choose auto, ldl, cg"
        )

    def make(pattern: Pattern, blocks: IndexArray) -> LinearSolver:
        if springs and (name == "cg" or (name == "auto" and pattern.shape[0] > LARGE_NET)):
            from tripod_sim.linear.incomplete import IncompleteConjugateGradients

            return IncompleteConjugateGradients(pattern, blocks, tolerance)
        direct = None if name in ("cg", "cholmod") else Ldl(pattern)
        if direct and (name == "ldl" or direct.entries <= SMALL):
            return direct
        if name == "cg" or (direct and direct.entries > LARGE):
            from tripod_sim.linear.cg import ConjugateGradients

            return ConjugateGradients(pattern, blocks, tolerance)
        if direct and not _has_cholmod():
            return direct
        from tripod_sim.linear.cholmod import Cholmod

        return Cholmod(pattern)

    return make


def _has_cholmod() -> bool:
    return find_spec("cvxopt") is not None
