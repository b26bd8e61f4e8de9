"""Effect: servos that take time, hear a command late and stall."""

from collections.abc import Callable
from dataclasses import replace

from tripod_sim.effect import Effect, Need, Parts
from tripod_sim.model import Model
from tripod_sim.tables.robot import ServoDynamics


def finish(table: ServoDynamics, model: Model, parts: Parts, build: Callable[[Model], Parts]) -> Parts:
    """Let the servos turn as described."""
    from tripod_sim.robot.servo import ServoMotion

    return replace(parts, servos=ServoMotion(table, len(parts.system.groups.driven)))


EFFECT = Effect(
    ServoDynamics,
    rank=90,
    rest=False,
    needs=(Need("servos", "it is the motion of the servos; add [servos]"),),
    modules=("robot.servo",),
    stages={"robot.servo.ServoMotion": {"advance": "servo dynamics", "stalled": "servo dynamics"}},
    steps=("servo dynamics",),
    finish=finish,
)
