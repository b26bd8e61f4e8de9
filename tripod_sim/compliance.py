"""The compliance of effector and servos, W = H A^-1 H^T.

A is the static tangent with the servo angles as unknowns. With K the block of the body's unknowns, K_s its
coupling to the angles and K_ss theirs, and H_e the rows of the effector,

    S = K_ss - K_s^T K^-1 K_s          dtau / dangle
    J = -H_e K^-1 K_s                  d(effector) / dangle
    W = [H_e K^-1 H_e^T + J S^-1 J^T, J S^-1; (J S^-1)^T, S^-1]

[Duriez2013], [CoevoetEtAl2017]. What contact holds adds rows C dx + C_q dangle + E lambda = 0 of multipliers lambda
(see `contact.rest`). With B = C_q - C K^-1 K_s and D = C K^-1 C^T + E, D^+ its pseudo-inverse,

    H_e K^-1 H_e^T loses H_e K^-1 C^T D^+ C K^-1 H_e^T,   J loses H_e K^-1 C^T D^+ B,   S gains B^T D^+ B.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tripod_sim.constraints.groups import quaternion
from tripod_sim.errors import SceneError, StepError
from tripod_sim.linear.solver import LinearError
from tripod_sim.state import State
from tripod_sim.system import System

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.contact.rest import Rest

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

REDUNDANT = 1e-10
"""Share of the largest eigenvalue of D, its rows of one size, up to which other rows hold a combination already."""


@dataclass(frozen=True, eq=False)
class Compliance:
    """Linearised static response about one state.

    Attributes:
        w: W, shape (6 + s, 6 + s): effector translation [m] and rotation vector [rad], then servo angles [rad], per
            force [N] or torque [N m]; symmetric.
        angles: Of the servos [rad], shape (s,).
        slide: [m].
        torques: Static torque that each servo exerts on the body [N m], shape (s,).
        position: Of the effector [m], shape (3,).
        quaternion: Of the effector (x, y, z, w), shape (4,).
        equilibrium_offset: From that pose to the static equilibrium at the same angles, first order: translation [m]
            and rotation vector [rad], shape (6,).
    """

    w: FloatArray
    angles: FloatArray
    slide: float
    torques: FloatArray
    position: FloatArray
    quaternion: FloatArray
    equilibrium_offset: FloatArray


def compliance(
    system: System,
    state: State,
    contacts: Sequence[tuple[IndexArray, FloatArray]] = (),
    held: "Rest | None" = None,
) -> Compliance:
    """Return the compliance of `system` at `state`.

    Args:
        system: Without inertia and damping: the static potential. Its factorisation is overwritten.
        state: Where it is linearised; need not be an equilibrium.
        contacts: What else resists: nodes of a side of an element, shape (k,), and the stiffness between them [N/m],
            shape (3 k, 3 k).
        held: What contact holds; its forces must be among the loads of `system`.

    Raises:
        SceneError: the system has no effector.
        StepError: the static tangent is singular there, or conjugate gradients do not solve with it.
    """
    if not system.groups.rigid:
        raise SceneError("the scene has no effector, so it has no compliance; add [effector]")
    reduction, linear, s = system.reduction, system.linear, len(system.groups.driven)
    for project in (False, True):
        if system.assemble(state, project=project) < 0:
            break
    for nodes, stiffness in contacts:
        system.solid.add_stiffness(nodes, stiffness)
    system.evaluate(state)
    torques = system.torques.copy()
    system.factor()
    if not system.factored:
        raise StepError(
            f"the static tangent is singular at {state.time:.4g} s (or indefinite, with solver.linear = 'cholmod'); "
            "the compliance is not defined"
        )
    first = 3 * reduction.free_count
    effector = slice(first, first + 6)
    answers = np.empty((reduction.unknowns, 6 + s))
    try:
        for k in range(6):
            unit = np.zeros(reduction.unknowns)
            unit[first + k] = 1.0
            answers[:, k] = linear.solve(unit)
        for k in range(s):
            answers[:, 6 + k] = linear.solve(reduction.drive[:, k].copy())
        fall = -linear.solve(system.residual)
        holding = _holding(system, held) if held else None
    except LinearError as error:
        raise StepError(f"no compliance at {state.time:.4g} s: {error}") from error
    w = np.empty((6 + s, 6 + s))
    jacobian = -answers[effector, 6:]
    stiffness = reduction.drive_drive - reduction.drive.T @ answers[:, 6:]
    yields, offset = answers[effector, :6].copy(), fall[effector].copy()
    if holding:
        rows, turns, back, answer = holding
        push, coupling = back[effector] @ answer, turns - rows @ answers[:, 6:]
        yields -= push @ (rows @ answers[:, :6])
        jacobian -= push @ coupling
        offset -= push @ (rows @ fall)
        stiffness += coupling.T @ answer @ coupling
    try:
        inverse = np.linalg.inv(0.5 * (stiffness + stiffness.T))
    except np.linalg.LinAlgError:
        raise StepError(
            f"the servos' stiffness is singular at {state.time:.4g} s; the compliance is not defined"
        ) from None
    w[6:, 6:] = inverse
    w[:6, 6:] = jacobian @ inverse
    w[6:, :6] = w[:6, 6:].T
    w[:6, :6] = yields + w[:6, 6:] @ jacobian.T
    w = 0.5 * (w + w.T)
    return Compliance(
        w, state.joints[:-1].copy(), float(state.joints[-1]), torques, state.centres[0].copy(),
        quaternion(state.rotations[0]), offset,
    )  # fmt: skip


def _holding(system: System, held: "Rest") -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return C, shape (r, n), C_q, shape (r, s), K^-1 C^T, shape (n, r), and D^+, shape (r, r)."""
    rows, turns, give = held.rows(system)
    back = np.empty((system.unknowns, len(give)))
    for k, row in enumerate(rows):
        back[:, k] = system.linear.solve(row.copy())
    d = rows @ back
    size = np.sqrt(np.abs(np.diag(d)) + np.abs(give))
    d = (0.5 * (d + d.T) + np.diag(give)) / np.outer(size, size)
    values, vectors = np.linalg.eigh(d)
    new = np.abs(values) > REDUNDANT * np.abs(values).max(initial=0.0)
    vectors = vectors[:, new] / size[:, None]
    return rows, turns, back, (vectors / values[new]) @ vectors.T
