"""What compiled loops over many evaluations of a solid take of it."""

from typing import Any, NamedTuple

Array = Any


class SolidArrays(NamedTuple):
    """Arrays and numbers of a solid, as `solid_kernels` names them; `every` are the numbers of all elements, (m,).

    `matrices`, `X` and `inverse` are those of its last `stiffness`, `y` of its last gradient, whoever asked for them.
    """

    elements: Array
    every: Array
    G: Array
    weight: Array
    law: int
    lam: float
    mu: float
    mean: bool
    matrices: Array
    X: Array
    inverse: Array
    y: Array
    work: Array
