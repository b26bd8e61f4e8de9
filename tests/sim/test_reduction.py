"""The reduced gradient, Hessian and moves, entry by entry, against the product with a Jacobian written by hand."""

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial.transform import Rotation

from tripod_sim.constraints.groups import DrivenFrame, Groups
from tripod_sim.constraints.reduction import PINNED, Reduction, move_bodies, write_levers

RNG = np.random.default_rng(3)
BODIES = (np.array([4, 9, 1]), np.array([16, 11, 14, 12]))
DRIVEN = (np.array([0, 7, 5]), np.array([13, 3, 8]))
FIXED, PINS = np.array([10]), np.array([[2, 1], [15, 0], [15, 2]])
SIZE = 19
ELEMENTS = [
    np.array([[4, 2, 0, 13], [9, 6, 10, 2], [16, 15, 3, 7], [12, 11, 18, 5]]),
    np.array([[1, 17], [8, 0]]),
]
"""Of four nodes and of two: they touch every kind of node beside every other, but no two bodies."""

AXES = np.array([Rotation.random(random_state=i).apply([1.0, 0.0, 0.0]) for i in range(2)])
MATRICES = [
    m + m.transpose(0, 2, 1) for m in (RNG.standard_normal((4, 12, 12)), RNG.standard_normal((2, 6, 6)))
]
FACTORS = (0.7, 1.3)
MASS, FORCE, X = RNG.uniform(1, 2, SIZE), RNG.standard_normal((SIZE, 3)), RNG.standard_normal((SIZE, 3))
LEVER = np.zeros((SIZE, 3))
for _nodes in (*BODIES, *DRIVEN):
    LEVER[_nodes] = RNG.standard_normal((len(_nodes), 3))


def reduction(pinned: np.ndarray) -> Reduction:
    zero = np.zeros(3)
    frames = tuple(DrivenFrame(nodes, axis, zero, zero) for nodes, axis in zip(DRIVEN, AXES, strict=True))
    made = Reduction(ELEMENTS, Groups(SIZE, rigid=BODIES, driven=frames, fixed=FIXED, pinned=pinned))
    made.lever[:] = LEVER
    return made


def jacobian(r: Reduction) -> np.ndarray:
    """dx / d(free nodes, bodies, servo angles), shape (3 nodes, unknowns + servos)."""
    J = np.zeros((SIZE, 3, r.unknowns + 2))
    for k, node in enumerate(r.free):
        J[node, :, 3 * k : 3 * k + 3] = np.eye(3)
    first = 3 * len(r.free)
    for b, nodes in enumerate(BODIES):
        for node in nodes:
            J[node, :, first + 6 * b : first + 6 * b + 3] = np.eye(3)
            J[node, :, first + 6 * b + 3 : first + 6 * b + 6] = np.cross(np.eye(3), LEVER[node]).T
    for s, nodes in enumerate(DRIVEN):
        J[nodes, :, r.unknowns + s] = np.cross(AXES[s], LEVER[nodes])
    return J.reshape(3 * SIZE, -1)


def stiffness() -> np.ndarray:
    """Element matrices and masses in one matrix of nodes."""
    K = np.diag(np.repeat(MASS, 3))
    for elements, matrices, factor in zip(ELEMENTS, MATRICES, FACTORS, strict=True):
        for nodes, matrix in zip(elements, matrices, strict=True):
            where = (3 * nodes[:, None] + np.arange(3)).ravel()
            K[np.ix_(where, where)] += factor * matrix
    return K


def bend_of(nodes: np.ndarray, turn: np.ndarray) -> float:
    """The work sum g . exp([turn]x) r against the nodal forces of a body or frame that turns."""
    return float(np.vdot(FORCE[nodes], Rotation.from_rotvec(turn).apply(LEVER[nodes])))


def second(nodes: np.ndarray, directions: np.ndarray, h: float = 1e-3) -> np.ndarray:
    """Second derivatives of `bend_of` along turns about `directions`, (k, 3), by differences of fourth order."""
    k = len(directions)

    def curvature(d: np.ndarray) -> float:
        values = [bend_of(nodes, s * h * d) for s in (-2, -1, 0, 1, 2)]
        return float(np.dot([-1, 16, -30, 16, -1], values)) / (12 * h * h)

    own = [curvature(d) for d in directions]
    out = np.diag(own)
    for i in range(k):
        for j in range(i):
            out[i, j] = out[j, i] = (curvature(directions[i] + directions[j]) - own[i] - own[j]) / 2
    return out


def dense(r: Reduction) -> np.ndarray:
    """The whole Hessian, of unknowns and then servo angles."""
    J = jacobian(r)
    H = J.T @ stiffness() @ J
    first = 3 * len(r.free)
    for b, nodes in enumerate(BODIES):
        at = slice(first + 6 * b + 3, first + 6 * b + 6)
        H[at, at] += second(nodes, np.eye(3))
    for s, nodes in enumerate(DRIVEN):
        H[r.unknowns + s, r.unknowns + s] += second(nodes, AXES[s : s + 1])[0, 0]
    return H


def reduced(r: Reduction) -> np.ndarray:
    """What `Reduction.hessian` writes, as one matrix; the bodies' blocks with the servos have no place in it."""
    for out in (r.pattern.data, r.drive, r.drive_drive):
        out[:] = np.nan  # nothing is left from before
    parts = [(k, m, f) for k, (m, f) in enumerate(zip(MATRICES, FACTORS, strict=True))]
    r.hessian(parts, MASS, FORCE)
    upper = r.pattern.copy()
    K = (upper + sparse.triu(upper, 1).T).toarray()
    return np.block([[K, r.drive], [r.drive.T, r.drive_drive]])


def test_hessian() -> None:
    r = reduction(np.zeros((0, 2), dtype=np.int64))
    expected = dense(r)
    assert np.abs(np.diag(expected)).min() > 0.1
    np.testing.assert_allclose(reduced(r), expected, rtol=0, atol=1e-7)


def test_hessian_of_what_is_held_along_an_axis() -> None:
    r = reduction(PINS)
    expected = dense(r)
    free = {node: k for k, node in enumerate(r.free)}
    pinned = [3 * free[node] + axis for node, axis in PINS]
    expected[pinned] = expected[:, pinned] = 0.0
    expected[pinned, pinned] = PINNED
    np.testing.assert_allclose(reduced(r), expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize("pins", [np.zeros((0, 2), dtype=np.int64), PINS])
def test_gradient_and_moves(pins: np.ndarray) -> None:
    r = reduction(pins)
    J, out, torque = jacobian(r), np.full(r.unknowns, np.nan), np.full(2, np.nan)
    r.gradient(FORCE, out, torque)
    expected = J.T @ FORCE.ravel()
    solution, dx = RNG.standard_normal(r.unknowns), np.full((SIZE, 3), 7.0)
    r.moves(solution, LEVER, dx)
    moved = (J[:, : r.unknowns] @ solution).reshape(SIZE, 3)
    moved[FIXED], moved[np.concatenate(DRIVEN)] = 7.0, 7.0  # left alone
    for node, axis in pins:
        expected[3 * list(r.free).index(node) + axis], moved[node, axis] = 0.0, 7.0
    np.testing.assert_allclose(np.append(out, torque), expected, rtol=0, atol=1e-13)
    np.testing.assert_allclose(dx, moved, rtol=0, atol=1e-13)


def test_forces_that_are_relieved_balance_and_their_work_is_that_along_the_way() -> None:
    """Of a body's residual force and moment its nodes lose all; the work is the mean force times the way."""
    reduced = reduction(np.zeros((0, 2), dtype=np.int64))
    lever = reduced.lever
    for nodes in BODIES:
        lever[nodes] -= lever[nodes].mean(axis=0)
    residual, dx, change = (RNG.standard_normal(n) for n in (reduced.unknowns, (SIZE, 3), (SIZE, 3)))
    g, first = FORCE.copy(), 3 * len(reduced.free)
    work = reduced.relieve(residual, MASS, dx, change, g)
    part = g - FORCE
    assert work == pytest.approx(float(np.vdot(FORCE + 0.5 * part, dx)), rel=1e-12)
    lost = part + MASS[:, None] * dx
    np.testing.assert_allclose(lost[reduced.free].ravel(), -residual[:first], rtol=0, atol=1e-13)
    for b, nodes in enumerate(BODIES):
        force, moment = residual[first + 6 * b :][:3], residual[first + 6 * b + 3 :][:3]
        r = lever[nodes]
        turn = np.linalg.solve((r**2).sum() * np.eye(3) - r.T @ r, moment)
        expected = -(force / len(nodes) + np.cross(turn, r))
        np.testing.assert_allclose(lost[nodes], expected, rtol=0, atol=1e-12)
    held = np.concatenate([*DRIVEN, FIXED])
    np.testing.assert_allclose(part[held], change[held], rtol=0, atol=1e-15)


def test_levers_begin_at_centres_and_at_hubs_that_slide() -> None:
    r = reduction(np.zeros((0, 2), dtype=np.int64))
    centres, hubs, inward = RNG.standard_normal((3, 2, 3))
    r.lever[:] = 7.0
    write_levers(X, centres, hubs, inward, 0.4, r.kind, r.number, r.lever)
    expected = np.full((SIZE, 3), 7.0)
    for b, nodes in enumerate(BODIES):
        expected[nodes] = X[nodes] - centres[b]
    for s, nodes in enumerate(DRIVEN):
        expected[nodes] = X[nodes] - hubs[s] - 0.4 * inward[s]
    np.testing.assert_allclose(r.lever, expected, rtol=0, atol=1e-15)


def test_bodies_are_turned_from_the_left() -> None:
    centres, rotations = RNG.standard_normal((2, 3)), Rotation.random(2, random_state=1).as_matrix()
    solution, scale = RNG.standard_normal(20), 0.3
    out, turned = np.empty((2, 3)), np.empty((2, 3, 3))
    move_bodies(centres, rotations, scale, solution, 8, out, turned)
    steps = scale * solution[8:].reshape(2, 6)
    np.testing.assert_allclose(out, centres + steps[:, :3], rtol=0, atol=1e-15)
    np.testing.assert_allclose(
        turned, Rotation.from_rotvec(steps[:, 3:]).as_matrix() @ rotations, rtol=0, atol=1e-14
    )
