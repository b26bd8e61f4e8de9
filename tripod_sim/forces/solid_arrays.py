"""What compiled loops take of a solid."""

from typing import NamedTuple

import numpy as np

from tripod_host.arrays import Array


class SolidArrays(NamedTuple):
    """Arrays and numbers of a solid, as `solid_kernels` names them; `every` are the numbers of all elements, (m,).

    `matrices`, `X` and `inverse` are those of its last `stiffness`, `y`, f_a and h_a [N], `pull` and `push`, (m, 3k),
    of its last gradients, whoever asked for them. Of the damper (see `damper_kernels`): `viscosity`, b (l, mu, kappa)
    [Pa s], (3,); `rate`, 1 / s of the stage [1/s], (1,); E_q of the stage, `before`, and E of the last gradient,
    `strain`, both (m, q, 6), or (m, 0, 6).
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
    pull: Array
    push: Array
    viscosity: Array
    rate: Array
    before: Array
    strain: Array


def no_solid() -> SolidArrays:
    """Return a solid without elements."""
    zeros = np.zeros
    return SolidArrays(
        zeros((0, 0), dtype=np.int64), zeros(0, dtype=np.int64), zeros((0, 0, 0, 0)), zeros((0, 0)),
        zeros(5, dtype=np.int64), zeros(3), False, zeros((0, 0, 0)), zeros((0, 0, 0)), zeros((0, 0, 0)), zeros((0, 0)),
        zeros((0, 0)), zeros((0, 0)), zeros(3), zeros(1), zeros((0, 0, 6)), zeros((0, 0, 6)),
    )  # fmt: skip
