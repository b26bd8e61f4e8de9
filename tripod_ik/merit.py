"""How good a step was on the model itself, and how to mend one that the model's curvature took beyond a limit."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.problem import BLIND, PRICE, IkProblem
from tripod_ik.row_limits import RowLimit
from tripod_ik.state import LinearState

ROUNDING = 1e-7
"""A hard limit passed by less than this [rad] counts as kept: 1.5 nm of the effector, 2e-8 N m."""


def merit(problem: IkProblem, state: LinearState, limits: Sequence[RowLimit]) -> float:
    """Return what `problem` minimises, at `state`, with the scales of the problem's own state [rad²].

    Hard limits cost in proportion to how far they are passed, with the price that the program has: a step that buys
    nearness to the target by passing one is no progress.
    """
    Se = [r.weights * r.error for r in (task.rows(state) for task in problem.tasks)]
    SJ = np.concatenate([r.weights[:, None] * r.jacobian for r in problem.rows])
    n = len(state.angles)
    mu = sum(r.curvature * float(np.linalg.norm(r.weights**2 * r.error)) for r in problem.rows)
    value = sum(float(e @ e) for e in Se) / (2 * max(float(np.sum(SJ**2)) / n + mu, 1e-18))
    for limit in limits:
        passed = _passed(limit, state, _scale(limit, problem.state))
        value += limit.weight / 2 * float(passed @ passed)
        if limit.hard:
            value += PRICE * np.sqrt(limit.weight) * float(np.maximum(passed - ROUNDING, 0.0).sum())
    return value


def hard_limits_passed(state: LinearState, limits: Sequence[RowLimit]) -> float:
    """Return how far `state` is beyond its hard limits at most, as a turn of the servos that leads back [rad]."""
    return limits_passed(state, [limit for limit in limits if limit.hard])


def limits_passed(state: LinearState, limits: Sequence[RowLimit]) -> float:
    """Return the same for all limits, soft ones, too."""
    found = [_passed(limit, state, _scale(limit, state)).max(initial=0.0) for limit in limits]
    return float(max(found, default=0.0))


def corrected(
    problem: IkProblem, step: FloatArray, there: LinearState, limits: Sequence[RowLimit]
) -> IkProblem:
    """Return `problem` with the rows of its limits as they were found at the end of a step.

    With c(δ) what a row limits, known at `there`, and G its slope, the bounds move by c(0) + G δ - c(δ): the second-
    order correction of sequential quadratic programming [NocedalWright2006, section 18.3]. Without it no merit that
    keeps to limits lets whole steps along a curved limit pass.

    Args:
        problem: The program.
        step: δ, from its state to `there` [rad], shape (n,).
        there: The state that the model has after that step.
        limits: Those that the program was built with.
    """
    low, high = problem.l.copy(), problem.u.copy()
    first = len(problem.q)
    for limit in limits:
        before, after = limit.rows(problem.state), limit.rows(there)
        rows = slice(first, first + len(before.names))
        shift = problem.A[rows, : len(step)] @ step + (after.low - before.low) / _scale(limit, problem.state)
        low[rows] += shift
        high[rows] += shift
        first = rows.stop
    return replace(problem, l=low, u=high)


def _scale(limit: RowLimit, state: LinearState) -> FloatArray:
    """Return |G| of each row [unit/rad]; infinite where no angle changes what it limits."""
    size = np.linalg.norm(limit.rows(state).matrix, axis=1)
    return np.where(size > BLIND, size, np.inf)


def _passed(limit: RowLimit, state: LinearState, scale: FloatArray) -> FloatArray:
    there = limit.rows(state)
    return np.asarray(np.maximum(np.maximum(there.low, -there.high), 0.0) / scale)
