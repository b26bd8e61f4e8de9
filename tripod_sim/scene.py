"""What a user describes: a scene is a set of named effects, each a frozen table of numbers, checked once.

A table that is absent is an effect that is off: it is not imported, allocates nothing and takes no time.
"""

from dataclasses import dataclass, field, replace

from tripod_sim.scene_checks import CHECKS
from tripod_sim.tables.bodies import Body, Material, Mesh, Obstacle, Region, Rigid, Springs, Tie
from tripod_sim.tables.fields import check_fields, number
from tripod_sim.tables.method import MeshError, Solver, TimeError
from tripod_sim.tables.motion import Contact, Damping, Gravity, Inertia, Sleep, StrainLimit
from tripod_sim.tables.robot import Ball, Clamp, Effector, Maze, Motion, Platform, ServoDynamics, Servos
from tripod_sim.tables.sets import Fixed, InitialVelocity, Load, Marker, NodeSet, Prescribed, Servo


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
        region: Parts of the solid that are of other materials.
        body: Soft bodies beside it, or instead of it.
        tie: Which of their nodes are one.
        platform: Rigid bodies that join sets of several of them; empty: none.
        set: Nodes of the body to which others refer.
        gravity, inertia, damping, fixed, prescribed, load, initial_velocity, servos, servo_dynamics, clamp, effector,
            strain_limit, maze, ball, contact, obstacles: Effects; None or empty is off.
        servo: Where the servos stand; empty: evenly about Z.
        marker: Sets that are watched.
        rigid: Effect: rigid bodies, beside the soft body or instead of it; empty is none.
        time_error: Effect: estimate of the error of the time steps; None is off.
        mesh_error: Effect: estimate of the error of the mesh at the effector; None is off.
        sleep: Effect: a body at rest is left alone; None is off.
        solver: Of each step.
        motion: What `tripod run` does with the servos unless told; None: nothing.
    """

    name: str
    mesh: Mesh | None = None
    material: Material | None = None
    springs: Springs | None = None
    region: tuple[Region, ...] = ()
    body: tuple[Body, ...] = ()
    tie: tuple[Tie, ...] = ()
    description: str = ""
    dt: float = number(0.005, unit="s", low=1e-9, high=1.0)
    duration: float = number(1.0, unit="s", above=0, high=1e9)
    gravity: Gravity | None = None
    inertia: Inertia | None = None
    damping: Damping | None = None
    set: tuple[NodeSet, ...] = ()
    fixed: tuple[Fixed, ...] = ()
    prescribed: tuple[Prescribed, ...] = ()
    load: tuple[Load, ...] = ()
    initial_velocity: tuple[InitialVelocity, ...] = ()
    marker: tuple[Marker, ...] = ()
    servos: Servos | None = None
    servo: tuple[Servo, ...] = ()
    servo_dynamics: ServoDynamics | None = None
    clamp: Clamp | None = None
    effector: Effector | None = None
    platform: tuple[Platform, ...] = ()
    strain_limit: StrainLimit | None = None
    maze: Maze | None = None
    ball: Ball | None = None
    contact: Contact | None = None
    obstacles: tuple[Obstacle, ...] = ()
    rigid: tuple[Rigid, ...] = ()
    time_error: TimeError | None = None
    mesh_error: MeshError | None = None
    sleep: Sleep | None = None
    solver: Solver = field(default_factory=Solver)
    motion: Motion | None = field(
        default=None, repr=False
    )  # no part of what is simulated, nor of a name for that

    def __post_init__(self) -> None:
        check_fields(self, "")
        for check in CHECKS:
            check(self)


EFFECTS = (
    "gravity",
    "inertia",
    "damping",
    "fixed",
    "prescribed",
    "load",
    "initial_velocity",
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
    "mesh_error",
    "sleep",
)
"""Tables of a scene that may be absent."""

OPTIONAL = (*EFFECTS, "body", "tie", "platform", "region", "set", "servo", "marker", "motion")
"""The same, with what is no effect."""


def at_rest(scene: Scene) -> Scene:
    """Return the static scene: without what only a body in motion has, or other bodies."""
    return replace(
        scene, inertia=None, damping=None, servo_dynamics=None, ball=None, time_error=None, mesh_error=None, sleep=None,
        strain_limit=None, contact=None, obstacles=(), rigid=(), initial_velocity=(),
    )  # fmt: skip
