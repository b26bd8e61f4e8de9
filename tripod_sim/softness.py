"""How near a body is to a snap: how soft its effector is with the servos held, and how that changes with the angles.

With F the answer of the effector to forces at held angles, rotations in metres at the rim, the stiffnesses c₁ ≤ c₂ ≤ …
are 1 / eig(F), and v is the direction of the softest. Towards a limit point, where the equilibrium ends and the body
snaps to another one, c₁ goes to zero while the others stay. The firmness is

    ρ = c₁ / c₃ of the undeformed body,

without a unit, negative where the equilibrium is not stable. With u = K⁻¹ Hᵀ v c₁ the move of the body that takes the
effector along v, and w_i its move with the angle i,

    dc₁ / dangle_i = uᵀ (dK / dangle_i) u = w_i · (r(x + ε u) + r(x - ε u) - 2 r(x)) / ε²,

r with the servos' torques: two evaluations of the forces, and no factorisation.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tripod_sim.linear.solver import LinearError, solve_columns
from tripod_sim.state import State
from tripod_sim.system import System

FloatArray = NDArray[np.float64]

FIRM = 0.3
"""Firmness above which no snap is near, and the slope is not looked for."""

MOVE = 2e-5
"""ε: how far the effector is moved along v [m]."""


@dataclass(frozen=True, eq=False)
class Softness:
    """Firmness and its slope.

    Attributes:
        firmness: ρ.
        slope: dρ/dangle [1/rad], shape (s,); zero where ρ is above `FIRM`.
    """

    firmness: float
    slope: FloatArray


def reference_stiffness(system: System, state: State) -> float:
    """Return c₃ of the first rigid body of `system` at `state` [N/m]; infinite where it has none.

    The factorisation of `system` is overwritten.
    """
    system.assemble(state, project=False)
    system.evaluate(state)
    system.factor()
    if not system.factored:
        return np.inf
    forces = np.zeros((system.reduction.unknowns, 6))
    forces[3 * system.reduction.free_count + np.arange(6), np.arange(6)] = 1.0
    try:
        stiffness, _ = _stiffnesses(system, solve_columns(system.linear, forces))
    except LinearError:
        return np.inf
    return float(stiffness[2]) if stiffness[0] > 0 else np.inf


def softness(system: System, state: State, answers: FloatArray, reference: float) -> Softness:
    """Return the softness of the first rigid body of `system`.

    Args:
        system: The static potential, evaluated and factored at `state`; it is evaluated elsewhere.
        state: Where it is linearised.
        answers: K⁻¹ of the six unit forces on that body, of the coupling to the angles, and more, shape (unknowns,
            6 + s or more).
        reference: What `reference_stiffness` gave for the undeformed body [N/m].
    """
    s = len(system.groups.driven)
    values = np.linalg.eigvalsh(_flexibility(system, answers))
    if (
        values[0] > 0 and 1.0 / (values[-1] * reference) >= FIRM
    ):  # the rule, and then no direction is asked for
        return Softness(1.0 / float(values[-1] * reference), np.zeros(s))
    stiffness, directions = _stiffnesses(system, answers)
    rho = max(float(stiffness[0]) / reference, -1.0)
    if not 0 < rho < FIRM:
        return Softness(rho, np.zeros(s))
    residual, torques = -2.0 * system.residual, -2.0 * system.torques
    u = stiffness[0] * (answers[:, :6] @ directions[:, 0])
    dx, moved = np.zeros_like(state.positions), state.copy()
    system.update_levers(state)
    system.reduction.moves(u, system.lever, dx)
    for step in (MOVE, -MOVE):
        system.move(state, u, dx, step, moved)
        system.evaluate(moved)
        residual += system.residual
        torques += system.torques
    return Softness(rho, (torques - residual @ answers[:, 6 : 6 + s]) / (MOVE**2 * reference))


def _flexibility(system: System, answers: FloatArray) -> FloatArray:
    """Return how the first rigid body answers to forces, symmetric, rotations in metres, shape (6, 6) [m/N]."""
    first, radius = 3 * system.reduction.free_count, system.radius(0)
    F = answers[first : first + 6, :6] + answers[first : first + 6, :6].T
    F *= 0.5
    F[3:] *= radius
    F[:, 3:] *= radius
    return F


def _stiffnesses(system: System, answers: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the stiffnesses of the first rigid body [N/m], ascending, and the forces that go with them, columns."""
    values, vectors = np.linalg.eigh(_flexibility(system, answers))
    stiffness = 1.0 / values
    order = np.argsort(stiffness)
    vectors[3:] *= system.radius(0)
    return stiffness[order], vectors[:, order]
