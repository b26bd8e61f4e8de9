"""What mesh and time steps make of predictions, and of the values that are found with them.

A number that a mesh gets wrong by C h^p is corrected by (f_h/2 - f_h) / (1 - 2^-p) [Richardson1911]. p is 1 where a
clamp's edge rules, 2 where the elements do: the middle of both corrections is taken. With d the correction at some
rows, the values that the same data give without the error of the mesh are u - (J^T J + W^-2)^-1 J^T d, W their
plausible widths. One refinement tells how large that is and hardly more, since what clamp and disc hold changes with
the nodes, too: the move itself counts as a standard deviation. Time steps likewise.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

from tripod_identify.fit import Fit
from tripod_identify.model import Rest, Told, motion
from tripod_identify.problem import Problem, refined
from tripod_sim.errors import StepError
from tripod_sim.state import State

FloatArray = NDArray[np.float64]

ROWS = 6
"""Poses at which the finer mesh is solved."""

FACTOR = 5 / 3
"""Of f_h/2 - f_h: the correction."""


@dataclass(frozen=True, eq=False)
class Share:
    """What a finer mesh, or shorter steps, would change.

    Attributes:
        size: Root mean square of the correction of places [m]; of rotations [rad] where no places were measured.
        move: Of u, shape (p,): add it to be rid of the error.
        unsure: Standard deviation of that, shape (p,).
        rows: Of how many rows.
    """

    size: float
    move: FloatArray
    unsure: FloatArray
    rows: int


def mesh_share(problem: Problem, fit: Fit) -> Share:
    """Return what a mesh with every edge halved would change. Raises SceneError, StepError."""
    here = problem.at(fit.u)
    if here.rest is None:
        return _share(
            fit, problem, _motion(refined(here.told), problem) - here.values, np.arange(len(here.values))
        )
    good = np.flatnonzero(fit.rows)
    rows = np.unique(good[np.linspace(0, len(good) - 1, min(ROWS, len(good))).round().astype(np.int64)])
    fine = Rest(refined(here.told).scene, problem.measured, problem.points)
    joints = here.told.joints(problem.measured.joints(here.told.scene))
    change = []
    for k in rows:
        state = between(here.rest, here.states[k], fine, joints[k])
        change.append(fine.observer.see(state, here.told.sensor) - here.values[k])
    return _share(fit, problem, np.array(change), rows)


def step_share(problem: Problem, fit: Fit) -> Share | None:
    """Return what steps of half the length would change in a motion; None for poses, or where dt is chosen anyway."""
    here = problem.at(fit.u)
    scene = here.told.scene
    if here.rest is not None or scene.time_error:
        return None
    halved = replace(here.told, scene=replace(scene, dt=0.5 * scene.dt))
    return _share(fit, problem, _motion(halved, problem) - here.values, np.arange(len(here.values)))


def _motion(told: Told, problem: Problem) -> FloatArray:
    return motion(told, problem.measured, problem.points)


def _share(fit: Fit, problem: Problem, change: FloatArray, rows: NDArray[np.int64]) -> Share:
    """Return what `change`, shape (r, m), at some rows is worth."""
    angle = np.array([c.angle for c in problem.measured.channels])
    use = np.isfinite(problem.measured.values[rows]) & fit.rows[rows, None]
    sigma = np.where(angle, fit.sigma[1], fit.sigma[0])
    J = (fit.jacobian[rows] / sigma[:, None])[use]
    width = np.array([p.width for p in fit.wanted])
    normal = J.T @ J + np.diag(width**-2.0)
    move = -np.linalg.solve(normal, J.T @ (change / sigma)[use])
    kind = ~angle if (~angle).any() else angle
    size = FACTOR * float(np.sqrt((change[:, kind] ** 2).mean()))
    return Share(size, np.asarray(FACTOR * move), np.asarray(FACTOR * np.abs(move)), len(rows))


def between(coarse: Rest, state: State, fine: Rest, joints: FloatArray) -> State:
    """Return the state of rest on a finer mesh, begun from that on a coarser one between its nodes.

    Where that leads nowhere the joints are played from the undeformed state. Raises StepError.
    """
    start = fine.start()
    places, moved = coarse.system.rest, state.positions - coarse.system.rest
    own = fine.system.rest
    found = LinearNDInterpolator(places, moved, rescale=True)(own)
    lost = ~np.isfinite(found).all(axis=1)
    found[lost] = NearestNDInterpolator(places, moved, rescale=True)(own[lost])
    start.positions[:] = own + found
    placed = fine.system.groups.placed(own)
    for b, nodes in enumerate(fine.system.groups.rigid):
        centre = placed[nodes].mean(axis=0)
        start.rotations[b] = state.rotations[b]
        start.centres[b] = state.centres[b] + state.rotations[b] @ (centre - _centre(coarse, b))
        start.positions[nodes] = start.centres[b] + (placed[nodes] - centre) @ state.rotations[b].T
    fine.system.drive(start, joints)
    try:
        fine.settle(start, joints)
    except StepError:
        start = fine.start()
        fine.settle(start, joints)
    return start


def _centre(rest: Rest, b: int) -> FloatArray:
    groups = rest.system.groups
    return np.asarray(groups.placed(rest.system.rest)[groups.rigid[b]].mean(axis=0))
