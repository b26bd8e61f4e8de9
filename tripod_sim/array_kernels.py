"""Whole arrays in compiled loops."""

from numba import njit

from tripod_host.arrays import Array


@njit(cache=True, error_model="numpy")
def put(to: Array, source: Array) -> None:
    """Write `source` to `to`, of the same shape, both contiguous.

    As `to[...] = source` does, but for the text of what could go wrong: that alone takes seconds to compile.
    """
    a, b = to.reshape(to.size), source.reshape(source.size)
    for k in range(a.shape[0]):
        a[k] = b[k]
