"""The quadratic program of one step of inverse kinematics: from state, task and limits to its matrices.

The method is the inverse one of soft robotics [Duriez2013], [CoevoetEtAl2017]: the compliance of the present
state, projected to effector and actuators, makes the effector's displacement a linear function of the
actuators' efforts, and a quadratic program finds the efforts that bring it closest to the target within the
limits.

Here the efforts are the torques and the actuators' displacements the angles,

    d_p = W_ea d_tau,    δ = W_aa d_tau,

and the program is written in the angles: d_tau = K δ and d_p = J δ with K = W_aa⁻¹ and J = W_ea K. Both forms
have the same solutions; in the angles the hard limits become simple bounds, the unknowns are of order one,
and J stays finite where the torques pass a maximum (W_aa infinite) or a servo is blocked (W_aa singular).

It is a Newton step on the *static* inverse problem. The error is measured from the equilibrium p̄ (the
effector plus its offset from rest), so the dynamics of the body are not in the loop, and the new command is
an absolute angle, not an increment upon the last command, so the delay of the loop is not either: repeated at
any rate it converges as the Newton iteration does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, inf, sqrt

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.arrays import frozen
from tripod_ik.errors import IkError
from tripod_ik.limits import CommandBox, IntervalLimit, Motion, command_box
from tripod_ik.row_limits import RowLimit
from tripod_ik.state import LinearState
from tripod_ik.tasks import Task, TaskRows

REGULARISATION = 1e-4
"""ε: weight of the change of the command against the mean square of the Jacobian. It decides where the task
leaves a choice and bounds the step where the Jacobian is singular. As it acts on the change and not on the
angles, it moves no solution: a step leaves 1e-4 of the distance, the next 1e-4 of that.
"""

LIGHT = 1e-7
"""The same with actuators that are no servos: chambers beside each other bend a body a hundred times as easily as they
stretch it, and what is as stiff as that should converge as well."""

ROW_BOUND = 1e3
"""Bounds of rows farther away than this [rad] are cut: they cannot act, and large numbers disturb OSQP."""

REACH = 0.03
"""Bounds of rows count at most this far [rad] beyond what the allowed commands can reach: a limit that is far out of
reach pulls there, and no harder than one that is just out of reach.
"""

PRICE = 1.0
"""What a radian of the slack of a hard limit costs beside s²/2 [rad]. A cost in proportion to |s| is exact: as long as
the limit's multiplier stays below √weight · PRICE, there is no slack wherever the limit can be kept.
"""

LEAST_STEP = 0.01
"""Over which the Jacobian is taken to have turned at least [rad]: over shorter steps, what changes it is that the body
swings or a cable goes slack, and a damping that grows with that would make the next step shorter still."""

RANK, FLAT = 1e-4, 1e-6
"""Singular values of the Jacobian that count as none, over its norm; smallest curvature of the energy, over the
largest."""

LONGEST_RELAXATION, MADE = 0.3, 0.1
"""Longest step towards the least energy [rad], and the part of a step from which on it counts as made."""

BLIND = 1e-9
"""Rows of limits smaller than this [unit/rad] count as zero: no angle changes what they limit."""


@dataclass(frozen=True, eq=False)
class IkProblem:
    """minimise x·P x / 2 + q·x subject to l ≤ A x ≤ u, with x = (δ [rad], slacks of the row limits [rad]).

    Attributes:
        P: Symmetric, positive definite, shape (m, m); m is n plus the number of limit rows.
        q: Shape (m,).
        A: The identity for the bounds of δ and of the slacks, then the limit rows, shape (2 m - n, m).
        l: Lower bounds [rad], shape (2 m - n,).
        u: Upper bounds [rad], shape (2 m - n,).
        push: By what a multiplier counts beside the distance from its bound, where it is guessed which rows are
            active: 1 / weight for the rows of soft limits, whose multiplier is weight times distance; else 1.
        state: The state it is about.
        tasks: The tasks it was built for.
        rows: Their rows.
        box: The commands allowed.
        hold: The command allowed that is nearest to the previous one [rad], shape (n,).
        names: Of the limit rows, shape (m - n,).
        relaxation: The step towards the least energy that it prefers where the tasks leave a choice [rad], shape (n,).
    """

    P: FloatArray
    q: FloatArray
    A: FloatArray
    l: FloatArray  # noqa: E741 - its name in every text on quadratic programs
    u: FloatArray
    push: FloatArray
    state: LinearState
    tasks: tuple[Task, ...]
    rows: tuple[TaskRows, ...]
    box: CommandBox
    hold: FloatArray
    names: tuple[str, ...]
    relaxation: FloatArray


def build_ik(
    state: LinearState,
    tasks: Sequence[Task],
    limits: Sequence[IntervalLimit] = (),
    row_limits: Sequence[RowLimit] = (),
    *,
    previous: FloatArray | None = None,
    dt: float = 0.0,
    ahead: float = 0.0,
    turning: float = 0.0,
    relax: float = 0.0,
) -> IkProblem:
    """Return the quadratic program of one step.

    With e, J, S and c the error, the Jacobian, the weights and the curvature of each task,

        μ = Σ c |S² e|,   σ = Σ |S J|²/n + μ,

    and δ_hold the step to the allowed command nearest to the previous one, it is

        minimise  (Σ |S (J δ - e)|² + μ |δ|² + δ·B δ) / 2σ + ε |δ - δ_hold|² / 2 + |s|² / 2 + Σ PRICE |s_hard|
        with      low ≤ angles + δ ≤ high
                  row limits, see `row_limits`, each divided by k = |G|.

    The division by σ makes P of order one and q an angle. The damping μ vanishes with the error, so that
    reachable targets are approached quadratically [YamashitaFukushima2001]; where the target cannot be reached the
    error remains, the second derivative of |e|² is J'J minus e times the curvature, and without μ the
    iteration would jump about the closest pose for ever once that second part is the larger one. With c at
    least half of the curvature it converges. Towards a snap J grows without bound: B, see `softening`, is zero where
    the stability margin has no slope, and for a posture alone. Damping counts from the present angles and not from the
    previous command, since then a delay between command and state does not matter.

    Args:
        state: The linearised state.
        tasks: What to do.
        limits: Hard limits of the command, the first outranks the next.
        row_limits: Limits of torques, of the effector and the like, soft or hard.
        previous: The command sent before this one [rad], shape (n,); None means the present angles.
        dt: Time since then [s].
        ahead: Length |δ| of a step [rad] over which hard limits are to be kept by the robot itself, not only by the
            linear model: they are tightened by curvature |δ|²/2, as far as the command that is held keeps to that.
            Zero where steps are corrected afterwards.
        turning: How fast the Jacobian was seen to turn [1/rad], see `seen_turning`: in place of the tasks' curvature
            with actuators that are no servos.
        relax: How far actuators that the tasks leave free may go towards the least energy [rad], see `least_energy`; 0:
            they stay, as servos alone always do.

    Raises:
        IkError: there is no task, or `previous`, `dt` or `ahead` is not finite, or has the wrong shape or sign.
    """
    n = len(state.joint_names)
    if not tasks:
        raise IkError("no task is given, so there is nothing to solve")
    before = taut(state, state.angles if previous is None else frozen("previous", previous, (n,)))
    if not 0 <= dt < np.inf:
        raise IkError(f"dt is {dt} s; it must be finite and not negative")
    if not 0 <= ahead < np.inf:
        raise IkError(f"ahead is {ahead} rad; it must be finite and not negative")
    box = command_box(limits, Motion(state, before, dt))
    hold = np.minimum(np.maximum(before, box.low), box.high)
    keep = hold - state.angles

    rows = tuple(task.rows(state) for task in tasks)
    Se, SJ = weighted(rows)
    straight = all(r.curvature == 0.0 for r in rows)  # a posture: no snap makes its Jacobian grow
    soft = 0.0 if straight else softening(state, SJ, Se)
    mu = _damping(rows, state, turning)
    relaxation = _free_step(state, SJ, box, 0.0 if straight else relax)
    sigma = max(float(np.vdot(SJ, SJ)) / n + mu, 1e-18)  # [m²]; less only on a target that nothing moves

    limited = [limit.rows(state) for limit in row_limits]
    m = n + (extra := sum(len(r.names) for r in limited))
    P, q, A = np.eye(m), np.zeros(m), np.eye(m + extra, m)
    P[:n, :n] = (SJ.T @ SJ + soft) / sigma
    epsilon = LIGHT if state.held else REGULARISATION
    P.flat[: n * m : m + 1] += mu / sigma + epsilon
    q[:n] = -SJ.T @ Se / sigma - epsilon * (keep + relaxation)
    low, high, push = np.empty(m + extra), np.empty(m + extra), np.ones(m + extra)
    low[n:m], high[n:m] = -np.inf, np.inf
    low[:n], high[:n] = box.low - state.angles, box.high - state.angles
    ends = np.minimum(np.maximum([low[:n], high[:n]], -ROW_BOUND), ROW_BOUND)
    first = 0
    for limit, found in zip(row_limits, limited, strict=True):
        slack = slice(n + first, n + first + len(found.names))
        here = slice(m + first, m + first + len(found.names))
        k = np.array(
            [size if size > BLIND else inf for size in (hypot(*row) for row in found.matrix.tolist())]
        )
        A[here, :n] = G = (
            found.matrix / k[:, None]
        )  # what no angle changes gets a row of zeros without bounds
        least, most = _reach(G, ends)
        blind = k == inf
        low[here] = np.where(blind, -ROW_BOUND, np.minimum(np.maximum(found.low / k, least), most))
        high[here] = np.where(blind, ROW_BOUND, np.minimum(np.maximum(found.high / k, least), most))
        A[here, slack].flat[:: len(found.names) + 1] = 1.0 / sqrt(limit.weight)
        push[here] = 1.0 if limit.hard else 1.0 / limit.weight
        if limit.hard:  # no more slack than holding needs, and on that side only
            off = limit.curvature * ahead**2 / 2 / k
            held = G @ keep
            low[here] = np.maximum(low[here], np.minimum(low[here] + off, held))
            high[here] = np.minimum(high[here], np.maximum(high[here] - off, held))
            high[slack] = sqrt(limit.weight) * np.maximum(low[here] - held, 0.0)
            low[slack] = -sqrt(limit.weight) * np.maximum(held - high[here], 0.0)
            q[slack] = PRICE * (np.sign(high[slack]) + np.sign(low[slack]))
        first += len(found.names)
    return IkProblem(
        P, q, A, low, high, push, state, tuple(tasks), rows, box, hold,
        tuple(name for found in limited for name in found.names), relaxation,
    )  # fmt: skip


def taut(state: LinearState, before: FloatArray) -> FloatArray:
    """Return commands with slack cables just taut, where the state has them: the pose is the same."""
    if not state.held:
        return before
    slack = np.array([a.pulls for a in state.actuators]) & (state.efforts <= 0)
    return np.where(slack, np.maximum(before, state.angles), before)


def _free_step(state: LinearState, SJ: FloatArray, box: CommandBox, longest: float) -> FloatArray:
    """Return the step to the least energy, shape (n,), no longer than `longest` [rad]; none for servos alone."""
    if not (state.held and longest):
        return np.zeros(len(state.angles))
    return least_energy(state, SJ, box.low - state.angles, box.high - state.angles, longest)


def overshoots(before: IkProblem, after: IkProblem) -> bool:
    """Return whether the relaxation of one program was made, and that of the next turns back.

    The energy has kinks where cables go slack, and its second derivative is approximate: near the least energy whole
    steps can go to and fro for ever.
    """
    step, moved = before.relaxation, after.state.angles - before.state.angles
    return float(moved @ step) > MADE * float(step @ step) and float(after.relaxation @ step) < 0.0


def _damping(rows: Sequence[TaskRows], state: LinearState, turning: float) -> float:
    """Return μ, see `build_ik`."""
    return sum(_curvature(r, state, turning) * hypot(*(r.weights**2 * r.error).tolist()) for r in rows)


def _curvature(rows: TaskRows, state: LinearState, turning: float) -> float:
    """Return how fast the Jacobian of a task turns [unit/rad²]: what is known of the Tripod, else what was seen."""
    if not state.held or not rows.curvature:
        return rows.curvature
    return turning * float(np.linalg.norm(rows.jacobian))


def seen_turning(before: LinearState, after: LinearState) -> float:
    """Return how fast the Jacobian turned from one state to another, over its norm [1/rad]; 0 for servos alone."""
    if not after.held:
        return 0.0
    step, now = float(np.linalg.norm(after.angles - before.angles)), after.jacobian[:3]
    turned = float(np.linalg.norm(now - before.jacobian[:3])) / max(float(np.linalg.norm(now)), 1e-18)
    return turned / max(step, LEAST_STEP)


def least_energy(
    state: LinearState, SJ: FloatArray, low: FloatArray, high: FloatArray, longest: float = LONGEST_RELAXATION
) -> FloatArray:
    """Return the step, shape (n,), that makes the stored energy U least without moving what the tasks ask.

    With actuators P whose position is commanded and F whose effort is, U = Φ - Σ_F q dV/dq, and at rest

        ∂U/∂q_i = [i in P] tau_i - Σ_F q_j K_ji,      ∂²U/∂q² ≈ [K_PP, 0; 0, -K_FF].

    It is the Newton step in the null space of S J, no longer than `longest` [rad], of the joints that are not at an end
    of `low` to `high`, shape (n,) each, which it would pass. So the pose that is reached is the same to first order; no
    weights are needed, since all is energy.
    """
    n = len(state.angles)
    effort = np.array([a.is_effort for a in state.actuators])
    K, free = state.stiffness, np.ones(n, dtype=bool)
    slope = np.where(effort, 0.0, state.efforts) - (effort * state.angles) @ K
    H = np.where(effort[:, None] == effort, np.where(effort, -K, K), 0.0)
    out = np.zeros(n)
    for _ in range(n):
        out[:] = 0.0
        _, sizes, V = np.linalg.svd(SJ[:, free], full_matrices=True)
        N = V[int((sizes > RANK * max(float(np.linalg.norm(SJ)), 1e-18)).sum()) :].T
        if not N.shape[1]:
            break
        values, vectors = np.linalg.eigh(N.T @ H[np.ix_(free, free)] @ N)
        largest = max(float(np.abs(H).max()), 1e-18)
        along = vectors.T @ (N.T @ slope[free]) / np.maximum(np.abs(values), FLAT * largest)
        step = -N @ (vectors @ along)
        out[free] = step * min(1.0, longest / max(float(np.linalg.norm(step)), 1e-18))
        stuck = free & (((out < 0) & (low >= 0)) | ((out > 0) & (high <= 0)))
        if not stuck.any():
            break
        free &= ~stuck
        if not free.any():
            return np.zeros(n)
    return out


def softening(state: LinearState, SJ: FloatArray, Se: FloatArray) -> FloatArray:
    """Return what the growth of J towards a snap adds to the second derivative of |S e|²/2, at most, shape (n, n).

    With s = dρ/dα, J n grows along n = s / |s| as |s| / ρ does, so that is |Se · SJ n| |s| / ρ in that direction.
    """
    slope = state.stability_margin_slope
    steep = hypot(*slope.tolist())
    if steep == 0.0:
        return np.zeros((len(slope), len(slope)))
    return (
        slope[:, None]
        * slope
        * (abs(float(Se @ (SJ @ slope))) / (steep**2 * max(abs(state.stability_margin), 1e-3)))
    )


def weighted(rows: Sequence[TaskRows]) -> tuple[FloatArray, FloatArray]:
    """Return S e, shape (m,), and S J, shape (m, n), of the rows of all tasks."""
    Se, SJ = [r.weights * r.error for r in rows], [r.weights[:, None] * r.jacobian for r in rows]
    return (Se[0], SJ[0]) if len(rows) == 1 else (np.concatenate(Se), np.concatenate(SJ))


def _reach(G: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least and the largest value of G δ for δ between `ends`, shape (2, n), `REACH` beyond, but within
    `ROW_BOUND`.
    """
    one, other = G * ends[0], G * ends[1]
    least, most = np.minimum(one, other).sum(axis=1), np.maximum(one, other).sum(axis=1)
    return np.maximum(least - REACH, -ROW_BOUND), np.minimum(most + REACH, ROW_BOUND)
