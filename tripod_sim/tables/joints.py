"""The servos of a scene: where their arms turn, what they hold, how far they may go."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.tables.robot import Servos
from tripod_sim.tables.sets import NodeSet


@dataclass(frozen=True, eq=False)
class Arm:
    """A servo: its arm turns about an axis and holds a set.

    Attributes:
        held: The set, or its name.
        field: How messages begin that are about it.
        hub: A point on the axis, before sliding [m].
        axis: Unit vector of the axis.
        inward: Unit vector of a positive slide; zero where it does not slide.
        angle: At the start [rad].
        table: What it shares with others: range, and what it looks like.
    """

    held: NodeSet | str
    field: str
    hub: FloatArray
    axis: FloatArray
    inward: FloatArray
    angle: float
    table: Servos

    @property
    def low(self) -> float:
        """Smallest angle [rad]."""
        return self.table.angle_min

    @property
    def high(self) -> float:
        """Largest angle [rad]."""
        return self.table.angle_max

    @property
    def length(self) -> float:
        """From the axis to what it holds, as it is drawn [m]."""
        return self.table.axis_depth

    @cached_property
    def frame(self) -> FloatArray:
        """Axes of the servo's body in columns: x outward, y against the axis, z along the arm at angle 0."""
        y = -self.axis
        outward = -self.inward if self.inward.any() else np.cross(y, [0.0, 0.0, 1.0])
        outward = outward - (outward @ y) * y
        if not np.linalg.norm(outward) > 1e-9:
            outward = np.cross(y, [1.0, 0.0, 0.0])
        x = outward / np.linalg.norm(outward)
        return np.column_stack([x, y, np.cross(x, y)])


@dataclass(frozen=True, eq=False)
class Joints:
    """The servos of a scene, in the order of its bodies, and the slide that they share.

    Attributes:
        arms: The servos.
        slide: At the start [m].
        slide_max: Largest [m].
    """

    arms: tuple[Arm, ...]
    slide: float
    slide_max: float

    @property
    def count(self) -> int:
        """Number of servos."""
        return len(self.arms)

    @cached_property
    def low(self) -> FloatArray:
        """Smallest angles [rad], shape (count,)."""
        return np.array([arm.low for arm in self.arms])

    @cached_property
    def high(self) -> FloatArray:
        """Largest angles [rad], shape (count,)."""
        return np.array([arm.high for arm in self.arms])

    def of_body(self, name: str) -> "Joints | None":
        """Return those that hold nodes of a soft body; None where there are none. `[[servo]]` hold the first body."""
        arms = tuple(arm for arm in self.arms if isinstance(arm.held, str) or arm.held.body == name)
        if not arms:
            return None
        return Joints(arms, self.slide, min(arm.table.slide_max for arm in arms))

    @property
    def slides(self) -> bool:
        """Whether any of them slides."""
        return any(arm.inward.any() for arm in self.arms)

    @property
    def start(self) -> FloatArray:
        """Angles [rad] and slide [m] at the start, shape (count + 1,)."""
        return np.array([*(arm.angle for arm in self.arms), self.slide])

    @property
    def reach(self) -> float:
        """Length by which a slide counts as a turn [m]: that of the longest arm."""
        return max(*(arm.length for arm in self.arms), 0.005)
