"""From snapshots to lift and shapes.

Free nodes move with what the constraints prescribe by the lift L, and beside it by the shapes S:

    u = L w + S q,   w the coordinates but q.

At first L is the static response of the undeformed body to moves of bodies and frames (constraint modes
[CraigBampton1968]). As w knows much of the large motions, L is then fitted to the snapshots; the ridge keeps it at the
response where these do not tell. The shapes are the proper orthogonal decomposition of what is left.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from tripod_sim.errors import SceneError
from tripod_sim.reduced.basis import free_rows, orthonormal
from tripod_sim.reduced.coordinates import boundary_columns
from tripod_sim.reduced.training import Snapshots
from tripod_sim.state import State
from tripod_sim.system import System

FloatArray = NDArray[np.float64]

RIDGE = 1e-6
"""Weight of staying at the static response, relative to that of all snapshots."""


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
    free = free_rows(system.groups)
    lift = _fitted(static_lift(system), snapshots)
    rest = np.hstack(
        [snapshots.moves - lift @ snapshots.boundary, snapshots.rates - lift @ snapshots.boundary_rates]
    )
    shapes = orthonormal(rest, np.repeat(mass, 3)[free], modes)
    if shapes.shape[1] < modes:
        raise SceneError(
            f"reduced.modes is {modes}; training has found {shapes.shape[1]} independent shapes: ask for fewer, or "
            "increase reduced.samples"
        )
    return lift, shapes


def static_lift(system: System) -> FloatArray:
    """Return the static response of the undeformed body's free nodes to the coordinates but q, (3 f, boundary)."""
    rest, solid = system.rest, system.solid
    state: State = system.start_state(np.zeros(len(system.groups.driven) + 1))
    system.assemble(state, project=True)
    parts = [(solid.elements, solid.matrices)]
    if system.foundation:
        parts.append((system.foundation.elements, system.foundation.matrices))
    size = 3 * len(rest)
    stiffness = sparse.csr_matrix((size, size))
    for elements, matrices in parts:
        rows = (3 * elements[:, :, None] + np.arange(3)).reshape(len(elements), -1)
        i = np.broadcast_to(rows[:, :, None], matrices.shape)
        j = np.broadcast_to(rows[:, None, :], matrices.shape)
        stiffness += sparse.csr_matrix((matrices.ravel(), (i.ravel(), j.ravel())), shape=(size, size))
    free, columns = free_rows(system.groups), boundary_columns(rest, system.groups)
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
