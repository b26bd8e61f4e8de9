"""A scene written out: all that builders of a simulation read.

`lowering.lowered` makes it of a scene. It has no short forms, and asks for nothing by the name of a table. Bodies and
discs carry the field by which a message names what the user wrote; obstacles, platforms and sets are named by number.
"""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from tripod_sim.errors import Doubt
from tripod_sim.integrators.scheme import ImplicitScheme, Scheme
from tripod_sim.tables.bodies import Body, Obstacle, Rigid, Tie
from tripod_sim.tables.contact import Contact
from tripod_sim.tables.joints import Joints
from tripod_sim.tables.maze import Ball
from tripod_sim.tables.method import Solver, TimeError
from tripod_sim.tables.robot import Effector, Platform
from tripod_sim.tables.sets import Marker, NodeSet, Vector

REACH = 0.03
"""Length by which a slide counts as a turn where there are no arms [m]."""

BALL = "ball"
"""Field of the ball among the rigid bodies."""


class ErrorEstimate(Enum):
    """How the error of the time steps is estimated."""

    CARRIED = "carried"  # the scheme carries it along: integrators.time_error
    OVER_PATH = "over path"  # over the path of each point: steps.path_error_control
    HALF_STEPS = "half steps"  # against steps of half the length: steps.doubling


@dataclass(frozen=True, eq=False)
class Model:
    """What is simulated.

    Attributes:
        dt: Time step [s].
        solver: Of each step.
        bodies: Soft bodies, each with what its fields begin with in messages.
        rigid: Rigid bodies, each with its field.
        obstacles: Surfaces that stand still.
        joints: Servos; None without any.
        effectors: Discs and what is observed, each with its field and its body; the first is the scene's.
        posed: Whether servos hold the first body, which then begins where they bring it.
        platforms, ties, sets, markers: Of the scene.
        effects: Each with its table, in the order of their ranks.
        doubts: Inputs of an unusual size, one sentence each.
        notes: What users should know, one sentence each.
        gravity: Acceleration [m/s²]; None without weight.
        scheme: Time integrator; None: every step is a static equilibrium.
        divide: Whether explicit steps are divided until they are stable.
        drag: a of the force -a M v [1/s].
        contact: What holds between bodies that touch; None: nothing does.
        jumps: Whether velocities jump, at impacts or at a limit of strain.
        ball: The ball in a maze; None without one.
        time_error: The table of the error of the time steps; None without one.
        estimate: How that error is found; None without `time_error`.
    """

    dt: float
    solver: Solver
    bodies: tuple[tuple[str, Body], ...]
    rigid: tuple[tuple[str, Rigid], ...]
    obstacles: tuple[Obstacle, ...]
    joints: Joints | None
    effectors: tuple[tuple[str, Effector, Body], ...]
    posed: bool
    platforms: tuple[Platform, ...]
    ties: tuple[Tie, ...]
    sets: tuple[NodeSet, ...]
    markers: tuple[Marker, ...]
    effects: tuple[tuple[Any, Any], ...]
    doubts: tuple[Doubt, ...]
    notes: tuple[str, ...] = ()
    gravity: Vector | None = None
    scheme: Scheme | None = None
    divide: bool = True
    drag: float = 0.0
    contact: Contact | None = None
    jumps: bool = False
    ball: Ball | None = None
    time_error: TimeError | None = None
    estimate: ErrorEstimate | None = None

    @property
    def discs(self) -> tuple[tuple[str, Effector, Body], ...]:
        """Those effectors that are rigid discs."""
        return tuple(found for found in self.effectors if found[1].is_disc)

    @property
    def implicit(self) -> ImplicitScheme:
        """The time integrator, which must be an implicit one."""
        assert isinstance(self.scheme, ImplicitScheme)
        return self.scheme

    @property
    def explicit(self) -> bool:
        """Whether steps solve no equations."""
        return self.scheme is not None and self.scheme.explicit

    @property
    def only_springs(self) -> bool:
        """Whether all soft bodies are nets of springs, which may have no stiffness across themselves."""
        return all(body.springs for _, body in self.bodies)

    @property
    def reach(self) -> float:
        """Length of the arms by which a slide counts as a turn [m]."""
        return self.joints.reach if self.joints else REACH

    @property
    def rigid_ball(self) -> int | None:
        """Which of the rigid bodies is the ball; None if none is."""
        return next((k for k, (field, _) in enumerate(self.rigid) if field == BALL), None)

    def at_rest(self) -> "Model":
        """Return the model of the body at rest: without effects that only a body in motion has, and other bodies."""
        return replace(
            self,
            rigid=(), obstacles=(), notes=(), scheme=None, drag=0.0, contact=None, jumps=False, ball=None,
            time_error=None, estimate=None,
            effects=tuple((effect, table) for effect, table in self.effects if effect.rest),
        )  # fmt: skip

    @property
    def carried(self) -> TimeError | None:
        """The table of an error that the scheme carries along; None where it carries none."""
        return self.time_error if self.estimate is ErrorEstimate.CARRIED else None
