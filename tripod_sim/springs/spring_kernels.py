"""Compiled loops over springs: energy, forces, tangents. With d = x_j - x_i, l = |d|, n = d / l (zero where l is)."""

from typing import NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.forces.term_kernels import add_pair


class Links(NamedTuple):
    """Springs as kernels take them; see `SpringBody`."""

    ends: Array
    rest: Array
    stiffness: Array
    damping: Array
    slack: bool


def links_of(ends: Array, rest: Array, stiffness: Array, damping: Array, slack: bool) -> Links:
    """Return springs with arrays of their own: kernels are compiled anew for arrays that may not be written."""
    e, r, k, c = (np.array(array, order="C") for array in (ends, rest, stiffness, damping))
    return Links(e, r, k, c, bool(slack))


SHORTEST = 1e-150
"""A spring shorter than this has no direction and no force [m]."""


@njit(cache=True, error_model="numpy", inline="always")
def direction(x: Array, i: int, j: int) -> tuple[float, float, float, float]:
    """Return l and n."""
    d0, d1, d2 = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
    length = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    if length < SHORTEST:
        return length, 0.0, 0.0, 0.0
    inverse = 1.0 / length
    return length, d0 * inverse, d1 * inverse, d2 * inverse


@njit(cache=True, error_model="numpy", inline="always")
def tension_of(length: float, rest: float, k: float, slack: bool) -> tuple[float, float, float]:
    """Return l - L, k and k (l - L) of a spring, the last two zero where it is slack."""
    stretch = length - rest
    if stretch < 0.0 and slack:
        k = 0.0
    return stretch, k, k * stretch


@njit(cache=True, error_model="numpy")
def elastic_energy(x: Array, links: Links) -> float:
    """Return sum of k (l - L)² / 2 over the springs that pull or push [J]."""
    total = 0.0
    for m in range(links.ends.shape[0]):
        length, _, _, _ = direction(x, links.ends[m, 0], links.ends[m, 1])
        stretch, _, tension = tension_of(length, links.rest[m], links.stiffness[m], links.slack)
        total += 0.5 * tension * stretch
    return total


@njit(cache=True, error_model="numpy")
def lengths(x: Array, links: Links, out: Array) -> None:
    """Write l of each spring [m]."""
    for m in range(links.ends.shape[0]):
        out[m], _, _, _ = direction(x, links.ends[m, 0], links.ends[m, 1])


@njit(cache=True, error_model="numpy")
def add_forces(x: Array, v: Array, links: Links, rayleigh: float, f: Array) -> float:
    """Add to `f` [N] the springs' forces T n and -b K v, K each spring's projected tangent; return the energy [J].

    K = k n n^T + max(0, k (1 - L / l)) (I - n n^T), zero for a slack spring that is compressed.
    """
    total = 0.0
    for m in range(links.ends.shape[0]):
        i, j = links.ends[m, 0], links.ends[m, 1]
        length, n0, n1, n2 = direction(x, i, j)
        stretch, k, tension = tension_of(length, links.rest[m], links.stiffness[m], links.slack)
        total += 0.5 * tension * stretch
        f0, f1, f2 = tension * n0, tension * n1, tension * n2
        if links.damping[m] > 0.0 or rayleigh > 0.0:
            w0, w1, w2 = v[j, 0] - v[i, 0], v[j, 1] - v[i, 1], v[j, 2] - v[i, 2]
            along = n0 * w0 + n1 * w1 + n2 * w2
            across = rayleigh * tension / length if stretch > 0.0 else 0.0
            pull = (links.damping[m] + rayleigh * k - across) * along
            f0 += pull * n0 + across * w0
            f1 += pull * n1 + across * w1
            f2 += pull * n2 + across * w2
        add_pair(f, i, j, f0, f1, f2)
    return total


@njit(cache=True, error_model="numpy")
def add_gradient(x: Array, links: Links, rate: float, reference: Array, g: Array) -> float:
    """Add the gradient of sum of k (l - L)² / 2 + r c (l - l_0)² / 2 to `g` [N] and return that sum [J].

    The second term is the damper of one implicit stage: dl/dt = r (l - l_0).

    Args:
        x: Positions [m], shape (n, 3).
        links: The springs.
        rate: r [1/s]; zero without dampers.
        reference: l_0 [m], shape (m,).
        g: Shape (n, 3).
    """
    total = 0.0
    for m in range(links.ends.shape[0]):
        i, j = links.ends[m, 0], links.ends[m, 1]
        length, n0, n1, n2 = direction(x, i, j)
        stretch, _, tension = tension_of(length, links.rest[m], links.stiffness[m], links.slack)
        total += 0.5 * tension * stretch
        if rate > 0.0:
            change, c = length - reference[m], rate * links.damping[m]
            tension += c * change
            total += 0.5 * c * change * change
        add_pair(g, j, i, tension * n0, tension * n1, tension * n2)
    return total


@njit(cache=True, error_model="numpy")
def tangents(x: Array, links: Links, rate: float, reference: Array, project: bool, out: Array) -> None:
    """Write the Hessian block B of what `add_gradient` sums, for each spring: xx, xy, xz, yy, yz, zz [N/m].

    B = (k + r c) n n^T + T / l (I - n n^T), T the whole tension; the Hessian has B at (i, i) and (j, j), -B at (i, j).
    `project` leaves T / l out where it is negative, which makes B positive semi-definite.
    """
    for m in range(links.ends.shape[0]):
        length, n0, n1, n2 = direction(x, links.ends[m, 0], links.ends[m, 1])
        _, k, tension = tension_of(length, links.rest[m], links.stiffness[m], links.slack)
        if rate > 0.0:
            c = rate * links.damping[m]
            tension += c * (length - reference[m])
            k += c
        across = tension / length
        if length < SHORTEST:
            across = k if links.rest[m] == 0.0 else 0.0
        if project and across < 0.0:
            across = 0.0
        along = k - across
        out[m, 0] = along * n0 * n0 + across
        out[m, 1] = along * n0 * n1
        out[m, 2] = along * n0 * n2
        out[m, 3] = along * n1 * n1 + across
        out[m, 4] = along * n1 * n2
        out[m, 5] = along * n2 * n2 + across


@njit(cache=True, error_model="numpy")
def add_products(ends: Array, blocks: Array, p: Array, scale: float, out: Array) -> float:
    """Add `scale` times the Hessian with the blocks of `tangents` times `p` to `out`; return `scale` p^T H p / 2."""
    total = 0.0
    for m in range(ends.shape[0]):
        i, j = ends[m, 0], ends[m, 1]
        d0, d1, d2 = p[i, 0] - p[j, 0], p[i, 1] - p[j, 1], p[i, 2] - p[j, 2]
        b = blocks[m]
        f0 = scale * (b[0] * d0 + b[1] * d1 + b[2] * d2)
        f1 = scale * (b[1] * d0 + b[3] * d1 + b[4] * d2)
        f2 = scale * (b[2] * d0 + b[4] * d1 + b[5] * d2)
        total += 0.5 * (f0 * d0 + f1 * d1 + f2 * d2)
        add_pair(out, i, j, f0, f1, f2)
    return total
