"""Conjugate gradients of springs: the answer is that of a dense solve, and says when there is none."""

import numpy as np
import pytest

from tests.sim.springs import blocks, hessian
from tripod_sim.springs import cg_kernels as kernels
from tripod_sim.springs.body import SpringBody
from tripod_sim.springs.generate import grid
from tripod_sim.springs.spring_system import SpringSystem

INERTIA = 10.0


class Case:
    """A grid of springs, of which some nodes are fixed, out of shape, with the Hessian of a step."""

    def __init__(self, n: int, seed: int, *, shuffled: bool = False, out: float = 0.05) -> None:
        rng = np.random.default_rng(seed)
        net = grid(n, 1.0)
        pairs = np.concatenate([net.structural, net.shear, net.bending])
        if shuffled:
            pairs = rng.permuted(pairs[rng.permutation(len(pairs))], axis=1)
        rest = np.linalg.norm(net.nodes[pairs[:, 0]] - net.nodes[pairs[:, 1]], axis=1)
        m, count = len(pairs), len(net.nodes)
        stiffness, mass = rng.uniform(100, 2000, m), rng.uniform(0.001, 0.002, count)
        body = SpringBody(net.nodes, pairs, rest, stiffness, np.zeros(m), mass, net.corners[2:])
        self.system, self.free = SpringSystem(body, None), body.free
        x = net.nodes + rng.standard_normal(net.nodes.shape) * out / n
        self.blocks = blocks(self.system, x, project=True)
        self.weight = INERTIA * mass / 0.001
        self.g = rng.standard_normal(net.nodes.shape)
        self.H = hessian(self.system, x, project=True) + np.diag(np.repeat(self.weight[self.free], 3))
        self.sweep = kernels.sweep(pairs, self.system.number, len(self.free))

    def prepare(self) -> bool:
        body = self.system.body
        return kernels.prepare(body.ends, self.blocks, self.weight, self.free, self.system.number, self.sweep)

    def solve(self, p: np.ndarray, tolerance: float, limit: int = 1000) -> int:
        return kernels.conjugate_gradients(self.sweep, self.g, self.free, tolerance, limit, p)


def by_jacobi(H: np.ndarray, b: np.ndarray, tolerance: float) -> int:
    """Iterations of conjugate gradients with the inverse of the diagonal blocks."""
    blocks = np.array([np.linalg.inv(H[k : k + 3, k : k + 3]) for k in range(0, len(b), 3)])

    def M(r: np.ndarray) -> np.ndarray:
        return np.einsum("kij,kj->ki", blocks, r.reshape(-1, 3)).ravel()

    r = b.copy()
    z = M(r)
    p, count = z.copy(), 0
    while np.linalg.norm(r) > tolerance * np.linalg.norm(b):
        q = H @ p
        step = (r @ z) / (p @ q)
        before, r = r @ z, r - step * q
        z = M(r)
        p, count = z + (r @ z) / before * p, count + 1
    return count


@pytest.mark.parametrize(
    ("n", "seed", "shuffled"), [(2, 0, False), (5, 1, True), (12, 2, False), (12, 3, True)]
)
def test_the_answer_is_that_of_a_dense_solve(n: int, seed: int, shuffled: bool) -> None:
    case = Case(n, seed, shuffled=shuffled)
    assert case.prepare()
    right = np.linalg.solve(case.H, -case.g[case.free].ravel())
    p = np.zeros_like(case.g)
    assert 0 < case.solve(p, 1e-12) < 100
    np.testing.assert_allclose(p[case.free].ravel(), right, atol=1e-10 * np.abs(right).max())
    assert not p[case.system.body.fixed].any()
    guess = p.copy()
    assert case.solve(guess, 1e-9) == 0  # it begins with what it is given
    assert guess.tobytes() == p.tobytes()


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5, 1e-8])
def test_the_residual_that_is_asked_for_is_left(tolerance: float) -> None:
    """And not a hundred times less, for which nobody would like to pay."""
    case = Case(14, 4)
    assert case.prepare()
    rng = np.random.default_rng(5)
    for start in (np.zeros_like(case.g), 1e-3 * rng.standard_normal(case.g.shape)):
        start[case.system.body.fixed] = 0.0
        assert case.solve(start, tolerance) > 0
        left = case.g[case.free].ravel() + case.H @ start[case.free].ravel()
        share = np.linalg.norm(left) / np.linalg.norm(case.g[case.free])
        assert 0.01 * tolerance < share <= tolerance * (1 + 1e-6)


def test_it_takes_much_less_than_a_diagonal_preconditioner() -> None:
    case = Case(24, 6, out=0.0)
    assert case.prepare()
    assert case.solve(np.zeros_like(case.g), 1e-5) < 0.4 * by_jacobi(case.H, -case.g[case.free].ravel(), 1e-5)


def test_what_cannot_be_solved_is_said() -> None:
    case = Case(6, 7)
    assert case.prepare()
    p = np.zeros_like(case.g)
    assert case.solve(p, 1e-12, limit=3) == -1
    case.g[case.free[3], 1] = np.nan
    assert case.solve(p, 1e-5) == -1
    case = Case(6, 8)
    case.blocks[:, [0, 3, 5]] -= 3e3
    assert not case.prepare()  # a block on the diagonal is not definite
    case = Case(6, 9)
    case.prepare()
    case.sweep.middle[:, [0, 3, 5]] *= 0.02  # the blocks on the diagonal are definite, the matrix is not
    assert case.solve(p, 1e-5) == -1
