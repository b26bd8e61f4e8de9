"""Effect: a rigid ball, in the maze or among what touches."""

from dataclasses import replace

import numpy as np

from tripod_sim.effect import Described, Draft, Effect, Need
from tripod_sim.errors import SceneError
from tripod_sim.model import Model
from tripod_sim.tables.maze import Ball


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


def lower(ball: Ball, scene: Described, model: Model) -> Model:
    """Leave the ball in a maze to that; elsewhere it is one of the rigid bodies."""
    return replace(model, ball=ball) if scene.maze else model


def act(ball: Ball, draft: Draft) -> None:
    """Let it move in the maze, which feels it as loads on nodes."""
    if not draft.plate:
        return
    from tripod_sim.forces.loads import NodalLoads
    from tripod_sim.maze.play import MazeBall

    loads, gravity = NodalLoads(draft.rest), np.array(draft.model.gravity)
    draft.terms.append(loads)
    draft.ball = MazeBall(ball, draft.plate, gravity, loads, quasi_static=draft.model.scheme is None)


BALL = "ball"

EFFECT = Effect(
    Ball,
    rank=140,
    rigid=True,
    rest=False,
    needs=(Need("gravity", "without it the ball would never touch anything"),),
    check=check,
    lower=lower,
    modules=("ball", "forces.loads"),
    stages={
        "forces.loads.NodalLoads": {"add_gradient": BALL},
        "maze.play.MazeBall": {"load": BALL, "follow": BALL},
    },
    steps=(BALL,),
    act=act,
)
