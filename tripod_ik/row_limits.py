"""Limits of what follows from the angles: torques, the effector's position.

Each gives rows G of the quadratic program, low ≤ G δ ≤ high, linear in the step δ of the angles. All have a slack s,

    low ≤ G δ + k s / √weight ≤ high,   k = |G| row by row,

that costs s²/2 beside the task: going beyond by an angle's worth of s costs weight · s²/2. A soft limit leaves s free;
it is passed by about (remaining distance in angle) / weight. A hard limit leaves s only what holding the previous
command needs, and has |s| cost besides. Where holding keeps to the limit, so does every solution, as exactly as the
linear model; where the robot is found beyond, it may not go farther and comes back as far as the limits of the command
and the other hard limits let it, whatever the task says. So no limit, hard or soft, can make the program infeasible.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.arrays import frozen
from tripod_ik.errors import IkError
from tripod_ik.state import LinearState

if TYPE_CHECKING:
    from tripod_sim.tables.joints import Actuator

WEIGHT = 1e3
"""Weight of a limit against the task: passed by a thousandth of what is missing."""

SLACK = " slack"
"""End of the name of an active limit: the cable before it hangs slack."""

POSITION_CURVATURE, TORQUE_CURVATURE = 0.1, 1.1
"""How fast the Jacobians of effector and torques turn at most, where the strips are stretched [m/rad², N m/rad²]."""


@dataclass(frozen=True, eq=False)
class LimitRows:
    """low ≤ G δ ≤ high at one state.

    Attributes:
        matrix: G [unit/rad], shape (m, n).
        low: [unit], shape (m,).
        high: [unit], shape (m,).
        names: Of each row, for people, such as "servo_1 torque".
    """

    matrix: FloatArray
    low: FloatArray
    high: FloatArray
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class RowLimit(ABC):
    """A limit on something linear in the step of the angles.

    Attributes:
        weight: How much passing it costs, see above.
        hard: Whether it may not be passed at all.
        curvature: How fast its rows turn, at most [unit/rad²]: a hard limit keeps off by what a step may miss.
    """

    weight: float = field(default=WEIGHT, kw_only=True)
    hard: bool = field(default=False, kw_only=True)
    curvature: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        if not 0 < self.weight < np.inf:
            raise IkError(f"weight of the {self.what} limit is {self.weight}; it must be positive and finite")
        if not 0 <= self.curvature < np.inf:
            raise IkError(
                f"curvature of the {self.what} limit is {self.curvature}; it must be finite and not negative"
            )

    @property
    @abstractmethod
    def what(self) -> str:
        """What it limits."""

    @abstractmethod
    def needs(self, state: LinearState) -> str:
        """Return what a pose beyond the limit needs, in words."""

    @abstractmethod
    def rows(self, state: LinearState) -> LimitRows:
        """Return the rows at `state`."""

    @abstractmethod
    def size(self, n: int) -> int:
        """Return the number of rows for `n` servos."""


@dataclass(frozen=True, eq=False)
class TorqueLimit(RowLimit):
    """Torques |tau + K δ| stay below `maximum` [N m], one number or one a joint, infinite where there is no limit.

    Soft by default: the torque comes from a model, and it may already be too large when the limit is set.
    """

    maximum: float | FloatArray
    curvature: float = field(default=TORQUE_CURVATURE, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (np.all(np.greater(self.maximum, 0)) and np.any(np.isfinite(self.maximum))):
            raise IkError(f"torque limit is {self.maximum} N m; it must be positive and finite")

    @property
    def what(self) -> str:
        """What it limits."""
        return "torque"

    def size(self, n: int) -> int:
        """Return n: a row a servo."""
        return n

    def needs(self, state: LinearState) -> str:
        """Return the largest torque, and the limit."""
        limit = f"{np.min(self.maximum):g}"
        return f"a torque of {np.abs(state.efforts).max():.2g} N m (limit {limit} N m)"

    def rows(self, state: LinearState) -> LimitRows:
        """Return -maximum - tau ≤ K δ ≤ maximum - tau [N m]."""
        maximum = np.broadcast_to(np.asarray(self.maximum, dtype=float), state.angles.shape)
        names = tuple(
            f"{name} {what}" for name, what in zip(state.joint_names, state.effort_quantities, strict=True)
        )
        return LimitRows(state.stiffness, -maximum - state.efforts, maximum - state.efforts, names)


@dataclass(frozen=True, eq=False)
class TensionLimit(RowLimit):
    """Tensions of cables that are commanded by length do not become negative: tau + K δ ≥ 0.

    A slack cable is linearised as if it were just taut (`tripod_sim.compliance`); this row lets it go slack again.

    Attributes:
        cables: Their numbers among the joints, shape (c,).
    """

    cables: tuple[int, ...]
    hard: bool = field(default=True, kw_only=True)

    @property
    def what(self) -> str:
        """What it limits."""
        return "slack"

    def size(self, n: int) -> int:
        """Return c."""
        return len(self.cables)

    def needs(self, state: LinearState) -> str:
        """Return what cannot be."""
        return "a cable that pushes"

    def rows(self, state: LinearState) -> LimitRows:
        """Return -tau ≤ K δ [N m]."""
        rows = list(self.cables)
        names = tuple(f"{state.joint_names[i]}{SLACK}" for i in rows)
        return LimitRows(state.stiffness[rows], -state.efforts[rows], np.full(len(rows), 1e9), names)


def effort_limits(actuators: Sequence["Actuator"], torque_max: float) -> FloatArray | None:
    """Return the largest effort of each actuator per span [N m], infinite for none; None for servos alone."""
    if all(a.unit == "rad" for a in actuators):
        return None
    limits = [torque_max if a.unit == "rad" else a.effort_max or np.inf for a in actuators]
    return np.array(limits) * [a.span for a in actuators]


def tension_limits(state: LinearState) -> tuple[TensionLimit, ...]:
    """Return the limit that the cables of a robot need, if it has any that are commanded by length."""
    cables = tuple(i for i, a in enumerate(state.actuators) if a.pulls)
    return (TensionLimit(cables),) if cables else ()


@dataclass(frozen=True, eq=False)
class EffectorBox(RowLimit):
    """The effector at rest stays within a box: low ≤ p + J δ ≤ high [m], each of shape (3,), in `world`."""

    low: FloatArray
    high: FloatArray
    curvature: float = field(default=POSITION_CURVATURE, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        for side in ("low", "high"):
            object.__setattr__(self, side, frozen(f"effector box, {side}", getattr(self, side), (3,)))
        if not np.all(self.low < self.high):
            raise IkError(
                f"effector box: low {self.low.tolist()} m must be below high {self.high.tolist()} m"
            )

    @property
    def what(self) -> str:
        """What it limits."""
        return "effector box"

    def size(self, n: int) -> int:
        """Return 3: x, y and z."""
        return 3

    def needs(self, state: LinearState) -> str:
        """Return where the effector is."""
        place = ", ".join(f"{1e3 * x:.1f}" for x in state.equilibrium)
        return f"the effector at {place} mm, outside of the box"

    def rows(self, state: LinearState) -> LimitRows:
        """Return low - p ≤ J δ ≤ high - p [m], p the equilibrium."""
        names = tuple(f"effector {axis}" for axis in "xyz")
        return LimitRows(
            state.jacobian[:3], self.low - state.equilibrium, self.high - state.equilibrium, names
        )
