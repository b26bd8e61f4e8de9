"""Motions that too few quadrature points do not see.

The 2x2x2 points of `h20` see 48 strains of the 54 ways in which an element can deform. The six others take no energy,
and they fit from element to element along a row, but not where elements lie side by side in two directions. A body one
element thick and wide therefore has a mechanism at every element, whatever its material is and whatever holds its ends
[BicanicHinton1979]. Whether a mesh has any is counted: with the sums over elements

    R(u) = 1/2 int |J_0^T sym(grad u) J_0|² dV / V at 2x2x2 points,   F(u) the same at 3x3x3 points,

J_0 the Jacobian at the centre, which measures strains in the element's own coordinates, so that flat elements count
like cubes, a mechanism has R = 0 and F > 0, a motion that is well seen R close to F, and as many motions have
R < SHARE F as the matrix of R - SHARE F has negative eigenvalues (Sylvester's law of inertia). One factorisation tells.
"""

from functools import lru_cache

import numpy as np
from scipy import sparse

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.element import Element, reference_gradients
from tripod_sim.elements.strains import strain_squares
from tripod_sim.linear.ldl import Ldl
from tripod_sim.mesh.solid_mesh import SolidMesh

SHARE = 0.05
"""Of F that must be seen of every motion. Of elements in a row, straight or bent, there are motions of which 0 to 0.02
is seen, side by side of all 0.2 and more (tests/sim/test_hourglass.py)."""

RIGID = 1e-7
"""What is added against rigid motions, which have no energy either, as a fraction of the matrix's diagonal."""

PATCH, CHUNK = 256, 4096
"""Elements up to which motions are counted at once, and whose matrices are made at a time."""

TIE = 1e-9
"""Distance, in sizes of a mesh, below which elements lie in one layer."""


def unseen_motions(mesh: SolidMesh) -> int:
    """Return of how many motions of a mesh, free in space, its points see less than `SHARE`; 0 where they see all."""
    (kind, elements), *others = mesh.blocks
    return 0 if others or not kind.full else _unseen(kind, mesh.nodes.tobytes(), elements.tobytes())


@lru_cache(maxsize=8)
def _unseen(kind: Element, of_nodes: bytes, of_elements: bytes) -> int:
    """Return it for nodes (n, 3) [m] and elements (m, k): whoever builds one mesh often, asks once."""
    elements = np.frombuffer(of_elements, dtype=np.int64).reshape(-1, kind.size)
    return _count(kind, np.frombuffer(of_nodes).reshape(-1, 3)[elements], elements)


def _count(kind: Element, places: FloatArray, elements: IndexArray) -> int:
    """Return it for elements (m, k) whose nodes are at `places` [m], shape (m, k, 3).

    R and F are sums over elements: where two parts of a mesh have no such motion, the whole has none. So it is seldom
    that more than `PATCH` elements are factored, whose time grows faster than their number.
    """
    if len(elements) > PATCH:
        middles = places.mean(axis=1)
        along = middles[:, int(np.ptp(middles, axis=0).argmax())]
        first = along <= np.median(along) + TIE * np.ptp(along)
        if not first.all() and not any(
            _count(kind, places[part], elements[part]) for part in (first, ~first)
        ):
            return 0
    nodes, numbers = np.unique(elements, return_inverse=True)
    numbers = numbers.reshape(elements.shape).astype(np.int32)
    chunks = range(0, len(elements), CHUNK)
    found = [
        _entries(kind, places[start : start + CHUNK], numbers[start : start + CHUNK]) for start in chunks
    ]
    values, rows, columns = (np.concatenate(part) for part in zip(*found, strict=True))
    solver = Ldl(
        sparse.csc_matrix((values, (rows, columns)), (3 * len(nodes),) * 2)
    )  # zeros stay: blocks are full
    if not solver.factor():
        return 1  # a zero pivot: a motion of just that share
    return solver.negative


def _entries(
    kind: Element, places: FloatArray, elements: IndexArray
) -> tuple[FloatArray, IndexArray, IndexArray]:
    """Return values, rows and columns in the upper triangle of R - SHARE F and what is added against rigid motions."""
    seen, full = _squares(kind, places), _squares(ELEMENTS[kind.full], places)
    dofs = (3 * elements[:, :, None] + np.arange(3, dtype=np.int32)).reshape(len(elements), -1)
    rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    upper = rows <= columns
    return (seen - SHARE * full + RIGID * full * np.eye(full.shape[1]))[upper], rows[upper], columns[upper]


def _squares(kind: Element, nodes: FloatArray) -> FloatArray:
    """Return each element's matrix of int |J_0^T sym(grad u) J_0|² dV / V; `nodes`: (m, k, 3) [m]."""
    gradients, volumes = reference_gradients(kind, nodes)
    centre = kind.jacobians(nodes, kind.centre)[:, 0]
    return strain_squares(gradients, volumes / volumes.sum(axis=1, keepdims=True), centre)
