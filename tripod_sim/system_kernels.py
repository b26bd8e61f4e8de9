"""Small loops over whole arrays that every step makes: compiled, they take a tenth of NumPy's calls."""

from numba import njit

from tripod_host.arrays import Array


@njit(cache=True, error_model="numpy")
def same(a: Array, b: Array) -> bool:
    """Return whether two arrays of one shape hold the same numbers."""
    x, y = a.ravel(), b.ravel()
    for k in range(x.shape[0]):  # noqa: SIM110 - compiled
        if x[k] != y[k]:
            return False
    return True


@njit(cache=True, error_model="numpy")
def scaled_norm_squared(a: Array, scale: Array) -> float:
    """Return sum_i (a_i scale_i)²."""
    total = 0.0
    for k in range(a.shape[0]):
        total += (a[k] * scale[k]) ** 2
    return total


@njit(cache=True, error_model="numpy")
def dot(a: Array, b: Array) -> float:
    """Return sum_i a_i b_i, in one thread: NumPy's keeps the others awake for it."""
    total = 0.0
    for k in range(a.shape[0]):
        total += a[k] * b[k]
    return total


@njit(cache=True, error_model="numpy")
def largest(a: Array) -> float:
    """Return max |a_i| of any shape; NaN is not larger than a number."""
    x, most = a.ravel(), 0.0
    for k in range(x.shape[0]):
        most = max(most, abs(x[k]))
    return most


@njit(cache=True, error_model="numpy")
def write_moves(nodes: Array, before: Array, after: Array, out: Array) -> None:
    """Write after - before [m] of `nodes`, shape (k,), to `out`; all three have shape (n, 3)."""
    for k in range(nodes.shape[0]):
        n = nodes[k]
        for i in range(3):
            out[n, i] = after[n, i] - before[n, i]


@njit(cache=True, error_model="numpy")
def write_difference(a: Array, b: Array, out: Array) -> float:
    """Write a - b, of any one shape, to `out`; return the largest of it."""
    x, y, z, most = a.ravel(), b.ravel(), out.ravel(), 0.0
    for k in range(x.shape[0]):
        z[k] = x[k] - y[k]
        most = max(most, abs(z[k]))
    return most
