"""What a user describes: a scene is a set of named effects, each a frozen table of numbers, checked once.

A table that is absent is an effect that is off: it is not imported, allocates nothing and takes no time.
"""

from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from tripod_sim.effect import Effect
from tripod_sim.effects import EFFECTS, has, named, table_of
from tripod_sim.effects.clamp import Clamp
from tripod_sim.effects.damping import Damping
from tripod_sim.effects.gravity import Gravity
from tripod_sim.effects.inertia import Inertia
from tripod_sim.effects.initial_velocity import InitialVelocity
from tripod_sim.effects.mesh_error import MeshError
from tripod_sim.effects.prescribed import Prescribed
from tripod_sim.effects.sleep import Sleep
from tripod_sim.effects.strain_limit import StrainLimit
from tripod_sim.scene.checks import check_bodies, check_held, check_needs, check_tables
from tripod_sim.tables.bodies import Body, Material, Mesh, Obstacle, Region, Rigid, Springs, Tie
from tripod_sim.tables.contact import Contact
from tripod_sim.tables.fields import check_fields, number
from tripod_sim.tables.kinds import kept_fields
from tripod_sim.tables.maze import Ball, Maze
from tripod_sim.tables.method import Solver, TimeError
from tripod_sim.tables.robot import Effector, Motion, Platform, ServoDynamics, Servos
from tripod_sim.tables.sets import Fixed, Load, Marker, NodeSet, Servo

T = TypeVar("T")


def with_effects(cls: type[T]) -> type[T]:
    """Give a class a field for each effect; those named in its body are for readers and type checkers."""
    for name, effect in EFFECTS.items():
        if name not in cls.__annotations__:
            cls.__annotations__[name] = tuple[effect.table, ...] if effect.several else effect.table | None  # type: ignore[name-defined]
            setattr(cls, name, () if effect.several else None)
    return cls


@dataclass(frozen=True)
@with_effects
class Scene:
    """A soft body, what holds it and what acts on it: a solid (`mesh` and `material`) or `springs`; or rigid bodies.

    Attributes:
        name: For people and file names.
        description: One line.
        dt: Time step [s].
        duration: How long `tripod run` simulates unless told [s]; where servos move, until 1 s after their last time.
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
        for name, value in kept_fields(Scene, self, "").items():
            object.__setattr__(self, name, value)
        check_fields(self, "")
        check_bodies(self)
        for name, effect in EFFECTS.items():
            if has(self, name):
                check_needs(self, name, effect)
        check_held(self)
        check_tables(self)
        for name, effect in EFFECTS.items():
            if effect.check and has(self, name):
                effect.check(table_of(self, name), self)

    @property
    def effects(self) -> dict[str, Effect]:
        """The effects that it names."""
        return {name: EFFECTS[name] for name in named(self)}


OPTIONAL = (*EFFECTS, "body", "tie", "platform", "region", "set", "servo", "marker", "motion")
"""Tables of a scene that may be absent: effects, and what is none."""


def at_rest(scene: Scene) -> Scene:
    """Return the static scene: without what only a body in motion has, or other bodies."""
    off: dict[str, Any] = {name: () if e.several else None for name, e in EFFECTS.items() if not e.rest}
    return replace(scene, **off)
