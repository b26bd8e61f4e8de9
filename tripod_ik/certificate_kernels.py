"""Loops of the certificate: in NumPy a program of a dozen numbers costs far more than its arithmetic."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array

VIOLATED, DEPENDENT = 1e-9, 1e-7
"""A row counts as satisfied to so much [rad]; a row counts as a combination of others if that part of it is left."""


@njit(cache=True, error_model="numpy")
def is_sane(P: Array, q: Array, A: Array, low: Array, high: Array) -> bool:
    """Return whether P, q and A are finite and no bound is crossed, nor NaN."""
    finite = np.isfinite(P).all() and np.isfinite(q).all() and np.isfinite(A).all()
    return bool(finite and (low <= high).all())


@njit(cache=True, error_model="numpy")
def conditions(P: Array, q: Array, A: Array, low: Array, high: Array, z: Array, rows: Array) -> float:
    """Return the residual of z = (x, y), NaN if it holds NaN, and write A x to `rows`.

    Args:
        P, q, A, low, high: As of `IkProblem`: shapes (n, n), (n,), (m, n), (m,), (m,).
        z: x, then y, shape (n + m,).
        rows: Written, shape (m,).
    """
    n, m, worst = len(q), len(low), 0.0
    for i in range(m):
        total = 0.0
        for j in range(n):
            total += A[i, j] * z[j]
        rows[i] = total
        inside = min(max(total + z[n + i], low[i]), high[i])
        off = abs(total - inside)
        if off > worst or np.isnan(off):  # and what is NaN stays so
            worst = off
    for j in range(n):
        total = q[j]
        for k in range(n):
            total += P[j, k] * z[k]
        for i in range(m):
            total += A[i, j] * z[n + i]
        if abs(total) > worst or np.isnan(total):
            worst = abs(total)
    return worst


@njit(cache=True, error_model="numpy")
def improve(
    P: Array, q: Array, A: Array, low: Array, high: Array, push: Array, z: Array, rounds: int, exact: float
) -> float:
    """Bring z = (x, y) to the best point that guesses of the active rows lead to; return its residual.

    See `certificate.polish`.

    Args:
        P, q, A, low, high, push: As of `IkProblem`.
        z: x, then y, shape (n + m,); overwritten by what is better.
        rounds: Guesses at most.
        exact: Residual below which to stop.
    """
    n, m = len(q), len(low)
    rows, trial, here = np.empty(m), z.copy(), np.empty(m)
    least = conditions(P, q, A, low, high, z, rows)
    sides, tried, which = np.zeros(m, np.int8), np.zeros((rounds, m), np.int8), np.empty(m, np.int64)
    matrix, right = np.empty((n + m, n + m)), np.empty(n + m)
    if not np.isfinite(least):
        return least
    for k in range(rounds):
        count = 0
        for i in range(m):
            reach = rows[i] + push[i] * trial[n + i]
            sides[i] = 1 if reach >= high[i] else (-1 if reach <= low[i] else 0)
            if sides[i] != 0:
                which[count] = i
                count += 1
        again = False
        for before in range(k):
            again |= np.array_equal(tried[before], sides)
        if again:
            break
        tried[k] = sides
        _solve_active(P, q, A, low, high, sides, which[:count], matrix, right, trial)
        residual = conditions(P, q, A, low, high, trial, here)
        rows[:] = here
        if residual < least:
            least = residual
            z[:] = trial
        if residual < exact:
            break
    return least


@njit(cache=True, error_model="numpy")
def _solve_active(
    P: Array, q: Array, A: Array, low: Array, high: Array, sides: Array, which: Array, matrix: Array, right: Array,
    z: Array,
) -> None:  # fmt: skip
    """Write z = (x, y) for the rows `which` as equations at the bounds that `sides` tells; other multipliers are 0.

    `matrix` and `right` are scratch.
    """
    n, count = len(q), len(which)
    size = n + count
    _write(P, q, A, low, high, sides, which, matrix, right)
    if not eliminate(matrix[:size, :size], right[:size]):  # active rows that say the same twice
        _write(P, q, A, low, high, sides, which, matrix, right)
        right[:size] = np.linalg.lstsq(matrix[:size, :size].copy(), right[:size].copy())[0]
    z[:n] = right[:n]
    z[n:] = 0.0
    for a in range(count):
        z[n + which[a]] = right[n + a]


@njit(cache=True, error_model="numpy")
def _write(
    P: Array,
    q: Array,
    A: Array,
    low: Array,
    high: Array,
    sides: Array,
    which: Array,
    matrix: Array,
    right: Array,
) -> None:
    """Write the system [P, A'; A, 0] (x, y) = (-q, bounds) of the rows `which` at the bounds that `sides` tells."""
    n, count = len(q), len(which)
    matrix[: n + count, : n + count] = 0.0
    matrix[:n, :n], right[:n] = P, -q
    for a in range(count):
        i = which[a]
        matrix[n + a, :n] = A[i]
        matrix[:n, n + a] = A[i]
        right[n + a] = high[i] if sides[i] > 0 else low[i]


@njit(cache=True, error_model="numpy")
def eliminate(matrix: Array, right: Array) -> bool:
    """Solve matrix x = right with row exchanges; x is written to `right`, `matrix` is spoilt. False at a zero pivot."""
    size = len(right)
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if matrix[best, k] == 0.0:
            return False
        if best != k:
            for j in range(k, size):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            right[k], right[best] = right[best], right[k]
        for i in range(k + 1, size):
            share = matrix[i, k] / matrix[k, k]
            if share != 0.0:
                for j in range(k + 1, size):
                    matrix[i, j] -= share * matrix[k, j]
                right[i] -= share * right[k]
    for k in range(size - 1, -1, -1):
        total = right[k]
        for j in range(k + 1, size):
            total -= matrix[k, j] * right[j]
        right[k] = total / matrix[k, k]
    return True


@njit(cache=True, error_model="numpy")
def dual_active_set(P: Array, q: Array, A: Array, low: Array, high: Array, z: Array, changes: int) -> None:
    """Write the solution to z = (x, y), or what was found where rows contradict each other or `changes` end.

    The dual method [GoldfarbIdnani1983] starts at the minimum without rows and makes the most violated row active,
    again and again. The dual value rises with each row that becomes active, so no set of active rows occurs twice, even
    where rows are nearly parallel. With L L' = P, B = L⁻¹ N of the active rows N', and d = L⁻¹ n of the violated row n,

        r = argmin |B r - d|,   w = d - B r,   dx = t L'⁻¹ w,   dy = t r,   dy_n = -t,

    where t is the smaller of what satisfies row n and of what takes the multiplier of an active row to zero. That row
    is then released.

    Args:
        P, q, A, low, high: As of `IkProblem`; P positive definite.
        z: x, then y, shape (n + m,); overwritten.
        changes: Of the active rows, at most.
    """
    n, m, count, row, side = len(q), len(low), 0, -1, 1.0
    inverse = np.linalg.inv(np.linalg.cholesky(P))
    x, y = z[:n], z[n:]
    x[:] = -(inverse.T @ (inverse @ q))
    y[:] = 0.0
    which, sides, B = np.zeros(n, np.int64), np.zeros(m, np.int8), np.zeros((n, n))
    matrix, right = np.empty((2 * n, 2 * n)), np.empty(2 * n)
    for _ in range(changes):
        if row < 0:
            row, side = _most_violated(A, low, high, x, which[:count])
            if row < 0:
                return
        missing = side * ((low[row] if side > 0 else high[row]) - (A[row] * x).sum())
        d = side * (inverse @ A[row])
        r, w = np.zeros(0), d
        if count:
            active = B[:, :count].copy()
            r = np.linalg.lstsq(active, d)[0]
            w = d - active @ r
        step, leaves = _first_released(r, y, sides, which[:count], low, high)
        square = (w * w).sum()
        if count < n and square > DEPENDENT**2 * (d * d).sum():
            if missing / square <= step:
                step, leaves = missing / square, -1
            x += step * (inverse.T @ w)
        elif leaves < 0:
            return
        for a in range(count):
            y[which[a]] += step * r[a]
        y[row] -= step * side
        if leaves < 0:
            which[count], B[:, count], sides[row] = row, side * d, 1 if side < 0 else -1
            count, row = count + 1, -1
            _solve_active(
                P, q, A, low, high, sides, which[:count], matrix, right, z
            )  # rounding does not add up
        else:
            y[which[leaves]] = 0.0
            count -= 1
            for a in range(leaves, count):
                which[a], B[:, a] = which[a + 1], B[:, a + 1]


@njit(cache=True, error_model="numpy")
def _most_violated(A: Array, low: Array, high: Array, x: Array, which: Array) -> tuple[int, float]:
    """Return the row that `x` violates most and is not in `which`, -1 if none, and its side: 1 is `low`, -1 `high`."""
    worst, row, side = VIOLATED, -1, 1.0
    for i in range(len(low)):
        value = (A[i] * x).sum()
        violation = max(low[i] - value, value - high[i])
        if violation > worst and not (which == i).any():
            worst, row, side = violation, i, 1.0 if value < low[i] else -1.0
    return row, side


@njit(cache=True, error_model="numpy")
def _first_released(
    r: Array, y: Array, sides: Array, which: Array, low: Array, high: Array
) -> tuple[float, int]:
    """Return the step at which the first multiplier of the rows `which` is zero, and its place; infinity, -1 if none.

    An equation is never released.
    """
    step, place = np.inf, -1
    for a in range(len(which)):
        i = which[a]
        if low[i] < high[i] and sides[i] * r[a] < 0 and abs(y[i] / r[a]) < step:
            step, place = abs(y[i] / r[a]), a
    return step, place
