"""The error of time steps by steps of half the length: for all that has no estimate of its own.

Where bodies touch, springs meet their bound or a scheme solves nothing, no tangent carries errors along. There a second
simulation of the scene, the twin, takes two steps where the first takes one. With p the order of the scheme, 1 where
velocities jump, and x_h, x_h/2 the two positions, the exact one less x_h is [HairerNorsettWanner1993, chapter II.4]

    (x_h/2 - x_h) / (1 - 2^-p).

The twin goes along from the start on, so that this is the whole error; steps of a length that is chosen know what they
add (`path_error_control`).
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.integrator import Integrator
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.time_error import TimeErrorReport
from tripod_sim.integrators.time_error_kernels import furthest
from tripod_sim.state import State, TwinState

if TYPE_CHECKING:
    from tripod_sim.steps.parts import Parts


class Doubling(Integrator):
    """A time integrator whose error is estimated by a twin with steps of half the length.

    Attributes:
        integrator: The stepper itself.
    """

    def __init__(self, parts: "Parts", twin: "Parts", order: int) -> None:
        """`twin`: of the same scene; `order`: p."""
        self.integrator, self._twin, self._share = parts.stepper, twin.stepper, 1.0 / (1.0 - 2.0**-order)
        self._rigid, self._nodes = (
            parts.rigid,
            len(parts.mesh.nodes) - (parts.rigid.count if parts.rigid else 0),
        )
        self._effector = bool(parts.system.groups.rigid)
        if parts.ball and twin.ball:
            twin.ball.loads.share(parts.ball.loads)
        steppers: list[Any] = [self._twin, getattr(self._twin, "inner", None)]
        for stepper in steppers:
            if hasattr(stepper, "finer"):  # an explicit scheme divides half a step as finely as a whole one
                stepper.finer = 2

    def start(self, state: State) -> TwinState:
        """Return what is remembered at the start."""
        return TwinState(_bare(state), _bare(state))

    def forget(self) -> None:
        """Drop what was kept from earlier steps."""
        self.integrator.forget()
        self._twin.forget()

    def advance(self, state: State, joints: FloatArray, h: float) -> StepReport:
        """Advance by `h` [s], and the twin in two steps, in place. Raises StepError; `state` is then in between."""
        errors = state.twin
        assert errors
        if not (errors.known and _same(state, errors.last)):
            state.copy_to(errors.twin)
            self._twin.forget()
        report = self.integrator.step(state, joints, h)
        middle = 0.5 * (errors.twin.joints + joints)
        self._twin.step(errors.twin, middle, 0.5 * h)
        self._twin.step(errors.twin, joints, 0.5 * h)
        state.copy_to(errors.last)
        errors.known = 1
        largest, node = furthest(self._shown(errors.twin) - self._shown(state))
        of_effector = np.nan
        if self._effector:
            of_effector = self._share * float(np.linalg.norm(errors.twin.centres[0] - state.centres[0]))
        report.time_error = TimeErrorReport(of_effector, self._share * float(largest), int(node), np.nan)
        return report

    def _shown(self, state: State) -> FloatArray:
        """Return the positions of all nodes and vertices [m], as the simulation shows them."""
        soft = state.positions[: self._nodes]
        return np.concatenate([soft, self._rigid.vertices(state.rigid)]) if self._rigid else soft


def _bare(state: State) -> State:
    """Return a copy without what only the body's own state has."""
    copy = state.copy()
    copy.twin = copy.servos = copy.ball = None
    return copy


def _same(one: State, other: State) -> bool:
    """Return whether two states have the same positions, velocities and joints."""
    pairs = [(one.positions, other.positions), (one.velocities, other.velocities), (one.joints, other.joints)]
    return all(np.array_equal(a, b) for a, b in (*pairs, *zip(one.rigid, other.rigid, strict=True)))
