"""Compiled loops over springs: energy, forces, tangents. With d = x_j - x_i, l = |d|, n = d / l (zero where l is)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.forces.term_kernels import add_pair


class Links(NamedTuple):
    """Springs as kernels take them; see `SpringBody`.

    damping: c of the dampers that always act [N s/m]; viscosity: b of dampers b k that act while a slack spring is taut
    [s], zero where springs push, too: there they are part of c.
    """

    ends: Array
    rest: Array
    stiffness: Array
    damping: Array
    slack: bool
    viscosity: float


def links_of(
    ends: Array, rest: Array, stiffness: Array, damping: Array, slack: bool, viscosity: float = 0.0
) -> Links:
    """Return springs with arrays of their own: kernels are compiled again for arrays that may not be written.

    `damping`: c of each [N s/m]; `viscosity`: b of further dampers b k [s].
    """
    e, r, k, c = (np.array(array, order="C") for array in (ends, rest, stiffness, damping))
    if not slack:
        c, viscosity = c + viscosity * k, 0.0
    return Links(e, r, k, c, bool(slack), float(viscosity))


def nets_of(springs: Sequence[Links]) -> tuple[Links, Links]:
    """Return all springs that push as one net, and all that only pull."""
    nets = []
    for slack in (False, True):
        own = [net for net in springs if bool(net.slack) == slack]
        ends = np.concatenate([*(net.ends for net in own), np.zeros((0, 2), dtype=np.int64)])
        rest, stiffness, damping = (
            np.concatenate([*(net[k] for net in own), np.zeros(0)]) for k in (1, 2, 3)
        )
        viscosity = max((net.viscosity for net in own), default=0.0)  # the scene has one for all
        nets.append(Links(ends, rest, stiffness, damping, slack, viscosity))
    return nets[0], nets[1]


def rates_of(links: Links) -> Array:
    """Return what the dampers of each spring are at most together [N s/m], shape (m,)."""
    return links.damping + links.viscosity * links.stiffness


def has_dampers(links: Links) -> bool:
    """Return whether a spring has a damper."""
    return bool(rates_of(links).any())


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


@njit(cache=True, error_model="numpy", inline="always")
def stage_tension(
    length: float, rest: float, k: float, c: float, taut: float, before: float, slack: bool
) -> tuple[float, float, float]:
    """Return energy [J], stiffness [N/m] and tension [N] of a spring with its damper in an implicit stage.

    The tension is k (l - L) + c (l - l_0), with c the damping over s and l_0 = `before`; its energy is that of both.
    Of a slack spring it is c (l - l_0) + max(0, k (l - L) + `taut` (l - l_0)), where in the latter l_0 is at least L: a
    continuous force, whose second part has the energy of its square over 2 (k + taut).
    """
    stretch, push = length - rest, c * (length - before)
    energy = 0.5 * push * (length - before)
    if not slack:
        return energy + 0.5 * k * stretch * stretch, k + c, k * stretch + push
    pull = k * stretch + taut * (length - max(before, rest))
    if not pull > 0.0:
        return energy, c, push
    return energy + 0.5 * pull * pull / (k + taut), k + taut + c, pull + push


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
def add_forces(x: Array, v: Array, links: Links, f: Array) -> float:
    """Add the forces T n of springs and dampers to `f` [N], T = k (l - L) + c dl/dt; return the springs' energy [J].

    Of a slack spring T = c dl/dt + max(0, k (l - L) + b k dl/dt), the second part zero while l < L.
    """
    total = 0.0
    for m in range(links.ends.shape[0]):
        i, j = links.ends[m, 0], links.ends[m, 1]
        length, n0, n1, n2 = direction(x, i, j)
        stretch, _, tension = tension_of(length, links.rest[m], links.stiffness[m], links.slack)
        total += 0.5 * tension * stretch
        if links.damping[m] > 0.0 or links.viscosity > 0.0:
            w0, w1, w2 = v[j, 0] - v[i, 0], v[j, 1] - v[i, 1], v[j, 2] - v[i, 2]
            speed = n0 * w0 + n1 * w1 + n2 * w2
            if links.slack and stretch >= 0.0:
                tension = max(0.0, tension + links.viscosity * links.stiffness[m] * speed)
            tension += links.damping[m] * speed
        add_pair(f, i, j, tension * n0, tension * n1, tension * n2)
    return total


@njit(cache=True, error_model="numpy")
def add_gradient(x: Array, links: Links, rate: float, reference: Array, g: Array) -> float:
    """Add the gradient of sum of k (l - L)² / 2 + r c (l - l_0)² / 2 to `g` [N] and return that sum [J].

    The second term is the damper of one implicit stage: dl/dt = r (l - l_0). Slack springs: see `stage_tension`.

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
        k, c = links.stiffness[m], rate * links.damping[m]
        energy, _, tension = stage_tension(
            length, links.rest[m], k, c, rate * links.viscosity * k, reference[m], links.slack
        )
        total += energy
        add_pair(g, j, i, tension * n0, tension * n1, tension * n2)
    return total


@njit(cache=True, error_model="numpy")
def _shares(
    links: Links, m: int, length: float, rate: float, before: float
) -> tuple[float, float, float, float]:
    """Return the energies [J] of spring m alone and of its dampers in a stage, then their tensions [N]."""
    rest, k, c = links.rest[m], links.stiffness[m], rate * links.damping[m]
    energy, _, tension = stage_tension(length, rest, k, c, rate * links.viscosity * k, before, links.slack)
    stretch, _, elastic = tension_of(length, rest, k, links.slack)
    own = 0.5 * elastic * stretch
    return own, energy - own, elastic, tension - elastic


@njit(cache=True, error_model="numpy")
def add_gradients(
    x: Array, links: Links, rate: float, reference: Array, g: Array, d: Array
) -> tuple[float, float]:
    """Add to `g` [N] what `add_gradient` adds without dampers, to `d` what these add; return both energies [J]."""
    stored = lost = 0.0
    for m in range(links.ends.shape[0]):
        i, j = links.ends[m, 0], links.ends[m, 1]
        length, n0, n1, n2 = direction(x, i, j)
        own, added, elastic, tension = _shares(links, m, length, rate, reference[m])
        stored, lost = stored + own, lost + added
        add_pair(g, j, i, elastic * n0, elastic * n1, elastic * n2)
        add_pair(d, j, i, tension * n0, tension * n1, tension * n2)
    return stored, lost


@njit(cache=True, error_model="numpy")
def add_damper_gradient(x: Array, links: Links, rate: float, reference: Array, g: Array) -> float:
    """Add to `g` [N] what `add_gradient` adds with dampers beyond that without; return the same of the sum [J]."""
    total = 0.0
    for m in range(links.ends.shape[0]):
        i, j = links.ends[m, 0], links.ends[m, 1]
        length, n0, n1, n2 = direction(x, i, j)
        _, added, _, tension = _shares(links, m, length, rate, reference[m])
        total += added
        add_pair(g, j, i, tension * n0, tension * n1, tension * n2)
    return total


@njit(cache=True, error_model="numpy")
def add_rates(x: Array, links: Links, rate: float, reference: Array, y: Array, out: Array) -> None:
    """Add r C y to `out` [N], C the sum of c n n^T, with b k of taut slack springs; y, out: (n, 3)."""
    for m in range(links.ends.shape[0]):
        i, j = links.ends[m, 0], links.ends[m, 1]
        length, n0, n1, n2 = direction(x, i, j)
        k, c = links.stiffness[m], rate * links.damping[m]
        taut = rate * links.viscosity * k
        _, stiffness, _ = stage_tension(length, links.rest[m], k, c, taut, reference[m], links.slack)
        if stiffness > c:
            c += taut
        pull = c * (n0 * (y[i, 0] - y[j, 0]) + n1 * (y[i, 1] - y[j, 1]) + n2 * (y[i, 2] - y[j, 2]))
        add_pair(out, i, j, pull * n0, pull * n1, pull * n2)


@njit(cache=True, error_model="numpy")
def tangents(x: Array, links: Links, rate: float, reference: Array, project: bool, out: Array) -> None:
    """Write the Hessian block B of what `add_gradient` sums, for each spring: xx, xy, xz, yy, yz, zz [N/m].

    B = (k + r c) n n^T + T / l (I - n n^T), T the whole tension; the Hessian has B at (i, i) and (j, j), -B at (i, j).
    `project` leaves T / l out where it is negative, which makes B positive semi-definite.
    """
    for m in range(links.ends.shape[0]):
        length, n0, n1, n2 = direction(x, links.ends[m, 0], links.ends[m, 1])
        k, c = links.stiffness[m], rate * links.damping[m]
        _, k, tension = stage_tension(
            length, links.rest[m], k, c, rate * links.viscosity * k, reference[m], links.slack
        )
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
