"""Products of the tall matrices of a reduced model, compiled.

They are small: a library that divides them among threads waits longer for these than the product takes, most of all on
a machine that has other work.
"""

from typing import Any

from numba import njit

Array = Any


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def multiply(matrix: Array, vector: Array, out: Array) -> None:
    """Write A x to `out`, shape (m,); A is stored by rows, shape (m, n)."""
    for i in range(matrix.shape[0]):
        total = 0.0
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * vector[j]
        out[i] = total
