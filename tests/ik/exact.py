"""Inverse kinematics solved by trying everything: an independent answer to compare with.

The program of `tripod_ik.problem` without its slack is, in δ alone, a sum of squares with bounds on δ and a penalty
on each torque beyond its maximum. For each choice of "at the lower bound, between, at the upper bound" for the angles
and "below, within, beyond" for the torques it is a linear system; the solution with the least cost among those within
the bounds is the solution.
"""

from itertools import product

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.problem import REACH, REGULARISATION, IkProblem
from tripod_ik.row_limits import TorqueLimit


def cost(problem: IkProblem, torque: TorqueLimit | None, delta: FloatArray) -> float:
    """Return the cost of the steps `delta` [rad], shape (..., n), as `build_ik` has it, less |S e|²/2σ."""
    state, task = problem.state, problem.tasks[0]
    S, J, e = np.diag(task.weights), state.jacobian[:3], task.target - state.equilibrium
    mu = task.curvature * np.linalg.norm(S @ S @ e)
    sigma = max(np.sum((S @ J) ** 2) / len(state.angles) + mu, 1e-18)
    value = np.sum((delta @ J.T) @ S @ S * (delta @ J.T - 2 * e), axis=-1) + mu * np.sum(delta**2, axis=-1)
    value = value / (2 * sigma)
    value += REGULARISATION / 2 * np.sum((state.angles + delta - problem.hold) ** 2, axis=-1)
    if torque is not None:
        k = np.linalg.norm(state.stiffness, axis=1)
        after, (least, most) = state.efforts + delta @ state.stiffness.T, torque_range(problem, torque)
        beyond = np.maximum(np.maximum(after - most, least - after), 0.0)
        value += (
            torque.weight / 2 * np.sum(np.where(k > 1e-9, beyond / np.maximum(k, 1e-9), 0.0) ** 2, axis=-1)
        )
    return value


def torque_range(problem: IkProblem, torque: TorqueLimit) -> tuple[FloatArray, FloatArray]:
    """Return the torques allowed [N m], cut where even the corner of the box that is nearest is far from them."""
    state = problem.state
    corners = np.array(list(product(*zip(problem.box.low, problem.box.high, strict=True)))) - state.angles
    reached = state.efforts + corners @ state.stiffness.T
    margin = REACH * np.linalg.norm(state.stiffness, axis=1)
    sides = [np.broadcast_to(sign * np.asarray(torque.maximum), margin.shape) for sign in (-1, 1)]
    least, most = (np.clip(s, reached.min(axis=0) - margin, reached.max(axis=0) + margin) for s in sides)
    return least, most


def best_step(problem: IkProblem, torque: TorqueLimit | None) -> FloatArray:
    """Return the step δ [rad] of least cost within the bounds, shape (n,)."""
    state, task = problem.state, problem.tasks[0]
    n = len(state.angles)
    low, high = problem.box.low - state.angles, problem.box.high - state.angles
    S, J, e = np.diag(task.weights), state.jacobian[:3], task.target - state.equilibrium
    mu = task.curvature * np.linalg.norm(S @ S @ e)
    sigma = max(np.sum((S @ J) ** 2) / n + mu, 1e-18)
    H = (J.T @ S @ S @ J + mu * np.eye(n)) / sigma + REGULARISATION * np.eye(n)
    g = -J.T @ S @ S @ e / sigma - REGULARISATION * (problem.hold - state.angles)
    K, k = state.stiffness, np.linalg.norm(state.stiffness, axis=1)
    sides = (np.zeros(n), np.zeros(n)) if torque is None else torque_range(problem, torque)
    weight = 0.0 if torque is None else torque.weight
    candidates = []
    for signs in product((-1, 0, 1), repeat=n if torque else 0):
        H2, g2 = H.copy(), g.copy()
        for i, sign in enumerate(signs):
            if sign and k[i] > 1e-9:  # weight / 2 ((tau + K δ - side) / k)²
                H2 += weight * np.outer(K[i], K[i]) / k[i] ** 2
                g2 += weight * K[i] * (state.efforts[i] - sides[sign > 0][i]) / k[i] ** 2
        for ends in product((-1, 0, 1), repeat=n):
            s = np.array(ends)
            delta = np.where(s < 0, low, np.where(s > 0, high, 0.0))
            if not np.isfinite(delta).all():
                continue
            free = s == 0
            delta[free] = np.linalg.solve(H2[np.ix_(free, free)], -(g2 + H2[:, ~free] @ delta[~free])[free])
            if (delta >= low - 1e-12).all() and (delta <= high + 1e-12).all():
                candidates.append(delta)
    candidates = np.array(candidates)
    return candidates[np.argmin(cost(problem, torque, candidates))]
