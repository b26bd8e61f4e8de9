"""Is x the solution? The residual of the optimality conditions, and the exact solution once the active rows
are known.

The first-order solver gives some digits and so tells which rows are active; with those the solution is that
of a linear system. OSQP has such a polish of its own, but it prints a line on stdout for each problem without
active rows, whatever `verbose` says, and gives up when its first guess of the active rows is wrong.
"""

import numpy as np

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
    stationary = problem.P @ x + problem.q + problem.A.T @ y
    rows = problem.A @ x
    bounds = rows - np.clip(rows + y, problem.l, problem.u)
    return float(np.abs(np.concatenate([stationary, bounds])).max())


def polish(problem: IkProblem, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return the best found of x and y and their residual; never a worse one than that of the arguments.

    Primal-dual active set iteration: take the rows with A x + y at or beyond a bound as active, solve for x
    with those as equations, and again with the rows that follow from the new x and y, until they are the
    same.
    """
    best = x, y, kkt_residual(problem, x, y)
    if not np.isfinite(best[2]):
        return best
    n = len(problem.q)
    active: tuple[bytes, bytes] | None = None
    for _ in range(ROUNDS):
        reach = problem.A @ x + y
        at_high = reach >= problem.u
        at_low = (reach <= problem.l) & ~at_high
        if active == (active := (at_high.tobytes(), at_low.tobytes())):
            break
        rows = np.flatnonzero(at_high | at_low)
        matrix = np.zeros((n + len(rows), n + len(rows)))
        matrix[:n, :n] = problem.P
        matrix[:n, n:] = problem.A[rows].T
        matrix[n:, :n] = problem.A[rows]
        bounds = np.where(at_high, problem.u, problem.l)[rows]
        right = np.concatenate([-problem.q, bounds])
        try:
            solution = np.linalg.solve(matrix, right)
        except np.linalg.LinAlgError:  # active rows that say the same twice
            solution = np.linalg.lstsq(matrix, right, rcond=None)[0]
        x, y = solution[:n], np.zeros(len(problem.l))
        y[rows] = solution[n:]
        residual = kkt_residual(problem, x, y)
        if residual < best[2]:
            best = x, y, residual
        if residual < EXACT:
            break
    return best
