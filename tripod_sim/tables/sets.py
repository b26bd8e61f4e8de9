"""Tables of sets of nodes, and of what holds, moves, loads and watches them."""

from dataclasses import dataclass

from tripod_sim.tables.fields import number, one_of

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class NodeSet:
    """Nodes of the bodies, by their undeformed places: those that meet all that is named here; all if nothing is.
    Without a table of its own there is the set `all`, one for each body, and one for each group of a mesh file.

    Attributes:
        name: By which others refer to it.
        body: Name of the body whose nodes alone are meant.
        low, high: Corners of a box [m]; each may stand alone.
        centre: Of a sphere, or a point on the axis of a cylinder [m]; without it the origin.
        radius: Of sphere or cylinder, nodes on it included [m].
        axis: Direction of a cylinder's axis, of any length; without it `radius` is that of a sphere.
        along: Direction, of any length, of the distances that follow, from the origin.
        at: In a plane at this distance [m], within `tolerance`.
        beyond: At this distance or farther [m].
        below: At this distance or nearer [m].
        tolerance: Of all of these places [m].
        group: Name of a group of the mesh file.
    """

    name: str
    body: str = ""
    low: Vector | None = number(None, unit="m")
    high: Vector | None = number(None, unit="m")
    centre: Vector | None = number(None, unit="m")
    radius: float | None = number(None, unit="m", above=0)
    axis: Vector | None = number(None)
    along: Vector | None = number(None)
    at: float | None = number(None, unit="m")
    beyond: float | None = number(None, unit="m")
    below: float | None = number(None, unit="m")
    tolerance: float = number(1e-9, unit="m", low=0, high=1.0)
    group: str = ""


@dataclass(frozen=True)
class Servo:
    """Where a servo stands and what it holds; without any they stand evenly about Z. `[servos]` has what all share:
    their number, range, slide and start.

    Attributes:
        set: Name of the set that its arm holds.
        hub: A point on its axis, before sliding [m].
        axis: Direction of the axis, of any length; the angle grows counter-clockwise about it, from 0 as meshed.
        inward: Direction of a positive slide, of any length; without it the servo does not slide.
    """

    set: str
    hub: Vector = number(unit="m")
    axis: Vector = number()
    inward: Vector | None = number(None)


@dataclass(frozen=True)
class Marker:
    """A set that is watched: `tripod run` and the topic `sim/markers` tell how far its nodes have moved on average.

    Attributes:
        set: Name of the set.
    """

    set: str


@dataclass(frozen=True)
class Fixed:
    """Nodes that never move, or not along some axes: a set, or those whose undeformed place lies in a box.

    Attributes:
        set: Name of the set; empty: the box.
        low: Smallest corner of the box [m].
        high: Largest corner [m].
        axes: Along which they stay: `xyz`, or fewer, for rollers and planes of symmetry.
    """

    set: str = ""
    low: Vector | None = number(None, unit="m")
    high: Vector | None = number(None, unit="m")
    axes: str = "xyz"


@dataclass(frozen=True)
class Load:
    """A dead load on a set, constant in size and direction: a force, a pressure or a mass; one of the three.

    Attributes:
        set: Name of the set.
        force: Of all its nodes together [N].
        pressure: On the faces of the surface whose nodes are all in the set [Pa], along the normals of the undeformed
            surface, inwards: it does not follow the surface.
        mass: Of all its nodes together [kg]: weight where there is gravity, inertia where there is that.
        share: How force and mass are divided: `area`, evenly over the same faces (consistent nodal loads), or `even`,
            the same for each node.
    """

    set: str
    force: Vector | None = number(None, unit="N", low=-1e9, high=1e9)
    pressure: float | None = number(None, unit="Pa", low=-1e13, high=1e13)
    mass: float | None = number(None, unit="kg", above=0, high=1e6)
    share: str = one_of("area", "even", default="area")
