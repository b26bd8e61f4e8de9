"""Symbolic analysis of a multifrontal factorisation: order, supernodes and where every number goes. Done once.

A supernode is a run of pivots whose columns of L have (nearly) the same rows; it becomes one dense front, in which its
pivots are eliminated and whose remainder is added to the front of its parent in the elimination tree [DuffReid1983].
"""

from functools import lru_cache
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
import qdldl
from scipy import sparse

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.linear.elimination import columns_of_factor
from tripod_sim.linear.keys import distinct

WIDE = 42
"""Pivots up to which a front is merged with its parent at the price of some zeros."""

DISSECTED = 3000
"""Blocks of a pattern from which nested dissection is faster: 1.4 to 2 times for 10,000 to 80,000 unknowns of t4."""

SMALL = 500_000
"""Entries of a pattern up to which its plan is kept for whoever builds the same system again."""

SHARED = 1_000_000
"""Entries of L from which subtrees are computed at the same time: a solution then takes 2 ms."""

PIECES, LEAST = 8, 20_000
"""A subtree is at most so small a part of the whole, and no smaller than so many entries: what is less is not handed
out."""

WASTE = 0.15
"""Zeros that such a merged front may hold, as a share of its panel."""


class Symbolic(NamedTuple):
    """The plan of a factorisation of one pattern, for f fronts.

    Attributes:
        order: order[k] is the unknown eliminated as number k, shape (n,).
        pivots: First pivot of each front; the last entry is n, shape (f + 1,).
        rows: Row numbers (in elimination order) of all fronts, own pivots first, one after the other.
        first_row: Where those of a front begin in `rows`, shape (f + 1,).
        panel: Where the panel of a front, pivots x rows, begins in the factor, shape (f + 1,).
        parent: Front that takes the remainder; -1 for a root, shape (f,).
        place: Position in the parent's front of each entry of `rows`; unused for own pivots.
        target: Position in its front (row * size + column) of each entry of the pattern, entries sorted by front.
        source: Entry of the pattern that goes there.
        first_entry: Where the entries of a front begin in `source`, shape (f + 1,).
        subtrees: Runs of fronts that are computed at the same time, first and after the last, shape (k, 2): subtrees of
            the elimination, of which the last front is the root. They depend on the pattern alone.
        largest: Rows of the largest front.
    """

    order: IndexArray
    pivots: IndexArray
    rows: IndexArray
    first_row: IndexArray
    panel: IndexArray
    parent: IndexArray
    place: IndexArray
    target: IndexArray
    source: IndexArray
    first_entry: IndexArray
    subtrees: IndexArray
    largest: int


def analyse(pattern: sparse.csc_matrix) -> Symbolic:
    """Return the plan for a symmetric matrix given by its upper triangle (CSC, with a full diagonal).

    Those of the last few patterns are kept: nobody writes into them.
    """
    if pattern.nnz > SMALL:
        return _analysed(pattern)
    return _plan(pattern.indptr.astype(np.int64).tobytes(), pattern.indices.astype(np.int64).tobytes())


@lru_cache(maxsize=16)
def _plan(of_indptr: bytes, of_indices: bytes) -> Symbolic:
    indptr, indices = np.frombuffer(of_indptr, np.int64), np.frombuffer(of_indices, np.int64)
    size = len(indptr) - 1
    return _analysed(sparse.csc_matrix((np.ones(len(indices)), indices, indptr), shape=(size, size)))


def _analysed(pattern: sparse.csc_matrix) -> Symbolic:
    blocks, step = _blocks_of(pattern)
    order, columns = _little_fill(blocks)
    parent = np.array([c[0] if len(c) else -1 for c in columns], dtype=np.int64)
    post = _postorder(parent)
    number = np.empty(len(order), dtype=np.int64)
    number[post] = np.arange(len(order))
    columns = [np.sort(number[columns[k]]) for k in post]  # renumbered within the same elimination tree
    inner = np.arange(step)
    order = (step * order[post][:, None] + inner).ravel()
    n = len(order)
    fronts = [
        (step * last + step - 1, (step * below[:, None] + inner).ravel())
        for last, below in _supernodes(columns, WIDE // step)
    ]
    pivots = np.array([0, *[last + 1 for last, _ in fronts]], dtype=np.int64)
    lists = [
        np.concatenate([np.arange(pivots[s], pivots[s + 1]), below]) for s, (_, below) in enumerate(fronts)
    ]
    sizes = np.array([len(r) for r in lists], dtype=np.int64)
    first_row = np.concatenate([[0], np.cumsum(sizes)])
    panel = np.concatenate([[0], np.cumsum(np.diff(pivots) * sizes)])
    front_of = np.repeat(np.arange(len(fronts)), np.diff(pivots))
    above = np.array([front_of[below[0]] if len(below) else -1 for _, below in fronts], dtype=np.int64)
    place = np.full(first_row[-1], -1, dtype=np.int64)
    for s, (_, below) in enumerate(fronts):
        if len(below):
            place[first_row[s + 1] - len(below) : first_row[s + 1]] = np.searchsorted(lists[above[s]], below)
    # entries of the pattern: the earlier pivot of the two names the front and the row in it
    rank = np.empty(n, dtype=np.int64)
    rank[order] = np.arange(n)
    a, b = rank[pattern.indices], rank[np.repeat(np.arange(n), np.diff(pattern.indptr))]
    low, high = np.minimum(a, b), np.maximum(a, b)
    owner = front_of[low]
    source = np.argsort(owner, kind="stable")
    target = np.empty(len(source), dtype=np.int64)
    first_entry = np.searchsorted(owner[source], np.arange(len(fronts) + 1))
    for s, r in enumerate(lists):
        part = slice(first_entry[s], first_entry[s + 1])
        e = source[part]
        target[part] = (low[e] - pivots[s]) * sizes[s] + np.searchsorted(r, high[e])
    return Symbolic(
        order, pivots, np.concatenate(lists), first_row, panel, above, place, target, source, first_entry,
        _subtrees(above, np.diff(panel)), int(sizes.max()),
    )  # fmt: skip


def operations(plan: Symbolic) -> FloatArray:
    """Return how many multiplications and additions each front takes, shape (f,)."""
    height, width = np.diff(plan.first_row).astype(float), np.diff(plan.pivots).astype(float)
    return width * height**2 - width**2 * height + width**3 / 3


def deepest(plan: Symbolic, fronts: IndexArray) -> int:
    """Return how many numbers the remainders of `fronts`, ascending, take at most that are not yet added."""
    sizes, own = np.diff(plan.first_row), set(fronts.tolist())
    remainders = ((sizes - np.diff(plan.pivots)) ** 2).tolist()
    depth = most = 0
    held: dict[int, int] = {}  # what children of a front left
    for s in fronts.tolist():
        depth += remainders[s] - held.pop(s, 0)
        most = max(most, depth)
        if (above := int(plan.parent[s])) in own:
            held[above] = held.get(above, 0) + remainders[s]
    return int(most)


def _subtrees(parent: IndexArray, entries: IndexArray) -> IndexArray:
    """Return the subtrees to be computed at the same time (see `Symbolic`), of fronts with as many `entries` of L."""
    total, first = entries.copy(), np.arange(len(parent))
    for s, above in enumerate(parent.tolist()):  # children come before their parents
        if above >= 0:
            total[above] += total[s]
            first[above] = min(first[above], first[s])
    whole = int(entries.sum())
    if whole < SHARED:
        return np.zeros((0, 2), dtype=np.int64)
    small = total <= whole / PIECES
    above = np.where(parent >= 0, parent, 0)
    roots = np.flatnonzero(small & (parent >= 0) & ~small[above] & (total >= LEAST))
    return np.stack([first[roots], roots + 1], axis=1)


def _blocks_of(pattern: sparse.csc_matrix) -> tuple[sparse.csc_matrix, int]:
    """Return the pattern of the blocks, upper triangle, and their size: 3 where all are full, else 1."""
    n = pattern.shape[0]
    columns = np.repeat(np.arange(n), np.diff(pattern.indptr))
    keys = distinct(columns // 3 * n + pattern.indices // 3)
    step = 3 if n % 3 == 0 and pattern.nnz == 9 * len(keys) - n else 1
    if step == 1:
        keys = columns * n + pattern.indices
    size = n // step
    return sparse.csc_matrix((np.full(len(keys), -1.0), (keys % n, keys // n)), shape=(size, size)), step


def _little_fill(blocks: sparse.csc_matrix) -> tuple[IndexArray, list[IndexArray]]:
    """Return an order of little fill and the rows below the diagonal of L's columns.

    Large patterns are ordered by nested dissection (METIS [KarypisKumar1998]) where that is installed, all others by
    AMD as QDLDL computes it, which cannot but factor what it orders.
    """
    size = blocks.shape[0]
    if size >= DISSECTED and find_spec("pymetis"):
        return _dissected(blocks)
    upper = blocks.copy()
    upper.setdiag(size + 1.0)  # dominant, so that no pivot vanishes
    upper.sort_indices()
    lower, _, order = qdldl.Solver(upper, upper=True).factors()
    indices, indptr = lower.indices.astype(np.int64), lower.indptr
    below = [np.sort(indices[indptr[k] : indptr[k + 1]]) for k in range(size)]
    return np.asarray(order, dtype=np.int64), below


def _dissected(blocks: sparse.csc_matrix) -> tuple[IndexArray, list[IndexArray]]:
    """As `_little_fill`, by nested dissection."""
    from pymetis import CSRAdjacency, nested_dissection  # noqa: PLC0415 - optional, for large meshes

    apart = sparse.triu(blocks, 1)
    both = (apart + apart.T).tocsr()
    found, _ = nested_dissection(CSRAdjacency(both.indptr, both.indices))
    order = np.asarray(found, dtype=np.int64)
    upper = sparse.triu(both[order][:, order], 1).tocsc()
    indptr, rows = columns_of_factor(upper.indptr.astype(np.int64), upper.indices.astype(np.int64))
    return order, np.split(rows, indptr[1:-1])


def _postorder(parent: IndexArray) -> IndexArray:
    """Return an order of the forest in which every subtree is contiguous and ends with its root."""
    children: list[list[int]] = [[] for _ in parent]
    stack = []
    for k, p in enumerate(parent.tolist()):
        if p < 0:
            stack.append(k)
        else:
            children[p].append(k)
    post = []
    while stack:  # parents first; reversed at the end
        k = stack.pop()
        post.append(k)
        stack.extend(children[k])
    return np.array(post[::-1], dtype=np.int64)


def _supernodes(columns: list[IndexArray], wide: int) -> list[tuple[int, IndexArray]]:
    """Return for each supernode its last pivot and the rows below it; `wide`: see WIDE, in rows of these columns."""
    done: list[tuple[int, int, IndexArray, int]] = []  # first and last pivot, rows below, zeros held
    for k, column in enumerate(columns):
        head = (k, k, column, 0)
        while (
            done and len(done[-1][2]) and done[-1][2][0] == head[0]
        ):  # the front before is a child of this one
            first, last, below, held = done[-1]
            width, own = last - first + 1, head[1] - head[0] + 1
            zeros = held + head[3] + width * (own + len(head[2]) - len(below))
            if zeros > WASTE * (width + own) * (width + own + len(head[2])) or (zeros and width + own > wide):
                break
            head = (first, head[1], head[2], zeros)
            done.pop()
        done.append(head)
    return [(last, below) for _, last, below, _ in done]
