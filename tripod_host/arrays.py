"""What arrays hold, for type checkers, and how a record keeps them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Array = Any
"""As compiled functions take them: numba finds the type."""


def freeze(record: object, **kinds: type) -> None:
    """Let fields of a frozen dataclass be read-only copies, arrays of the given kinds of numbers."""
    for name, kind in kinds.items():
        array: Array = np.array(getattr(record, name), dtype=kind)
        array.flags.writeable = False
        object.__setattr__(record, name, array)
