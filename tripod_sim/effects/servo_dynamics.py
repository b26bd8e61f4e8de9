"""Effect: servos that take time, hear a command late and stall."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from tripod_sim.effect import Described, Effect, Need, Parts
from tripod_sim.tables.fields import number


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


def finish(
    table: ServoDynamics, scene: Described, parts: Parts, build: Callable[[Described], Parts]
) -> Parts:
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
