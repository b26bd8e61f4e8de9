"""Linear solvers against dense algebra, and the Tripod's load cases against each other with every solver."""

import numpy as np
import pytest
from scipy import sparse

from tripod_sim import load_scene
from tripod_sim.build import build
from tripod_sim.linear.ldl import Ldl

EPS = np.finfo(float).eps


def tangent(level: int = 1) -> sparse.csc_matrix:
    """Upper triangle of the Tripod's static tangent, servos bent: free nodes and the disc's six unknowns."""
    parts = build(load_scene("tripod", ["inertia=off", "damping=off", f"mesh.level={level}"]))
    system = parts.system
    state = system.start_state(np.zeros(4))
    parts.stepper.step(state, np.array([-0.5, -0.3, 0.1, 0.003]), 0.0)
    assert system.assemble(state, project=False) == -1
    system.evaluate(state)
    assert system.factor()
    return system.reduction.pattern.copy()


def whole(upper: sparse.csc_matrix) -> np.ndarray:
    return (upper + sparse.triu(upper, 1).T).toarray()


def scattered(n: int, share: float, seed: int) -> sparse.csc_matrix:
    """Upper triangle of a random symmetric matrix with a full diagonal, indefinite unless shifted."""
    rng = np.random.default_rng(seed)
    a = sparse.random(n, n, density=share, random_state=rng, format="csc", data_rvs=rng.standard_normal)
    upper = sparse.csc_matrix(sparse.triu(a + a.T, 1) + sparse.diags(rng.uniform(0.5, 1.5, n)))
    upper.sort_indices()
    return upper


def close(x: np.ndarray, A: np.ndarray, b: np.ndarray) -> None:
    """Backward error of a stable solve: a few n eps of |A| |x|; without pivoting up to the growth, here 1e3."""
    assert np.abs(A @ x - b).max() <= 1e3 * len(b) * EPS * np.abs(A).max() * np.abs(x).max()


def definite(upper: sparse.csc_matrix) -> sparse.csc_matrix:
    """The same pattern, its diagonal dominant."""
    upper = upper.copy()
    upper.setdiag(1.1 * np.abs(whole(upper)).sum(axis=1))
    return upper


@pytest.mark.parametrize("level", [1, 2])
def test_ldl_solves_the_tangent(level: int) -> None:
    upper = tangent(level)
    A, b = whole(upper), np.random.default_rng(level).standard_normal(upper.shape[0])
    solver = Ldl(upper)
    assert solver.factor()
    assert solver.is_positive()
    close(solver.solve(b), A, b)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("share", [0.0, 0.01, 0.05, 0.6])
def test_ldl_counts_negative_eigenvalues(share: float, seed: int) -> None:
    """Sylvester: as many negative pivots as negative eigenvalues, over forests, fill and dense patterns."""
    upper = scattered(60 + seed, share, seed)
    solver = Ldl(upper)
    for sign in (1, -1):
        upper.data *= sign
        A = whole(upper)
        eigenvalues = np.linalg.eigvalsh(A)
        assert np.abs(eigenvalues).min() > 1e-6  # else the count is not defined in rounding
        assert solver.factor()
        assert solver.negative == (eigenvalues < 0).sum()
        assert solver.is_positive() == (solver.negative == 0)
        b = np.random.default_rng(seed).standard_normal(len(A))
        np.testing.assert_allclose(A @ solver.solve(b), b, atol=1e-6 * np.abs(b).max())


def test_ldl_answers_belong_to_the_values_at_factor() -> None:
    upper = tangent()
    solver, b = Ldl(upper), np.ones(upper.shape[0])
    solver.factor()
    before = solver.solve(b)
    upper.data *= 2
    np.testing.assert_array_equal(solver.solve(b), before)
    assert solver.factor()
    np.testing.assert_allclose(solver.solve(b), before / 2, rtol=1e-14)  # a power of two changes no mantissa


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf, -np.inf])
def test_ldl_reports_a_pivot_that_is_zero_or_not_finite_and_recovers(value: float) -> None:
    upper = sparse.csc_matrix(np.triu(np.array([[2.0, 1, 0], [1, 2, 1], [0, 1, 2]])))
    solver, good = Ldl(upper), upper.data.copy()
    for k in range(len(good)):
        if value == 0.0 and upper.indices[k] != np.repeat(np.arange(3), np.diff(upper.indptr))[k]:
            continue  # an entry off the diagonal may vanish
        upper.data[:] = good
        if value == 0.0:
            upper.data[:] = np.where(np.arange(len(good)) == k, 0.0, upper.data)
            rows = np.repeat(np.arange(3), np.diff(upper.indptr))
            upper.data[(rows != upper.indices)] = 0.0  # decoupled, so the zero stays a pivot
        else:
            upper.data[k] = value
        assert not solver.factor()
    upper.data[:] = good
    assert solver.factor()
    assert solver.is_positive()
    np.testing.assert_allclose(whole(upper) @ solver.solve(np.ones(3)), 1, rtol=1e-14)
