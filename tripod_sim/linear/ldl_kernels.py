"""Numeric part of the multifrontal L D L^T: fronts are dense, row-major, and only their upper triangles count.

Row k of a panel holds d_k L[j, k] for the rows j of its front, so that loops run over contiguous numbers.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.linear.ldl_symbolic import Symbolic, deepest

ROWS = 4
"""Rows that are eliminated at once."""


class Numbers(NamedTuple):
    """Of one factorisation: values of the upper triangle, CSC; panels; 1 / D, (n,); remainders that wait; y (n,)."""

    data: Array
    factors: Array
    inverse: Array
    stack: Array
    y: Array


class Share(NamedTuple):
    """Of the elimination, what one thread does at a time: a subtree of fronts, or what is above them.

    fronts: their numbers, ascending; held: for each, where its remainder stands if another share has it eliminated,
    else -1; base: where its own remainders begin; end: pivots from there on are of other shares; front, waiting,
    places, depth: scratch, one front, the numbers of those that wait and where their remainders stand, how many wait
    and where the next one goes; x: of the largest front; beyond: what it adds to `y` of other shares, (n,).
    """

    fronts: Array
    held: Array
    base: int
    end: int
    front: Array
    waiting: Array
    places: Array
    depth: Array
    x: Array
    beyond: Array


def numbers(plan: Symbolic, data: Array, kind: type[np.floating[Any]]) -> tuple[Numbers, list[Share]]:
    """Return room for the factorisation of the matrix with a plan and the values `data`, which change, and its shares.

    `kind`: as which the factor is kept. The last share is what is above all others.
    """
    n, count = len(plan.order), len(plan.parent)
    top, fronts = np.ones(count, dtype=bool), list[Array]()
    for first, end in plan.subtrees.tolist():
        top[first : end - 1] = False  # all but the root, whose remainder it needs
        fronts.append(np.arange(first, end))
    held = [np.full(len(own), -1) for own in fronts]
    fronts.append(np.flatnonzero(top))
    held.append(np.full(len(fronts[-1]), -1))
    shares, base = list[Share](), 0
    for own, known in zip(fronts, held, strict=True):
        if own is fronts[-1]:
            known[np.searchsorted(own, plan.subtrees[:, 1] - 1)] = [share.base for share in shares]
        mine = own[known < 0]
        size, waiting = int(np.diff(plan.first_row)[mine].max(initial=0)), np.zeros(len(own), dtype=np.int64)
        scratch = np.zeros(size**2), waiting, waiting.copy(), np.zeros(2, dtype=np.int64), np.zeros(size)
        beyond = np.zeros(n if len(fronts) > 1 else 0)
        shares.append(Share(own, known, base, int(plan.pivots[own[-1] + 1]), *scratch, beyond))
        base += deepest(plan, mine)
    factors = np.zeros(int(plan.panel[-1]), dtype=kind)
    return Numbers(data, factors, np.zeros(n), np.zeros(base), np.zeros(n)), shares


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def _eliminate_row(F: Array, size: int, i: int, k: int, pivots: int, inverse: Array) -> None:
    """Subtract from row i what the rows from k to `pivots` eliminate, four at a time."""
    n, start, end = size - i, k * size + i, (k + 1) * size
    out = F[i * size + i : (i + 1) * size]
    while k + 4 <= pivots:
        u0, u1 = F[start:end], F[start + size : end + size]
        u2, u3 = F[start + 2 * size : end + 2 * size], F[start + 3 * size : end + 3 * size]
        a0, a1, a2, a3 = (
            u0[0] * inverse[k],
            u1[0] * inverse[k + 1],
            u2[0] * inverse[k + 2],
            u3[0] * inverse[k + 3],
        )
        for j in range(n):
            out[j] -= a0 * u0[j] + a1 * u1[j] + a2 * u2[j] + a3 * u3[j]
        k += 4
        start += 4 * size
        end += 4 * size
    while k < pivots:
        u0 = F[start:end]
        a0 = u0[0] * inverse[k]
        for j in range(n):
            out[j] -= a0 * u0[j]
        k += 1
        start += size
        end += size


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def _eliminate_rows(F: Array, size: int, i: int, k: int, pivots: int, inverse: Array) -> None:
    """As `_eliminate_row`, from `ROWS` rows from i on: what is read serves all of them."""
    n, start, end = size - i, k * size + i, (k + 1) * size
    o0, o1 = F[i * size + i : (i + 1) * size], F[(i + 1) * size + i : (i + 2) * size]
    o2, o3 = F[(i + 2) * size + i : (i + 3) * size], F[(i + 3) * size + i : (i + 4) * size]
    while k + 4 <= pivots:
        u0, u1 = F[start:end], F[start + size : end + size]
        u2, u3 = F[start + 2 * size : end + 2 * size], F[start + 3 * size : end + 3 * size]
        v0, v1, v2, v3 = inverse[k], inverse[k + 1], inverse[k + 2], inverse[k + 3]
        a0, a1, a2, a3 = u0[0] * v0, u1[0] * v1, u2[0] * v2, u3[0] * v3
        b0, b1, b2, b3 = u0[1] * v0, u1[1] * v1, u2[1] * v2, u3[1] * v3
        c0, c1, c2, c3 = u0[2] * v0, u1[2] * v1, u2[2] * v2, u3[2] * v3
        d0, d1, d2, d3 = u0[3] * v0, u1[3] * v1, u2[3] * v2, u3[3] * v3
        for j in range(n):
            f0, f1, f2, f3 = u0[j], u1[j], u2[j], u3[j]
            o0[j] -= a0 * f0 + a1 * f1 + a2 * f2 + a3 * f3
            o1[j] -= b0 * f0 + b1 * f1 + b2 * f2 + b3 * f3
            o2[j] -= c0 * f0 + c1 * f1 + c2 * f2 + c3 * f3
            o3[j] -= d0 * f0 + d1 * f1 + d2 * f2 + d3 * f3
        k += 4
        start += 4 * size
        end += 4 * size
    while k < pivots:
        u0 = F[start:end]
        a0, b0, c0, d0 = u0[0] * inverse[k], u0[1] * inverse[k], u0[2] * inverse[k], u0[3] * inverse[k]
        for j in range(n):
            f0 = u0[j]
            o0[j] -= a0 * f0
            o1[j] -= b0 * f0
            o2[j] -= c0 * f0
            o3[j] -= d0 * f0
        k += 1
        start += size
        end += size


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def factor(p: Symbolic, A: Numbers, w: Share, first: int, end: int) -> int:
    """Write the panels and 1 / D of the fronts from `first` to `end` of a share, of the values `A.data`.

    Return the number of negative pivots, or -1 - k where pivot k is zero or not finite.
    """
    # arrays are taken out of their tuples once: for each front that would take as long as small fronts themselves
    fronts, held, waiting, places, depth, F = w.fronts, w.held, w.waiting, w.places, w.depth, w.front
    pivots, first_row, parent, place = p.pivots, p.first_row, p.parent, p.place
    target, source, first_entry, panel = p.target, p.source, p.first_entry, p.panel
    data, stack, factors, inverse, base = A.data, A.stack, A.factors, A.inverse, w.base
    negative = 0
    for number in range(first, end):
        s = fronts[number]
        if held[number] >= 0:
            _keep_waiting(s, held[number], waiting, places, depth)
            continue
        own, size = pivots[s], first_row[s + 1] - first_row[s]
        width = pivots[s + 1] - own
        _open(
            s, base, pivots, first_row, parent, place, target, source, first_entry, data, F, stack, waiting, places,
            depth,
        )  # fmt: skip
        inv = inverse[own : own + width]
        found = eliminate_pivots(F, size, 0, width, inv)
        if found < 0:
            return found - own
        negative += found
        eliminate_below(F, size, width, size, width, inv)
        _close(s, size, width, panel[s], parent[s], F, stack, factors, waiting, places, depth)
    return negative


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def _keep_waiting(s: int, place: int, waiting: Array, places: Array, depth: Array) -> None:
    """Remember that the remainder of front s waits at a place of the stack."""
    count = depth[0]
    waiting[count], places[count] = s, place
    depth[0] = count + 1


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def _open(
    s: int,
    base: int,
    pivots: Array,
    first_row: Array,
    parent: Array,
    place: Array,
    target: Array,
    source: Array,
    first_entry: Array,
    data: Array,
    F: Array,
    stack: Array,
    waiting: Array,
    places: Array,
    depth: Array,
) -> None:
    """Write to F the entries of front s and the remainders of its children; all others as in `Share` and `Symbolic`."""
    size, count = first_row[s + 1] - first_row[s], depth[0]
    for i in range(size):
        F[i * size + i : (i + 1) * size] = 0.0
    for e in range(first_entry[s], first_entry[s + 1]):
        F[target[e]] += data[source[e]]
    while count > 0 and parent[waiting[count - 1]] == s:
        count -= 1
        child, at = waiting[count], places[count]
        m = first_row[child + 1] - first_row[child] - (pivots[child + 1] - pivots[child])
        if at >= base:
            depth[1] = at
        own = first_row[child + 1] - m
        for i in range(m):
            row = F[place[own + i] * size : (place[own + i] + 1) * size]
            left, to = stack[at + i * m + i : at + (i + 1) * m], place[own + i : own + m]
            for j in range(m - i):
                row[to[j]] += left[j]
    depth[0] = count


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def _close(
    s: int,
    size: int,
    width: int,
    at: int,
    above: int,
    F: Array,
    stack: Array,
    factors: Array,
    waiting: Array,
    places: Array,
    depth: Array,
) -> None:
    """Keep the panel of front s, which begins `at`, and put its remainder on the stack if it has a front `above` it."""
    factors[at : at + width * size] = F[: width * size]
    if above >= 0:
        m, top = size - width, depth[1]
        for i in range(m):
            row = (width + i) * size + width
            stack[top + i * m + i : top + (i + 1) * m] = F[row + i : row + m]
        _keep_waiting(s, top, waiting, places, depth)
        depth[1] = top + m * m


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def open_front(p: Symbolic, A: Numbers, w: Share, s: int) -> None:
    """Write to `w.front` the entries of front s and the remainders of its children."""
    _open(
        s, w.base, p.pivots, p.first_row, p.parent, p.place, p.target, p.source, p.first_entry, A.data, w.front,
        A.stack, w.waiting, w.places, w.depth,
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def close_front(p: Symbolic, A: Numbers, w: Share, s: int) -> None:
    """Keep the panel of front s, which has been eliminated, and put its remainder on the stack."""
    size, width = p.first_row[s + 1] - p.first_row[s], p.pivots[s + 1] - p.pivots[s]
    _close(s, size, width, p.panel[s], p.parent[s], w.front, A.stack, A.factors, w.waiting, w.places, w.depth)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def eliminate_pivots(F: Array, size: int, begin: int, end: int, inverse: Array) -> int:
    """Eliminate the pivots from `begin`, a multiple of `ROWS`, to `end` from each other; those before have been.

    Return the number of negative ones, or -1 - k where pivot k is zero or not finite.
    """
    negative, whole = 0, end - end % ROWS
    for i in range(begin, end):
        if i < whole and i % ROWS == 0:
            _eliminate_rows(F, size, i, begin, i, inverse)
        _eliminate_row(F, size, i, i - i % ROWS if i < whole else begin, i, inverse)
        d = F[i * size + i]
        if not 0.0 < abs(d) < np.inf:  # zero, infinite or not a number
            return -1 - i
        if d < 0.0:
            negative += 1
        inverse[i] = 1.0 / d
    return negative


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def eliminate_below(F: Array, size: int, begin: int, end: int, pivots: int, inverse: Array) -> None:
    """Eliminate the first `pivots` pivots from the rows from `begin` to `end`, all below them."""
    i = begin
    while i + ROWS <= end:
        _eliminate_rows(F, size, i, 0, pivots, inverse)
        i += ROWS
    while i < end:
        _eliminate_row(F, size, i, 0, pivots, inverse)
        i += 1


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def solve(b: Array, p: Symbolic, A: Numbers, w: Share, out: Array) -> None:
    """Write A^-1 b to `out`, shape (n,); `w` is all of the elimination."""
    order, y = p.order, A.y
    for k in range(b.shape[0]):
        y[k] = b[order[k]]
    forward(p, A, w)
    backward(p, A, w)
    for k in range(b.shape[0]):
        out[order[k]] = y[k]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def forward(p: Symbolic, A: Numbers, w: Share) -> None:
    """Eliminate the pivots of a share from `A.y`; what it adds to rows of other shares goes to `w.beyond`."""
    pivots, rows, first_row, panel, beyond = p.pivots, p.rows, p.first_row, p.panel, w.beyond
    factors, inverse, y, x = A.factors, A.inverse, A.y, w.x
    last = w.fronts[-1]
    for e in range(first_row[last], first_row[last + 1]):
        if rows[e] >= w.end:
            beyond[rows[e]] = 0.0
    for number in range(w.fronts.shape[0]):
        if w.held[number] >= 0:
            continue
        s = w.fronts[number]
        begin, own, at = first_row[s], pivots[s], panel[s]
        size, width = first_row[s + 1] - begin, pivots[s + 1] - own
        x[:size] = 0.0
        for k in range(width):
            z = (y[own + k] - x[k]) * inverse[own + k]
            u, part = factors[at + k * size + k : at + (k + 1) * size], x[k:size]
            for j in range(size - k):
                part[j] += u[j] * z
            y[own + k] = z
        for j in range(width, size):
            row = rows[begin + j]
            if row < w.end:
                y[row] -= x[j]
            else:
                beyond[row] -= x[j]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def backward(p: Symbolic, A: Numbers, w: Share) -> None:
    """Find the unknowns of a share in `A.y` from those of the shares above it."""
    pivots, rows, first_row, panel = p.pivots, p.rows, p.first_row, p.panel
    factors, inverse, y, x = A.factors, A.inverse, A.y, w.x
    for number in range(w.fronts.shape[0] - 1, -1, -1):
        if w.held[number] >= 0:
            continue
        s = w.fronts[number]
        begin, own, at = first_row[s], pivots[s], panel[s]
        size, width = first_row[s + 1] - begin, pivots[s + 1] - own
        for j in range(size):
            x[j] = y[rows[begin + j]]
        for k in range(width - 1, -1, -1):
            u, part, total = factors[at + k * size + k + 1 : at + (k + 1) * size], x[k + 1 : size], 0.0
            for j in range(size - k - 1):
                total += u[j] * part[j]
            x[k] -= total * inverse[own + k]
            y[own + k] = x[k]


def add_beyond(p: Symbolic, A: Numbers, w: Share) -> None:
    """Add to `A.y` what a share found for rows of others."""
    last = w.fronts[-1]
    rows = p.rows[p.first_row[last] : p.first_row[last + 1]]
    rows = rows[rows >= w.end]
    A.y[rows] += w.beyond[rows]


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def solve_many(b: Array, p: Symbolic, A: Numbers, out: Array) -> None:
    """Write A^-1 b to `out`, both of shape (n, k): the factor is read once for all k columns."""
    order, pivots, rows, first_row, panel = p.order, p.pivots, p.rows, p.first_row, p.panel
    factors, inverse = A.factors, A.inverse
    n, k = b.shape
    y, x = np.empty((n, k)), np.empty((p.largest, k))
    for i in range(n):
        z, given = y[i], b[order[i]]
        for c in range(k):
            z[c] = given[c]
    for s in range(first_row.shape[0] - 1):
        begin, own, at = first_row[s], pivots[s], panel[s]
        size, width = first_row[s + 1] - begin, pivots[s + 1] - own
        x[:size] = 0.0
        for i in range(width):
            z, sums, d = y[own + i], x[i], inverse[own + i]
            for c in range(k):
                z[c] = (z[c] - sums[c]) * d
            for j in range(i + 1, size):
                u, part = factors[at + i * size + j], x[j]
                for c in range(k):
                    part[c] += u * z[c]
        for j in range(width, size):
            row, part = y[rows[begin + j]], x[j]
            for c in range(k):
                row[c] -= part[c]
    for s in range(first_row.shape[0] - 2, -1, -1):
        begin, own, at = first_row[s], pivots[s], panel[s]
        size, width = first_row[s + 1] - begin, pivots[s + 1] - own
        for i in range(width - 1, -1, -1):
            z, d = y[own + i], inverse[own + i]
            for j in range(i + 1, size):
                u, part = factors[at + i * size + j] * d, y[rows[begin + j]]
                for c in range(k):
                    z[c] -= u * part[c]
    for i in range(n):
        z, found = y[i], out[order[i]]
        for c in range(k):
            found[c] = z[c]
