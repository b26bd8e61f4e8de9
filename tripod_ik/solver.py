"""The quadratic programs solved: one OSQP instance, set up once, and a result that certifies itself."""

import signal
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import osqp
from scipy import sparse

from tripod_host.arrays import FloatArray, IndexArray
from tripod_ik.certificate import is_sane, kkt_residual, polish, prepare, solve_exactly
from tripod_ik.errors import IkError
from tripod_ik.problem import IkProblem
from tripod_ik.tasks import total_distance, total_of

KKT_TOLERANCE = 1e-6
"""Residual of the optimality conditions [rad] up to which a solution is used."""

COARSE, FINE = 1e-4, 1e-9
"""Tolerances of OSQP [rad]: the first nearly always suffices to find the active limits; the second without polish."""

RHO = 0.1
"""Step length of OSQP."""

CERTAIN = 1e-9
"""Residual [rad] up to which a solution with the active limits of the one before is taken without asking OSQP."""

CHANGES = 2
"""Guesses of the active rows from those of the solution before; where these do not do, OSQP is faster."""

NO_BOUND = float(osqp.constant("OSQP_INFTY"))
"""A bound from which on OSQP takes it for none."""

INTERRUPTED = int(osqp.SolverStatus.OSQP_SIGINT)

ACTIVE = 1e-7
"""Multiplier [rad] from which on a limit counts as active: it keeps the effector from coming closer."""


@dataclass(frozen=True, eq=False)
class IkResult:
    """What one step of inverse kinematics gives.

    Attributes:
        ok: Whether the program was solved; if not, `command` is the previous one and everything else refers
            to it.
        command: Servo angles to send [rad], shape (n,); finite and within all hard limits, always.
        d_tau: Change of the torques that goes with them [N m], shape (n,).
        error: Distance from all that the tasks ask to the equilibrium of the state [m], see
            `tasks.total_distance`.
        residual: The same after this command, as the linear model predicts [m].
        residuals: The residual of each task by name with unit, such as {"position [m]": 1e-5}.
        active_limits: Limits that keep the effector from coming closer, such as "servo_0 angle max", "servo_1
            torque".
        kkt: Residual of the optimality conditions, see `certificate.kkt_residual` [rad].
        iterations: Of OSQP; 0 where it was not asked.
        status: As OSQP names it.
    """

    ok: bool
    command: FloatArray
    d_tau: FloatArray
    error: float
    residual: float
    residuals: Mapping[str, float]
    active_limits: tuple[str, ...]
    kkt: float
    iterations: int
    status: str


class IkSolver:
    """Solves programs of one size, each started from the solution of the last.

    Where the limits active in the last solution, or a few changes of them, give a solution that certifies itself, that
    is it. Else OSQP finds the active limits to four digits, `certificate.polish` the exact solution for them, and the
    residual of the optimality conditions decides whether it is used: neither a false "solved" nor a false
    "infeasible" gets through, and a solution that OSQP ran out of iterations for is used if it is one. Where limits are
    nearly parallel, as those of tensions, OSQP may not find them: then `certificate.solve_exactly` does. Equal
    sequences of problems give equal bits, on a busy machine too: nothing depends on time unless a time limit is
    set, and 2000 iterations take less than a millisecond.
    """

    def __init__(
        self,
        n: int,
        *,
        rows: int = 0,
        max_iterations: int = 2000,
        time_limit: float | None = None,
        polishing: bool = True,
        reuse: bool = True,
    ) -> None:
        """Set OSQP up, once, and compile what is needed besides.

        Args:
            n: Number of servos.
            rows: Number of rows of the row limits.
            max_iterations: Of OSQP.
            time_limit: Of OSQP [s]; None for none.
            polishing: Whether the solution is polished to the last digit; without it OSQP has to find all digits
                itself, and takes ten times as many iterations.
            reuse: Whether the limits active in the last solution are tried before OSQP; needs polishing.

        Raises:
            IkError: a number is out of its range.
        """
        for name, value, least in (("n", n, 1), ("rows", rows, 0), ("max_iterations", max_iterations, 1)):
            if not value >= least:
                raise IkError(f"{name} is {value}; it must be at least {least}")
        if time_limit is not None and not time_limit > 0:
            raise IkError(f"time_limit is {time_limit} s; it must be positive")
        self._size, self._polishing, self._reuse = n + rows, polishing, reuse and polishing
        self._last: tuple[FloatArray, FloatArray] | None = None
        prepare(n, rows)
        P = np.eye(self._size, dtype=bool)
        P[:n, :n] = np.triu(np.ones((n, n), bool))
        A = np.zeros((self._size + rows, self._size), bool)
        A[: self._size] = np.eye(self._size, dtype=bool)
        A[self._size :, :n] = True
        A[self._size :, n:] = np.eye(rows, dtype=bool)
        self._P_entries, self._A_entries = _entries(P), _entries(A)
        self._osqp = osqp.OSQP()
        ones = np.ones(len(A))
        self._osqp.setup(
            _csc(np.eye(self._size), P),
            np.zeros(self._size),
            _csc(np.eye(*A.shape), A),
            -ones,
            ones,
            verbose=False,
            eps_abs=COARSE if polishing else FINE,
            eps_rel=0.0,
            max_iter=max_iterations,
            time_limit=1e10 if time_limit is None else time_limit,
            check_termination=5,
            rho=RHO,
            adaptive_rho=1,  # by iterations: by time, the same problem would give other bits each time
            adaptive_rho_interval=25,
            polishing=False,
        )
        self._core = self._osqp._solver  # what computes: to copy all that it tells of itself takes far longer

    def solve(self, problem: IkProblem) -> IkResult:
        """Return the solution, or the previous command with the reason why there is none.

        Raises:
            IkError: the problem has another size than this solver.
            KeyboardInterrupt: Ctrl-C came meanwhile, unless the process handles it otherwise.
        """
        if len(problem.q) != self._size:
            raise IkError(f"the problem has {len(problem.q)} unknowns, the solver was made for {self._size}")
        if not is_sane(problem):
            return _held(
                problem, 0, "the problem has a number that is not finite, or a lower bound above an upper one"
            )
        last, self._last = self._last, None
        if self._reuse and last:
            x, y, kkt = polish(problem, *last, CHANGES, problem.push)
            if kkt <= CERTAIN:
                self._last = x, y
                return _solved(problem, x, y, 0, "solved")
            self._osqp.warm_start(*last)
        self._update(problem)
        x, y, kkt, iterations, status = self._attempt(problem)
        if self._polishing and not kkt <= KKT_TOLERANCE:
            exact = solve_exactly(problem)
            if exact[2] <= KKT_TOLERANCE:
                x, y, kkt = exact
                status = "solved"
        if not kkt <= KKT_TOLERANCE:
            if status == "solved":
                status = (
                    f"no solution to {KKT_TOLERANCE:g} rad was found: the optimality conditions are violated by "
                    f"{kkt:.2g}"
                )
            return _held(problem, iterations, status, kkt)
        self._last = x, y
        return _solved(problem, x, y, iterations, status)

    def _update(self, problem: IkProblem) -> None:
        """Give OSQP the numbers of `problem`."""
        low, high = np.maximum(problem.l, -NO_BOUND), np.minimum(problem.u, NO_BOUND)
        P, A = problem.P.ravel()[self._P_entries], problem.A.ravel()[self._A_entries]
        self._core.update_data_vec(q=problem.q, l=low, u=high)
        self._core.update_data_mat(P_x=P, P_i=None, A_x=A, A_i=None)

    def _attempt(self, problem: IkProblem) -> tuple[FloatArray, FloatArray, float, int, str]:
        core = self._core
        core.solve()
        found = core.info
        if found.status_val == INTERRUPTED:
            signal.raise_signal(signal.SIGINT)  # OSQP takes Ctrl-C for itself while it runs: pass it on
        x, y = np.array(core.solution.x), np.array(core.solution.y)
        if self._polishing:
            x, y, kkt = polish(problem, x, y)
        else:
            kkt = kkt_residual(problem, x, y)
        return x, y, kkt, int(found.iter), str(found.status)


def solve_ik(problem: IkProblem) -> IkResult:
    """Solve one program by a solver of its own; to solve many, keep an `IkSolver`."""
    return IkSolver(len(problem.state.joint_names), rows=len(problem.names)).solve(problem)


def _csc(matrix: FloatArray, pattern: np.ndarray) -> sparse.csc_matrix:
    """Return `matrix` with the entries of `pattern` stored, zeros too, since updates cannot add any."""
    columns, rows = np.nonzero(pattern.T)
    ends = np.concatenate([[0], np.cumsum(pattern.sum(axis=0))])
    return sparse.csc_matrix((matrix[rows, columns], rows, ends), shape=matrix.shape)


def _entries(pattern: np.ndarray) -> IndexArray:
    """Return where the entries of `pattern` stand in a matrix read by rows, in the order of its columns."""
    columns, rows = np.nonzero(pattern.T)
    return np.asarray(rows * pattern.shape[1] + columns)


def _solved(problem: IkProblem, x: FloatArray, y: FloatArray, iterations: int, status: str) -> IkResult:
    state, box = problem.state, problem.box
    n = len(state.joint_names)
    command = np.minimum(np.maximum(state.angles + x[:n], box.low), box.high)
    kkt = kkt_residual(problem, np.concatenate((command - state.angles, x[n:])), y)
    pushes = y.tolist()
    names = [
        (box.high_names if pushes[i] > 0 else box.low_names)[i] for i in range(n) if abs(pushes[i]) > ACTIVE
    ]
    names += [
        name
        for name, push in zip(problem.names, pushes[len(y) - len(problem.names) :], strict=True)
        if abs(push) > ACTIVE
    ]
    return _result(problem, command, tuple(names), ok=True, kkt=kkt, iterations=iterations, status=status)


def _held(problem: IkProblem, iterations: int, status: str, kkt: float = float("inf")) -> IkResult:
    kkt = kkt if np.isfinite(kkt) else float("inf")
    return _result(problem, problem.hold, (), ok=False, kkt=kkt, iterations=iterations, status=status)


def _result(
    problem: IkProblem,
    command: FloatArray,
    active_limits: tuple[str, ...],
    *,
    ok: bool,
    kkt: float,
    iterations: int,
    status: str,
) -> IkResult:
    state, tasks = problem.state, problem.tasks
    step = command - state.angles
    errors = [rows.error for rows in problem.rows]
    left = [
        task.distances(rows.error - rows.jacobian @ step)
        for task, rows in zip(tasks, problem.rows, strict=True)
    ]
    return IkResult(
        ok=ok,
        command=command,
        d_tau=state.stiffness @ step,
        error=total_distance(tasks, errors),
        residual=total_of(tasks, left),
        residuals={name: value for found in left for name, value in found.items()},
        active_limits=active_limits,
        kkt=kkt,
        iterations=iterations,
        status=status,
    )
