import numpy as np
import pytest

from tests.ik.plant import SpringRobot
from tests.messages import raises_naming
from tripod_ik.errors import IkError
from tripod_ik.limits import AngleLimit, SpeedLimit
from tripod_ik.problem import build_ik
from tripod_ik.row_limits import EffectorBox, TorqueLimit
from tripod_ik.solver import IkSolver, solve_ik
from tripod_ik.tasks import PositionTask

WORKING = np.full(3, -1.4965)


def state_at(angles=WORKING):
    return SpringRobot(slide=0.035).state(np.asarray(angles, float))


def towards(state, move):
    return [PositionTask(state.equilibrium + np.array(move))]


@pytest.mark.parametrize(
    ("limit", "value"),
    [
        (
            lambda s, hard: TorqueLimit(0.0175, hard=hard),
            lambda s, d: np.abs(s.efforts + s.stiffness @ d) - 0.0175,
        ),
        (
            lambda s, hard: EffectorBox(s.equilibrium - 0.002, s.equilibrium + 0.002, hard=hard),
            lambda s, d: np.abs(s.jacobian[:3] @ d) - 0.002,
        ),
    ],
)
def test_a_soft_limit_gives_a_little_and_a_hard_one_does_not(limit, value):
    state = state_at()
    beyond = {}
    for hard in (False, True):
        result = solve_ik(build_ik(state, towards(state, [0.01, 0.002, 0.008]), [], [limit(state, hard)]))
        assert result.ok
        assert result.active_limits
        beyond[hard] = value(state, result.command - state.angles).max()
    free = solve_ik(build_ik(state, towards(state, [0.01, 0.002, 0.008])))
    assert value(state, free.command - state.angles).max() > 10 * beyond[False]
    assert beyond[False] > 1e-7
    assert beyond[True] < 1e-12


def test_a_hard_limit_that_is_broken_already_is_never_broken_further_and_always_feasible():
    """A torque above its maximum, a box elsewhere, angles that may not move: what can be kept is kept."""
    state = state_at()
    limit = TorqueLimit(0.8 * np.abs(state.efforts).min(), hard=True)
    box = EffectorBox(state.equilibrium + 0.01, state.equilibrium + 0.02, hard=True)
    still = [SpeedLimit(1.0)]
    held = solve_ik(build_ik(state, towards(state, [0, 0, 0.01]), still, [limit, box], dt=0.0))
    assert held.ok
    assert held.command == pytest.approx(WORKING, abs=1e-15)
    for rows in ([limit], [limit, box]):
        moved = solve_ik(build_ik(state, towards(state, [0, 0, 0.01]), still, rows, dt=0.01))
        assert moved.ok
        assert moved.kkt < 1e-9
    relieved = solve_ik(build_ik(state, towards(state, [0, 0, 0.01]), still, [limit], dt=0.01))
    assert (np.abs(state.efforts + relieved.d_tau) < np.abs(state.efforts) - 1e-5).all()


def test_all_limits_at_once_are_kept_and_named():
    """Hard and soft, more rows than angles, many targets, one solver."""
    rng = np.random.default_rng(8)
    one, named = IkSolver(3, rows=9), set()
    for _ in range(150):
        state = state_at(rng.uniform(-1.7, -1.3, 3))
        low, high = (
            state.equilibrium - rng.uniform(1e-4, 5e-3, 3),
            state.equilibrium + rng.uniform(1e-4, 5e-3, 3),
        )
        torque = np.abs(state.efforts) + rng.uniform(0, 2e-3, 3)
        rows = [
            TorqueLimit(torque, hard=True),
            EffectorBox(low, high, hard=True),
            EffectorBox(0.5 * (low + state.equilibrium), 0.5 * (high + state.equilibrium)),
        ]
        limits = [AngleLimit(-1.75, -1.25), SpeedLimit(3.0)]
        task = towards(state, 0.03 * rng.standard_normal(3))
        result = one.solve(build_ik(state, task, limits, rows, dt=0.1))
        assert result.ok, result.status
        assert result.kkt < 1e-6
        step = result.command - state.angles
        there = state.jacobian[:3] @ step
        assert (np.abs(state.efforts + state.stiffness @ step) <= torque + 1e-9).all()
        assert (state.equilibrium + there <= high + 1e-9).all()
        assert (state.equilibrium + there >= low - 1e-9).all()
        assert (result.command >= -1.75).all()
        named |= {name.split()[-1] for name in result.active_limits}
    assert {"torque", "x", "y", "z"} <= named


def test_limits_that_contradict_each_other_leave_a_solution():
    """Torques found too large, boxes that the effector is not in: a command all the same, certified."""
    rng = np.random.default_rng(12)
    one = IkSolver(3, rows=6)
    for _ in range(200):
        state = state_at(rng.uniform(-1.8, -1.2, 3))
        corner = state.equilibrium + rng.uniform(-0.03, 0.03, 3)
        rows = [
            TorqueLimit(rng.uniform(0.2, 1.2) * np.abs(state.efforts) + 1e-4, hard=bool(rng.integers(2))),
            EffectorBox(corner, corner + rng.uniform(1e-3, 0.02, 3), hard=bool(rng.integers(2))),
        ]
        task = towards(state, 0.03 * rng.standard_normal(3))
        result = one.solve(build_ik(state, task, [SpeedLimit(3.0)], rows, dt=0.05))
        assert result.ok, result.status
        assert result.kkt < 1e-6


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: EffectorBox([0, 0, 0], [1, 0, 1]), ("low [0.0, 0.0, 0.0] m", "high [1.0, 0.0, 1.0] m")),
        (lambda: EffectorBox([0, np.nan, 0], [1, 1, 1]), ("effector box", "low[1]", "nan")),
        (lambda: EffectorBox([0, 0, 0], [1, 1, 1], weight=np.inf), ("weight", "effector box", "inf")),
        (lambda: TorqueLimit(np.nan, hard=True), ("torque limit", "nan N m")),
    ],
)
def test_bad_limits_are_refused(make, named):
    with raises_naming(IkError, *named):
        make()
