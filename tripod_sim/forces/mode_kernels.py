"""Incompatible modes of elements whose nodes stand still: brought to the least of E + D, element by element.

With f_a = d(E + D)/da and K_aa its derivative, both of one element, a Newton step is d = -K_aa^-1 f_a. The inverse is
reused while it lowers the force tenfold; else it is computed again, projected where it is not positive definite, and
the step is halved until it lowers energy or force [NocedalWright2006]. Modes of different elements have nothing to do
with each other while the nodes stand still, so each element takes as many steps as it needs.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put
from tripod_sim.forces.damper_kernels import add_damper_tangent, damper_stress, damps, strain_rate
from tripod_sim.forces.solid_arrays import SolidArrays
from tripod_sim.forces.solid_kernels import DAMPER, constants, invert
from tripod_sim.materials import calls

MOST_STEPS, MOST_HALVINGS = 30, 12
"""Of one element."""

SERVES = 0.01
"""Factor by which a step lowers the square of the force for the inverse to serve on."""

_stress, _tangent = calls.stress, calls.tangent


@njit(cache=True, error_model="numpy")
def settle_modes(x: Array, modes: Array, solid: SolidArrays, of: int, tolerance: float) -> float:
    """Move `modes` (m, k, 3) [m] to where |f_a|² of all elements is at most `tolerance` [N²], in place.

    `of` is ELASTIC or BOTH. Its inverses K_aa^-1, shape (m, 3k, 3k), are renewed where they do not serve.

    Returns:
        |f_a|² [N²], infinite where a point has no energy at the start.
    """
    elements, G, weight, law, p, _ = constants(solid)
    nodes, count, points = elements.shape[1], modes.shape[1], G.shape[1]
    base, force, ahead = np.empty((points, 3, 3)), np.empty((count, 3)), np.empty((count, 3))
    trial, step, C = np.empty((count, 3)), np.empty((count, 3)), np.empty((9, 9))
    viscosity = solid.viscosity
    enough, total = tolerance / elements.shape[0], 0.0
    for e in range(elements.shape[0]):
        for q in range(points):
            for i in range(3):
                for j in range(3):
                    entry = 0.0
                    for a in range(nodes):
                        entry += x[elements[e, a], i] * G[e, q, j, a]
                    base[q, i, j] = entry
        at, Ge, we, before = modes[e], G[e, :, :, nodes:], weight[e], solid.before[e]
        rate = solid.rate[0] if of & DAMPER and damps(before) else 0.0
        energy, left = _force(at, base, Ge, we, law, p, rate, viscosity, before, force)
        if not np.isfinite(energy):
            return np.inf
        fresh = False
        for _ in range(MOST_STEPS):
            if left <= enough:
                break
            _times(solid.inverse[e], force, step)
            scale, moved = 1.0, False
            for _ in range(MOST_HALVINGS if fresh else 1):
                for k in range(count):
                    for i in range(3):
                        trial[k, i] = at[k, i] - scale * step[k, i]
                after, smaller = _force(trial, base, Ge, we, law, p, rate, viscosity, before, ahead)
                if fresh:
                    moved = np.isfinite(after) and (after < energy or smaller < left)
                else:
                    moved = np.isfinite(after) and smaller <= SERVES * left
                if moved:
                    break
                scale *= 0.5
            if moved:
                put(at, trial)
                put(force, ahead)
                fresh, energy, left = False, after, smaller
            elif fresh or not _renew(at, base, Ge, we, law, p, rate, viscosity, before, C, solid.inverse[e]):
                break
            else:
                fresh = True
        total += left
    return total


@njit(cache=True, error_model="numpy", inline="always")
def _deformation(modes: Array, base: Array, G: Array, F: Array) -> None:
    """Write F at a point: `base` (3, 3), that of the nodes, and what the modes add."""
    for i in range(3):
        for j in range(3):
            entry = base[i, j]
            for k in range(modes.shape[0]):
                entry += modes[k, i] * G[j, k]
            F[i, j] = entry


@njit(cache=True, error_model="numpy")
def _force(
    modes: Array, base: Array, G: Array, weight: Array, law: Array, p: Array, rate: float, viscosity: Array,
    before: Array, force: Array,
) -> tuple[float, float]:  # fmt: skip
    """Write f_a (k, 3) [N] of one element; return its E + D [J], infinite for none, and |f_a|² [N²]; `rate` 0: no D."""
    F, P, A = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    Q, strain = np.empty((3, 3)), np.empty(6)
    energy, square = 0.0, 0.0
    force[:] = 0.0
    for q in range(base.shape[0]):
        _deformation(modes, base[q], G[q], F)
        density = _stress(law, F, p, P)
        if not np.isfinite(density):
            return np.inf, np.inf
        energy += weight[q] * density
        if rate > 0.0:
            strain_rate(F, rate, before[q], strain, A)
            energy += 0.5 * weight[q] / rate * damper_stress(F, A, viscosity, 0.0, Q)
            for i in range(3):
                for j in range(3):
                    P[i, j] += Q[i, j]
        for k in range(modes.shape[0]):
            for i in range(3):
                force[k, i] += weight[q] * (
                    P[i, 0] * G[q, 0, k] + P[i, 1] * G[q, 1, k] + P[i, 2] * G[q, 2, k]
                )
    for k in range(modes.shape[0]):
        square += force[k, 0] ** 2 + force[k, 1] ** 2 + force[k, 2] ** 2
    return energy, square


@njit(cache=True, error_model="numpy", inline="always")
def _times(inverse: Array, force: Array, out: Array) -> None:
    """Write K_aa^-1 f_a, shape (k, 3)."""
    for r in range(inverse.shape[0]):
        entry = 0.0
        for c in range(inverse.shape[0]):
            entry += inverse[r, c] * force[c // 3, c % 3]
        out[r // 3, r % 3] = entry


@njit(cache=True, error_model="numpy")
def _renew(
    modes: Array,
    base: Array,
    G: Array,
    weight: Array,
    law: Array,
    p: Array,
    rate: float,
    viscosity: Array,
    before: Array,
    C: Array,
    inverse: Array,
) -> bool:
    """Write K_aa^-1 of one element, as it is or else projected; return whether there is one. C: scratch (9, 9)."""
    F, rows, S = np.empty((3, 3)), np.empty((3, 9)), np.empty((3, 3))
    count = modes.shape[0]
    for project in (False, True):
        inverse[:] = 0.0
        for q in range(base.shape[0]):
            _deformation(modes, base[q], G[q], F)
            _tangent(law, F, p, project, C)
            if rate > 0.0:
                add_damper_tangent(F, rate, before[q], viscosity, 0.0, project, S, C)
            for k in range(count):
                for i in range(3):
                    for c in range(9):
                        rows[i, c] = weight[q] * (
                            G[q, 0, k] * C[3 * i, c]
                            + G[q, 1, k] * C[3 * i + 1, c]
                            + G[q, 2, k] * C[3 * i + 2, c]
                        )
                for n in range(count):
                    for i in range(3):
                        for j in range(3):
                            inverse[3 * k + i, 3 * n + j] += (
                                rows[i, 3 * j] * G[q, 0, n]
                                + rows[i, 3 * j + 1] * G[q, 1, n]
                                + rows[i, 3 * j + 2] * G[q, 2, n]
                            )
        if invert(inverse):
            return True
    return False


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def turn_blocks(rotations: Array, matrices: Array) -> None:
    """Turn the matrix of each element, (m, 3a, 3b), in place: each 3 x 3 block B becomes R B R^T, R (m, 3, 3)."""
    half = np.empty((3, 3))
    for e in range(matrices.shape[0]):
        R, B = rotations[e], matrices[e]
        for a in range(0, B.shape[0], 3):
            for b in range(0, B.shape[1], 3):
                for i in range(3):
                    for j in range(3):
                        half[i, j] = (
                            R[i, 0] * B[a, b + j] + R[i, 1] * B[a + 1, b + j] + R[i, 2] * B[a + 2, b + j]
                        )
                for i in range(3):
                    for j in range(3):
                        B[a + i, b + j] = half[i, 0] * R[j, 0] + half[i, 1] * R[j, 1] + half[i, 2] * R[j, 2]
