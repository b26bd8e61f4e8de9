"""The certificate against its formula in NumPy, and polishing where the system of the active rows is singular."""

import dataclasses

import numpy as np
import pytest

from tests.ik.plant import SpringRobot
from tripod_ik import certificate_kernels as kernels
from tripod_ik.certificate import is_sane, kkt_residual, polish
from tripod_ik.limits import AngleLimit, SpeedLimit
from tripod_ik.problem import IkProblem, build_ik
from tripod_ik.row_limits import TorqueLimit
from tripod_ik.solver import IkSolver
from tripod_ik.tasks import PositionTask

WORKING = np.full(3, -1.4965)


def typical(**changes: np.ndarray) -> IkProblem:
    state = SpringRobot(slide=0.035).state(WORKING)
    task = PositionTask(state.equilibrium + np.array([0.005, -0.002, 0.004]))
    problem = build_ik(state, [task], [AngleLimit(-2.1, 0.6), SpeedLimit(3.0)], [TorqueLimit(0.3)], dt=0.01)
    return dataclasses.replace(problem, **changes)


def formula(p: IkProblem, x: np.ndarray, y: np.ndarray) -> float:
    rows = p.A @ x
    return max(np.abs(p.P @ x + p.q + p.A.T @ y).max(), np.abs(rows - np.clip(rows + y, p.l, p.u)).max())


def test_the_residual_is_that_of_the_formula() -> None:
    """Now one part of it is the larger, now the other."""
    rng, problem, larger = np.random.default_rng(1), typical(), set()
    for _ in range(100):
        x, y = (
            rng.standard_normal(6) * 10 ** rng.uniform(-4, 0),
            rng.standard_normal(9) * 10 ** rng.uniform(-4, 0),
        )
        expected = formula(problem, x, y)
        assert kkt_residual(problem, x, y) == pytest.approx(expected, rel=1e-12)
        larger.add(expected > np.abs(problem.P @ x + problem.q + problem.A.T @ y).max())
    assert larger == {True, False}


@pytest.mark.parametrize("where", range(15))
def test_a_number_that_is_none_is_in_the_residual(where: int) -> None:
    z = np.zeros(15)
    z[where] = np.nan
    assert np.isnan(kkt_residual(typical(), z[:6], z[6:]))
    assert np.isnan(polish(typical(), z[:6], z[6:])[2])


@pytest.mark.parametrize("name", ["P", "q", "A", "l", "u"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_any_number_of_a_program_that_is_none_is_found(name: str, bad: float) -> None:
    problem = typical(l=np.full(9, -1.0), u=np.full(9, 1.0))
    assert is_sane(problem)
    for place in np.ndindex(getattr(problem, name).shape):
        values = getattr(problem, name).copy()
        values[place] = bad
        no_bound = (name, bad) in {("l", -np.inf), ("u", np.inf)}
        assert is_sane(dataclasses.replace(problem, **{name: values})) == no_bound


def test_bounds_that_say_the_same_twice_share_the_multiplier() -> None:
    """δ_0 ≤ -0.01 as a bound and as a row: the system of both is singular, and of its solutions the least is found."""
    A, low, high = typical().A.copy(), np.full(9, -np.inf), np.full(9, np.inf)
    A[6] = np.eye(6)[0]
    high[0] = high[6] = -0.01
    problem = typical(P=np.eye(6), q=np.zeros(6), A=A, l=low, u=high)
    x, y, residual = polish(problem, np.zeros(6), np.zeros(9))
    assert residual < 1e-15
    assert x == pytest.approx(-0.01 * np.eye(6)[0], abs=1e-15)
    assert y == pytest.approx(0.005 * (np.eye(9)[0] + np.eye(9)[6]), abs=1e-15)


def test_elimination_exchanges_rows() -> None:
    rng = np.random.default_rng(4)
    for size in range(2, 12):
        matrix, right = rng.standard_normal((size, size)), rng.standard_normal(size)
        matrix += matrix.T
        matrix[0, 0] = matrix[-1, -1] = 0.0
        found = right.copy()
        assert kernels.eliminate(matrix.copy(), found)
        assert found == pytest.approx(np.linalg.solve(matrix, right), rel=1e-9)
    assert not kernels.eliminate(np.ones((2, 2)), np.ones(2))


def test_nothing_is_compiled_in_a_tick() -> None:
    solver = IkSolver(3, rows=3)
    before = [len(k.signatures) for k in (kernels.improve, kernels.conditions, kernels.is_sane)]
    assert solver.solve(typical()).ok
    assert solver.solve(typical()).ok
    assert [len(k.signatures) for k in (kernels.improve, kernels.conditions, kernels.is_sane)] == before
