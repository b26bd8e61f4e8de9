"""The joints of a scene: servos, where their arms turn and what they hold; other actuators; how far all may go."""

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


TURN = 1.5
"""Turns of a servo [rad] to which the whole range of another actuator counts as equal."""


@dataclass(frozen=True)
class Actuator:
    """A joint as its commands know it.

    Attributes:
        name: By which it is commanded.
        unit: Of the command, SI.
        low, high, start: Of the command: smallest, largest, and at the start.
        is_effort: Whether a force, a pressure or a tension is commanded, not a position.
        effort_max: Largest effort that it may bear where a position is commanded [N m, N]; None: none is given.
        pulls: Whether it only pulls where a position is commanded: a cable, which goes slack.
    """

    name: str
    unit: str
    low: float
    high: float
    start: float
    is_effort: bool = False
    effort_max: float | None = None
    pulls: bool = False

    @property
    def span(self) -> float:
        """By how much the command changes where a servo would turn by a radian."""
        return 1.0 if self.unit == "rad" else (self.high - self.low) / TURN

    @property
    def quantity(self) -> str:
        """What is commanded, in a word."""
        if self.unit == "m":
            return "length" if self.pulls else "displacement"
        return {"rad": "angle", "N": "force", "Pa": "pressure", "m³": "volume"}[self.unit]

    @property
    def effort_quantity(self) -> str:
        """What it does where a position is commanded, in a word."""
        return {"rad": "torque", "m": "tension" if self.pulls else "force"}.get(self.unit, "")

    @property
    def position_unit(self) -> str:
        """Of where it is, see `Joints.moved`."""
        return {"N": "m", "Pa": "m³"}.get(self.unit, self.unit)

    @property
    def effort_unit(self) -> str:
        """Of what it does there."""
        return {"rad": "N m", "m": "N", "m³": "Pa"}.get(self.unit, self.unit)


@dataclass(frozen=True, eq=False)
class Joints:
    """The servos of a scene, in the order of its bodies, its other actuators, and the slide that servos share.

    Attributes:
        arms: The servos.
        slide: At the start [m].
        slide_max: Largest [m].
        others: Actuators that are no servos.
    """

    arms: tuple[Arm, ...]
    slide: float
    slide_max: float
    others: tuple[Actuator, ...] = ()

    @cached_property
    def actuators(self) -> tuple[Actuator, ...]:
        """All that is commanded but the slide, servos first."""
        servos = (
            Actuator(f"servo_{i}", "rad", arm.low, arm.high, arm.angle) for i, arm in enumerate(self.arms)
        )
        return (*servos, *self.others)

    @property
    def count(self) -> int:
        """Number of actuators."""
        return len(self.arms) + len(self.others)

    @cached_property
    def low(self) -> FloatArray:
        """Smallest commands, shape (count,)."""
        return np.array([a.low for a in self.actuators])

    @cached_property
    def high(self) -> FloatArray:
        """Largest commands, shape (count,)."""
        return np.array([a.high for a in self.actuators])

    @cached_property
    def spans(self) -> FloatArray:
        """`Actuator.span` of each, shape (count,)."""
        return np.array([a.span for a in self.actuators])

    def moved(self, commands: FloatArray, efforts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where actuators are and what they do there, q and dV/dq (see `forces.actuator`) sorted by their kinds.

        Of a position that is commanded these are q and dV/dq: angle and torque, length pulled and tension. Of an effort
        they are -dV/dq and q: the displacement along a force, the volume of a chamber. The work that an actuator does
        is the integral of the effort over the position.

        Args:
            commands: q, shape (count,).
            efforts: dV/dq, shape (count,).

        Returns:
            Positions [rad, m, m³] and efforts [N m, N, Pa], shape (count,).
        """
        swaps = np.array([a.is_effort for a in self.actuators], dtype=bool)
        return np.where(swaps, -efforts, commands), np.where(swaps, commands, efforts)

    def of_body(self, name: str) -> "Joints | None":
        """Return those that hold nodes of a soft body; None where there are none. `[[servo]]` hold the first body."""
        arms = tuple(arm for arm in self.arms if isinstance(arm.held, str) or arm.held.body == name)
        if not arms:
            return None
        return Joints(
            arms, self.slide, min(arm.table.slide_max for arm in arms)
        )  # other actuators: not known

    @property
    def slides(self) -> bool:
        """Whether any of them slides."""
        return any(arm.inward.any() for arm in self.arms)

    @property
    def start(self) -> FloatArray:
        """Commands of the actuators and slide [m] at the start, shape (count + 1,)."""
        return np.array([*(a.start for a in self.actuators), self.slide])

    @property
    def reach(self) -> float:
        """Length by which a slide counts as a turn [m]: that of the longest arm."""
        return max([*(arm.length for arm in self.arms), 0.005])
