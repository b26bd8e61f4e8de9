"""Hyper-reduction: few elements stand for all, by energy-conserving sampling and weighting [FarhatEtAl2014].

With p_e the part of element e in the forces on the coordinates, weights w >= 0 are sought with

    |L^-1 (sum_e w_e p_e - sum_e p_e)| <= tolerance |L^-1 sum_e p_e|   over all states of the training,

most of them zero. L L^T is the stiffness at each state: the norm is that of the error which the forces' error makes of
the displacements, in energy. As every element keeps its own energy, times a weight that is not negative, forces are the
gradient of a potential and the tangent stays symmetric, and positive where those of the elements are.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from tripod_sim.forces.solid import Solid
from tripod_sim.reduced.basis import Basis, free_rows
from tripod_sim.reduced.coordinates import Coordinates
from tripod_sim.state import State
from tripod_sim.system import System

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

BLUR = 0.3
"""States are also taken beside those of the training: the amplitudes moved at random by so much of their spread."""

SOFTEST = 1e-4
"""Stiffness below this share of the largest counts as that."""


def sampled_weights(
    system: System,
    mass: FloatArray,
    basis: Basis,
    states: tuple[State, ...],
    tolerance: float,
    progress: Callable[[float], None],
) -> FloatArray:
    """Return the weights of the elements, shape (m,).

    Args:
        system: Full and static.
        mass: Of nodes [kg], shape (n,).
        basis: Its lift and shapes are used.
        states: Of the full system.
        tolerance: Relative error of the forces.
        progress: Called with the finished fraction.
    """
    blocks = []
    for k, block in enumerate(_contributions(system, mass, basis, states)):
        progress(0.5 * k / (2 * len(states)))
        blocks.append(block)
    stacked = np.concatenate(blocks)
    return nonnegative(stacked, stacked.sum(axis=1), tolerance, lambda part: progress(0.5 + 0.5 * part))


def _contributions(
    system: System, mass: FloatArray, basis: Basis, states: tuple[State, ...]
) -> Iterator[FloatArray]:
    """Yield L^-1 p_e of all elements, shape (equations, m), for each state and for one beside it."""
    groups, count = system.groups, len(system.solid.elements)
    columns = basis.columns(system.rest, groups)
    free = free_rows(groups)
    back = basis.shapes.T * np.repeat(mass, 3)[free]
    centres = np.array([system.rest[b].mean(axis=0) for b in groups.rigid]).reshape(-1, 3)
    coordinates = Coordinates(centres, len(groups.driven), basis.shapes.shape[1])
    of_elements = columns.reshape(-1, 3, columns.shape[1])[system.solid.elements].reshape(
        count, -1, columns.shape[1]
    )
    nodes = np.arange(system.solid.elements.size).reshape(system.solid.elements.shape)
    apart = system.solid.part(np.arange(count), np.ones(count), nodes)  # every element has nodes of its own
    rest = system.rest.reshape(-1)
    amplitudes = []
    for state in states:
        w = coordinates.boundary_values(state.centres, state.rotations, state.joints)
        amplitudes.append(np.append(w, back @ ((state.positions.reshape(-1) - rest)[free] - basis.lift @ w)))
    spread = np.std(amplitudes, axis=0)
    spread[: coordinates.boundary] = 0.0
    rng = np.random.default_rng(0)
    for state, at in zip(states, amplitudes, strict=True):
        coordinates.update(state.rotations, state.joints)
        change = np.hstack([coordinates.tangent, coordinates.drive])
        for z in (at, at + BLUR * spread * rng.standard_normal(len(at))):
            x = (rest + columns @ z).reshape(-1, 3)[system.solid.elements].reshape(-1, 3)
            modes, g = state.modes.copy(), np.zeros_like(x)
            if not _settle(apart, x, modes, g):
                continue
            parts = np.einsum("eak,ea->ke", of_elements, g.reshape(count, -1))
            products = np.matmul(apart.matrices, of_elements).reshape(-1, len(z))
            stiffness = of_elements.reshape(-1, len(z)).T @ products
            values, vectors = np.linalg.eigh(change.T @ stiffness @ change)
            scale = 1 / np.sqrt(np.maximum(values, SOFTEST * values[-1]))
            yield scale[:, None] * (vectors.T @ (change.T @ parts))


def _settle(apart: Solid, x: FloatArray, modes: FloatArray, g: FloatArray) -> bool:
    """Bring the incompatible modes to equilibrium at `x`; write the gradient to `g`; return whether there is one."""
    still = np.zeros_like(x)
    for _ in range(20):
        if apart.stiffness(x, modes, project=True) >= 0:
            return False
        g[:] = 0.0
        if not np.isfinite(apart.add_gradient(x, modes, g)):
            return False
        if apart.mode_residual_squared < 1e-20:
            break
        apart.advance_modes(modes.copy(), still, 1.0, modes)
    return True


def nonnegative(
    a: FloatArray, b: FloatArray, tolerance: float, progress: Callable[[float], None] = lambda _: None
) -> FloatArray:
    """Return x >= 0 with |A x - b| <= tolerance |b|, few of it positive, or the x >= 0 with the least |A x - b|.

    The active-set method [LawsonHanson1974], which adds one column after the other, ended early.

    Args:
        a: A, shape (k, m).
        b: Shape (k,).
        tolerance: Of the residual.
        progress: Called with the finished fraction, on a logarithmic scale of the residual.
    """
    scale = np.linalg.norm(a, axis=0)
    scale[scale == 0.0] = 1.0
    stacked = np.column_stack([a / scale, b])
    if len(stacked) > stacked.shape[1]:
        stacked = np.asarray(np.linalg.qr(stacked, mode="r"))
    a, b = stacked[:, :-1], stacked[:, -1]
    x, passive = np.zeros(a.shape[1]), np.zeros(a.shape[1], dtype=bool)
    residual, goal = b.copy(), tolerance * float(np.linalg.norm(b))
    refused = np.zeros_like(passive)
    while np.linalg.norm(residual) > goal:
        slope = np.where(passive | refused, -np.inf, a.T @ residual)
        best = int(np.argmax(slope))
        if not slope[best] > 1e-12 * np.linalg.norm(b):
            break
        passive[best] = True
        if not _solve_passive(a, b, x, passive):
            refused[best] = True
            continue
        refused[:] = False
        residual = b - a @ x
        left = float(np.linalg.norm(residual) / np.linalg.norm(b))
        progress(min(1.0, np.log(max(left, 1e-12)) / np.log(max(tolerance, 1e-12))))
    return x / scale


def _solve_passive(a: FloatArray, b: FloatArray, x: FloatArray, passive: NDArray[np.bool_]) -> bool:
    """Move `x` to the least residual over the `passive` columns, which lose those that would become negative.

    Returns:
        Whether x has changed: not, where the column that came last goes at once.
    """
    before = passive & (x > 0)
    while passive.any():
        which = np.flatnonzero(passive)
        q, r = np.linalg.qr(a[:, which])
        wanted = solve_triangular(r, q.T @ b)
        if wanted.min() > 0:
            x[:] = 0.0
            x[which] = wanted
            return True
        falling = wanted <= 0
        now = x[which]
        step = np.min(now[falling] / np.maximum(now[falling] - wanted[falling], 1e-300))
        x[which] = np.maximum(now + step * (wanted - now), 0.0)
        gone = which[falling & (x[which] <= 1e-14 * x.max())]
        x[gone] = 0.0
        passive[gone] = False
        if np.array_equal(passive, before):
            return False
    return False
