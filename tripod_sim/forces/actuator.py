"""Actuators as terms of the potential: V(x, q), with a commanded coordinate q for each.

The servo's arm moves nodes; every other actuator is such a term. q is a length by which a cable is pulled in [m], its
tension [N], the pressure of a chamber [Pa] or a force [N]. What the actuator gives in return is its effort dV/dq: of a
pulled length the tension [N], of a pressure less the volume [m³].
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from tripod_host.arrays import FloatArray
from tripod_sim.forces.term import BlockTerm

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.mesh.embedding import Embedding


class ActuatorTerm(BlockTerm):
    """A term with one commanded coordinate.

    Attributes:
        value: q, see the module.
        effort: dV/dq at the last `add_gradient`.
        effort_slope: d²V/dq² there.
        span: By how much q changes where a servo would turn by a radian: larger changes are divided in statics.
        high: Largest q.
        holds: Whether the second derivatives of an actuator that only pulls, and is slack, are those of when it is just
            taut, as far as `high` allows that.
        only_pulls: Whether a position is commanded and it can go slack.
        gap: By how much q then has to grow until it is; else 0.
    """

    value = effort = effort_slope = gap = 0.0
    span, high = 1.0, math.inf
    holds = only_pulls = False

    def add_coupling(self, x: FloatArray, out: FloatArray) -> None:
        """Add d²V/dx dq at positions `x` [m] to `out`, both of shape (n, 3)."""
        raise NotImplementedError

    def energies(self, x: FloatArray) -> tuple[float, float]:
        """Return none: the work that actuators do comes from outside."""
        return 0.0, 0.0

    @property
    def route(self) -> "Embedding | None":
        """Points of the line as which it is drawn; None: it is no line."""
        return None

    def runaway(self) -> str:
        """Return in words why the last `add_gradient` may have been far from any equilibrium; empty if it was not."""
        return ""


class EffortWatch:
    """Says when what an actuator bears is beyond its limits."""

    def __init__(self, measured: Callable[[], float], low: float, high: float, said: str) -> None:
        """`measured`: what it bears; `low`, `high`: the limits; `said`: the note, a format for what was measured."""
        self._measured, self._low, self._high, self._said = measured, low, high, said

    def __call__(self, positions: FloatArray) -> str:
        """Return the note, empty as long as there is none."""
        value = self._measured()
        return "" if self._low <= value <= self._high else self._said.format(value)
