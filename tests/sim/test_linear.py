"""Linear solvers against dense algebra, and the Tripod's load cases against each other with every solver."""

import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest
from scipy import sparse

from tests.messages import names, raises_naming
from tests.scenes import SHARP
from tripod_sim import SceneError, Simulation, StepError, load_scene
from tripod_sim.build import build
from tripod_sim.linear import choice, ldl, ldl_symbolic, multigrid
from tripod_sim.linear.cg import ConjugateGradients
from tripod_sim.linear.ldl import Ldl
from tripod_sim.linear.ldl_symbolic import analyse
from tripod_sim.linear.solver import LinearError

EPS = np.finfo(float).eps
NAMES = (
    "ldl",
    "cg",
    pytest.param("cholmod", marks=pytest.mark.skipif(not find_spec("cvxopt"), reason="no cvxopt")),
    pytest.param("multigrid", marks=pytest.mark.skipif(not find_spec("pyamg"), reason="no pyamg")),
)


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let multigrid take over in the first solution."""
    monkeypatch.setattr(multigrid, "EASY", 5)


def tangent(level: int = 1) -> sparse.csc_matrix:
    """Upper triangle of the Tripod's static tangent, servos bent: free nodes and the disc's six unknowns."""
    parts = build(load_scene(SHARP, ["inertia=off", "damping=off", f"mesh.level={level}"]))
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


def blocks_of(n: int, bodies: int = 1) -> np.ndarray:
    """Diagonal blocks: nodes, then bodies at the end."""
    first = n - 6 * bodies
    return np.append(np.arange(0, first, 3), first + 6 * np.arange(bodies + 1))


@pytest.mark.parametrize("level", [1, 2])
def test_ldl_solves_the_tangent(level: int) -> None:
    upper = tangent(level)
    A, b = whole(upper), np.random.default_rng(level).standard_normal(upper.shape[0])
    solver = Ldl(upper)
    assert solver.factor()
    assert solver.is_positive()
    close(solver.solve(b), A, b)


@pytest.fixture
def shared(monkeypatch: pytest.MonkeyPatch):
    """Let also small factors be computed in subtrees."""
    ldl_symbolic._plan.cache_clear()
    for name in ("SHARED", "LEAST"):
        monkeypatch.setattr(ldl_symbolic, name, 0)
    for name, value in (("SHARED", 0), ("LARGE", 0), ("BLOCK", 8)):
        monkeypatch.setattr(ldl, name, value)
    yield
    ldl_symbolic._plan.cache_clear()


@pytest.mark.usefixtures("shared")
def test_subtrees_are_the_same_with_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    upper = tangent(2)
    A, b = whole(upper), np.random.default_rng(1).standard_normal(upper.shape[0])
    found = []
    for threads, large in (("1", np.inf), ("1", 0), ("4", 0)):  # fronts that several threads eliminate
        monkeypatch.setenv("NUMBA_NUM_THREADS", threads)
        monkeypatch.setattr(ldl, "LARGE", large)
        solver = Ldl(upper)
        assert solver.factor()
        assert len(solver._shares) > 2
        assert bool(solver._large) == (large == 0)
        assert solver.is_positive()
        found.append(solver.solve(b))
        close(found[-1], A, b)
    assert np.array_equal(found[1], found[2])


@pytest.mark.usefixtures("shared")
@pytest.mark.parametrize("seed", range(5))
def test_subtrees_count_negative_pivots_and_find_zeros(seed: int) -> None:
    upper = scattered(120, 0.02, seed)
    solver, values = Ldl(upper), np.linalg.eigvalsh(whole(upper))
    assert solver.factor()
    assert len(solver._shares) > 2
    assert solver.negative == np.count_nonzero(values < 0)
    for pivot in (0, -1):  # of the first subtree, and of the last front
        values, k = upper.data.copy(), int(solver._plan.order[pivot])
        upper.data[upper.indptr[k] : upper.indptr[k + 1]] = 0.0
        upper.data[upper.indices == k] = 0.0
        assert not solver.factor()
        upper.data[:] = values
    assert solver.factor()


@pytest.mark.usefixtures("shared")
def test_a_rough_solver_has_half_the_digits() -> None:
    upper = tangent(2)
    A, b = whole(upper), np.random.default_rng(2).standard_normal(upper.shape[0])
    exact, rough = Ldl(upper), Ldl(upper).rough()
    assert exact.factor()
    assert rough.factor()
    x = rough.solve(b)
    assert np.abs(A @ x - b).max() > 1e-12 * np.abs(A).max() * np.abs(x).max()
    assert np.abs(A @ x - b).max() < 1e-6 * np.abs(A).max() * np.abs(x).max()
    x += rough.solve(b - A @ x)
    x += rough.solve(b - A @ x)
    close(x, A, b)
    assert np.abs(x - exact.solve(b)).max() < 1e-9 * np.abs(x).max()


@pytest.mark.parametrize("columns", [1, 3, 17])
@pytest.mark.parametrize("share", [0.0, 0.05, 0.6])
def test_ldl_solves_many_columns_as_one_by_one(share: float, columns: int) -> None:
    upper = scattered(40, share, seed=5)
    solver, b = Ldl(upper), np.random.default_rng(columns).standard_normal((40, columns))
    assert solver.factor()
    found, single = solver.solve_many(b), np.stack([solver.solve(c) for c in b.T.copy()], axis=1)
    np.testing.assert_allclose(found, single, atol=1e-10 * np.abs(single).max())


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


def test_the_order_of_blocks_is_as_good_as_that_of_unknowns() -> None:
    """A mesh is ordered by blocks; with one entry less, by unknowns, which gives hardly other fill."""
    upper = tangent(2)
    less = upper.tolil()
    less[0, 1] = 0
    less = sparse.csc_matrix(less)
    less.eliminate_zeros()
    assert less.nnz < upper.nnz
    by_blocks, by_unknowns = Ldl(upper).entries, Ldl(less).entries
    assert by_blocks == pytest.approx(by_unknowns, rel=0.2)


@pytest.mark.parametrize("name", NAMES)
def test_every_solver_solves_the_tangent(name: str) -> None:
    upper = tangent()
    A, b = whole(upper), np.random.default_rng(7).standard_normal(upper.shape[0])
    tolerance = 1e-10
    solver = choice.linear_factory(name, tolerance)(upper, blocks_of(len(A)))
    assert solver.factor()
    assert solver.is_positive()
    exact, x = np.linalg.solve(A, b), solver.solve(b)
    both = solver.solve_many(np.stack([b, -2 * b], axis=1))
    np.testing.assert_allclose(both, np.stack([x, -2 * x], axis=1), rtol=1e-9, atol=1e-9 * np.abs(x).max())
    # a relative residual t in the norm of M^-1 bounds the error by t times the condition number of M^-1 A
    M = np.zeros_like(A)
    for first, end in zip(blocks_of(len(A))[:-1], blocks_of(len(A))[1:], strict=True):
        M[first:end, first:end] = A[first:end, first:end]
    L = np.linalg.cholesky(M)
    eigenvalues = np.linalg.eigvalsh(np.linalg.solve(L, np.linalg.solve(L, A).T))
    error = np.linalg.norm(L.T @ (x - exact)) / np.linalg.norm(L.T @ exact)
    assert error <= tolerance * eigenvalues[-1] / eigenvalues[0]
    np.testing.assert_array_equal(b, np.random.default_rng(7).standard_normal(len(A)))  # left as it was


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("share", [1e-3, 0.3, 2.0])
def test_no_solver_takes_an_indefinite_matrix_for_positive(name: str, share: float) -> None:
    """One slightly negative eigenvalue, few, many; in Newton's order of calls."""
    upper = tangent()
    n = upper.shape[0]
    low = np.linalg.eigvalsh(whole(upper))
    upper.setdiag(upper.diagonal() - (1 + share) * low[0] if share < 1 else upper.diagonal() - low[n // 2])
    assert np.linalg.eigvalsh(whole(upper))[0] < 0
    solver = choice.linear_factory(name, 1e-8)(upper, blocks_of(n))
    assert not (solver.factor() and solver.is_positive())


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_no_solver_takes_a_value_that_is_not_finite(name: str, value: float) -> None:
    upper = tangent()
    solver = choice.linear_factory(name, 1e-8)(upper, blocks_of(upper.shape[0]))
    assert solver.factor()
    upper.data[len(upper.data) // 2] = value
    assert not solver.factor()


def test_conjugate_gradients_report_what_they_do_not_solve() -> None:
    upper = tangent()
    n = upper.shape[0]
    b = np.random.default_rng(1).standard_normal(n)
    strict = ConjugateGradients(upper, blocks_of(n), tolerance=1e-30)
    assert strict.factor()
    with raises_naming(LinearError, "did not converge", "tolerance 1e-30", "solver.linear = 'ldl'"):
        strict.solve(b)
    b[3] = np.nan
    with raises_naming(LinearError, "not finite"):
        strict.solve(b)
    np.testing.assert_array_equal(strict.solve(np.zeros(n)), np.zeros(n))
    # indefinite, but with positive blocks: the direction of negative curvature itself cannot be missed
    values, vectors = np.linalg.eigh(whole(upper))
    upper.setdiag(upper.diagonal() - 0.5 * (values[0] + values[1]))
    solver = ConjugateGradients(upper, blocks_of(n))
    assert solver.factor()
    with raises_naming(LinearError, "positive definite"):
        solver.solve(whole(upper) @ vectors[:, 0])
    upper.setdiag(-np.abs(upper.diagonal()))
    assert solver.factor()
    assert not solver.is_positive()
    with raises_naming(LinearError, "solver.linear = 'ldl'"):
        solver.solve(np.ones(n))


def test_conjugate_gradients_end_in_as_many_iterations_as_distinct_eigenvalues() -> None:
    """Diagonal blocks alone: the preconditioner is exact, one iteration; k blocks away from it, at most 2 k + 1."""
    rng, n = np.random.default_rng(3), 60
    A = np.zeros((n, n))
    for k in range(0, n, 3):
        a = rng.standard_normal((3, 3))
        A[k : k + 3, k : k + 3] = a @ a.T + np.eye(3)
    A[:3, 3:6] = 0.1
    A[3:6, :3] = 0.1
    for matrix, most in (
        (A * (np.abs(np.subtract.outer(np.arange(n) // 3, np.arange(n) // 3)) < 1), 1),
        (A, 3),
    ):
        upper = sparse.csc_matrix(np.triu(matrix))
        solver = ConjugateGradients(upper, np.arange(0, n + 1, 3), 1e-12)
        assert solver.factor()
        b = rng.standard_normal(n)
        np.testing.assert_allclose(matrix @ solver.solve(b), b, atol=1e-9)
        assert solver.iterations <= most


@pytest.mark.skipif(not find_spec("pyamg"), reason="no pyamg")
@pytest.mark.parametrize("turned", [False, True])
def test_multigrid_knows_rigid_bodies_wherever_the_body_is(
    monkeypatch: pytest.MonkeyPatch, turned: bool
) -> None:
    beam = ["mesh.cells=[4,4,20]", "inertia=off", "damping=off"]
    found = {}
    for name in ("cg", "multigrid"):
        simulation = Simulation(load_scene("column", [*beam, f"solver.linear={name}"]))
        system, state = simulation.system, simulation.state
        if turned:
            state.positions[:] = state.positions @ np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
        assert system.assemble(state, project=False) < 0
        assert system.factor()
        b = np.random.default_rng(0).standard_normal(system.unknowns)
        x, first = system.linear.solve(b), system.linear.iterations
        again = system.linear.solve(b)
        found[name] = first, system.linear.iterations, x
        assert np.abs(x - again).max() < 1e-6 * np.abs(x).max()
    assert found["multigrid"][1] < min(25, 0.1 * found["cg"][0])  # twice as many without turns
    assert np.abs(found["cg"][2] - found["multigrid"][2]).max() < 1e-5 * np.abs(found["cg"][2]).max()


@pytest.mark.skipif(not find_spec("pyamg"), reason="no pyamg")
def test_multigrid_does_not_draw_and_is_set_up_again_where_it_serves_no_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    system = Simulation(load_scene("column", ["mesh.cells=[4,4,20]", "inertia=off", "damping=off"])).system
    system.factor()
    upper = system.reduction.pattern.copy()
    n, found, made = upper.shape[0], [], []
    make = multigrid.Multigrid._set_up
    monkeypatch.setattr(multigrid.Multigrid, "_set_up", lambda self: made.append(1) or make(self))
    b = np.random.default_rng(0).standard_normal(n)
    for seed in (1, 2):
        np.random.seed(seed)
        solver = multigrid.Multigrid(upper, blocks_of(n, 0))
        assert solver.factor()
        found.append(solver.solve(b))
        assert np.random.rand() == np.random.RandomState(seed).rand()
    assert np.array_equal(*found)
    assert len(made) == 2
    upper.setdiag(upper.diagonal() * np.where(np.arange(n) // 3 % 2, 1.0, 1e4))
    assert solver.factor()
    for _ in range(12):
        solver.solve(b)
    assert len(made) == 3


QUARTER = -np.pi / 4
CASES = {
    "L1": np.zeros(4),
    "L2": np.array([QUARTER, QUARTER, QUARTER, 0.0]),
    "L3": np.array([QUARTER, 0.0, 0.0, 0.0]),
    "L4": np.array([-1.4965, -1.4965, -1.4965, 0.035]),
}


@pytest.fixture(scope="module")
def reference() -> dict[str, np.ndarray]:
    return {case: displacements("ldl", case) for case in CASES}


def displacements(name: str, case: str) -> np.ndarray:
    """Of all nodes [m], at equilibrium to 1e-9 N: with stiffnesses near 100 N/m that leaves 1e-11 m."""
    options = ["inertia=off", "damping=off", "mesh.level=1", "solver.tolerance=1e-9", f"solver.linear={name}"]
    simulation = Simulation(load_scene(SHARP, options))
    for k in range(1, 9):
        simulation.step(CASES[case] * k / 8)
    return simulation.state.positions - simulation.mesh.nodes


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", NAMES[1:])
def test_load_cases_do_not_depend_on_the_solver(
    name: str, case: str, reference: dict[str, np.ndarray]
) -> None:
    u = reference[case]
    assert np.abs(u).max() > 1e-3
    np.testing.assert_allclose(displacements(name, case), u, rtol=0, atol=1e-6 * np.abs(u).max())


@pytest.mark.parametrize("name", NAMES)
def test_newton_projects_where_a_solver_reports_an_indefinite_tangent(name: str) -> None:
    """Half of the node spacing as noise turns elements inside out: no solver may follow the tangent as it is there."""
    options = ["mesh.level=1", "material.law=stable_neo_hooke", f"solver.linear={name}"]
    simulation = Simulation(load_scene(SHARP, options))
    free = simulation._system.reduction.free
    noise = 2e-3 * np.random.default_rng(0).standard_normal((len(free), 3))
    simulation.state.positions[free] += noise
    system = simulation._system
    assert system.assemble(simulation.state, project=False) >= 0 or not system.factor()
    for _ in range(40):
        simulation.step()
    assert np.isfinite(simulation.state.positions).all()
    assert (
        simulation._system.elastic.terms[0].worst_element(simulation.state.positions, simulation.state.modes)[
            1
        ]
        > 0.5
    )


def test_a_tolerance_below_rounding_is_reported() -> None:
    options = [
        "inertia=off",
        "damping=off",
        "mesh.level=1",
        "solver.linear=cg",
        "solver.linear_tolerance=1e-30",
    ]
    with pytest.raises(StepError) as caught:
        Simulation(load_scene(SHARP, options)).step(np.array([-0.1, 0, 0, 0]))
    assert names(caught.value, "conjugate gradients", "1e-30") or names(
        caught.value, "stiffness matrix is singular"
    )


def test_a_solver_that_gives_up_fails_the_step_and_leaves_the_state(monkeypatch: pytest.MonkeyPatch) -> None:
    def give_up(b: np.ndarray) -> np.ndarray:
        raise LinearError("no solution to be had")

    simulation = Simulation(load_scene(SHARP, ["mesh.level=1"]))
    before = simulation.state.positions.tobytes()
    for system in (simulation._system, simulation._static.system):
        for name in ("solve", "solve_many"):
            monkeypatch.setattr(system.linear, name, give_up)
    with raises_naming(StepError, "step 1", "no solution"):
        simulation.step(np.array([-0.1, 0, 0, 0]))
    assert simulation.state.positions.tobytes() == before
    with raises_naming(StepError, "no compliance", "0 s", "no solution"):
        simulation.compliance()


def test_compliance_is_that_of_the_direct_solver() -> None:
    found = []
    for options in (["solver.linear=ldl"], ["solver.linear=cg", "solver.linear_tolerance=1e-10"]):
        found.append(Simulation(load_scene(SHARP, ["mesh.level=1", *options])).compliance().w)
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=1e-6 * np.abs(found[0]).max())


def test_auto_goes_by_the_size_of_the_factor(monkeypatch: pytest.MonkeyPatch) -> None:
    upper = tangent()
    blocks, entries = blocks_of(upper.shape[0]), Ldl(upper).entries
    auto = choice.linear_factory("auto", 1e-5)
    assert isinstance(auto(upper, blocks), Ldl)
    monkeypatch.setattr(choice, "LARGE", entries - 1)
    assert isinstance(auto(upper, blocks), Ldl)  # not below SMALL
    monkeypatch.setattr(choice, "SMALL", entries - 1)
    iterative = auto(upper, blocks)
    assert isinstance(iterative, ConjugateGradients)
    assert iterative.tolerance == 1e-5
    monkeypatch.setattr(choice, "LARGE", entries)
    monkeypatch.setattr(choice, "find_spec", lambda _: None)
    assert isinstance(auto(upper, blocks), Ldl)
    assert isinstance(choice.linear_factory("ldl", 1e-8)(upper, blocks), Ldl)
    with raises_naming(SceneError, "solver.linear is 'cholmod'", "not installed", "pip install"):
        choice.linear_factory("cholmod", 1e-8)


def test_a_solver_that_is_not_chosen_is_not_imported() -> None:
    code = (
        "import sys; from tripod_sim import Simulation, load_scene;"
        "Simulation(load_scene('tripod', ['mesh.level=1'])).step();"
        "print(*[m for m in sys.modules if m.startswith('tripod_sim.linear') or m == 'cvxopt'])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    loaded = set(done.stdout.split())
    assert "tripod_sim.linear.ldl" in loaded
    assert not {"tripod_sim.linear.cg", "tripod_sim.linear.cholmod", "cvxopt"} & loaded


def test_patterns_are_planned_once_and_each_for_itself() -> None:
    """Two of as many entries in each column; the values are no part of a plan."""
    size = 12
    rows = [(1, 2, 4), (3, 5, 8)]
    matrices = []
    for own in rows:
        full = 4.0 * np.eye(size)
        for column, row in zip((9, 10, 11), own, strict=True):
            full[row, column] = full[column, row] = -1.0
        matrices.append(full)
    uppers = [sparse.csc_matrix(sparse.triu(m)) for m in matrices]
    np.testing.assert_array_equal(uppers[0].indptr, uppers[1].indptr)
    plans = [analyse(upper) for upper in uppers]
    assert plans[0] is not plans[1]
    assert analyse(2.0 * uppers[0]) is plans[0]
    b = np.arange(1.0, size + 1)
    for full, upper in zip(matrices, uppers, strict=True):
        solver = Ldl(upper)
        assert solver.factor()
        np.testing.assert_allclose(full @ solver.solve(b), b, rtol=1e-12)
