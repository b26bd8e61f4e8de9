"""Effect: a rigid ball, in the maze or among what touches."""

from dataclasses import dataclass

import numpy as np

from tripod_sim.effect import Described, Draft, Effect, Need
from tripod_sim.errors import SceneError
from tripod_sim.tables.fields import number


@dataclass(frozen=True)
class Ball:
    """A rigid ball: in the maze if there is one, else a rigid body in contact. Needs gravity.

    Outside of a maze and without [contact] a scene with a ball has that of the ball's friction, restitution and
    rest_speed, at a sixteenth of its radius; with [contact] that counts for the ball, too.

    Attributes:
        radius: [m].
        mass: [kg], spread evenly through the ball.
        friction: Coulomb's coefficient.
        restitution: Normal speed after an impact over that before it.
        rest_speed: Impacts below it do not bounce [m/s].
        rolling: Rolling resistance in the maze: moment over load and radius.
        substep: Longest part of a step in which it moves in the maze [s].
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
    """Raise SceneError if it has what only one in a maze has, or what contact has for all."""
    if scene.maze:
        return
    plain, elsewhere = (
        Ball(),
        dict.fromkeys(("rolling", "substep"), "only a ball in a maze uses it; leave it out"),
    )
    if scene.contact:
        for name in ("friction", "restitution", "rest_speed"):
            elsewhere[name] = f"bodies in contact use contact.{name}; set that instead"
    for name, why in elsewhere.items():
        if (value := getattr(ball, name)) != getattr(plain, name):
            raise SceneError(f"ball.{name} is {value:g}, but {why}")


def act(ball: Ball, draft: Draft) -> None:
    """Let it move in the maze, which feels it as loads on nodes."""
    if not draft.plate:
        return
    from tripod_sim.forces.loads import NodalLoads
    from tripod_sim.maze.play import MazeBall

    scene = draft.scene
    loads, gravity = NodalLoads(draft.rest), np.array(scene.gravity.acceleration)
    draft.terms.append(loads)
    draft.ball = MazeBall(ball, draft.plate, gravity, loads, quasi_static=not scene.inertia)


BALL = "ball"

EFFECT = Effect(
    Ball,
    rank=140,
    rigid=True,
    rest=False,
    needs=(Need("gravity", "without it the ball would never touch anything"),),
    check=check,
    modules=("ball", "forces.loads"),
    stages={
        "forces.loads.NodalLoads": {"add_gradient": BALL},
        "maze.play.MazeBall": {"load": BALL, "follow": BALL},
    },
    steps=(BALL,),
    act=act,
)
