import dataclasses
import os
import signal
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from tests.ik.exact import best_step, cost
from tests.ik.plant import SpringRobot
from tests.messages import assert_names, raises_naming
from tripod_graph.names import SERVOS
from tripod_ik import solver
from tripod_ik.certificate import kkt_residual, polish, solve_exactly
from tripod_ik.errors import IkError
from tripod_ik.limits import AngleLimit, SpeedLimit, StepLimit
from tripod_ik.problem import REGULARISATION, build_ik
from tripod_ik.row_limits import TorqueLimit
from tripod_ik.solver import IkSolver, solve_ik
from tripod_ik.state import LinearState
from tripod_ik.tasks import PositionTask

WORKING = np.full(3, -1.4965)
LIMITS = (AngleLimit(-2.1, 0.6), StepLimit(0.5), SpeedLimit(3.0))


def random_problem(rng, *, torque):
    """Any sizes that could occur, and degenerate ones: blocked servos, dead effector, zero time, bounds met exactly."""
    root = rng.standard_normal((9, 9)) * np.array([0.1] * 6 + [3.0] * 3)[:, None]
    W = root @ root.T / 9
    match rng.integers(6):
        case 0:
            W[8], W[:, 8] = 0.0, 0.0  # servo 2 blocked
        case 1:
            W[:6], W[:, :6] = 0.0, 0.0  # nothing moves the effector
        case 2:
            W[7], W[:, 7] = W[6], W[:, 6]  # two servos that act as one
            W[7, 7] = W[6, 7] = W[7, 6] = W[6, 6]
        case 3:
            W[6:, 6:] -= 2 * np.diag(np.diag(W)[6:])  # unstable at fixed torques
        case 4:
            W[0], W[:, 0] = 1e-4 * W[1], 1e-4 * W[:, 1]  # nearly singular
    angles = rng.uniform(-2.2, 0.7, 3)
    state = LinearState(
        SERVOS,
        angles,
        rng.standard_normal(3) * 0.2,
        rng.standard_normal(3) * 0.01,
        np.array([0, 0, 0, 1.0]),
        rng.standard_normal(6) * 1e-3,
        (W + W.T) / 2,
    )
    weights = rng.choice([[1, 1, 1], [1, 1, 0], [0.1, 1, 10]])
    target = state.equilibrium + rng.standard_normal(3) * 10 ** rng.uniform(-5, -1) * rng.integers(2)
    limit = TorqueLimit(rng.uniform(0.05, 0.4), weight=10 ** rng.uniform(1, 3)) if torque else None
    previous = angles + rng.standard_normal(3) * 10 ** rng.uniform(-3, 0)
    limits = LIMITS[: rng.integers(1, 4)]
    task = PositionTask(target, weights, curvature=rng.choice([0.0, 0.03]))
    rows, dt = [limit] if limit else [], rng.choice([0.0, 0.01, 0.1])
    return build_ik(state, [task], limits, rows, previous=previous, dt=dt), limit


@pytest.mark.parametrize(("torque", "count"), [(False, 150), (True, 60)])
def test_the_solution_is_the_best_of_all_combinations_of_active_limits(torque, count):
    rng = np.random.default_rng(5)
    warm = IkSolver(3, rows=3 if torque else 0)
    binding = 0
    for _ in range(count):
        problem, limit = random_problem(rng, torque=torque)
        result = warm.solve(problem)
        assert result.ok, result.status
        assert result.kkt < 1e-6
        exact = best_step(problem, limit)
        found = result.command - problem.state.angles
        assert found == pytest.approx(exact, abs=1e-6 * max(1.0, np.abs(exact).max()))
        assert cost(problem, limit, found) <= cost(problem, limit, exact) + 1e-9
        assert (result.command >= problem.box.low).all()
        assert (result.command <= problem.box.high).all()
        binding += bool(result.active_limits)
    assert count * 0.2 < binding < count


def nearly_parallel(rng):
    """Rows that limit two directions from both sides, as tensions of many cables do; slacks are fixed to zero."""
    n = 8
    J, directions = rng.standard_normal((3, n)), rng.standard_normal((2, n))
    G = rng.choice([-1.0, 1.0], (n, 1)) * directions[rng.integers(2, size=n)] + 1e-3 * rng.standard_normal(
        (n, n)
    )
    G /= np.linalg.norm(G, axis=1)[:, None]
    A = np.eye(3 * n, 2 * n)
    A[2 * n :] = np.hstack([G, 0.03 * np.eye(n)])
    P = np.diag(np.full(2 * n, 1.0))
    P[:n, :n] = J.T @ J / n + 1e-7 * np.eye(n)
    q = np.append(rng.standard_normal(n) * 0.1, np.zeros(n))
    low = np.concatenate([np.full(n, -0.03), np.zeros(n), -rng.uniform(0, 3e-3, n) * rng.integers(2, size=n)])
    high = np.concatenate([np.full(n, 0.03), np.zeros(n), np.full(n, 0.1)])
    return SimpleNamespace(P=P, q=q, A=A, l=low, u=high)


def test_limits_that_are_nearly_parallel_are_solved_exactly():
    rng, active = np.random.default_rng(2), []
    for _ in range(300):
        problem = nearly_parallel(rng)
        x, y, kkt = solve_exactly(problem)
        assert kkt < 1e-9 and kkt == kkt_residual(problem, x, y)
        active.append((np.abs(y[16:]) > 1e-7).sum())
    assert np.mean(active) > 1
    problem.l[16:], problem.u[16:] = problem.l[16:] + 10, problem.u[16:] + 10
    assert solve_exactly(problem)[2] > 1


@pytest.mark.parametrize("torque", [False, True])
def test_no_problem_is_too_hard(torque):
    """Some of these need the finer tolerance, some are certified though OSQP ran out of iterations."""
    rng = np.random.default_rng(7)
    one = IkSolver(3, rows=3 if torque else 0)
    results = [one.solve(random_problem(rng, torque=torque)[0]) for _ in range(1500)]
    assert [r.status for r in results if not (r.ok and r.kkt < 1e-9)] == []


def test_polishing_never_makes_it_worse():
    rng = np.random.default_rng(9)
    for _ in range(100):
        problem, _ = random_problem(rng, torque=True)
        x, y = rng.standard_normal(6) * 1e-3, rng.standard_normal(9) * 1e-3
        residual = kkt_residual(problem, x, y)
        for _ in range(3):
            x, y, after = polish(problem, x, y)
            assert after <= residual
            assert after == kkt_residual(problem, x, y)
            residual = after


def test_a_servo_that_cannot_turn_has_no_torque_limit():
    state = SpringRobot(slide=0.035).state(WORKING)
    W = state.W.copy()
    W[8], W[:, 8] = 0.0, 0.0
    W[8, 8] = 1e-14  # what rounding leaves
    state = dataclasses.replace(state, W=W, efforts=np.array([0.0, 0.0, 5.0]))
    task = PositionTask(state.equilibrium + np.array([0.001, 0.0, 0.0]))
    result = solve_ik(build_ik(state, [task], LIMITS, [TorqueLimit(0.3)], dt=0.1))
    assert result.ok
    assert result.command[2] == pytest.approx(WORKING[2], abs=1e-12)
    assert np.abs(result.command[:2] - WORKING[:2]).max() > 1e-2
    assert result.active_limits == ()


def test_angles_and_torques_are_two_forms_of_one_problem():
    """Without limits, minimise over d_tau directly, as the method is published, with the same damping."""
    state = SpringRobot(slide=0.035).state(np.array([-1.3, -1.5, -1.6]))
    task = PositionTask(state.equilibrium + np.array([0.004, -0.003, 0.002]))
    result = solve_ik(build_ik(state, [task]))
    W_ea, W_aa = state.W[:3, 6:], state.W[6:, 6:]
    e = task.target - state.equilibrium
    mu = task.curvature * np.linalg.norm(e)
    sigma = np.sum((W_ea @ np.linalg.inv(W_aa)) ** 2) / 3 + mu
    H = (W_ea.T @ W_ea + (mu + 1e-4 * sigma) * W_aa.T @ W_aa) / sigma
    d_tau = np.linalg.solve(H, W_ea.T @ e / sigma)
    assert result.d_tau == pytest.approx(d_tau, rel=1e-7)
    assert result.command == pytest.approx(state.angles + W_aa @ d_tau, rel=1e-9)
    assert result.error == pytest.approx(np.linalg.norm(e))
    assert result.residual == pytest.approx(np.linalg.norm(e - W_ea @ d_tau))
    assert result.active_limits == ()


@pytest.mark.parametrize("torque", [False, True])
def test_a_limit_is_named_as_soon_as_it_takes_something_away(torque):
    """Limits that the best step would pass by a hundred thousandth of a radian, and by less than can be told."""
    state = SpringRobot(slide=0.035).state(np.array([-1.3, -1.5, -1.6]))
    task = PositionTask(state.equilibrium + np.array([0.0, 0.0, 0.01]))  # all turn up, and all torques grow
    free = solve_ik(build_ik(state, [task]))
    assert (free.command > state.angles).all()
    after = state.efforts + free.d_tau
    assert (after < state.efforts).all() and (state.efforts < 0).all()
    for cut, active in ((1e-2, True), (1e-5, True), (1e-10, False), (-1e-5, False)):
        ends = np.array([-cut, 1.0, 1.0])
        if torque:
            name, limit = (
                "servo_0 torque",
                TorqueLimit(-after + np.linalg.norm(state.stiffness, axis=1) * ends),
            )
            result = solve_ik(build_ik(state, [task], [], [limit]))
        else:
            name, limit = "servo_0 angle max", AngleLimit(-2.1, free.command + ends)
            result = solve_ik(build_ik(state, [task], [limit]))
        assert result.active_limits == ((name,) if active else ()), cut


def test_the_prediction_agrees_with_the_robot():
    robot = SpringRobot(slide=0.035)
    state = robot.state(WORKING)
    task = PositionTask(state.equilibrium + np.array([1e-4, 2e-4, -1e-4]))
    result = solve_ik(build_ik(state, [task]))
    there = robot.state(result.command)
    assert np.linalg.norm(task.target - there.equilibrium) == pytest.approx(result.residual, abs=1e-6)
    assert there.efforts - state.efforts == pytest.approx(result.d_tau, abs=2e-5)
    assert np.abs(result.d_tau).max() > 1e-4


@pytest.mark.parametrize(
    ("limits", "torque", "name"),
    [
        ([AngleLimit(-3.0, -1.4)], [], "servo_0 angle max"),
        ([AngleLimit(-1.5, 0.0)], [], "servo_1 angle min"),
        ([SpeedLimit(2.0)], [], "servo_0 speed"),
        ([StepLimit(0.05)], [], "servo_0 step"),
        ([], [TorqueLimit(0.016)], "servo_0 torque"),
    ],
)
def test_a_limit_binds_when_on_and_not_when_off(limits, torque, name):
    state = SpringRobot(slide=0.035).state(WORKING)
    task = PositionTask(state.equilibrium + np.array([-0.004, 0.002, 0.003]))
    free = solve_ik(build_ik(state, [task], dt=0.01))
    bound = solve_ik(build_ik(state, [task], limits, torque, dt=0.01))
    assert free.active_limits == ()
    assert name in bound.active_limits
    assert bound.residual > free.residual + 2e-5
    wide = [AngleLimit(-3.0, 0.0), SpeedLimit(500.0), StepLimit(2.0)]
    off = solve_ik(build_ik(state, [task], wide, [TorqueLimit(1.0)], dt=0.01))
    assert off.active_limits == ()
    assert off.command == pytest.approx(free.command, abs=1e-9)


def test_hard_limits_hold_exactly():
    rng = np.random.default_rng(3)
    robot = SpringRobot(slide=0.035)
    one = IkSolver(3)
    for _ in range(50):
        state = robot.state(rng.uniform(-2.0, -1.0, 3))
        previous = state.angles + rng.uniform(-0.02, 0.02, 3)
        low, high = rng.uniform(-2.1, -1.6), rng.uniform(-1.5, -1.0)
        task = PositionTask(state.equilibrium + rng.standard_normal(3) * 0.05)
        limits = [AngleLimit(low, high), SpeedLimit(3.0)]
        result = one.solve(build_ik(state, [task], limits, previous=previous, dt=0.02))
        before = np.clip(previous, low, high)
        assert (result.command >= low).all()  # no tolerance: a receiver has none
        assert (result.command <= high).all()
        assert np.abs(result.command - before).max() <= 3.0 * 0.02 + 1e-15


def test_all_bounds_active():
    state = SpringRobot(slide=0.035).state(WORKING)
    task = PositionTask(state.equilibrium + np.array([0.0, 0.0, -0.1]))
    result = solve_ik(build_ik(state, [task], [SpeedLimit(1.0)], dt=0.01))
    assert result.ok
    assert result.active_limits == ("servo_0 speed", "servo_1 speed", "servo_2 speed")
    assert np.abs(result.command - WORKING) == pytest.approx([0.01] * 3, abs=1e-15)


def test_zero_time_holds_the_previous_command_and_says_why():
    state = SpringRobot(slide=0.035).state(WORKING)
    previous = WORKING + np.array([0.01, -0.02, 0.0])
    task = PositionTask(state.equilibrium + np.array([0.01, 0.0, 0.0]))
    result = solve_ik(build_ik(state, [task], LIMITS, [TorqueLimit(0.3)], previous=previous, dt=0.0))
    assert result.ok
    assert result.command.tolist() == previous.tolist()
    assert set(result.active_limits) == {"servo_0 speed", "servo_1 speed", "servo_2 speed"}


def test_a_torque_limit_below_the_present_torque_is_approached_not_refused():
    robot = SpringRobot(slide=0.035)
    angles = np.full(3, -1.1)
    state = robot.state(angles)
    limit = TorqueLimit(0.8 * np.abs(state.efforts).min())
    result = solve_ik(build_ik(state, [PositionTask(state.equilibrium)], [SpeedLimit(1.0)], [limit], dt=0.01))
    assert result.ok
    after = np.abs(state.efforts + result.d_tau)
    assert (after < np.abs(state.efforts) - 1e-5).all()
    assert set(result.active_limits) >= {f"{name} torque" for name in SERVOS}


def infeasible(problem):
    """Ask for δ_0 <= 0.1 and, in the row of a torque, for δ_0 >= 1."""
    A, low, high = problem.A.copy(), problem.l.copy(), problem.u.copy()
    A[6] = [1, 0, 0, 0, 0, 0]
    high[0], low[6], high[6] = 0.1, 1.0, 2.0
    return dataclasses.replace(problem, A=A, l=low, u=high)


def typical(**changes):
    state = SpringRobot(slide=0.035).state(WORKING)
    task = PositionTask(state.equilibrium + np.array([0.005, -0.002, 0.004]))
    problem = build_ik(state, [task], LIMITS, [TorqueLimit(0.3)], previous=WORKING + 0.01, dt=0.01)
    return dataclasses.replace(problem, **changes)


def test_what_is_held_keeps_to_the_limits_too():
    state = SpringRobot(slide=0.035).state(WORKING)
    problem = build_ik(
        state, [PositionTask(state.equilibrium)], LIMITS, [TorqueLimit(0.3)], previous=np.full(3, 1.5)
    )
    result = IkSolver(3, rows=3).solve(infeasible(problem))
    assert not result.ok
    assert result.command == pytest.approx(WORKING + 0.5)


def test_an_infeasible_problem_holds_the_previous_command():
    one = IkSolver(3, rows=3)
    result = one.solve(infeasible(typical()))
    assert not result.ok
    assert "infeasible" in result.status
    assert result.command == pytest.approx(WORKING + 0.01, abs=1e-15)
    assert result.kkt > 1e-6
    assert all(np.isfinite(v).all() for v in (result.command, result.d_tau, result.error, result.residual))
    again = one.solve(typical())  # and the solver is none the worse for it
    assert again.ok
    assert again.command == pytest.approx(solve_ik(typical()).command, abs=1e-9)


@pytest.mark.parametrize(
    "changes", [{"q": np.full(6, np.nan)}, {"P": np.full((6, 6), np.inf)}, {"l": np.full(9, np.nan)}]
)
def test_a_problem_that_is_not_finite_holds_the_previous_command(changes):
    result = IkSolver(3, rows=3).solve(typical(**changes))
    assert not result.ok
    assert_names(result.status, "not finite")
    assert result.command == pytest.approx(WORKING + 0.01, abs=1e-15)


@pytest.mark.parametrize(
    ("settings", "limit"),
    [({"max_iterations": 1}, "maximum iterations"), ({"time_limit": 1e-9}, "time limit")],
)
def test_without_time_the_result_is_used_only_if_it_is_certified(monkeypatch, settings, limit):
    state = SpringRobot(slide=0.035).state(WORKING)
    tasks = [PositionTask(state.equilibrium + np.array([0.005, -0.002, 0.004]))]
    problem = build_ik(state, tasks, LIMITS, previous=WORKING + 0.01, dt=0.01)
    rescued = IkSolver(3, **settings).solve(problem)
    assert_names(rescued.status, limit)
    assert rescued.ok  # the active limits were guessed right, and the residual proves it
    assert rescued.command == pytest.approx(solve_ik(problem).command, abs=1e-9)
    monkeypatch.setattr(solver, "polish", lambda problem, x, y, *_: (x, y, kkt_residual(problem, x, y)))
    exact = IkSolver(3, **settings).solve(problem)
    assert exact.ok and exact.kkt < 1e-12
    assert exact.command == pytest.approx(rescued.command, abs=1e-9)
    none = np.zeros(3), np.zeros(3), np.inf
    monkeypatch.setattr(solver, "solve_exactly", lambda problem: none)
    held = IkSolver(3, **settings).solve(problem)
    assert held.status == rescued.status
    assert not held.ok
    assert held.command == pytest.approx(WORKING + 0.01, abs=1e-15)
    monkeypatch.setattr(solver, "KKT_TOLERANCE", 1e-14)
    ended = IkSolver(3).solve(problem)
    assert not ended.ok
    assert_names(ended.status, "optimality conditions", "1e-14 rad", f"{ended.kkt:.2g}")


def test_without_polishing_osqp_finds_the_same_by_itself():
    rng = np.random.default_rng(13)
    for rows in (0, 3):
        plain, polished = (IkSolver(3, rows=rows, polishing=p, max_iterations=100_000) for p in (False, True))
        for _ in range(20):
            problem, _ = random_problem(rng, torque=rows > 0)
            a, b = plain.solve(problem), polished.solve(problem)
            if a.ok:
                assert 1e-15 < a.kkt < 1e-6
                assert a.command == pytest.approx(b.command, abs=1e-5)
                assert a.iterations >= b.iterations
        assert a.ok


def moving_targets(*, torque, count=200):
    """The robot follows a target that runs about and now and then jumps: limits come and go."""
    robot, angles = SpringRobot(slide=0.035), WORKING
    limit = [TorqueLimit(0.0175, hard=torque == "hard")] if torque else []
    for k in range(count):
        state = robot.state(angles)
        reach = 0.1 if k % 50 > 40 else 0.004
        target = robot.rest(WORKING) + reach * np.array([np.cos(0.1 * k), np.sin(0.1 * k), np.sin(0.17 * k)])
        problem = build_ik(state, [PositionTask(target)], LIMITS, limit, previous=angles, dt=0.02)
        yield problem
        angles = solve_ik(problem).command


@pytest.mark.parametrize("torque", ["", "soft", "hard"])
def test_the_limits_active_last_time_spare_osqp_and_change_nothing(torque):
    rows = 3 if torque else 0
    reusing, asking = IkSolver(3, rows=rows), IkSolver(3, rows=rows, reuse=False)
    spared = limited = 0
    for problem in moving_targets(torque=torque):
        a, b = reusing.solve(problem), asking.solve(problem)
        assert a.ok
        assert a.kkt < 1e-9
        assert a.command == pytest.approx(b.command, abs=1e-8)
        assert a.active_limits == b.active_limits
        assert b.iterations > 0
        spared += a.iterations == 0
        limited += bool(a.active_limits)
    assert spared > 80
    assert limited > 40


def test_equal_sequences_give_equal_bits():
    def sequence():
        rng = np.random.default_rng(11)
        one = IkSolver(3, rows=3)
        return [one.solve(random_problem(rng, torque=True)[0]) for _ in range(40)]

    for a, b in zip(sequence(), sequence(), strict=True):
        assert a.command.tobytes() == b.command.tobytes()
        assert a.iterations == b.iterations


def test_nothing_is_printed(capfd):
    state = SpringRobot(slide=0.035).state(WORKING)
    one = IkSolver(3)
    for target in (state.equilibrium, state.equilibrium + np.array([0, 0, 0.1])):
        one.solve(build_ik(state, [PositionTask(target)], LIMITS, dt=0.01))
    assert capfd.readouterr() == ("", "")


def test_a_solver_of_another_size_is_refused():
    with raises_naming(IkError, "6 unknowns", "made for 3"):
        IkSolver(3).solve(typical())


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"n": 0}, ("n", 0, "at least 1")),
        ({"rows": -1}, ("rows", -1, "at least 0")),
        ({"max_iterations": 0}, ("max_iterations", 0, "at least 1")),
        ({"time_limit": -1.0}, ("time_limit", "-1.0 s", "positive")),
        ({"time_limit": np.nan}, ("time_limit", "nan s", "positive")),
    ],
)
def test_a_solver_that_cannot_be_is_refused_and_prints_nothing(given, named, capfd):
    with raises_naming(IkError, *named):
        IkSolver(**{"n": 3} | given)
    assert capfd.readouterr() == ("", "")


def test_previous_dt_and_ahead_are_checked():
    state = SpringRobot().state(np.zeros(3))
    task = PositionTask(state.equilibrium)
    with raises_naming(IkError, "previous[2]", "nan"):
        build_ik(state, [task], previous=np.array([0, 0, np.nan]))
    for dt in (np.nan, -1.0, np.inf):
        with raises_naming(IkError, "dt", dt):
            build_ik(state, [task], dt=dt)
        with raises_naming(IkError, "ahead", dt):
            build_ik(state, [task], ahead=dt)


def test_ctrl_c_during_a_solve_is_not_lost():
    """OSQP installs a handler of its own while it runs; an endless problem and a signal meanwhile show it."""
    problem = infeasible(typical())
    problem = dataclasses.replace(problem, A=np.zeros((9, 6)), l=np.full(9, -1.0), u=np.full(9, 1.0))
    one = IkSolver(3, rows=3, max_iterations=2_000_000_000, time_limit=60.0)
    one._osqp.update_settings(eps_abs=1e-300, check_termination=0)
    caught, ended = [], threading.Event()
    used = time.pthread_getcpuclockid(threading.get_ident())
    begun = time.clock_gettime(used)

    def interrupt():
        """Wait until this thread has computed for so long [s] that it must be in the midst of the solve."""
        while time.clock_gettime(used) < begun + 0.2:
            if ended.wait(0.005):
                return
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, lambda *_: caught.append(True))
    killer = threading.Thread(target=interrupt)
    killer.start()
    try:
        result = one.solve(problem)
    finally:
        ended.set()
        killer.join()
        signal.signal(signal.SIGINT, before)
    assert caught == [True]
    assert "interrupt" in result.status


@pytest.mark.parametrize("off", [-4e-3, -1e-4, 4e-3])
def test_towards_a_snap_the_program_has_the_curvature_of_what_it_minimises(off):
    """A servo at α moves the effector by p = -c ρ, with ρ² = k (α0 - α): J = c k / 2ρ, and J grows by c k² / 4ρ³."""
    c, k, rho, curvature = 0.02, 1.5, 0.2, 1e-6
    J, growth = c * k / (2 * rho), c * k**2 / (4 * rho**3)
    W = np.zeros((7, 7))
    W[6, 6], W[0, 6], W[6, 0], W[0, 0] = 2.0, 2.0 * J, 2.0 * J, 3.0 * J * J
    state = LinearState(
        ("servo_0",), np.array([-1.0]), np.zeros(1), np.array([-c * rho, 0.0, 0.0]), np.array([0, 0, 0, 1.0]),
        np.zeros(6), W, stability_margin=rho, stability_margin_slope=np.array([-k / (2 * rho)]),
    )  # fmt: skip
    task = PositionTask(
        state.equilibrium + np.array([off, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]), curvature=curvature
    )
    problem = build_ik(state, [task])
    sigma = J**2 + curvature * abs(off)
    found = (problem.P[0, 0] - REGULARISATION) * sigma - curvature * abs(off)
    # of |e|²/2 it is J² - e dJ/dα; where that is less than J², no more than its size is known: the step is not longer
    assert found == pytest.approx(J**2 + abs(off) * growth, rel=1e-9)
    if off < 0:
        turn = 1e-4
        ends = [(off - c * rho + c * np.sqrt(rho**2 - k * t)) ** 2 / 2 for t in (-turn, 0.0, turn)]
        assert found == pytest.approx((ends[0] - 2 * ends[1] + ends[2]) / turn**2, rel=1e-4)
