"""The contacts of one step: arrays that grow, never overflow."""

from typing import NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put

KIND, FIRST = 60, 30
"""Bits of a key below its kind, and below its first shape."""


class Contacts(NamedTuple):
    """Contacts as kernels take them, first come first.

    A contact presses side A of at most four vertices (weights positive) from side B (negative, summing to -1) along its
    normal, which points from B to A. To first order its gap is n . sum_k w_k x_k - offset.

    vertex: shape (c, 4); weight: (c, 4), sums to zero; normal: n, (c, 3); offset: required distance [m], (c,);
    key: what touches what, the same from step to step, (c,); pressure: normal force [N], (c,);
    friction: tangential force on A [N], (c, 3); limit: largest friction [N] of the present iteration, (c,);
    stiffness: rho of normal and tangential direction [N/m], (c, 2); gain: how much penalty
    has stiffened, (c,); gap: at the start of the step [m], (c,); drift: t_0 of `response_kernels` [m], (c, 3);
    base: first unknown of each row block, -1 for none, (c, 4); lump: its weight, (c, 4);
    moment: sum of w r of the vertices of a rigid body [m], (c, 4, 3); width: 3 (node) or 6 (rigid body), (c, 4).
    """

    vertex: Array
    weight: Array
    normal: Array
    offset: Array
    key: Array
    pressure: Array
    friction: Array
    limit: Array
    stiffness: Array
    gain: Array
    gap: Array
    drift: Array
    base: Array
    lump: Array
    moment: Array
    width: Array


def allocate(capacity: int) -> Contacts:
    """Return room for `capacity` contacts."""
    c = capacity
    return Contacts(
        np.zeros((c, 4), dtype=np.int64), np.zeros((c, 4)), np.zeros((c, 3)), np.zeros(c),
        np.zeros(c, dtype=np.int64), np.zeros(c), np.zeros((c, 3)), np.zeros(c), np.zeros((c, 2)),
        np.ones(c), np.zeros(c), np.zeros((c, 3)),
        np.full((c, 4), -1, dtype=np.int64), np.zeros((c, 4)), np.zeros((c, 4, 3)), np.zeros((c, 4), dtype=np.int64),
    )  # fmt: skip


class ContactSet:
    """A growing list of contacts.

    Attributes:
        arrays: The room; only the first `count` entries count.
        count: Of contacts.
    """

    def __init__(self) -> None:
        self.arrays, self.count = allocate(256), 0

    def reserve(self, capacity: int) -> None:
        """Make room for at least `capacity` contacts; those there are stay."""
        if capacity > len(self.arrays.key):
            larger = allocate(capacity + capacity // 2)
            for old, new in zip(self.arrays, larger, strict=True):
                new[: self.count] = old[: self.count]
            self.arrays = larger

    def unique(self) -> None:
        """Of contacts of one key keep the last, with the forces of the first."""
        self.count = drop_repeated(self.arrays, self.count)


@njit(cache=True, error_model="numpy", inline="always")
def copy(a: Contacts, i: int, b: Contacts, j: int) -> None:
    """Copy contact i of `a` to place j of `b`: what detection wrote, and the forces."""
    for k in range(4):
        b.vertex[j, k], b.weight[j, k] = a.vertex[i, k], a.weight[i, k]
    for k in range(3):
        b.normal[j, k], b.friction[j, k] = a.normal[i, k], a.friction[i, k]
    b.offset[j], b.key[j] = a.offset[i], a.key[i]
    b.pressure[j], b.gain[j] = a.pressure[i], a.gain[i]


@njit(cache=True, error_model="numpy")
def drop_repeated(c: Contacts, count: int) -> int:
    """Of contacts of one key keep the last, in its order, with the forces of the first; return how many are left."""
    order = np.argsort(c.key[:count], kind="mergesort")
    keep = np.ones(count, dtype=np.bool_)
    for i in range(1, count):
        a, b = order[i - 1], order[i]
        if c.key[a] == c.key[b]:
            keep[a] = False
            c.pressure[b] = c.pressure[a]
            put(c.friction[b], c.friction[a])
            c.gain[b] = c.gain[a]
    left = 0
    for i in range(count):
        if keep[i]:
            if left < i:
                copy(c, i, c, left)
            left += 1
    return left


@njit(cache=True, error_model="numpy")
def inherit(old: Contacts, old_count: int, new: Contacts, new_count: int) -> None:
    """Give contacts the forces of old ones of the same key; else those of one that has ended, of the same first shape.

    So a vertex that slides from one triangle to the next keeps its force. The friction of an old contact is turned into
    the tangential plane of the new one. Others have no force.
    """
    one = np.argsort(old.key[:old_count], kind="mergesort")
    keys = old.key[:old_count][one]
    left = np.ones(old_count, dtype=np.bool_)
    heir = np.full(new_count, -1, dtype=np.int64)
    for b in range(new_count):
        new.pressure[b] = 0.0
        new.friction[b] = 0.0
        new.gain[b] = 1.0
        i = np.searchsorted(keys, new.key[b])
        if i < old_count and keys[i] == new.key[b]:
            heir[b] = one[i]
            left[one[i]] = False
    for b in range(new_count):
        if heir[b] < 0:
            heir[b] = _ended(old, one, keys, left, new, b)
        a = heir[b]
        if a >= 0:
            new.pressure[b], new.gain[b] = old.pressure[a], old.gain[a]
            f, n = old.friction[a], new.normal[b]
            along = f[0] * n[0] + f[1] * n[1] + f[2] * n[2]
            for k in range(3):
                new.friction[b, k] = f[k] - along * n[k]


@njit(cache=True, error_model="numpy")
def _ended(old: Contacts, one: Array, keys: Array, left: Array, new: Contacts, b: int) -> int:
    """Return an old contact of the same first shape as new contact b, nearly the same normal and no heir; or -1."""
    kind = new.key[b] >> KIND
    first = (new.key[b] >> FIRST) & ((1 << (KIND - FIRST)) - 1)
    best, closest = -1, 0.9
    for k in range(3, 4) if kind == 3 else range(3):
        prefix = (k << KIND) | (first << FIRST)
        i = np.searchsorted(keys, prefix)
        while i < len(keys) and keys[i] >> FIRST == prefix >> FIRST:
            a = one[i]
            if left[a] and old.pressure[a] > 0.0:
                cosine = 0.0
                for j in range(3):
                    cosine += old.normal[a, j] * new.normal[b, j]
                if cosine > closest:
                    best, closest = a, cosine
            i += 1
    if best >= 0:
        left[best] = False
    return best
