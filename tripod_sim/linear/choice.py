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
        name: `auto`, `ldl`, `cholmod`, `cg` or `multigrid`.
        tolerance: Relative residual of solvers that iterate.
        springs: Whether the matrices are of nets of springs alone.

    Raises:
        SceneError: `cholmod` or `multigrid` is named and not installed.
    """
    for optional, package, extra in (("cholmod", "cvxopt", "cholmod"), ("multigrid", "pyamg", "large")):
        if name == optional and not find_spec(package):
            raise SceneError(
                f"solver.linear is {name!r}, which is not installed: pip install 'tripod[{extra}]'; or choose auto, "
                "ldl, cg"
            )

    def make(pattern: Pattern, blocks: IndexArray) -> LinearSolver:
        if springs and (name == "cg" or (name == "auto" and pattern.shape[0] > LARGE_NET)):
            from tripod_sim.linear.incomplete import IncompleteConjugateGradients

            return IncompleteConjugateGradients(pattern, blocks, tolerance)
        direct = Ldl(pattern) if name in ("auto", "ldl") else None
        if direct and (name == "ldl" or direct.entries <= SMALL):
            return direct
        beyond = direct is not None and direct.entries > LARGE
        if name == "multigrid" or (beyond and find_spec("pyamg")):
            from tripod_sim.linear.multigrid import Multigrid

            return Multigrid(pattern, blocks, tolerance)
        if name == "cg" or beyond:
            from tripod_sim.linear.cg import ConjugateGradients

            return ConjugateGradients(pattern, blocks, tolerance)
        if direct and not find_spec("cvxopt"):
            return direct
        from tripod_sim.linear.cholmod import Cholmod

        return Cholmod(pattern)

    return make
