"""What compiled loops take of a solid."""

from itertools import pairwise
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


POINTS = 4000
"""Of a part of a solid: its loops then take about half a millisecond, ten times what it costs to hand them out."""

MOST_PARTS = 8


class SolidPart(NamedTuple):
    """A run of elements of a solid, computed apart from the others.

    Attributes:
        elements: Which they are, in the arrays of the whole.
        nodes: A range that holds all of their nodes.
        arrays: Of these elements alone, views of those of the whole; their nodes are numbers within the range.
        g, d: What the part adds to two fields of the range, shape (nodes of it, 3).
    """

    elements: slice
    nodes: slice
    arrays: SolidArrays
    g: Array
    d: Array


def parts_of(solid: SolidArrays) -> list[SolidPart]:
    """Return the parts of a large solid; none of a small one.

    They depend on the mesh alone, so that sums over them are the same with any number of threads.
    """
    m = len(solid.elements)
    count = min(m * solid.weight.shape[1] // POINTS, MOST_PARTS)
    if count < 2:
        return []
    ends = np.linspace(0, m, count + 1).astype(int).tolist()
    return [_part(solid, slice(a, b)) for a, b in pairwise(ends)]


def _part(solid: SolidArrays, run: slice) -> SolidPart:
    own = solid.elements[run]
    low, high = int(own.min()), int(own.max()) + 1
    per_element = (
        "every",
        "G",
        "weight",
        "matrices",
        "X",
        "inverse",
        "y",
        "pull",
        "push",
        "before",
        "strain",
    )
    views = {name: getattr(solid, name)[run] for name in per_element}
    g, d = np.zeros((2, high - low, 3))
    return SolidPart(run, slice(low, high), solid._replace(elements=own - low, **views), g, d)
