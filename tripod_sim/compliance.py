"""The compliance of effector and servos, W = H A^-1 H^T.

A is the static tangent with the servo angles as unknowns. With K the block of the body's unknowns, K_s its
coupling to the angles and K_ss theirs, and H_e the rows of the effector,

    F = H_e K^-1 H_e^T                 d(effector) / dforce, the angles held
    J = -H_e K^-1 K_s                  d(effector) / dangle
    S = K_ss - K_s^T K^-1 K_s          dtau / dangle
    W = [F + J S^-1 J^T, J S^-1; (J S^-1)^T, S^-1]

[Duriez2013], [CoevoetEtAl2017]. What holds the body besides joins in as `Holding`, by the same F, J, S of the few
unknowns that it has to do with: nothing is factored again.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_host.rotations import quaternion, rotation_vector
from tripod_sim.errors import SceneError, StepError
from tripod_sim.linear.solver import LinearError
from tripod_sim.response import Response, held_response
from tripod_sim.state import State
from tripod_sim.system import System

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.contact.rest_rows import Rest
    from tripod_sim.rest_state import RestState
    from tripod_sim.stability_margin import SoftestMove, StabilityMargin


ROUNDS = 3
"""Corrections of the state of rest for one compliance, at most, before the last: one is the rule."""


@dataclass(frozen=True, eq=False)
class Compliance:
    """Linearised static response about one state.

    Attributes:
        w: W, shape (6 + s, 6 + s): effector translation [m] and rotation vector [rad], then servo angles [rad], per
            force [N] or torque [N m]; symmetric.
        angles: Of the servos [rad], shape (s,).
        slide: [m].
        efforts: Static torque that each servo exerts on the body [N m], shape (s,).
        position: Of the effector [m], shape (3,).
        quaternion: Of the effector (x, y, z, w), shape (4,).
        equilibrium_offset: From that pose to the static equilibrium at the same angles, first order: translation [m]
            and rotation vector [rad], shape (6,).
        stability_margin: How near it is to a snap; None where that is not known: with contact.
    """

    w: FloatArray
    angles: FloatArray
    slide: float
    efforts: FloatArray
    position: FloatArray
    quaternion: FloatArray
    equilibrium_offset: FloatArray
    stability_margin: "StabilityMargin | None" = None


def compliance(
    system: System,
    state: State,
    held: "Rest | None" = None,
    rest: "RestState | None" = None,
    softest: "SoftestMove | None" = None,
) -> Compliance:
    """Return the compliance of `system` at `state`, or where that would rest.

    Args:
        system: Without inertia and damping: the static potential. Its factorisation is overwritten.
        state: Where it is linearised; need not be an equilibrium.
        held: What contact holds; its forces must be among the loads of `system`.
        rest: The state of rest that goes along with `state`: the tangent is that of rest then.
        softest: Tells the stability margin; None where nobody asks for it. With contact it is not told.

    Raises:
        SceneError: the system has no effector.
        StepError: the static tangent is singular there, or conjugate gradients do not solve with it.
    """
    if not system.groups.rigid:
        raise SceneError("the scene has no effector, so it has no compliance; add [effector]")
    s = system.actuators
    at = _factored(system, state, rest)
    efforts, soft = system.efforts.copy(), None
    first = 3 * system.reduction.free_count
    effector = first + np.arange(6)
    try:
        if held:
            holding = held.holding(system)
            inside = (holding.unknowns >= first) & (holding.unknowns < first + 6)
            unknowns = np.concatenate([effector, holding.unknowns[~inside]])
            free = _response(system, unknowns, _answers(system, unknowns))
            where = np.where(inside, holding.unknowns - first, 5 + np.cumsum(~inside))
            answer = held_response(free, holding, where)
        else:
            answers = _answers(system, effector)
            for _ in range(ROUNDS if rest else 0):
                if not (rest and rest.misses(-answers[:, -1])):
                    break
                rest.correct(-answers[:, 6:-1], -answers[:, -1], stable=system.linear.is_positive())
                at = _factored(system, state, rest)
                answers = _answers(system, effector)
            efforts = system.efforts.copy()
            answer = _response(system, effector, answers)
            soft = softest.stability_margin(system, at, answers) if softest else None
    except LinearError as error:
        raise StepError(f"no compliance at {state.time:.4g} s: {error}") from error
    except np.linalg.LinAlgError:
        raise StepError(
            f"the compliance is not defined at {state.time:.4g} s: the contact forces make the pose "
            "unstable; move the robot to another pose"
        ) from None
    jacobian, stiffness = answer.jacobian[:6], answer.stiffness
    w = np.empty((6 + s, 6 + s))
    try:
        inverse = np.linalg.inv(0.5 * (stiffness + stiffness.T))
    except np.linalg.LinAlgError:
        raise StepError(
            f"the compliance is not defined at {state.time:.4g} s: the stiffness of the servos is "
            "singular; move the robot to another pose"
        ) from None
    w[6:, 6:] = inverse
    w[:6, 6:] = jacobian @ inverse
    w[6:, :6] = w[:6, 6:].T
    w[:6, :6] = answer.flexibility[:6, :6] + w[:6, 6:] @ jacobian.T
    w = 0.5 * (w + w.T)
    fall = answer.fall[:6].copy()
    if rest:
        rest.correct(-answers[:, 6:-1], -answers[:, -1], stable=system.linear.is_positive())
        fall[:3] = at.centres[0] - state.centres[0]
        fall[3:] = rotation_vector(at.rotations[0] @ state.rotations[0].T)
    return Compliance(
        w, state.joints[:s].copy(), float(state.joints[s]), efforts, state.centres[0].copy(),
        quaternion(state.rotations[0]), fall, soft,
    )  # fmt: skip


def _factored(system: System, state: State, rest: "RestState | None") -> State:
    """Return where `system` is linearised, evaluated and factored: at rest, or as it is where that fails.

    Raises:
        StepError: the static tangent is singular.
    """
    for at in (rest.carried(state), state) if rest else (state,):
        for project in (False, True):
            if system.assemble(at, project=project) < 0:
                break
        system.evaluate(at)
        system.factor()
        if system.factored:
            return at
        if rest:
            rest.forget()
    raise StepError(
        f"the compliance is not defined at {state.time:.4g} s: the stiffness at rest is singular (or "
        "indefinite, with solver.linear = 'cholmod'); is a part of the body held by nothing, or the "
        "pose unstable?"
    )


def _answers(system: System, unknowns: IndexArray) -> FloatArray:
    """Return K⁻¹ of unit forces on `unknowns`, shape (z,), of the drive and of the residual. Raises LinearError."""
    reduction, z, s = system.reduction, len(unknowns), system.actuators
    right = np.zeros((reduction.unknowns, z + s + 1))
    right[unknowns, np.arange(z)] = 1.0
    right[:, z:-1], right[:, -1] = reduction.drive, system.residual
    return system.linear.solve_many(right)


def _response(system: System, unknowns: IndexArray, answers: FloatArray) -> Response:
    """Return how `unknowns`, shape (z,), answer by the factored tangent."""
    reduction, z = system.reduction, len(unknowns)
    here, stiffness = answers[unknowns], reduction.drive_drive - reduction.drive.T @ answers[:, z:-1]
    return Response(here[:, :z], -here[:, z:-1], stiffness, -here[:, -1])
