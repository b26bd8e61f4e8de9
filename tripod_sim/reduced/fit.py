"""From snapshots to lift and shapes.

Free nodes move with what the constraints prescribe by the lift L, and beside it by the shapes S:

    u = L w + S q,   w the coordinates but q.

At first L is the static response of the undeformed body to moves of bodies and frames (constraint modes
[CraigBampton1968]). As w knows much of the large motions, L is then fitted to the snapshots; the ridge keeps it at the
response where these do not tell. The shapes are the proper orthogonal decomposition of what is left.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from tripod_sim.errors import SceneError
from tripod_sim.reduced.basis import free_rows
from tripod_sim.reduced.coordinates import boundary_columns
from tripod_sim.reduced.training import Snapshots
from tripod_sim.system import System

FloatArray = NDArray[np.float64]

SparseMatrix = Any
"""scipy.sparse.csr_matrix: scipy has no types."""

RIDGE = 1e-6
"""Weight of staying at the static response, relative to that of all snapshots."""

SMALLEST = 1e-13
"""Share of the energy of all snapshots below which a shape is rounding."""


def fit(system: System, mass: FloatArray, snapshots: Snapshots, modes: int) -> tuple[FloatArray, FloatArray]:
    """Return lift, shape (3 f, boundary), and shapes, shape (3 f, modes).

    Args:
        system: Full and static.
        mass: Of nodes [kg], shape (n,).
        snapshots: Of it.
        modes: Number of shapes.

    Raises:
        SceneError: the snapshots have fewer independent shapes.
    """
    free, stiffness = free_rows(system.groups), rest_stiffness(system)
    lift = _fitted(static_lift(system, stiffness), snapshots)
    left = snapshots.moves - lift @ snapshots.boundary, snapshots.rates - lift @ snapshots.boundary_rates
    shapes = decomposed(np.hstack(left), stiffness[free][:, free], np.repeat(mass, 3)[free], modes)
    if shapes.shape[1] < modes:
        raise SceneError(
            f"reduced.modes is {modes}; training has found {shapes.shape[1]} independent shapes: ask for fewer, or "
            "increase reduced.samples"
        )
    return lift, shapes


def rest_stiffness(system: System) -> SparseMatrix:
    """Return the stiffness of the undeformed body, sparse, shape (3 n, 3 n)."""
    system.assemble(system.start_state(np.zeros(len(system.groups.driven) + 1)), project=True)
    parts = [(system.solid.elements, system.solid.matrices)]
    if system.foundation:
        parts.append((system.foundation.elements, system.foundation.matrices))
    size = system.rest.size
    stiffness = sparse.csr_matrix((size, size))
    for elements, matrices in parts:
        rows = (3 * elements[:, :, None] + np.arange(3)).reshape(len(elements), -1)
        i = np.broadcast_to(rows[:, :, None], matrices.shape)
        j = np.broadcast_to(rows[:, None, :], matrices.shape)
        stiffness += sparse.csr_matrix((matrices.ravel(), (i.ravel(), j.ravel())), shape=(size, size))
    return stiffness


def static_lift(system: System, stiffness: SparseMatrix) -> FloatArray:
    """Return the static response of free nodes to the coordinates but q, shape (3 f, boundary).

    Args:
        system: Full and static.
        stiffness: Of the undeformed body, sparse, shape (3 n, 3 n).
    """
    free, columns = free_rows(system.groups), boundary_columns(system.rest, system.groups)
    load = -(stiffness @ columns)[free]
    return np.asarray(splu(sparse.csc_matrix(stiffness[free][:, free])).solve(load))


def _fitted(lift: FloatArray, snapshots: Snapshots) -> FloatArray:
    """Return the lift that leaves least of the snapshots, near to `lift`."""
    w = np.hstack([snapshots.boundary, snapshots.boundary_rates])
    rest = np.hstack([snapshots.moves, snapshots.rates]) - lift @ w
    size = np.sqrt((w**2).mean(axis=1))
    size[size == 0.0] = 1.0
    scaled = w / size[:, None]
    normal = scaled @ scaled.T + RIDGE * w.shape[1] * np.eye(len(w))
    return np.asarray(lift + np.linalg.solve(normal, scaled @ rest.T).T / size)


def decomposed(snapshots: FloatArray, stiffness: SparseMatrix, mass: FloatArray, most: int) -> FloatArray:
    """Return the shapes that represent `snapshots` best: proper orthogonal decomposition, greatest first.

    They minimise the sum of the squared errors [Sirovich1987] in the norm of the energy, u^T K u: in that of the mass
    three times the shapes are needed for some errors. They are then made orthonormal with respect to the mass.

    Args:
        snapshots: Columns, shape (3 f, k).
        stiffness: K, sparse, shape (3 f, 3 f).
        mass: Of each row [kg], positive, shape (3 f,).
        most: Number of shapes.

    Returns:
        Shape (3 f, the rank, or `most` if that is less) [kg^-1/2].
    """
    values, vectors = np.linalg.eigh(snapshots.T @ (stiffness @ snapshots))
    values, vectors = values[::-1], vectors[:, ::-1]
    count = min(most, int((values > SMALLEST * values[0]).sum()))
    shapes = snapshots @ (vectors[:, :count] / np.sqrt(values[:count]))
    root = np.sqrt(mass)[:, None]
    shapes = np.linalg.qr(root * shapes)[0] / root
    largest = shapes[np.abs(shapes).argmax(axis=0), np.arange(count)]
    return np.ascontiguousarray(shapes * np.where(largest < 0, -1.0, 1.0))
