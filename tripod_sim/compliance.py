"""The compliance of effector and actuators, W = H A^-1 H^T.

A is the static tangent with the commands q of the actuators as unknowns: the angles of servos, and see
`forces.actuator`. With K the block of the body's unknowns, K_s its coupling to the commands and K_ss theirs, tau the
efforts dV/dq, and H_e the rows of the effector,

    F = H_e K^-1 H_e^T                 d(effector) / dforce, the commands held
    J = -H_e K^-1 K_s                  d(effector) / dq
    S = K_ss - K_s^T K^-1 K_s          dtau / dq
    W = [F + J S^-1 J^T, J S^-1; (J S^-1)^T, S^-1]

[Duriez2013], [CoevoetEtAl2017]. Of a force, a pressure or a tension that is commanded dtau is minus a displacement. S
is singular where several of them act alike: S^-1 is then the pseudo-inverse, while J and S themselves stay exact. A
slack cable counts as just taut: J and S are those of pulling it further. An effector that is observed has no rotation;
its rows are zero. What holds the body besides joins in as `Holding`, by the same F, J, S of the few unknowns that it
has to do with: nothing is factored again.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
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
    from tripod_sim.robot.observed import ObservedPoint
    from tripod_sim.stability_margin import SoftestMove, StabilityMargin


SINGULAR = 1e-12
"""Eigenvalues of S, commands over their spans, that count as zero, over the largest."""

PIVOTS = 8
"""Exchanges of slack and taut for each cable, at most: about one is the rule."""

ROUNDS = 3
"""Corrections of the state of rest for one compliance, at most, before the last: one is the rule."""


@dataclass(frozen=True, eq=False)
class Compliance:
    """Linearised static response about one state.

    Attributes:
        w: W, shape (6 + s, 6 + s): effector translation [m] and rotation vector [rad], then commands [rad, m, N, Pa],
            per force [N], torque [N m] or effort; symmetric.
        jacobian: J, shape (6, s).
        stiffness: S, shape (s, s).
        angles: Commands of the actuators [rad, m, N, Pa], shape (s,); of a slack cable that at which it is just taut.
        slide: [m].
        efforts: tau, static: the torque that each servo exerts on the body [N m], and see `forces.actuator`, shape
            (s,); with cables that can go slack, those at rest.
        position: Of the effector [m], shape (3,).
        quaternion: Of the effector (x, y, z, w), shape (4,); that of no rotation where it is observed.
        equilibrium_offset: From that pose to the static equilibrium at the same angles, first order: translation [m]
            and rotation vector [rad], shape (6,).
        stability_margin: How near it is to a snap; None where that is not known: with contact.
        places: Of each further place of the effector, by name: where it is [m], from there to where it rests [m], shape
            (3,) each, and J, shape (3, s); none with contact or a ball.
    """

    w: FloatArray
    jacobian: FloatArray
    stiffness: FloatArray
    angles: FloatArray
    slide: float
    efforts: FloatArray
    position: FloatArray
    quaternion: FloatArray
    equilibrium_offset: FloatArray
    stability_margin: "StabilityMargin | None" = None
    places: Mapping[str, tuple[FloatArray, FloatArray, FloatArray]] = field(default_factory=dict)


def compliance(
    system: System,
    state: State,
    held: "Rest | None" = None,
    rest: "RestState | None" = None,
    softest: "SoftestMove | None" = None,
    observed: "ObservedPoint | None" = None,
    places: "Mapping[str, ObservedPoint] | None" = None,
) -> Compliance:
    """Return the compliance of `system` at `state`, or where that would rest.

    Args:
        system: Without inertia and damping: the static potential. Its factorisation is overwritten.
        state: Where it is linearised; need not be an equilibrium.
        held: What contact holds; its forces must be among the loads of `system`.
        rest: The state of rest that goes along with `state`: the tangent is that of rest then.
        softest: Tells the stability margin; None where nobody asks for it. With contact it is not told.
        observed: The effector where it is no disc.
        places: Further places of it; left out with `held`.

    Raises:
        SceneError: the system has no effector.
        StepError: the static tangent is singular there, or conjugate gradients do not solve with it.
    """
    if not (observed or system.groups.rigid):
        raise SceneError("the scene has no effector, so it has no compliance; add [effector]")
    with system.taut():
        return _compliance(system, state, held, rest, softest, observed, places or {})


def _compliance(
    system: System,
    state: State,
    held: "Rest | None",
    rest: "RestState | None",
    softest: "SoftestMove | None",
    observed: "ObservedPoint | None",
    places: "Mapping[str, ObservedPoint]",
) -> Compliance:
    s = system.actuators
    at = _factored(system, state, rest)
    efforts, gaps, soft = system.efforts.copy(), system.gaps, None
    slopes = dict[str, tuple[FloatArray, FloatArray]]()
    first = 3 * system.reduction.free_count
    none = np.zeros(0, dtype=np.int64)
    try:
        if held:
            holding = held.holding(system)
            inside = (holding.unknowns >= first) & (holding.unknowns < first + 6) & (observed is None)
            unknowns = holding.unknowns[~inside]
            free = _response(system, unknowns, _answers(system, unknowns, observed), observed)
            where = np.where(inside, holding.unknowns - first, 5 + np.cumsum(~inside))
            answer = held_response(free, holding, where)
        else:
            answers = _answers(system, none, observed)
            fall = _fall(system, answers)
            for _ in range(ROUNDS if rest else 0):
                if not (rest and rest.misses(fall.unknowns)):
                    break
                rest.correct(fall.turning, fall.unknowns, stable=system.linear.is_positive())
                at = _factored(system, state, rest)
                answers = _answers(system, none, observed)
                fall = _fall(system, answers)
            efforts, gaps = fall.efforts, system.gaps + fall.slack
            answer = _response(system, none, answers, observed)
            if fall.slack.any():
                answer = replace(answer, fall=answer.fall + answer.jacobian @ fall.slack)
            slopes = {name: _slopes(system, place, answers, fall) for name, place in places.items()}
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
    inverse = _inverse(system, 0.5 * (stiffness + stiffness.T), state)
    w[6:, 6:] = inverse
    w[:6, 6:] = jacobian @ inverse
    w[6:, :6] = w[:6, 6:].T
    w[:6, :6] = answer.flexibility[:6, :6] + w[:6, 6:] @ jacobian.T
    w = 0.5 * (w + w.T)
    offset = answer.fall[:6].copy()
    position, turn = _pose(state, observed)
    if rest:
        rest.correct(fall.turning, fall.unknowns, stable=system.linear.is_positive())
        there, turned = _pose(at, observed)
        offset[:3] = there - position
        offset[3:] = rotation_vector(turned @ turn.T)
    return Compliance(
        w,
        jacobian,
        stiffness,
        state.joints[:s] + gaps,
        float(state.joints[s]),
        efforts,
        position,
        quaternion(turn),
        offset,
        soft,
        {name: _place(places[name], state, at if rest else None, *slope) for name, slope in slopes.items()},
    )


@dataclass(frozen=True, eq=False)
class _Fall:
    """From a state to rest at the same commands, to first order.

    Attributes:
        unknowns: Move of all unknowns, shape (unknowns,).
        turning: Move of the unknowns with the commands, shape (unknowns, s); zero for cables that are slack at rest.
        slack: What the gaps change by, shape (s,): a cable that is slack at rest need not keep its length.
        efforts: tau, shape (s,); with cables that go slack that at rest, else that of the state.
    """

    unknowns: FloatArray
    turning: FloatArray
    slack: FloatArray
    efforts: FloatArray


def _fall(system: System, answers: FloatArray) -> _Fall:
    """Return how the body goes to rest, from `answers` without further unknowns.

    The tangent counts slack cables as taut, so that they would keep their lengths. At rest a cable is either taut or
    slack: gap + d >= 0, tau >= 0, and one of them is zero, with tau = tau_0 + K_s^T u + S d. `_slack` solves that.
    """
    turning, fall, efforts = -answers[:, 6:-1], -answers[:, -1], system.efforts.copy()
    slack = np.zeros(len(efforts))
    pulls = np.flatnonzero(system.pulls)
    if not len(pulls):
        return _Fall(fall, turning, slack, efforts)
    stiffness = system.reduction.drive_drive + system.reduction.drive.T @ turning
    pulls = pulls[np.diag(stiffness)[pulls] > 0]  # of one that cannot be pulled taut nothing is known
    at_rest = efforts + system.reduction.drive.T @ fall
    slack[pulls] = _slack(stiffness[np.ix_(pulls, pulls)], at_rest[pulls], system.gaps[pulls])
    at_rest += stiffness @ slack
    is_slack = pulls[system.gaps[pulls] + slack[pulls] > 0]
    at_rest[is_slack] = 0.0
    fall = fall + turning @ slack
    turning[:, is_slack] = 0.0
    return _Fall(fall, turning, slack, at_rest)


def _slack(S: FloatArray, tau: FloatArray, gaps: FloatArray) -> FloatArray:
    """Return d, shape (c,), with gaps + d >= 0, tau + S d >= 0, of each cable one of them zero.

    A linear complementarity problem, solved by principal pivoting, the least index first.
    """
    is_slack = (gaps > 0) | (tau < 0)
    d = -gaps
    for _ in range(PIVOTS * len(gaps)):
        d = np.where(is_slack, 0.0, -gaps)
        right = -(tau + S @ d)[is_slack]
        d[is_slack] = np.linalg.lstsq(S[np.ix_(is_slack, is_slack)], right)[0]
        wrong = np.where(is_slack, gaps + d < 0, tau + S @ d < 0)
        if not wrong.any():
            break
        first = int(np.argmax(wrong))
        is_slack[first] = not is_slack[first]
    return d


def _slopes(
    system: System, place: "ObservedPoint", answers: FloatArray, fall: _Fall
) -> tuple[FloatArray, FloatArray]:
    """Return how far a place moves to where it rests [m], shape (3,), and its J, shape (3, s)."""
    rows, driven = place.forces(system.reduction, len(system.rest))
    jacobian = -(rows.T @ answers[:, 6:-1])
    jacobian[:, : len(driven)] += driven.T
    return rows.T @ fall.unknowns, jacobian


def _place(
    place: "ObservedPoint", state: State, rest: State | None, move: FloatArray, jacobian: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a value of `Compliance.places`; `rest`: the state of rest if there is one, else it is `move` away."""
    here = place.position(state.positions)
    return here, move if rest is None else place.position(rest.positions) - here, jacobian


def _pose(state: State, observed: "ObservedPoint | None") -> tuple[FloatArray, FloatArray]:
    """Return position [m], shape (3,), and rotation matrix of the effector."""
    if observed:
        return observed.position(state.positions), np.eye(3)
    return state.centres[0].copy(), state.rotations[0]


def _inverse(system: System, stiffness: FloatArray, state: State) -> FloatArray:
    """Return S^-1; with actuators that are no servos the pseudo-inverse, commands over their spans.

    Raises:
        StepError: S of servos is singular.
    """
    if system.has_other_actuators:
        spans = system.spans
        scaled = np.linalg.pinv(stiffness * np.outer(spans, spans), rcond=SINGULAR, hermitian=True)
        return np.asarray(scaled * np.outer(spans, spans))
    try:
        return np.asarray(np.linalg.inv(stiffness))
    except np.linalg.LinAlgError:
        raise StepError(
            f"the compliance is not defined at {state.time:.4g} s: the stiffness of the servos is "
            "singular; move the robot to another pose"
        ) from None


def _factored(system: System, state: State, rest: "RestState | None") -> State:
    """Return where `system` is linearised, evaluated and factored: at rest, or as it is where that fails.

    Raises:
        StepError: the static tangent is singular.
    """
    for at in (rest.carried(state), state) if rest else (state,):
        system.command(at.joints)  # a state that was restored has others than the last step
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


def _answers(system: System, unknowns: IndexArray, observed: "ObservedPoint | None") -> FloatArray:
    """Return K⁻¹ of unit forces on the effector (6) and on `unknowns`, shape (z,), of the drive and of the residual.

    Raises LinearError.
    """
    reduction, z, s = system.reduction, 6 + len(unknowns), system.actuators
    right = np.zeros((reduction.unknowns, z + s + 1))
    if observed:
        right[:, :3] = observed.forces(reduction, len(system.rest))[0]
    else:
        right[3 * reduction.free_count + np.arange(6), np.arange(6)] = 1.0
    right[unknowns, np.arange(6, z)] = 1.0
    right[:, z:-1], right[:, -1] = reduction.drive, system.residual
    return system.linear.solve_many(right)


def _response(
    system: System, unknowns: IndexArray, answers: FloatArray, observed: "ObservedPoint | None"
) -> Response:
    """Return how the effector and `unknowns`, shape (z,), answer by the factored tangent."""
    reduction, z = system.reduction, 6 + len(unknowns)
    if observed:
        rows, driven = observed.forces(reduction, len(system.rest))
        here = np.concatenate([rows.T @ answers, np.zeros((3, answers.shape[1])), answers[unknowns]])
        here[:3, z : z + len(driven)] -= driven.T  # of nodes that servos hold
    else:
        here = answers[np.concatenate([3 * reduction.free_count + np.arange(6), unknowns])]
    stiffness = reduction.drive_drive - reduction.drive.T @ answers[:, z:-1]
    return Response(here[:, :z], -here[:, z:-1], stiffness, -here[:, -1])
