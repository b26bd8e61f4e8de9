"""Arrays that are kept: checked once, copied, made read-only."""

from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.errors import IkError

LARGEST = 1e9
"""No quantity here comes near this in SI units; what does is broken, and its square might overflow."""


def frozen(name: str, values: Any, shape: tuple[int, ...]) -> FloatArray:
    """Return a read-only copy of `values`; raise IkError unless it has that shape and is finite and sane."""
    try:
        array = np.array(values, np.float64)
    except (TypeError, ValueError):
        raise IkError(f"{name} is not an array of numbers; give a list or NumPy array") from None
    if array.shape != shape:
        raise IkError(f"{name} has shape {array.shape}; it must be {shape}")
    if array.size and not abs(array).max() <= LARGEST:  # not so for NaN
        sane = np.abs(array) <= LARGEST
        where = tuple(int(i) for i in np.argwhere(~sane)[0])
        raise IkError(
            f"{name}{list(where)} is {array[where]:g}; it must be finite and below {LARGEST:g} in size"
        )
    array.flags.writeable = False
    return array


def per_joint(name: str, value: float | FloatArray, n: int) -> FloatArray:
    """Return `value`, one number for all or an array of shape (n,), as an array of shape (n,)."""
    array = np.asarray(value, np.float64)
    if array.shape not in ((), (n,)):
        raise IkError(f"{name} has shape {array.shape}; it must be one number or have shape ({n},)")
    return array if array.shape else np.full(n, array)
