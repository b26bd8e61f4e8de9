"""Where the numbers of a Cholesky factor stand, of a matrix in the order of its elimination, compiled."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array


@njit(cache=True)
def columns_of_factor(indptr: Array, indices: Array) -> tuple[Array, Array]:
    """Return where the columns of L begin, shape (n + 1,), and their rows below the diagonal, ascending.

    Row k of L has the columns on the ways from those of A's row k to k in the elimination tree [Liu1990].

    Args:
        indptr: Of A's upper triangle by columns, without the diagonal, shape (n + 1,).
        indices: Rows of its entries.
    """
    n = indptr.shape[0] - 1
    parent, mark = np.full(n, -1), np.full(n, -1)
    count = np.zeros(n + 1, dtype=np.int64)
    for k in range(n):
        mark[k] = k
        for e in range(indptr[k], indptr[k + 1]):
            i = indices[e]
            while mark[i] != k:
                if parent[i] < 0:
                    parent[i] = k
                count[i + 1] += 1
                mark[i] = k
                i = parent[i]
    begin = np.cumsum(count)
    rows, used = np.empty(begin[n], dtype=np.int64), begin[:-1].copy()
    mark = np.full(n, -1)
    for k in range(n):
        mark[k] = k
        for e in range(indptr[k], indptr[k + 1]):
            i = indices[e]
            while mark[i] != k:
                rows[used[i]] = k
                used[i] += 1
                mark[i] = k
                i = parent[i]
    return begin, rows
