"""Is x the solution? The residual of the optimality conditions, and the exact solution once the active rows
are known.

The first-order solver gives some digits and so tells which rows are active; with those the solution is that
of a linear system. OSQP has such a polish of its own, but it prints a line on stdout for each problem without
active rows, whatever `verbose` says, and gives up when its first guess of the active rows is wrong.
"""

import numpy as np
from scipy.linalg.lapack import dgesv

from tripod_ik.arrays import FloatArray
from tripod_ik.problem import IkProblem

EXACT = 1e-10
"""A residual [rad] below which nothing is left to improve."""

ROUNDS = 10
"""Guesses of the active rows before giving up; one is the rule."""


def kkt_residual(problem: IkProblem, x: FloatArray, y: FloatArray) -> float:
    """Return how far `x` with multipliers `y` is from optimal [rad]; NaN if they hold NaN.

    The largest entry of P x + q + A'y (stationary) and of A x - clip(A x + y, l, u) (within the bounds, and y
    acting only at a bound and away from it). Zero for the solution and for nothing else.
    """
    stationary = problem.P @ x + problem.q + y @ problem.A
    rows = problem.A @ x
    bounds = rows - np.minimum(np.maximum(rows + y, problem.l), problem.u)
    return float(np.maximum(np.abs(stationary).max(), np.abs(bounds).max()))


def polish(
    problem: IkProblem, x: FloatArray, y: FloatArray, rounds: int = ROUNDS, push: FloatArray | float = 1.0
) -> tuple[FloatArray, FloatArray, float]:
    """Return the best found of x and y and their residual; never a worse one than that of the arguments.

    Primal-dual active set iteration: take the rows with A x + push y at or beyond a bound as active, solve for x
    with those as equations, and again with the rows that follow from the new x and y, until they are those
    of a round before. `push`, positive, is by what multipliers count in that: any leads to the solution if it leads
    anywhere; 1 is right where x and y come from OSQP, `IkProblem.push` where they are those of another program.
    """
    best = x, y, kkt_residual(problem, x, y)
    if not np.isfinite(best[2]):
        return best
    A, low, high, n = problem.A, problem.l, problem.u, len(problem.q)
    matrix, right = np.zeros((n + len(low), n + len(low))), np.empty(n + len(low))
    matrix[:n, :n], right[:n] = problem.P, -problem.q
    tried = set()
    for _ in range(rounds):
        reach = A @ x + push * y
        at_high = reach >= high
        active = at_high | (reach <= low)
        if (guess := (active.tobytes(), at_high.tobytes())) in tried:
            break
        tried.add(guess)
        rows = active.nonzero()[0]
        size = n + len(rows)
        found = A[rows]
        matrix[n:size, :n] = found
        matrix[:n, n:size] = found.T
        right[n:size] = np.where(at_high, high, low)[rows]
        _, _, solution, info = dgesv(matrix[:size, :size], right[:size])
        if info:  # active rows that say the same twice
            solution = np.linalg.lstsq(matrix[:size, :size], right[:size], rcond=None)[0]
        x, y = solution[:n], np.zeros(len(low))
        y[rows] = solution[n:]
        residual = kkt_residual(problem, x, y)
        if residual < best[2]:
            best = x, y, residual
        if residual < EXACT:
            break
    return best
