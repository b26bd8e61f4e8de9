"""Effect: a rigid ball, on the maze or on the soft body itself."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tripod_sim.effect import Described, Draft, Effect, Need
from tripod_sim.errors import SceneError
from tripod_sim.scene_short import ball_is_rigid, soft_bodies
from tripod_sim.tables.fields import number

if TYPE_CHECKING:
    from tripod_sim.parts import Parts


RIGID = (
    "beside contact the ball is a rigid body: it touches with contact.friction, restitution and rest_speed; its own, "
    "rolling and substep are of no account"
)
"""What users should know of it."""


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


def check(ball: Ball, scene: Described) -> None:
    """Raise SceneError if there is nothing that it could lie on."""
    bodies = soft_bodies(scene)
    if not ball_is_rigid(scene) and not (bodies and bodies[0].mesh):
        raise SceneError("ball needs contact where the first body is no solid; add [contact]")


def act(ball: Ball, draft: Draft) -> None:
    """Let it move beside the body, which feels it as loads on nodes."""
    scene = draft.scene
    if ball_is_rigid(scene):
        return
    from tripod_sim.forces.loads import NodalLoads

    loads, gravity = NodalLoads(draft.rest), np.array(scene.gravity.acceleration)
    draft.terms.append(loads)
    if draft.plate:
        from tripod_sim.maze.play import MazeBall

        draft.ball = MazeBall(ball, draft.plate, gravity, loads, quasi_static=not scene.inertia)
        return
    from tripod_sim.ball.body_ball import BodyBall

    body, groups = draft.assembly.bodies[0], draft.groups
    draft.ball = BodyBall(
        ball, body.solid.surface, groups.driven, body.table.material.mass, gravity, loads,
        quasi_static=not scene.inertia, disc=groups.rigid[0] if groups.rigid else None,
    )  # fmt: skip


def finish(ball: Ball, scene: Described, parts: "Parts", build: "Callable[[Described], Parts]") -> "Parts":
    """Say what is of no account."""
    return replace(parts, notes=(*parts.notes, RIGID)) if ball_is_rigid(scene) else parts


BALL = "ball"

EFFECT = Effect(
    Ball,
    rank=140,
    needs=(Need("gravity", "without it the ball would never touch anything"),),
    check=check,
    modules=("ball", "forces.loads"),
    stages={
        "forces.loads.NodalLoads": {"add_gradient": BALL},
        "maze.play.MazeBall": {"load": BALL, "follow": BALL},
        "ball.body_ball.BodyBall": {"load": BALL, "follow": BALL},
    },
    steps=(BALL,),
    act=act,
    finish=finish,
)
