"""Is x the solution? The residual of the optimality conditions, and the exact solution once the active rows
are known.

The first-order solver gives some digits and so tells which rows are active; with those the solution is that
of a linear system. OSQP has such a polish of its own, but it prints a line on stdout for each problem without
active rows, whatever `verbose` says, and gives up when its first guess of the active rows is wrong.
"""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik import certificate_kernels as kernels
from tripod_ik.problem import IkProblem

EXACT = 1e-10
"""A residual [rad] below which nothing is left to improve."""

CHANGES = 10
"""Changes of the active rows for each unknown and row before the dual method gives up; one is the rule."""

ROUNDS = 10
"""Guesses of the active rows before giving up; one is the rule."""


def prepare(n: int, rows: int) -> None:
    """Compile, or load, what certifies programs of `n` servos and `rows` row limits: not in the first tick."""
    size = n + rows
    P, q, A, low, high = (
        np.eye(size),
        np.zeros(size),
        np.ones((size + rows, size)),
        *np.zeros((2, size + rows)),
    )
    kernels.is_sane(P, q, A, low, high)
    kernels.conditions(P, q, A, low, high, np.zeros(size + len(low)), low)
    kernels.improve(P, q, A, low, high, high, np.zeros(size + len(low)), 1, EXACT)
    kernels.dual_active_set(P, q, A, low, high, np.zeros(size + len(low)), 1)


def is_sane(problem: IkProblem) -> bool:
    """Return whether the numbers of `problem` are finite and its bounds not crossed; infinite bounds are none."""
    p = problem
    return bool(kernels.is_sane(p.P, p.q, p.A, p.l, p.u))


def kkt_residual(problem: IkProblem, x: FloatArray, y: FloatArray) -> float:
    """Return how far `x` with multipliers `y` is from optimal [rad]; NaN if they hold NaN.

    The largest entry of P x + q + A'y (stationary) and of A x - clip(A x + y, l, u) (within the bounds, and y
    acting only at a bound and away from it). Zero for the solution and for nothing else.
    """
    p, rows = problem, np.empty(len(y))
    return float(kernels.conditions(p.P, p.q, p.A, p.l, p.u, np.concatenate((x, y)), rows))


def polish(
    problem: IkProblem, x: FloatArray, y: FloatArray, rounds: int = ROUNDS, push: FloatArray | float = 1.0
) -> tuple[FloatArray, FloatArray, float]:
    """Return the best found of x and y and their residual; never a worse one than that of the arguments.

    Primal-dual active set iteration: take the rows with A x + push y at or beyond a bound as active, solve for x
    with those as equations, and again with the rows that follow from the new x and y, until they are those
    of a round before. `push`, positive, is by what multipliers count in that: any leads to the solution if it leads
    anywhere; 1 is right where x and y come from OSQP, `IkProblem.push` where they are those of another program.
    """
    p, n, z = problem, len(x), np.concatenate((x, y))
    pushes = push if isinstance(push, np.ndarray) else np.full(len(y), push)
    residual = float(kernels.improve(p.P, p.q, p.A, p.l, p.u, pushes, z, rounds, EXACT))
    return z[:n], z[n:], residual


def solve_exactly(problem: IkProblem) -> tuple[FloatArray, FloatArray, float]:
    """Return x, y and their residual by the dual active-set method; it is large where rows contradict each other."""
    p, n = problem, len(problem.q)
    z = np.zeros(n + len(p.l))
    kernels.dual_active_set(p.P, p.q, p.A, p.l, p.u, z, CHANGES * len(z))
    return polish(problem, z[:n], z[n:])
