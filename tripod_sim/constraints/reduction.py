"""Elimination of constraints: from nodal gradients and element matrices to the unknowns that remain.

Unknowns: the positions of free nodes, then six per rigid body: translation c and a rotation vector theta that
turns it from the left, x_i = c + r_i, dx_i = dc + theta x r_i. With g_i = dPhi/dx_i the reduced gradient is J^T g
and the reduced Hessian J^T H J plus, for a body, the second-order term of the rotation,

    sum_i sym(g_i r_i^T) - (g_i . r_i) I,

and for a driven frame with axis a through the lever r_i: d²x_i/d angle² = a x (a x r_i).

A free node that is held along some axes keeps three unknowns, so that nothing else has to tell it from other nodes: the
gradient is zero there, and the Hessian `PINNED` on the diagonal and zero beside it.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy import sparse

from tripod_host.arrays import Array, FloatArray, IndexArray
from tripod_sim.constraints.groups import Groups, Kind
from tripod_sim.errors import SceneError
from tripod_sim.linear.keys import distinct
from tripod_sim.rotation_kernels import cross, turned

FREE, RIGID, DRIVEN, FIXED = int(Kind.FREE), int(Kind.RIGID), int(Kind.DRIVEN), int(Kind.FIXED)


PINNED = 1e18
"""Stiffness of what is held along an axis [N/m]: no force that a body bears moves it by an atom."""


class Nodes(NamedTuple):
    """What kernels take of the nodes: kind and number of their groups and their first unknown, base, shape (n,).

    lever (n, 3): r_i of nodes of bodies and frames [m]; axes (s, 3): of the frames.
    """

    kind: Array
    number: Array
    base: Array
    lever: Array
    axes: Array


class Sums(NamedTuple):
    """What elements and nodes add to: `pattern.data`, `drive`, `drive_drive`, and a block (6, 6) of each body."""

    data: Array
    drive: Array
    drive_drive: Array
    body: Array


class Pairs(NamedTuple):
    """Where the blocks (3, 3) of pairs of free nodes of elements are added, on and above the diagonal.

    first (m + 1,): Where the pairs of each element begin; nodes (k, 2): three times the places of both in the element;
    starts (k, 3): where the columns of the block begin in `pattern.data`.
    """

    first: Array
    nodes: Array
    starts: Array


class Bound(NamedTuple):
    """Elements with nodes of bodies or frames, numbers (k,), and where they are added beside a body.

    starts (k, nodes, 6): where the columns of the element's body begin in `pattern.data` for each of its free nodes.
    """

    elements: Array
    starts: Array


class Reduction:
    """Maps between nodes and unknowns for one mesh and one set of groups.

    Attributes:
        lever: r_i of nodes of bodies and frames [m], shape (n, 3), which `write_levers` writes for a state.
        axes: Axis of each driven frame, shape (s, 3).
        unknowns: Number of unknowns n.
        pattern: Upper triangle of the reduced Hessian, scipy CSC; its `data` is what `hessian` writes.
        drive: Mixed derivatives with respect to unknowns and what is commanded: s driven angles, then a other
            actuators, whose columns the caller writes, shape (n, s + a).
        pinned: Unknowns of free nodes along axes along which they are held, shape (k,).
        drive_drive: Second derivatives with respect to what is commanded, shape (s + a, s + a).
    """

    def __init__(self, blocks: Sequence[IndexArray], groups: Groups) -> None:
        """`blocks`: node indices of elements, an array for each kind of element matrix; `groups`: all constraints."""
        self.kind, self.number = groups.kinds()
        free = np.flatnonzero(self.kind == FREE)
        self.bodies, self.driven = len(groups.rigid), len(groups.driven)
        self.free_count = len(free)
        self.unknowns = 3 * len(free) + 6 * self.bodies
        self.base = np.full(groups.size, -1, dtype=np.int64)
        self.base[free] = 3 * np.arange(len(free))
        rigid = self.kind == RIGID
        self.base[rigid] = 3 * len(free) + 6 * self.number[rigid]
        self.lever = np.zeros((groups.size, 3))
        self.axes = np.array([f.axis for f in groups.driven]).reshape(-1, 3)
        self._nodes = Nodes(self.kind, self.number, self.base, self.lever, self.axes)
        self.free, self.blocks = free, list(blocks)
        for block in self.blocks:
            of_body = np.where(self.kind[block] == RIGID, self.number[block], -1)
            two = ((of_body != of_body.max(axis=1, keepdims=True)) & (of_body >= 0)).any(axis=1)
            if two.any():
                e = np.flatnonzero(two)[0]
                raise SceneError(
                    f"element {e} touches two rigid parts (disc, fixed or driven nodes); refine the mesh between "
                    "them"
                )
        self.pattern, self._pairs, self._bound, self._body_slots, self._node_slots = self._symbolic()
        count = groups.commanded
        self.drive, self.drive_drive = np.zeros((self.unknowns, count)), np.zeros((count, count))
        body = np.zeros((max(self.bodies, 1), 6, 6))
        self._sums = Sums(self.pattern.data, self.drive, self.drive_drive, body)
        self.pinned = self.base[groups.pinned[:, 0]] + groups.pinned[:, 1]
        self._pinned = tuple(groups.pinned.T) if len(groups.pinned) else None
        column = np.repeat(np.arange(self.unknowns), np.diff(self.pattern.indptr))
        beside = np.isin(self.pattern.indices, self.pinned) | np.isin(column, self.pinned)
        self._beside = np.flatnonzero(beside)
        self._held = self._beside[self.pattern.indices[self._beside] == column[self._beside]]

    def _symbolic(self) -> tuple[sparse.csc_matrix, list[Pairs], list[Bound], IndexArray, IndexArray]:
        """Return the pattern and where in its data stand: pairs of nodes, bodies, diagonals of free nodes."""
        n, first = self.unknowns, 3 * self.free_count
        pairs = [self._pairs_of(elements) for elements in self.blocks]
        bound = [self._bound_of(elements) for elements in self.blocks]
        own = [np.arange(6 * b + first, 6 * b + first + 6) for b in range(self.bodies)]
        starts = [*(keys for *_, keys in pairs), *(keys for *_, keys in bound)]
        starts += [b[:, None] * n + b[::3] for b in own] or [np.zeros(0, dtype=np.int64)]
        keys = (distinct(np.concatenate([start.ravel() for start in starts]))[:, None] + np.arange(3)).ravel()
        keys = keys[keys % n <= keys // n]
        indptr = np.searchsorted(keys, np.arange(n + 1) * n)
        pattern = sparse.csc_matrix((np.ones(len(keys)), keys % n, indptr), shape=(n, n))

        def slot(key: IndexArray) -> IndexArray:
            return np.searchsorted(keys, key)

        bounds = [Bound(some, np.full((*beside.shape, 6), -1)) for some, beside, _ in bound]
        for there, (_, beside, start) in zip(bounds, bound, strict=True):
            there.starts[beside] = slot(start)
        return (
            pattern,
            [Pairs(begin, nodes, slot(start)) for begin, nodes, start in pairs],
            bounds,
            np.array([slot(b * n + b[0]) for b in own], dtype=np.int64).reshape(-1, 6),
            slot((np.arange(first) * (n + 1)).reshape(-1, 3)),
        )

    def _pairs_of(self, elements: IndexArray) -> tuple[IndexArray, IndexArray, IndexArray]:
        """Return the free pairs of elements, as in `Pairs`, with n column + row for where they start, shape (k, 3)."""
        base, free = self.base[elements], self.kind[elements] == FREE
        above = base[:, :, None] <= base[:, None, :]
        e, a, b = np.nonzero(free[:, :, None] & free[:, None, :] & above)
        keys = (base[e, b][:, None] + np.arange(3)) * self.unknowns + base[e, a][:, None]
        return np.searchsorted(e, np.arange(len(elements) + 1)), 3 * np.column_stack([a, b]), keys

    def _bound_of(self, elements: IndexArray) -> tuple[IndexArray, IndexArray, IndexArray]:
        """Return the elements at bodies and frames, which of their nodes are free beside a body, and where these begin.

        That is n column + row for the columns of the body, shape (nodes beside one, 6).
        """
        kind = self.kind[elements]
        some = np.flatnonzero(((kind == RIGID) | (kind == DRIVEN)).any(axis=1))
        base, kind = self.base[elements[some]], kind[some]
        body = np.where(kind == RIGID, base, -1).max(axis=1)
        beside = (kind == FREE) & (body >= 0)[:, None]
        keys = (body[np.nonzero(beside)[0]][:, None] + np.arange(6)) * self.unknowns + base[beside][:, None]
        return some, beside, keys

    def gradient(self, g: FloatArray, out: FloatArray, torque: FloatArray) -> None:
        """Write the reduced gradient J^T g.

        Args:
            g: Nodal gradient [N], shape (nodes, 3).
            out: Reduced gradient [N, N m], shape (unknowns,).
            torque: Derivative with respect to each driven angle [N m], shape (s,).
        """
        _gradient(g, self.lever, self.axes, self.kind, self.number, self.base, out, torque)
        if self._pinned:
            out[self.pinned] = 0.0

    def relieve(
        self, residual: FloatArray, weight: FloatArray, dx: FloatArray, change: FloatArray, g: FloatArray
    ) -> float:
        """Take off forces what is unbalanced after a move; return the work that they resist with on the way [J].

        The levers are those from the mean of each body's nodes.

        Free nodes and those of bodies lose the residual and weight dx; of a body's residual F, T each of
        its n nodes has F / n + t x r, where t makes T = sum r x (t x r). Driven and fixed nodes gain `change`.

        Args:
            residual: Reduced gradient [N, N m], shape (unknowns,).
            weight: Isotropic nodal stiffness [N/m], shape (nodes,).
            dx: The move [m], shape (nodes, 3).
            change: [N], shape (nodes, 3).
            g: The forces as a gradient [N], shape (nodes, 3), changed.
        """
        first = 3 * self.free_count
        return float(
            _relieve(
                residual, weight, dx, change, self.lever, self.kind, self.number, self.base, first, self.bodies,
                g,
            )
        )  # fmt: skip

    def hessian(
        self, parts: Sequence[tuple[int, FloatArray, float]], mass: FloatArray, g: FloatArray
    ) -> None:
        """Write the reduced Hessian into `pattern.data`, `drive` and `drive_drive`.

        Args:
            parts: What is added up: number of a block, its element matrices [N/m], shape (m, 3 nodes, 3 nodes), and
                their common factor.
            mass: Isotropic nodal term [N/m] (mass over dt², or zero), shape (nodes,).
            g: Nodal gradient [N] of the whole potential, for the second-order terms.
        """
        for out in self._sums:
            out[:] = 0.0
        for block, matrices, factor in parts:
            _add_pairs(matrices, factor, self._pairs[block], self.pattern.data)
            _add_bound(matrices, factor, self._nodes, self.blocks[block], self._bound[block], self._sums)
        _add_nodes(mass, g, self._nodes, self._body_slots, self._node_slots, self.free, self._sums)
        if self._pinned:
            self.pattern.data[self._beside] = 0.0
            self.pattern.data[self._held] = PINNED
            self.drive[self.pinned] = 0.0

    def moves(self, solution: FloatArray, lever: FloatArray, out: FloatArray) -> None:
        """Write the first-order move of free and rigid nodes for a step of the unknowns; of what is held it stays."""
        held = out[self._pinned] if self._pinned else None
        _moves(solution, lever, self.kind, self.base, out)
        if self._pinned:
            out[self._pinned] = held

    def unknown_name(self, index: int) -> str:
        """Return in words what the unknown `index` belongs to."""
        if index < 3 * self.free_count:
            return f"node {self.free[index // 3]}"
        return f"rigid body {(index - 3 * self.free_count) // 6}"


@njit(cache=True, error_model="numpy")
def _gradient(
    g: Array, lever: Array, axes: Array, kind: Array, number: Array, base: Array, out: Array, torque: Array
) -> None:
    moment = np.empty(3)
    out[:] = 0.0
    torque[:] = 0.0
    for n in range(g.shape[0]):
        if kind[n] == FREE:
            for i in range(3):
                out[base[n] + i] += g[n, i]
        elif kind[n] == FIXED:
            continue
        else:
            cross(lever[n], g[n], moment)
            if kind[n] == RIGID:
                for i in range(3):
                    out[base[n] + i] += g[n, i]
                    out[base[n] + 3 + i] += moment[i]
            else:
                a = axes[number[n]]
                torque[number[n]] += a[0] * moment[0] + a[1] * moment[1] + a[2] * moment[2]


@njit(cache=True, error_model="numpy")
def _relieve(
    residual: Array,
    weight: Array,
    dx: Array,
    change: Array,
    lever: Array,
    kind: Array,
    number: Array,
    base: Array,
    first: int,
    bodies: int,
    g: Array,
) -> float:
    sizes, J, turn, part = np.zeros(bodies), np.zeros((bodies, 3, 3)), np.zeros((bodies, 3)), np.empty(3)
    for n in range(g.shape[0]):
        if kind[n] == RIGID:
            r, b = lever[n], number[n]
            sizes[b] += 1
            for i in range(3):
                for j in range(3):
                    J[b, i, j] -= r[i] * r[j]
                J[b, i, i] += r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    for b in range(bodies):
        for i in range(3):  # Cramer's rule; J is symmetric
            k, m = (i + 1) % 3, (i + 2) % 3
            for j in range(3):
                p, q = (j + 1) % 3, (j + 2) % 3
                minor = J[b, k, p] * J[b, m, q] - J[b, k, q] * J[b, m, p]
                turn[b, j] += minor * residual[first + 6 * b + 3 + i]
        x, y, z = J[b, 0], J[b, 1], J[b, 2]
        determinant = (
            x[0] * (y[1] * z[2] - y[2] * z[1])
            - x[1] * (y[0] * z[2] - y[2] * z[0])
            + x[2] * (y[0] * z[1] - y[1] * z[0])
        )
        for j in range(3):
            turn[b, j] /= determinant
    work = 0.0
    for n in range(g.shape[0]):
        for i in range(3):
            part[i] = -weight[n] * dx[n, i]
        if kind[n] == FREE:
            for i in range(3):
                part[i] -= residual[base[n] + i]
        elif kind[n] == RIGID:
            r, b, t = lever[n], number[n], turn[number[n]]
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                part[i] -= residual[first + 6 * b + i] / sizes[b] + t[j] * r[k] - t[k] * r[j]
        else:
            for i in range(3):
                part[i] = change[n, i]
        for i in range(3):
            work += (g[n, i] + 0.5 * part[i]) * dx[n, i]
            g[n, i] += part[i]
    return work


@njit(cache=True, error_model="numpy")
def _moves(solution: Array, lever: Array, kind: Array, base: Array, out: Array) -> None:
    for n in range(out.shape[0]):
        if kind[n] == FREE:
            for i in range(3):
                out[n, i] = solution[base[n] + i]
        elif kind[n] == RIGID:
            r, c, w = lever[n], solution[base[n] : base[n] + 3], solution[base[n] + 3 : base[n] + 6]
            out[n, 0] = c[0] + w[1] * r[2] - w[2] * r[1]
            out[n, 1] = c[1] + w[2] * r[0] - w[0] * r[2]
            out[n, 2] = c[2] + w[0] * r[1] - w[1] * r[0]


@njit(cache=True, error_model="numpy")
def write_levers(
    x: Array,
    centres: Array,
    hubs: Array,
    inward: Array,
    slide: float,
    kind: Array,
    number: Array,
    lever: Array,
) -> None:
    """Write r_i to `lever` (n, 3): from the centre of a node's body, or from a point on the axis of its frame.

    Args:
        x: Positions [m], shape (n, 3).
        centres: Of the bodies [m], shape (b, 3).
        hubs, inward: A point on each frame's axis before sliding [m], and its direction of sliding, shape (s, 3).
        slide: How far all frames have slid [m].
        kind, number: Of nodes, as `Groups.kinds` returns them.
        lever: Output; free and fixed nodes are left alone.
    """
    for n in range(x.shape[0]):
        if kind[n] == RIGID:
            for i in range(3):
                lever[n, i] = x[n, i] - centres[number[n], i]
        elif kind[n] == DRIVEN:
            for i in range(3):
                lever[n, i] = x[n, i] - hubs[number[n], i] - slide * inward[number[n], i]


@njit(cache=True, error_model="numpy")
def swing_nodes(
    nodes: Array,
    frame: Array,
    centre: Array,
    along: Array,
    across: Array,
    inward: Array,
    slide: float,
    joints: Array,
    x: Array,
) -> None:
    """Put nodes of driven frames where `joints` has them: c + u cos(angle) + w sin(angle) + slide inward.

    Args:
        nodes: Shape (k,).
        frame: Of each of these nodes, shape (k,).
        centre, along, across: c, u and w of each [m], shape (k, 3).
        inward: Direction of the slide, shape (k, 3).
        slide: How far all frames have slid [m].
        joints: Angle of each frame first [rad].
        x: Positions of all nodes [m], shape (n, 3), written for `nodes`.
    """
    for k in range(nodes.shape[0]):
        cosine, sine = math.cos(joints[frame[k]]), math.sin(joints[frame[k]])
        for i in range(3):
            x[nodes[k], i] = centre[k, i] + cosine * along[k, i] + sine * across[k, i] + slide * inward[k, i]


@njit(cache=True, error_model="numpy")
def move_bodies(
    centres: Array,
    rotations: Array,
    scale: float,
    solution: Array,
    first: int,
    out_centres: Array,
    out_rotations: Array,
) -> None:
    """Write where `scale` times a step puts the bodies: c + scale u, and exp([scale w]x) R.

    Args:
        centres, rotations: Where they are [m], shape (b, 3), and matrices, shape (b, 3, 3).
        scale: Fraction of the step.
        solution: The step: from `first` on u [m] and w [rad] of the first bodies; others are left alone.
        first: Of the bodies' unknowns.
        out_centres, out_rotations: The results; not the arrays that they are made of.
    """
    turn = np.empty(3)
    for b in range((solution.shape[0] - first) // 6):
        k = first + 6 * b
        for i in range(3):
            out_centres[b, i], turn[i] = centres[b, i] + scale * solution[k + i], scale * solution[k + 3 + i]
        turned(turn, rotations[b], out_rotations[b])


@njit(cache=True, error_model="numpy")
def move_nodes(
    start: Array,
    scale: float,
    dx: Array,
    centres: Array,
    rotations: Array,
    arm: Array,
    kind: Array,
    number: Array,
    out: Array,
) -> None:
    """Write to `out` (n, 3) start + scale dx of free nodes and c + R arm of nodes of bodies; others are left alone."""
    for n in range(start.shape[0]):
        if kind[n] == FREE:
            for i in range(3):
                out[n, i] = start[n, i] + scale * dx[n, i]
        elif kind[n] == RIGID:
            R = rotations[number[n]]
            for i in range(3):
                turned = R[i, 0] * arm[n, 0] + R[i, 1] * arm[n, 1] + R[i, 2] * arm[n, 2]
                out[n, i] = centres[number[n], i] + turned


@njit(cache=True, error_model="numpy", inline="always")
def _jacobian(kind: int, r: Array, axes: Array, number: int, J: Array) -> int:
    """Write dx of a node by its body's motion, [I, -[r]x], or by its frame's angle, a x r; return how many."""
    if kind == RIGID:
        J[:] = 0.0
        J[0, 0] = J[1, 1] = J[2, 2] = 1.0
        J[0, 4], J[0, 5] = r[2], -r[1]
        J[1, 3], J[1, 5] = -r[2], r[0]
        J[2, 3], J[2, 4] = r[1], -r[0]
        return 6
    cross(axes[number], r, J[:, 0])
    return 1


@njit(cache=True, error_model="numpy")
def _add_pairs(stiffness: Array, factor: float, pairs: Pairs, data: Array) -> None:
    """Add the blocks of pairs of free nodes; element matrices are symmetric, so rows stand for columns."""
    first, nodes, starts = pairs
    for e in range(stiffness.shape[0]):
        K = stiffness[e]
        for p in range(first[e], first[e + 1]):
            a, b = nodes[p]
            for c in range(3):
                start = starts[p, c]
                for i in range(3 if a != b else c + 1):
                    data[start + i] += factor * K[b + c, a + i]


@njit(cache=True, error_model="numpy")
def _add_bound(
    stiffness: Array, factor: float, nodes: Nodes, elements: Array, bound: Bound, sums: Sums
) -> None:
    """Add what elements have in columns of bodies and frames: of an element each body or frame once."""
    kind, number = nodes.kind, nodes.number
    size = elements.shape[1]
    W, todo = np.empty((6, 3 * size)), np.empty(size, np.bool_)
    for k in range(bound.elements.shape[0]):
        e = bound.elements[k]
        todo[:] = True
        for b in range(size):
            n = elements[e, b]
            if not todo[b] or (kind[n] != RIGID and kind[n] != DRIVEN):
                continue
            W[: 6 if kind[n] == RIGID else 1] = 0.0
            for c in range(b, size):
                m = elements[e, c]
                if kind[m] == kind[n] and number[m] == number[n]:
                    _add_columns(stiffness[e], 3 * c, m, nodes, W)
                    todo[c] = False
            _add_rows(W, factor, n, nodes, elements[e], bound.starts[k], sums)


@njit(cache=True, error_model="numpy")
def _add_columns(K: Array, column: int, node: int, nodes: Nodes, W: Array) -> None:
    """Add K J of a node's three columns, as rows; J as in `_jacobian`."""
    r = nodes.lever[node]
    k0, k1, k2 = K[column], K[column + 1], K[column + 2]
    if nodes.kind[node] == DRIVEN:
        J = np.empty(3)
        cross(nodes.axes[nodes.number[node]], r, J)
        for i in range(K.shape[0]):
            W[0, i] += J[0] * k0[i] + J[1] * k1[i] + J[2] * k2[i]
        return
    for i in range(K.shape[0]):
        W[0, i] += k0[i]
        W[1, i] += k1[i]
        W[2, i] += k2[i]
        W[3, i] += r[1] * k2[i] - r[2] * k1[i]
        W[4, i] += r[2] * k0[i] - r[0] * k2[i]
        W[5, i] += r[0] * k1[i] - r[1] * k0[i]


@njit(cache=True, error_model="numpy")
def _add_rows(
    W: Array, factor: float, of: int, nodes: Nodes, element: Array, starts: Array, sums: Sums
) -> None:
    """Add factor J^T W of an element, W in the columns of the body or frame that the node `of` belongs to."""
    kind, number, base, lever, axes = nodes
    data, drive, drive_drive, body = sums
    J = np.empty((3, 6))
    column, rigid = number[of], kind[of] == RIGID
    for a in range(element.shape[0]):
        n = element[a]
        if kind[n] == FIXED or (rigid and kind[n] == DRIVEN):
            continue
        if kind[n] != FREE:
            high = _jacobian(kind[n], lever[n], axes, number[n], J)
        for c in range(6 if rigid else 1):
            w0, w1, w2 = factor * W[c, 3 * a], factor * W[c, 3 * a + 1], factor * W[c, 3 * a + 2]
            if kind[n] == FREE:
                if rigid:
                    start = starts[a, c]
                    data[start] += w0
                    data[start + 1] += w1
                    data[start + 2] += w2
                else:
                    drive[base[n], column] += w0
                    drive[base[n] + 1, column] += w1
                    drive[base[n] + 2, column] += w2
                continue
            for r in range(high):
                value = J[0, r] * w0 + J[1, r] * w1 + J[2, r] * w2
                if rigid:
                    body[column, r, c] += value
                elif kind[n] == RIGID:
                    drive[base[n] + r, column] += value
                else:
                    drive_drive[number[n], column] += value


@njit(cache=True, error_model="numpy")
def _add_nodes(
    mass: Array, g: Array, nodes: Nodes, body_slots: Array, node_slots: Array, free: Array, sums: Sums
) -> None:
    """Add the nodal terms and the second-order terms of rotations, and put the bodies' own blocks into `data`."""
    kind, number, _, lever, axes = nodes
    data, _, drive_drive, body = sums
    J = np.empty((3, 6))
    for k in range(free.shape[0]):
        for i in range(3):
            data[node_slots[k, i]] += mass[free[k]]
    for n in range(g.shape[0]):
        if kind[n] == RIGID:
            r, f, D = lever[n], g[n], body[number[n]]
            _jacobian(RIGID, r, axes, number[n], J)
            for k in range(6):
                for c in range(6):
                    D[k, c] += mass[n] * (J[0, k] * J[0, c] + J[1, k] * J[1, c] + J[2, k] * J[2, c])
            dot = f[0] * r[0] + f[1] * r[1] + f[2] * r[2]
            for k in range(3):
                for c in range(3):
                    D[3 + k, 3 + c] += 0.5 * (f[k] * r[c] + f[c] * r[k])
                D[3 + k, 3 + k] -= dot
        elif kind[n] == DRIVEN:
            a3, r, f, s = axes[number[n]], lever[n], g[n], number[n]
            along = a3[0] * r[0] + a3[1] * r[1] + a3[2] * r[2]
            for i in range(3):
                across = a3[i] * along - r[i]  # a x (a x r)
                drive_drive[s, s] += f[i] * across + mass[n] * across * across
    for b in range(body_slots.shape[0]):
        for c in range(6):
            for k in range(c + 1):
                data[body_slots[b, c] + k] += body[b, k, c]
