"""What a user describes: a scene is a set of named effects, each a frozen table of numbers, checked once.

A table that is absent is an effect that is off: it is not imported, allocates nothing and takes no time.
"""

from dataclasses import MISSING, dataclass, field, fields
from typing import Any

from tripod_sim.errors import SceneError, shown


def number(
    default: Any = MISSING,
    *,
    unit: str = "",
    above: float | None = None,
    low: float | None = None,
    high: float | None = None,
) -> Any:
    """Declare a field with its unit and range: `above` excludes the bound, `low` and `high` include it."""
    return field(default=default, metadata={"unit": unit, "above": above, "low": low, "high": high})


def one_of(*choices: str, default: str) -> Any:
    """Declare a field that takes one of some words."""
    return field(default=default, metadata={"choices": choices})


def check_fields(table: Any, path: str) -> None:
    """Raise SceneError if a field of a dataclass is out of the range that its declaration names."""
    for f in fields(table):
        value, meta = getattr(table, f.name), f.metadata
        where = f"{path}.{f.name}" if path else f.name
        if choices := meta.get("choices"):
            if value not in choices:
                raise SceneError(f"{where} is {shown(value)}; allowed: {', '.join(choices)}")
            continue
        if "unit" not in meta:
            continue
        for v in value if isinstance(value, tuple) else (value,):
            ok = v - v == 0  # finite: inf - inf and nan - nan are nan
            ok &= meta["above"] is None or v > meta["above"]
            ok &= (meta["low"] is None or v >= meta["low"]) and (meta["high"] is None or v <= meta["high"])
            if not ok:
                raise SceneError(f"{where} is {value}; {allowed(meta)}")


def allowed(meta: Any) -> str:
    """Return in words what a numeric field may be."""
    unit = f" {meta['unit']}" if meta["unit"] else ""
    bounds = []
    if meta["above"] is not None:
        bounds.append(f"above {meta['above']:g}{unit}")
    if meta["low"] is not None:
        bounds.append(f"at least {meta['low']:g}{unit}")
    if meta["high"] is not None:
        bounds.append(f"at most {meta['high']:g}{unit}")
    return "it must be " + (" and ".join(bounds) if bounds else f"a finite number{unit}")


@dataclass(frozen=True)
class Mesh:
    """Where the solid's mesh comes from.

    Attributes:
        source: The generator `y_piece`, or the path of a file with tetrahedra or hexahedra (relative to the scene's
            file): GiD text, gmsh, VTK, Abaqus and what else meshio reads.
        level: Resolution of the generator, 1 (coarse) to 4; 5 to 7 for `t4`, of the sizes of the workshop's meshes;
            8 to 11 for compliant clamps, whose bedded ends they divide, too.
        element: Kind of element: `h8_modes` (with incompatible modes), `h8_mean` (with mean dilatation), `h8`,
            `h20`, `h20_full`, `h27`, `t4`, `t10`; of a file those that its cells allow (linear hexahedra all, linear
            tetrahedra `t4` and `t10`).
        scale: Length unit of a file [m]: 0.001 for millimetres.
        refine: How many times every edge is halved, so that each element becomes eight.
    """

    source: str = "y_piece"
    level: int = number(2, low=1, high=11)
    element: str = one_of(
        "h8_modes", "h8_mean", "h8", "h20", "h20_full", "h27", "t4", "t10", default="h8_modes"
    )
    scale: float = number(1.0, unit="m", above=0, high=1e3)
    refine: int = number(0, low=0, high=3)


@dataclass(frozen=True)
class Material:
    """The solid's elastic law.

    Attributes:
        law: `neo_hooke`, `corotational`, `stable_neo_hooke` or `st_venant_kirchhoff`.
        young: E [Pa].
        poisson: nu.
        mass: Of the whole solid [kg], spread evenly over its volume.
    """

    law: str = one_of(
        "neo_hooke", "corotational", "stable_neo_hooke", "st_venant_kirchhoff", default="neo_hooke"
    )
    young: float = number(250e3, unit="Pa", above=0, high=1e13)
    poisson: float = number(0.45, low=0, high=0.499)
    mass: float = number(0.032, unit="kg", above=0, high=1e6)


@dataclass(frozen=True)
class Springs:
    """A body of nodes and springs: a chain, a grid or the edges of a surface.

    Attributes:
        source: `chain` (nodes in a line from the origin along X), `grid` (a square in z = 0 about the origin), or the
            path of an OBJ or STL file (relative to the scene's file), whose edges become springs.
        nodes: Of a chain; along each edge of a grid.
        size: Length of a chain, edge of a grid [m].
        scale: Length unit of a file [m]: 0.001 for millimetres.
        position: Where the origin of chain, grid or file lies [m].
        node_mass: Of each node [kg].
        stiffness: k of the springs along lines and edges [N/m].
        shear: k of those across the cells of a grid, or the quadrangles of a file [N/m]; 0 leaves them out.
        bending: k of those from a node to the next but one, or across the edge of two triangles [N/m]; 0 leaves them
            out.
        damping: c of each spring, the force per rate of its length [N s/m].
        compressed: `push`: a compressed spring pushes; `slack`: it carries no force.
        fixed_nodes: Nodes that never move.
        fixed_corners: Corners that never move: ends 0 and 1 of a chain, 0 to 3 of a grid, counter-clockwise from the
            smallest x and y.
    """

    source: str = "grid"
    nodes: int = number(20, low=2, high=200_000)
    size: float = number(1.0, unit="m", above=0, high=1e3)
    scale: float = number(1.0, unit="m", above=0, high=1e3)
    position: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="m", low=-1e3, high=1e3)
    node_mass: float = number(0.001, unit="kg", above=0, high=1e6)
    stiffness: float = number(1500.0, unit="N/m", low=0, high=1e9)
    shear: float = number(0.0, unit="N/m", low=0, high=1e9)
    bending: float = number(0.0, unit="N/m", low=0, high=1e9)
    damping: float = number(0.0, unit="N s/m", low=0, high=1e6)
    compressed: str = one_of("push", "slack", default="push")
    fixed_nodes: tuple[int, ...] = number((), low=0)
    fixed_corners: tuple[int, ...] = number((), low=0, high=3)

    @property
    def holds(self) -> bool:
        """Whether it has nodes that never move."""
        return bool(self.fixed_nodes or self.fixed_corners)


@dataclass(frozen=True)
class StrainLimit:
    """Springs that cannot be stretched beyond a bound. Needs springs and inertia.

    Attributes:
        stretch: Largest elongation of a spring, as a share of its rest length.
    """

    stretch: float = number(0.1, low=1e-4, high=10.0)


@dataclass(frozen=True)
class Gravity:
    """Weight.

    Attributes:
        acceleration: [m/s²], three components in world.
    """

    acceleration: tuple[float, float, float] = number((0.0, 0.0, -9.81), unit="m/s²", low=-1e6, high=1e6)


EXPLICIT = ("semi_implicit_euler", "explicit_euler", "rk4")
"""Time integrators that solve nothing."""


@dataclass(frozen=True)
class Inertia:
    """Mass and velocity; without it every step is a static equilibrium.

    Attributes:
        scheme: Time integrator: `implicit_euler` (first order), `bdf2` or `tr_bdf2` (second order); explicit are
            `semi_implicit_euler` (first order), `rk4` (fourth order) and `explicit_euler` (first order, unstable: what
            is not damped grows whatever the step; for teaching).
        substeps: Of explicit schemes: `auto` divides a step until it is stable; `off` shows the instability.
    """

    scheme: str = one_of(
        "implicit_euler",
        "bdf2",
        "tr_bdf2",
        "semi_implicit_euler",
        "explicit_euler",
        "rk4",
        default="implicit_euler",
    )
    substeps: str = one_of("auto", "off", default="auto")


@dataclass(frozen=True)
class Damping:
    """Rayleigh damping: the force -(a M + b K) v, K the tangent of the moment (b K v is the rate of elastic forces).

    Attributes:
        mass: a [1/s].
        stiffness: b [s].
    """

    mass: float = number(0.0, unit="1/s", low=0, high=1e6)
    stiffness: float = number(5e-4, unit="s", low=0, high=1e3)


@dataclass(frozen=True)
class FixedBox:
    """Nodes that never move: those whose undeformed position lies in a box.

    Attributes:
        low: Smallest corner [m].
        high: Largest corner [m].
    """

    low: tuple[float, float, float] = number(unit="m")
    high: tuple[float, float, float] = number(unit="m")


@dataclass(frozen=True)
class Servos:
    """Three servo arms that hold the ends of the strips.

    Attributes:
        axis_radius: Of the servo axes from the centre, before sliding [m].
        axis_depth: Of the axes below the mid-plane [m].
        clamp_radius: Nodes beyond it, along each strip, are held [m].
        angle_min: Smallest angle [rad].
        angle_max: Largest angle [rad].
        slide_max: Largest inward slide [m].
        angles: At the start [rad].
        slide: At the start [m].
    """

    axis_radius: float = number(0.060, unit="m", above=0, high=10.0)
    axis_depth: float = number(0.02885, unit="m", low=0, high=10.0)
    clamp_radius: float = number(0.045, unit="m", above=0, high=10.0)
    angle_min: float = number(-2.1, unit="rad", low=-3.2, high=0)
    angle_max: float = number(0.6, unit="rad", low=0, high=3.2)
    slide_max: float = number(0.04, unit="m", low=0, high=10.0)
    angles: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="rad")
    slide: float = number(0.0, unit="m")


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


@dataclass(frozen=True)
class Clamp:
    """Compliant clamps: the held ends of the strips are bedded on the arms, not tied to them. Needs servos.

    Attributes:
        stiffness: Of the bedding: force per volume and displacement [N/m⁴]. The default lets the strip of 250 kPa slip
            over about 2 mm at the edge; the ideal clamp is the limit of an infinite one.
    """

    stiffness: float = number(6e10, unit="N/m⁴", above=0, high=1e20)


@dataclass(frozen=True)
class Effector:
    """A rigid disc in the centre of the piece.

    Attributes:
        radius: Nodes within it of the Z axis belong to the disc [m].
    """

    radius: float = number(0.0075, unit="m", above=0, high=10.0)


@dataclass(frozen=True)
class Maze:
    """A plate with walls on the effector disc. Needs effector.

    Attributes:
        source: Name of a shipped maze, the path of a text file (`.txt`) or of an STL surface (`.stl`), relative to the
            scene's file, or `random:SEED`, or `random:SEED:COLUMNSxROWS`.
        pitch: Distance of the centres of two cells [m].
        wall: Thickness of the walls [m].
        height: Of the walls above the floor [m].
        thickness: Of the floor [m].
        offset: Of the floor's top above the centre of the disc [m].
        mass: Of the whole plate [kg], spread evenly over its floor.
        hole_radius: Of the holes [m].
        scale: Length unit of an STL file [m]: 0.001 for millimetres.
        start: Of the ball in an STL maze: x, y [m] in the plate's frame.
        goal: Centre x, y of the goal of an STL maze and its radius [m]; a radius of 0 is no goal.
    """

    source: str = "labyrinth"
    pitch: float = number(0.007, unit="m", above=0, high=1.0)
    wall: float = number(0.001, unit="m", low=1e-5, high=1.0)
    height: float = number(0.004, unit="m", above=0, high=1.0)
    thickness: float = number(0.002, unit="m", above=0, high=1.0)
    offset: float = number(0.008, unit="m", low=0, high=1.0)
    mass: float = number(0.008, unit="kg", above=0, high=100.0)
    hole_radius: float = number(0.0026, unit="m", above=0, high=1.0)
    scale: float = number(0.001, unit="m", above=0, high=1e3)
    start: tuple[float, float] = number((0.0, 0.0), unit="m")
    goal: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="m")


@dataclass(frozen=True)
class Ball:
    """A rigid ball: on the maze if there is one, else on the soft body itself. Needs gravity.

    Attributes:
        radius: [m].
        mass: [kg], spread evenly through the ball.
        friction: Coulomb's coefficient.
        restitution: Normal speed after an impact over that before it.
        rest_speed: Impacts below it do not bounce [m/s].
        rolling: Rolling resistance: moment over load and radius.
        substep: Longest part of a step in which the ball moves [s].
        position: Of the centre at the start [m]; in a maze it starts there where the maze says.
    """

    radius: float = number(0.002, unit="m", low=1e-5, high=1.0)
    mass: float = number(1e-4, unit="kg", above=0, high=10.0)
    friction: float = number(0.3, low=0, high=10.0)
    restitution: float = number(0.4, low=0, high=1.0)
    rest_speed: float = number(0.01, unit="m/s", low=1e-6, high=10.0)
    rolling: float = number(0.002, low=0, high=1.0)
    substep: float = number(5e-4, unit="s", low=1e-7, high=0.1)
    position: tuple[float, float, float] = number((0.0, 0.0, 0.02), unit="m", low=-10.0, high=10.0)


@dataclass(frozen=True)
class Obstacle:
    """A surface that never moves. Needs contact.

    Attributes:
        source: Path of an OBJ or STL file (relative to the scene's file).
        scale: Length unit of the file [m]: 0.001 for millimetres.
        position: Where the file's origin lies [m].
        orientation: Of the file's axes about that point: unit quaternion x, y, z, w.
    """

    source: str
    scale: float = number(1.0, unit="m", above=0, high=1e3)
    position: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="m", low=-1e3, high=1e3)
    orientation: tuple[float, float, float, float] = number((0.0, 0.0, 0.0, 1.0), low=-1.01, high=1.01)


@dataclass(frozen=True)
class Rigid:
    """A body that moves as a whole. Needs contact.

    Attributes:
        shape: `box` (edges `size`), `ball` (`radius`) or `surface`, the inside of a closed surface from a file.
        source: Path of the OBJ or STL file of a `surface` (relative to the scene's file).
        scale: Length unit of the file [m]: 0.001 for millimetres.
        size: Edges of a box [m].
        radius: Of a ball [m].
        mass: [kg], spread evenly.
        position: Of the centre of mass at the start [m].
        orientation: At the start: unit quaternion x, y, z, w.
        velocity: Of the centre at the start [m/s].
        spin: Angular velocity at the start, in world [rad/s].
    """

    shape: str = one_of("box", "ball", "surface", default="box")
    source: str = ""
    scale: float = number(1.0, unit="m", above=0, high=1e3)
    size: tuple[float, float, float] = number((0.1, 0.1, 0.1), unit="m", above=0, high=1e3)
    radius: float = number(0.05, unit="m", above=0, high=1e3)
    mass: float = number(1.0, unit="kg", above=0, high=1e6)
    position: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="m", low=-1e3, high=1e3)
    orientation: tuple[float, float, float, float] = number((0.0, 0.0, 0.0, 1.0), low=-1.01, high=1.01)
    velocity: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="m/s", low=-1e4, high=1e4)
    spin: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="rad/s", low=-1e5, high=1e5)


@dataclass(frozen=True)
class Contact:
    """Bodies do not pass through obstacles and each other, nor through themselves if asked. Needs implicit Euler.

    Attributes:
        response: `lagrange`: multipliers, which hold the contact distance and Coulomb's law; `penalty`: springs, faster
            and soft, which let bodies sink in by a part of the contact distance.
        contact_distance: At which surfaces are held [m].
        alarm_distance: Below which contacts are made [m]; larger.
        friction: Coulomb's coefficient.
        restitution: Normal speed after an impact over that before it.
        rest_speed: Impacts below it do not bounce [m/s].
        self_contact: Whether the soft body touches itself.
        start: Where bodies pass through each other or through an obstacle at the start: `refuse` names them, `lift`
            moves them against gravity until they do not.
        tolerance: Error of gaps and slips at which a step counts as solved, as a fraction of the contact distance.
        max_solves: Linear solves of a step after which its error, which the report tells, is let be.
    """

    response: str = one_of("lagrange", "penalty", default="lagrange")
    contact_distance: float = number(0.002, unit="m", above=0, high=1.0)
    alarm_distance: float = number(0.005, unit="m", above=0, high=10.0)
    friction: float = number(0.3, low=0, high=10.0)
    restitution: float = number(0.0, low=0, high=1.0)
    rest_speed: float = number(0.05, unit="m/s", low=0, high=100.0)
    self_contact: bool = False
    start: str = one_of("refuse", "lift", default="refuse")
    tolerance: float = number(1e-3, low=1e-9, high=0.1)
    max_solves: int = number(30, low=1, high=10_000)


@dataclass(frozen=True)
class TimeError:
    """The error of the time steps is estimated while the scene runs. Needs inertia with an implicit scheme.

    Attributes:
        steps: `fixed`: every step has the length dt; `auto`: it is divided, as coarsely as `tolerance` allows. A scene
            file or override says `dt = "auto"` for short; dt stays the interval of commands and outputs.
        tolerance: Error that a part of a step may add to the position of any node [m].
        shortest: Length of a part that is accepted whatever its error [s].
    """

    steps: str = one_of("fixed", "auto", default="fixed")
    tolerance: float = number(1e-6, unit="m", above=0, high=1.0)
    shortest: float = number(1e-6, unit="s", low=1e-9, high=1.0)


@dataclass(frozen=True)
class Sleep:
    """A body at rest is not solved for until something changes. Needs inertia.

    Attributes:
        speed: Root mean square speed of the body below which it can be at rest [m/s].
        time: For twice this long it must have been slow, have gone nowhere and not have fallen [s].
    """

    speed: float = number(0.003, unit="m/s", above=0, high=10.0)
    time: float = number(0.25, unit="s", above=0, high=1e3)


@dataclass(frozen=True)
class Reduced:
    """The body moves in few coordinates, learned from the full model when the simulation is built (or before: what
    was learned is kept in the user's cache directory). Needs servos and effector. Faster, and less accurate the further
    the servos are from where it was trained: slides from 0 to `slide`, angles within `spread` of the line from 0 to
    `angle`.

    Attributes:
        modes: Number of shapes beside the motion of disc and arms: more are more accurate and slower.
        tolerance: Error of the forces, relative, at which elements stand for others (hyper-reduction); 0 evaluates all.
        samples: Static poses of the training.
        angle: Of all servos at the largest slide [rad].
        slide: Largest slide [m].
        spread: How far each angle may be from that line [rad].
        seed: Of the choice of poses and motions.
    """

    modes: int = number(20, low=1, high=1000)
    tolerance: float = number(0.03, low=0, high=0.5)
    samples: int = number(60, low=8, high=10_000)
    angle: float = number(-1.4965, unit="rad", low=-3.2, high=3.2)
    slide: float = number(0.035, unit="m", low=0, high=10.0)
    spread: float = number(0.4, unit="rad", low=0.01, high=3.2)
    seed: int = number(0, low=0)


@dataclass(frozen=True)
class Solver:
    """Newton's method.

    Attributes:
        tolerance: Unbalanced force at which a step counts as solved [N].
        mode: `newton`: every step is solved to the tolerance; `one_solve`: one linear solve is enough where it leaves
            at most `share` of the step's unbalanced force, else the step is solved as with `newton`.
        share: See `mode`.
        max_iterations: Before a step is rolled back and halved.
        max_halvings: Before the simulation gives up.
        max_turn: Largest servo move of one static load increment [rad].
        linear: Linear solver: `ldl`, `cholmod` (optional extra), `cg` (conjugate gradients), or `auto`, by size.
        linear_tolerance: Relative residual at which conjugate gradients stop; without effect on direct solvers.
    """

    tolerance: float = number(1e-4, unit="N", low=1e-14, high=1e3)
    mode: str = one_of("newton", "one_solve", default="newton")
    share: float = number(0.1, above=0, high=0.5)
    max_iterations: int = number(300, low=1, high=1000)
    max_halvings: int = number(8, low=0, high=20)
    max_turn: float = number(0.1, unit="rad", low=1e-4, high=7.0)
    linear: str = one_of("auto", "ldl", "cholmod", "cg", default="auto")
    linear_tolerance: float = number(1e-8, above=0, high=0.1)


@dataclass(frozen=True)
class Scene:
    """A soft body, what holds it and what acts on it: a solid (`mesh` and `material`) or `springs`; or rigid bodies.

    Attributes:
        name: For people and file names.
        description: One line.
        dt: Time step [s].
        duration: How long `tripod run` simulates unless told [s].
        mesh, material: The solid; None where the body is of springs.
        springs: The body of springs; None where it is a solid.
        gravity, inertia, damping, fixed, servos, servo_dynamics, clamp, effector, strain_limit, maze, ball, contact,
            obstacles: Effects; None or empty is off.
        rigid: Effect: rigid bodies, beside the soft body or instead of it; empty is none.
        time_error: Effect: estimate of the error of the time steps; None is off.
        sleep: Effect: a body at rest is left alone; None is off.
        reduced: Effect: the reduced-order model; None is the full one.
        solver: Of each step.
    """

    name: str
    mesh: Mesh | None = None
    material: Material | None = None
    springs: Springs | None = None
    description: str = ""
    dt: float = number(0.005, unit="s", low=1e-9, high=1.0)
    duration: float = number(1.0, unit="s", above=0, high=1e9)
    gravity: Gravity | None = None
    inertia: Inertia | None = None
    damping: Damping | None = None
    fixed: tuple[FixedBox, ...] = ()
    servos: Servos | None = None
    servo_dynamics: ServoDynamics | None = None
    clamp: Clamp | None = None
    effector: Effector | None = None
    strain_limit: StrainLimit | None = None
    maze: Maze | None = None
    ball: Ball | None = None
    contact: Contact | None = None
    obstacles: tuple[Obstacle, ...] = ()
    rigid: tuple[Rigid, ...] = ()
    time_error: TimeError | None = None
    sleep: Sleep | None = None
    reduced: Reduced | None = None
    solver: Solver = Solver()

    def __post_init__(self) -> None:
        check_fields(self, "")
        for f in fields(self):
            value = getattr(self, f.name)
            for i, part in enumerate(value) if isinstance(value, tuple) else ((None, value),):
                if hasattr(part, "__dataclass_fields__"):
                    check_fields(part, f.name if i is None else f"{f.name}.{i}")
        _check_body(self)
        if self.damping and not self.inertia:
            raise SceneError("damping needs inertia: without velocity there is nothing to damp")
        if self.clamp and not self.servos:
            raise SceneError("clamp needs servos: it is the bedding of the strips on their arms")
        if self.servo_dynamics and not self.servos:
            raise SceneError("servo_dynamics needs servos: without them there is nothing that turns")
        if self.maze and not self.effector:
            raise SceneError("maze needs effector: it is fastened to the disc")
        if self.ball and not self.gravity:
            raise SceneError("ball needs gravity: without it the ball would never touch anything")
        if self.sleep and not self.inertia:
            raise SceneError("sleep needs inertia: without velocity every step is at rest")
        if self.sleep and (self.rigid or self.reduced):
            other = "rigid" if self.rigid else "reduced"
            raise SceneError(f"sleep and {other} exclude each other: sleep looks at the nodes of one soft body alone")
        if not (self.inertia or self.servos or self.fixed or (self.springs and self.springs.holds)):
            raise SceneError(
                "nothing holds the body (no servos, no fixed box), so its translation and rotation are free and it has "
                "no static equilibrium; add [inertia] or hold it"
            )
        for i, box in enumerate(self.fixed):
            if not all(a <= b for a, b in zip(box.low, box.high, strict=True)):
                raise SceneError(f"fixed.{i}: low {box.low} must not exceed high {box.high} [m]")
        if self.servos:
            _check_start(self.servos)
        _check_rigid(self)
        _check_contact(self)
        _check_time_error(self)
        _check_reduced(self)


def _check_body(scene: Scene) -> None:
    """Raise SceneError if the body is neither a solid nor of springs, or names what its kind has not."""
    for name in ("mesh", "material"):
        given = getattr(scene, name)
        if not scene.springs and given is None and not (scene.rigid and not (scene.mesh or scene.material)):
            raise SceneError(
                f"field {name} is missing: a scene has mesh and material, or springs, or rigid bodies"
            )
        if scene.springs and given is not None:
            raise SceneError(
                f"{name} and springs exclude each other: a scene has mesh and material, or springs"
            )
    if scene.strain_limit and not (scene.springs and scene.inertia):
        raise SceneError(
            "strain_limit needs springs and inertia: it bounds how far springs stretch in motion"
        )
    for name in ("servos", "effector"):
        if scene.springs and getattr(scene, name):
            raise SceneError(
                f"{name} needs a solid: springs are held by fixed_nodes, fixed_corners or fixed boxes"
            )


def _check_rigid(scene: Scene) -> None:
    """Raise SceneError if rigid bodies or obstacles are described wrongly, or lack what they need."""
    for i, body in enumerate(scene.rigid):
        named = "." in body.source
        if body.shape == "surface" and not named:
            raise SceneError(
                f"rigid.{i}.source is {shown(body.source)}; for shape 'surface' allowed: the path of an OBJ or STL file"
            )
        if body.shape != "surface" and body.source:
            raise SceneError(
                f"rigid.{i}.source is {shown(body.source)}, but rigid.{i}.shape is {body.shape!r}; leave it out, or "
                "choose shape 'surface'"
            )
    turned = [("rigid", i, body.orientation) for i, body in enumerate(scene.rigid)]
    turned += [("obstacles", i, obstacle.orientation) for i, obstacle in enumerate(scene.obstacles)]
    for name, i, orientation in turned:
        size = sum(c * c for c in orientation) ** 0.5
        if not abs(size - 1) <= 0.01:
            raise SceneError(
                f"{name}.{i}.orientation is {orientation}, of norm {size:.4g}; it must be a unit quaternion x, y, z, "
                "w; divide it by its norm"
            )
    if scene.rigid and not scene.contact:
        raise SceneError("rigid needs contact: without it nothing touches the bodies; add [contact]")
    if scene.mesh or scene.springs:
        return
    for name in ("damping", "fixed", "servos", "effector"):
        if getattr(scene, name):
            raise SceneError(
                f"{name} needs a soft body (mesh and material, or springs): rigid bodies have none"
            )


def _check_contact(scene: Scene) -> None:
    """Raise SceneError if contact lacks what it needs."""
    contact = scene.contact
    if not contact:
        if scene.obstacles:
            raise SceneError("obstacles need contact: without it nothing touches them; add [contact]")
        return
    if not (scene.inertia and scene.inertia.scheme == "implicit_euler"):
        has = f"inertia.scheme is {scene.inertia.scheme!r}" if scene.inertia else "there is no inertia"
        raise SceneError(f"contact needs inertia.scheme = 'implicit_euler'; {has}")
    for name, why in (
        ("strain_limit", "what the one moves the other would undo"),
        ("ball", "the ball touches nothing but the soft body; make it a [[rigid]] with shape = 'ball'"),
        ("time_error", "the estimate knows nothing of contacts"),
        ("reduced", "the reduced model moves the surface in the shapes that it has learned"),
    ):
        if getattr(scene, name):
            raise SceneError(f"contact and {name} exclude each other: {why}")
    soft = bool(scene.mesh or scene.springs)
    if contact.self_contact and not soft:
        raise SceneError("contact.self_contact needs a soft body: a rigid one does not touch itself")
    if not (scene.obstacles or contact.self_contact or len(scene.rigid) + soft > 1):
        raise SceneError(
            "contact has nothing to touch: add [[obstacles]], [[rigid]] or contact.self_contact = true"
        )
    if not contact.alarm_distance > contact.contact_distance:
        raise SceneError(
            f"contact.alarm_distance is {contact.alarm_distance:g} m; it must be above contact.contact_distance, "
            f"{contact.contact_distance:g} m"
        )


def _check_time_error(scene: Scene) -> None:
    """Raise SceneError if the estimate of the error of the time steps lacks what it needs."""
    wanted = scene.time_error
    if not wanted:
        return
    if scene.strain_limit:
        raise SceneError("time_error and strain_limit exclude each other: the estimate knows nothing of the bound")
    if scene.springs and scene.solver.linear == "cg":
        raise SceneError("solver.linear is 'cg'; time_error of springs needs auto or ldl, a factorisation")
    if scene.reduced:
        raise SceneError("time_error and reduced exclude each other: the estimate is of the full model")
    if not scene.inertia or scene.inertia.scheme in EXPLICIT:
        has = f"inertia.scheme is {scene.inertia.scheme!r}" if scene.inertia else "there is none"
        raise SceneError(
            f"time_error needs inertia with one of the schemes implicit_euler, bdf2, tr_bdf2; {has}"
        )
    if wanted.steps == "auto" and wanted.shortest > scene.dt:
        raise SceneError(
            f"time_error.shortest is {wanted.shortest:g} s; it must be at most dt, {scene.dt:g} s, which it divides"
        )


def _check_reduced(scene: Scene) -> None:
    """Raise SceneError if the reduced model lacks what it needs, or meets what it cannot do."""
    reduced = scene.reduced
    if not reduced:
        return
    if not (scene.servos and scene.effector):
        raise SceneError("reduced needs servos and effector: it learns from poses of the arms how the body moves")
    for name in ("ball", "time_error"):
        if getattr(scene, name):
            raise SceneError(f"reduced and {name} exclude each other; choose the full model, reduced=off")
    if scene.inertia and scene.inertia.scheme in EXPLICIT:
        raise SceneError(
            f"inertia.scheme is {scene.inertia.scheme!r}, which moves single nodes; reduced needs one of: "
            "implicit_euler, bdf2, tr_bdf2"
        )
    s = scene.servos
    if not s.angle_min <= reduced.angle <= s.angle_max:
        raise SceneError(
            f"reduced.angle is {reduced.angle:g} rad; the servos allow {s.angle_min:g} to {s.angle_max:g} rad"
        )
    if not reduced.slide <= s.slide_max:
        raise SceneError(
            f"reduced.slide is {reduced.slide:g} m; it must be at most servos.slide_max, {s.slide_max:g} m"
        )


def _check_start(s: Servos) -> None:
    """Raise SceneError if the servos start out of their limits."""
    for i, angle in enumerate(s.angles):
        if not s.angle_min <= angle <= s.angle_max:
            raise SceneError(
                f"servos.angles.{i} is {angle} rad; allowed is {s.angle_min} to {s.angle_max} rad"
            )
    if not 0 <= s.slide <= s.slide_max:
        raise SceneError(f"servos.slide is {s.slide} m; allowed is 0 to {s.slide_max} m")


EFFECTS = (
    "gravity",
    "inertia",
    "damping",
    "fixed",
    "servos",
    "servo_dynamics",
    "clamp",
    "effector",
    "strain_limit",
    "maze",
    "ball",
    "contact",
    "obstacles",
    "rigid",
    "time_error",
    "sleep",
    "reduced",
)
"""Tables of a scene that may be absent."""
