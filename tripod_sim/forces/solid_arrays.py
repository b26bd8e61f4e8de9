"""What compiled loops take of a solid."""

from typing import NamedTuple

import numpy as np

from tripod_host.arrays import Array


class SolidArrays(NamedTuple):
    """Arrays and numbers of a solid, as `solid_kernels` names them; `every` are the numbers of all elements, (m,).

    `matrices`, `X` and `inverse` are those of its last `stiffness`, `y` of its last gradient, whoever asked for them.
    """

    elements: Array
    every: Array
    G: Array
    weight: Array
    law: Array
    p: Array
    mean: bool
    matrices: Array
    X: Array
    inverse: Array
    y: Array


def no_solid() -> SolidArrays:
    """Return a solid without elements."""
    zeros = np.zeros
    return SolidArrays(
        zeros((0, 0), dtype=np.int64), zeros(0, dtype=np.int64), zeros((0, 0, 0, 0)), zeros((0, 0)),
        zeros(5, dtype=np.int64), zeros(3), False, zeros((0, 0, 0)), zeros((0, 0, 0)), zeros((0, 0, 0)), zeros((0, 0)),
    )  # fmt: skip
