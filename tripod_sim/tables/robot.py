"""Tables of the Tripod: servos and disc."""

from dataclasses import dataclass

from tripod_sim.tables.fields import number


@dataclass(frozen=True)
class Servos:
    """Servo arms, evenly about Z, that hold the ends of the strips.

    Attributes:
        count: How many; the first holds the strip along X.
        axis_radius: Of the servo axes from the centre, before sliding [m].
        axis_depth: Of the axes below the mid-plane [m]; where servos have tables of their own, how long their arms are
            drawn.
        clamp_radius: Nodes beyond it, along each strip, are held [m].
        angle_min: Smallest angle [rad].
        angle_max: Largest angle [rad].
        slide_max: Largest inward slide [m].
        angles: At the start [rad], one for each; empty: 0.
        slide: At the start [m].
    """

    count: int = number(3, low=1, high=12)

    axis_radius: float = number(0.060, unit="m", above=0, high=10.0)
    axis_depth: float = number(0.02885, unit="m", low=0, high=10.0)
    clamp_radius: float = number(0.045, unit="m", above=0, high=10.0)
    angle_min: float = number(-2.1, unit="rad", low=-3.2, high=0)
    angle_max: float = number(0.6, unit="rad", low=0, high=3.2)
    slide_max: float = number(0.04, unit="m", low=0, high=10.0)
    angles: tuple[float, ...] = number((), unit="rad", low=-3.2, high=3.2)
    slide: float = number(0.0, unit="m", low=0, high=10.0)

    def __post_init__(self) -> None:
        if len(self.angles) == 0:  # also of an array
            object.__setattr__(self, "angles", (0.0,) * self.count)


@dataclass(frozen=True)
class Motion:
    """What `tripod run` asks of the actuators, if there are any, unless it is told something else: shows what the scene
    is about. No effect: nodes, studies and `Simulation` itself take no notice.

    Attributes:
        servo: Angles over time [s], [rad]: `0:0,0,0; 1:-0.7854,-0.7854,-0.7854`; empty: as at the start.
        slide: Slide over time [s], [m], `0:0; 1:0.035`, or one number; empty: as at the start.
        actuate: Values of other actuators over time, each with its name, in the unit of its range:
            `tendon=0:0; 1:0.01`. Actuators that are not named stay as at the start.
    """

    servo: str = ""
    slide: str = ""
    actuate: tuple[str, ...] = ()


@dataclass(frozen=True)
class EffectorPoint:
    """A further place that inverse kinematics brings to a target, observed as `[effector]` with `point` or `set` is.

    Attributes:
        name: By which targets name it.
        point: A point of the body of the effector, undeformed, in the frame of the body [m].
        set: Name of a set: its mean position is observed.
        weight: How much its distance from the target counts, that of the effector counting 1.
    """

    name: str
    point: tuple[float, float, float] | None = number(None, unit="m", low=-1e3, high=1e3)
    set: str = ""
    weight: float = number(1.0, above=0, high=1e6)


@dataclass(frozen=True)
class Effector:
    """The effector: a rigid disc in the centre of the piece; or a point or the mean of a set, which is only observed.

    A point and a set add no stiffness and no mass. They have a position, but no orientation.

    Attributes:
        radius: Nodes within it of the Z axis belong to the disc [m]; without effect on a point or a set.
        point: A point of the body, undeformed, in the frame of the body [m]: anywhere in its elements, or a node of a
            net.
        set: Name of a set: its mean position is observed.
        more: Further places that have targets of their own in inverse kinematics, each a `[[effector.more]]`.
    """

    radius: float = number(0.0075, unit="m", above=0, high=10.0)
    point: tuple[float, float, float] | None = number(None, unit="m", low=-1e3, high=1e3)
    set: str = ""
    more: tuple[EffectorPoint, ...] = ()

    @property
    def is_disc(self) -> bool:
        """Whether it is a rigid disc, which has an orientation."""
        return self.point is None and not self.set


@dataclass(frozen=True)
class Hold:
    """A set that a platform holds: a node X of it stands at position + to + R(turn) (X - point) where that begins.

    Attributes:
        set: Name of the set.
        point: A point of the undeformed body [m].
        to: Where the platform has it, from its centre [m].
        turn: How the set is turned there: rotation vector [rad].
    """

    set: str
    point: tuple[float, float, float] = number(unit="m", low=-1e3, high=1e3)
    to: tuple[float, float, float] = number(unit="m", low=-1e3, high=1e3)
    turn: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="rad", low=-6.3, high=6.3)


@dataclass(frozen=True)
class Platform:
    """A rigid body that joins sets of several bodies, each at a place of its own. Bodies that do not fit undeformed are
    bent there, a little at a time, before the simulation begins; then the platform is let go.

    Attributes:
        hold: What it holds.
        position: Of its centre, which is its centre of mass, until it is let go [m].
        mass: [kg], spread evenly over a box.
        size: Edges of the box [m].
        stretch: A body that is longer than undeformed by more than this share, from what holds it to the platform, is
            refused: it does not reach.
    """

    hold: tuple[Hold, ...]
    position: tuple[float, float, float] = number(unit="m", low=-1e3, high=1e3)
    mass: float = number(0.005, unit="kg", above=0, high=1e6)
    size: tuple[float, float, float] = number((0.02, 0.02, 0.02), unit="m", above=0, high=1e3)
    stretch: float = number(0.2, low=0, high=10.0)


@dataclass(frozen=True)
class ServoDynamics:
    """Real servos of the S90 class, as data sheets and shops describe them; without it angles are ideal.

    Attributes:
        speed: Without load [rad/s]; the default is 60 degrees in 0.1 s.
        refresh: Time between two pulses; a servo hears of a new command only with the next one [s].
        dead_band: Deviation from the pulse that a servo leaves alone, to either side [rad]; the default is 0.5 degrees.
        stall_torque: At which its speed, falling linearly with the load, is zero [N m].
    """

    speed: float = number(10.47, unit="rad/s", above=0, high=1000.0)
    refresh: float = number(0.02, unit="s", low=1e-4, high=1.0)
    dead_band: float = number(0.0087, unit="rad", low=0, high=0.5)
    stall_torque: float = number(0.17, unit="N m", above=0, high=1e6)
