"""How near a body is to a snap: how soft it is with the servos held, and how that changes with the angles.

The stiffness of a move u of the body is λ = uᵀ K u / |u|² with |u| the root mean square of how far its nodes go.
Towards a limit point, where the equilibrium ends and the body, or one strip of it, snaps to another one, the least
stiffness λ₁ goes to zero. The stability margin is

    ρ = λ₁ / λ₃ of the undeformed body,

without a unit, negative where the equilibrium is not stable. The softest move is looked for among what forces on the
effector and turns of the servos do to the body, K⁻¹ [Hᵀ, K_s], which is known: near a snap they go along with it. Where
that is soft, steps of inverse iteration, u ← K⁻¹ M u with uᵀ M u = |u|², make it exact. With |u| = 1 and w_i the move
of the body with the angle i,

    dλ₁ / dangle_i = uᵀ (dK / dangle_i) u = w_i · (r(x + ε u) + r(x - ε u) - 2 r(x)) / ε²,

r with the servos' torques: two evaluations of the forces, and no factorisation.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from tripod_host.arrays import FloatArray
from tripod_sim.linear.solver import LinearError
from tripod_sim.state import State
from tripod_sim.system import System

AMPLE_MARGIN = 0.45
"""Stability margin above which no snap is near, and the slope is not looked for."""

NEAR, LOW_MARGIN = 0.07, 0.25
"""Stability margin below which a snap is near, as inverse kinematics has it; and below which a mesh a little too stiff
may lead to another equilibrium at rest, or err by far more than elsewhere (`benchmarks/promise_branches.py`)."""

REDUCED_MARGIN = 0.75
"""Stability margin below which, in motion, the mesh errs by more than it is told to (`benchmarks/mesh_error.py`)."""

MOVE = 2e-5
"""ε |u|: how far a node is moved, at most [m]."""

ALIKE = 1e-12
"""Part of the square of a move below which the rest of it is nothing but rounding, others taken away."""


ITERATIONS = 2
"""Steps of inverse iteration."""


@dataclass(frozen=True, eq=False)
class StabilityMargin:
    """Stability margin and its slope.

    Attributes:
        value: ρ.
        slope: dρ/dangle [1/rad], shape (s,); zero where ρ is above `AMPLE_MARGIN`.
    """

    value: float
    slope: FloatArray


class SoftestMove:
    """The softest move of a body, as its equilibria change."""

    def __init__(self, system: System) -> None:
        """Take the measure of the moves of `system`, the static potential of a body with an effector."""
        reduction, rigid = system.reduction, system.groups.rigid
        first = 3 * reduction.free_count
        weights = np.ones(reduction.unknowns)
        for body, nodes in enumerate(rigid):
            at = first + 6 * body
            weights[at : at + 3] = len(nodes)
            weights[at + 3 : at + 6] = len(nodes) * system.radius(body) ** 2
        self._weights = (weights / (reduction.free_count + sum(map(len, rigid))))[:, None]
        self._effector = first + np.arange(6)
        self._reference = 1.0

    def refer(self, system: System, state: State) -> bool:
        """Refer to the stiffness of `system` at its undeformed `state`; return False where that has none.

        Its factorisation is overwritten.
        """
        reduction = system.reduction
        system.assemble(state, project=False)
        system.evaluate(state)
        system.factor()
        if not system.factored:
            return False
        forces = np.zeros((reduction.unknowns, 6))
        forces[self._effector, np.arange(6)] = 1.0
        try:
            answers = system.linear.solve_many(np.hstack([forces, reduction.drive]))
            stiffness, _ = self._stiffnesses(system, answers)
        except LinearError:
            return False
        self._reference = float(stiffness[2])
        return bool(stiffness[0] > 0)

    def stability_margin(self, system: System, state: State, answers: FloatArray) -> StabilityMargin:
        """Return the stability margin of the body.

        Args:
            system: The static potential, evaluated and factored at `state`; it is evaluated elsewhere.
            state: Where it is linearised.
            answers: K⁻¹ of the six unit forces on the effector, of the coupling to the angles, and more, shape
                (unknowns, 6 + s or more).

        Raises:
            LinearError: K⁻¹ cannot be applied once more.
        """
        s = system.actuators
        stiffness, moves = self._stiffnesses(system, answers[:, : 6 + s])
        rho = max(float(stiffness[0]) / self._reference, -1.0)
        if not 0 < rho < AMPLE_MARGIN:
            return StabilityMargin(rho, np.zeros(s))
        u, size = answers[:, : 6 + s] @ moves[:, 0], 1.0
        for _ in range(ITERATIONS):
            push = self._weights[:, 0] * u / size
            u = system.linear.solve(push)
            size = float(u @ (self._weights[:, 0] * u))
        rho = max(float(u @ push) / (size * self._reference), -1.0)
        residual, efforts = -2.0 * system.residual, -2.0 * system.efforts
        dx, moved = np.zeros_like(state.positions), state.copy()
        system.update_levers(state)
        system.reduction.moves(u, system.lever, dx)
        step = MOVE / float(np.abs(dx).max())
        for part in (step, -step):
            system.move(state, u, dx, part, moved)
            system.evaluate(moved)
            residual += system.residual
            efforts += system.efforts
        change = (efforts - residual @ answers[:, 6 : 6 + s]) / step**2
        return StabilityMargin(rho, change / (size * self._reference))

    def _stiffnesses(self, system: System, answers: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return stiffnesses of the body [N/m], ascending, and of which `answers` the moves are made, columns."""
        known = np.concatenate([answers[self._effector], system.reduction.drive.T @ answers])
        sizes = answers.T @ (self._weights * answers)
        share = ALIKE * np.maximum(sizes.flat[:: len(sizes) + 1], 1e-300)
        sizes.flat[:: len(sizes) + 1] += (
            share  # and what combinations of others leave is as stiff as the stiffest
        )
        known.flat[:: len(known) + 1] += share * float((known.diagonal() / share).max()) * ALIKE
        stiffness, moves, failed = lapack.dsygvd(known, sizes)
        if failed:
            raise LinearError(
                "forces on the body give displacements that are not finite: is a part of it held by nothing?"
            )
        return stiffness, moves


def softest_move(system: System, state: State) -> SoftestMove | None:
    """Return the softest move of `system`, the static potential; None where its undeformed `state` has no stiffness."""
    found = SoftestMove(system)
    return found if found.refer(system, state) else None
