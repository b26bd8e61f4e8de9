"""Tables of actuators other than servos: what is commanded, and how far it may go."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

from tripod_sim.errors import SceneError, shown
from tripod_sim.tables.fields import Described, number, one_of
from tripod_sim.tables.joints import Actuator
from tripod_sim.tables.sets import Vector

NAME = re.compile(r"[a-z][a-z0-9_]*")
"""What an actuator may be called: parts of names in ROS."""

TAKEN = re.compile(r"servo_[0-9]+|slide")
"""Names of other joints."""


WORLD = "world"
"""Body of points that never move."""

VACUUM = -101_325.0
"""Smallest pressure above that outside, at sea level [Pa]."""


@dataclass(frozen=True)
class Via:
    """Points of a body that a cable passes one after another.

    Attributes:
        points: Undeformed, in the frame of the body [m]; anywhere in its elements, or nodes of a net.
        body: Name of the body; empty: the first; `world`: points that never move.
        source: Path of a text file with the points instead, x, y, z a line [m] (relative to the scene's file).
    """

    points: tuple[Vector, ...] = number((), unit="m")
    body: str = ""
    source: str = ""


@dataclass(frozen=True)
class Cable:
    """A cable without friction that runs through points of bodies and is pulled: one tension, slack when pushed.

    Attributes:
        name: Of the joint.
        via: The points, in the order in which the cable passes them.
        range: Smallest and largest command: length pulled in [m], or tension [N].
        command: What is commanded: `length` or `tension`.
        start: At the start [m, N].
        slack: By how much it is longer than the way through the points undeformed [m].
        stiffness: Tension over stretch [N/m]; without effect by tension.
        tension_max: Tension from which on a run warns [N]; None: none.
    """

    name: str
    via: tuple[Via, ...]
    range: tuple[float, float] = number(low=-1e9, high=1e9)
    command: str = one_of("length", "tension", default="length")
    start: float = number(0.0, low=-1e9, high=1e9)
    slack: float = number(0.0, unit="m", low=-1e3, high=1e3)
    stiffness: float = number(1e6, unit="N/m", above=0, high=1e7)
    tension_max: float | None = number(None, unit="N", above=0, high=1e9)

    @property
    def actuator(self) -> Actuator:
        """Return the joint."""
        by_tension = self.command == "tension"
        return Actuator(
            self.name, "N" if by_tension else "m", *self.range, self.start, by_tension,
            None if by_tension else self.tension_max, pulls=not by_tension,
        )  # fmt: skip


@dataclass(frozen=True)
class Chamber:
    """A closed cavity of a solid: the pressure in it is commanded, or how much liquid is pumped in.

    Attributes:
        name: Of the joint.
        range: Smallest and largest command: pressure above that outside [Pa], or volume pumped in [m³].
        command: What is commanded: `pressure` or `volume`.
        start: At the start [Pa, m³].
        body: Name of the solid; empty: the first.
        cavity: Number of the cavity, from 0, in the order of their smallest nodes; or give `set`.
        set: Name of a set whose faces enclose the chamber.
        cap: Whether openings of that set with nearly planar rims are closed; the pressure on a cap acts on its rim.
        bulk: Modulus of the liquid, pressure over relative compression [Pa]; without effect by pressure.
    """

    name: str
    range: tuple[float, float] = number(low=-1e12, high=1e12)
    command: str = one_of("pressure", "volume", default="pressure")
    start: float = number(0.0, low=-1e12, high=1e12)
    body: str = ""
    cavity: int = number(0, low=0, high=10**6)
    set: str = ""
    cap: bool = False
    bulk: float = number(1e8, unit="Pa", above=0, high=1e10)

    @property
    def actuator(self) -> Actuator:
        """Return the joint."""
        by_volume = self.command == "volume"
        return Actuator(
            self.name, "m³" if by_volume else "Pa", *self.range, self.start, is_effort=not by_volume
        )


@dataclass(frozen=True)
class Force:
    """A force on a set along a fixed direction, or a displacement of the set along it, that is commanded.

    Attributes:
        name: Of the joint.
        set: Name of the set.
        direction: Of a positive command, of any length; across it the set is free.
        range: Smallest and largest command: force of all nodes together [N], or displacement [m].
        command: What is commanded: `force` or `displacement`.
        start: At the start [N, m].
        share: How force and stiffness are divided: `area` or `even`, as of a load.
        stiffness: Of the drive: force over how far the set lags behind [N/m]; without effect by force.
        force_max: Force of a displacement from which on a run warns [N]; None: none.
    """

    name: str
    set: str
    direction: Vector = number()
    range: tuple[float, float] = number(low=-1e9, high=1e9)
    command: str = one_of("force", "displacement", default="force")
    start: float = number(0.0, low=-1e9, high=1e9)
    share: str = one_of("area", "even", default="area")
    stiffness: float = number(1e6, unit="N/m", above=0, high=1e9)
    force_max: float | None = number(None, unit="N", above=0, high=1e9)

    @property
    def actuator(self) -> Actuator:
        """Return the joint."""
        by_force = self.command == "force"
        most = None if by_force else self.force_max
        return Actuator(self.name, "N" if by_force else "m", *self.range, self.start, by_force, most)


KINDS = ("cable", "chamber", "force")
"""Fields of a scene with tables of actuators, in the order of their joints."""


def actuator_tables(scene: Described) -> Iterator[tuple[str, int, Cable | Chamber | Force]]:
    """Yield kind, number and table of each actuator of a scene, in the order of their joints."""
    for kind in KINDS:
        for i, table in enumerate(getattr(scene, kind)):
            yield kind, i, table


def check_actuators(scene: Described) -> None:
    """Raise SceneError if an actuator has a name that is no name or not its own, or a range upside down."""
    names = list[str]()
    for kind, i, table in actuator_tables(scene):
        field, a = f"{kind}.{i}", table.actuator
        if not NAME.fullmatch(a.name) or TAKEN.fullmatch(a.name) or a.name in names:
            raise SceneError(
                f"{field}.name is {shown(a.name)}; it must be of small letters, digits and _, differ from the names of "
                "other actuators and be neither 'slide' nor 'servo_0' and so on"
            )
        names.append(a.name)
        if not a.low < a.high:
            raise SceneError(
                f"{field}.range is {[a.low, a.high]}; give the smallest {a.unit} first, then the largest"
            )
        if not a.low <= a.start <= a.high:
            raise SceneError(
                f"{field}.start is {a.start:g} {a.unit}; allowed: {a.low:g} to {a.high:g} {a.unit}, its range"
            )


def started(scene: Described, values: list[float]) -> Described:
    """Return a scene whose actuators start at `values`, in the order of `actuator_tables`."""
    found = {kind: list(getattr(scene, kind)) for kind in KINDS}
    for (kind, i, table), value in zip(actuator_tables(scene), values, strict=True):
        found[kind][i] = replace(table, start=value)
    return replace(scene, **{kind: tuple(tables) for kind, tables in found.items() if tables})
