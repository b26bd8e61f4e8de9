"""What arrays hold, for type checkers; the only module here that needs more than the standard library."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Array = Any
"""As compiled functions take them: numba finds the type."""
