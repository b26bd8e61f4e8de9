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

LARGE = 20_000_000
"""Entries of L (160 MB) above which `auto` iterates: a cube of 20,000 unknowns. There one factorisation takes as long
as four solutions by conjugate gradients, which is what a renewed Hessian needs. Not the unknowns but the factor
decides: thin bodies of as many unknowns have a factor ten times smaller and take ten times the iterations."""


def linear_factory(name: str, tolerance: float) -> LinearFactory:
    """Return what makes the solver `name`; the thresholds are those of `benchmarks/linear.py`.

    Args:
        name: `auto`, `ldl`, `cholmod` or `cg`.
        tolerance: Relative residual of conjugate gradients.

    Raises:
        SceneError: `cholmod` is named and not installed.
    """
    if name == "cholmod" and not _has_cholmod():
        raise SceneError(
            "solver.linear is 'cholmod', which is not installed: pip install 'tripod[cholmod]'; or choose auto, ldl, cg"
        )

    def make(pattern: Pattern, blocks: IndexArray) -> LinearSolver:
        if name == "cg":
            return _iterative(pattern, blocks, tolerance)
        if name == "cholmod":
            return _cholmod(pattern)
        direct = Ldl(pattern)
        if name == "ldl" or direct.entries <= SMALL:
            return direct
        if direct.entries > LARGE:
            return _iterative(pattern, blocks, tolerance)
        return _cholmod(pattern) if _has_cholmod() else direct

    return make


def _has_cholmod() -> bool:
    return find_spec("cvxopt") is not None


def _cholmod(pattern: Pattern) -> LinearSolver:
    from tripod_sim.linear.cholmod import Cholmod

    return Cholmod(pattern)


def _iterative(pattern: Pattern, blocks: IndexArray, tolerance: float) -> LinearSolver:
    from tripod_sim.linear.cg import ConjugateGradients

    return ConjugateGradients(pattern, blocks, tolerance)
