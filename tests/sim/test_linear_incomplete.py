"""Conjugate gradients of nets of springs: the answer is that of a dense solve, and says when there is none."""

import numpy as np
import pytest
from scipy import sparse

from tests.messages import raises_naming
from tests.sim.springs import hessian
from tripod_sim.linear.cg import ConjugateGradients
from tripod_sim.linear.incomplete import IncompleteConjugateGradients
from tripod_sim.linear.solver import LinearError
from tripod_sim.springs.body import SpringBody
from tripod_sim.springs.generate import grid


def net_matrix(n: int, seed: int, *, out: float = 0.05, weight: float = 10.0) -> np.ndarray:
    """Return the Hessian of a step of a grid of springs, of which two corners are fixed, out of shape."""
    rng = np.random.default_rng(seed)
    net = grid(n, 1.0)
    pairs = np.concatenate([net.structural, net.shear, net.bending])
    rest = np.linalg.norm(net.nodes[pairs[:, 0]] - net.nodes[pairs[:, 1]], axis=1)
    m, count = len(pairs), len(net.nodes)
    stiffness, mass = rng.uniform(100, 2000, m), rng.uniform(1.0, 2.0, count)
    body = SpringBody(net.nodes, pairs, rest, stiffness, np.zeros(m), mass, net.corners[2:])
    x = net.nodes + rng.standard_normal(net.nodes.shape) * out / n
    return hessian(body, x, project=True) + np.diag(np.repeat(weight * mass[body.free], 3))


def solver_of(A: np.ndarray, kind: type[ConjugateGradients], tolerance: float) -> ConjugateGradients:
    """Return a solver that has factored `A`."""
    pattern = sparse.csc_matrix(np.triu(A))
    pattern.sort_indices()
    solver = kind(pattern, np.arange(0, len(A) + 1, 3), tolerance)
    assert solver.factor()
    return solver


@pytest.mark.parametrize(("n", "seed"), [(2, 0), (5, 1), (12, 2)])
def test_the_answer_is_that_of_a_dense_solve(n: int, seed: int) -> None:
    A = net_matrix(n, seed)
    b = np.random.default_rng(seed).standard_normal(len(A))
    solver, right = solver_of(A, IncompleteConjugateGradients, 1e-12), np.linalg.solve(A, b)
    assert solver.is_positive()
    np.testing.assert_allclose(solver.solve(b), right, atol=1e-10 * np.abs(right).max())
    assert 0 < solver.iterations < 100
    assert not solver.solve(np.zeros_like(b)).any()


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5, 1e-8])
def test_the_residual_that_is_asked_for_is_left(tolerance: float) -> None:
    """And not a hundred times less, for which nobody would like to pay."""
    A = net_matrix(14, 4)
    b = np.random.default_rng(5).standard_normal(len(A))
    left = b - A @ solver_of(A, IncompleteConjugateGradients, tolerance).solve(b)
    assert 0.01 * tolerance < np.linalg.norm(left) / np.linalg.norm(b) <= tolerance * (1 + 1e-6)


def test_it_takes_much_less_than_a_diagonal_preconditioner() -> None:
    A = net_matrix(24, 6, out=0.0)
    b = np.random.default_rng(0).standard_normal(len(A))
    found = {}
    for kind in (IncompleteConjugateGradients, ConjugateGradients):
        solver = solver_of(A, kind, 1e-5)
        solver.solve(b)
        found[kind] = solver.iterations
    assert found[IncompleteConjugateGradients] < 0.4 * found[ConjugateGradients]


@pytest.mark.parametrize("block", ["symmetric", "turned"])
def test_blocks_beside_the_diagonal_may_be_of_any_kind(block: str) -> None:
    rng = np.random.default_rng(7)
    root = np.tril(rng.standard_normal((12, 12)))
    if block == "symmetric":
        root[3:, :9] = 0.0
    A = root @ root.T + 3.0 * np.eye(12)
    b = rng.standard_normal(12)
    solver = solver_of(A, IncompleteConjugateGradients, 1e-12)
    np.testing.assert_allclose(solver.solve(b), np.linalg.solve(A, b), rtol=1e-8)


def test_what_cannot_be_solved_is_said() -> None:
    A = net_matrix(6, 7)
    b = np.ones(len(A))
    solver = solver_of(A, IncompleteConjugateGradients, 1e-12)
    solver._limit = 3
    with raises_naming(LinearError, "3 iterations", "solver.linear = 'ldl'"):
        solver.solve(b)
    b[3] = np.nan
    with raises_naming(LinearError, "not finite"):
        solver.solve(b)
    indefinite = A.copy()
    indefinite[:3, :3] -= 1e5 * np.eye(3)  # a block on the diagonal
    assert not solver_of(indefinite, IncompleteConjugateGradients, 1e-5).is_positive()
    turned = np.kron(
        [[1.0, -1.5], [-1.5, 1.0]], np.eye(3)
    )  # blocks on the diagonal are definite, the matrix is not
    assert not solver_of(turned, IncompleteConjugateGradients, 1e-5).is_positive()
    A[4, 4] = np.nan
    pattern = sparse.csc_matrix(np.triu(A))
    assert not IncompleteConjugateGradients(pattern, np.arange(0, len(A) + 1, 3)).factor()
