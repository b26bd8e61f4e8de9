"""The quadratic program of one step of inverse kinematics: from state, task and limits to its matrices.

The method is the inverse one of soft robotics [Duriez2013], [Coevoet2017]: the compliance of the present
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

[Duriez2013] C. Duriez: Control of elastic soft robots based on real-time finite element method, ICRA 2013.
[Coevoet2017] E. Coevoet, A. Escande, C. Duriez: Optimization-based inverse model of soft robots with contact
    handling, IEEE Robotics and Automation Letters 2(3), 2017.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tripod_ik.arrays import FloatArray, frozen
from tripod_ik.errors import IkError
from tripod_ik.limits import CommandBox, IntervalLimit, Motion, TorqueLimit, command_box
from tripod_ik.state import LinearState
from tripod_ik.tasks import PositionTask

REGULARISATION = 1e-4
"""ε: weight of the change of the command against the mean square of the Jacobian. It decides where the task
leaves a choice and bounds the step where the Jacobian is singular. As it acts on the change and not on the
angles, it moves no solution: a step leaves 1e-4 of the distance, the next 1e-4 of that.
"""

ROW_BOUND = 1e3
"""Torque bounds farther away than this [rad] are cut: they cannot act, and large numbers disturb OSQP."""


@dataclass(frozen=True, eq=False)
class IkProblem:
    """minimise x·P x / 2 + q·x subject to l ≤ A x ≤ u, with x = (δ [rad], slack of the torque limits).

    Attributes:
        P: Symmetric, positive definite, shape (m, m); m is n, or 2 n with a torque limit.
        q: Shape (m,).
        A: First the identity for the bounds of δ, then one row a torque; shape (m, m).
        l: Lower bounds [rad], shape (m,).
        u: Upper bounds [rad], shape (m,).
        state: The state it is about.
        task: The task it was built for.
        box: The commands allowed.
        hold: The command allowed that is nearest to the previous one [rad], shape (n,).
    """

    P: FloatArray
    q: FloatArray
    A: FloatArray
    l: FloatArray  # noqa: E741 - its name in every text on quadratic programs
    u: FloatArray
    state: LinearState
    task: PositionTask
    box: CommandBox
    hold: FloatArray


def build_ik(
    state: LinearState,
    task: PositionTask,
    limits: Sequence[IntervalLimit] = (),
    torque: TorqueLimit | None = None,
    *,
    previous: FloatArray | None = None,
    dt: float = 0.0,
) -> IkProblem:
    """Return the quadratic program of one step.

    With e = target - p̄, S the weights, c the curvature of the task, μ = c |S² e|, σ = |S J|²/n + μ and
    δ_hold the step to the allowed command nearest to the previous one, it is

        minimise  (|S (J δ - e)|² + μ |δ|²) / 2σ + ε |δ - δ_hold|² / 2 + |s|² / 2
        with      low ≤ angles + δ ≤ high
                  |torques + K δ + k s / √weight| ≤ maximum     row by row, k = |K_i|, written divided by k

    The division by σ makes P of order one and q an angle. The damping μ vanishes with the error, so that
    reachable targets are approached quadratically [Yamashita2001]; where the target cannot be reached the
    error remains, the second derivative of |e|² is J'J minus e times the curvature, and without μ the
    iteration would jump about the closest pose for ever once that second part is the larger one. With c at
    least half of the curvature it converges. Damping counts from the present angles and not from the previous
    command, since then a delay between command and state does not matter.

    [Yamashita2001] N. Yamashita, M. Fukushima: On the rate of convergence of the Levenberg-Marquardt method,
        Computing Supplement 15, 2001.

    Args:
        state: The linearised state.
        task: What to do.
        limits: Hard limits of the command, the first outranks the next.
        torque: Soft limit of the torques.
        previous: The command sent before this one [rad], shape (n,); None means the present angles.
        dt: Time since then [s].

    Raises:
        IkError: `previous` or `dt` is not finite, or has the wrong shape or sign.
    """
    n = len(state.joint_names)
    before = state.angles if previous is None else frozen("previous", previous, (n,))
    if not 0 <= dt < np.inf:
        raise IkError(f"dt is {dt} s; it must be finite and not negative")
    box = command_box(limits, Motion(state, before, dt))

    e, SJ = task.error(state), task.weights[:, None] * task.jacobian(state)
    mu = task.curvature * float(np.linalg.norm(task.weights**2 * e))
    sigma = max(float(np.sum(SJ**2)) / n + mu, 1e-18)  # [m²]; less only on a target that nothing moves
    m = n if torque is None else 2 * n
    P, q, A = np.eye(m), np.zeros(m), np.eye(m)
    P[:n, :n] = (SJ.T @ SJ + mu * np.eye(n)) / sigma + REGULARISATION * np.eye(n)
    hold = np.clip(before, box.low, box.high)
    q[:n] = -SJ.T @ (task.weights * e) / sigma - REGULARISATION * (hold - state.angles)
    low, high = box.low - state.angles, box.high - state.angles
    if torque is not None:
        k = np.linalg.norm(state.stiffness, axis=1)
        k = np.where(k > 1e-9, k, np.inf)  # [N m/rad]; a servo that cannot turn gets a row of zeros
        A[n:, :n] = state.stiffness / k[:, None]
        A[n:, n:] /= np.sqrt(torque.weight)
        reach = np.clip([(s * torque.maximum - state.torques) / k for s in (-1, 1)], -ROW_BOUND, ROW_BOUND)
        low, high = np.concatenate([low, reach[0]]), np.concatenate([high, reach[1]])
    return IkProblem(P, q, A, low, high, state, task, box, hold)
