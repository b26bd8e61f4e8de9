"""Effect: bodies at rest are left alone until something changes."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from tripod_sim.effect import Effect, Need, Parts
from tripod_sim.model import Model
from tripod_sim.tables.fields import number


@dataclass(frozen=True)
class Sleep:
    """Bodies at rest are not solved for until something changes. Needs inertia.

    Attributes:
        speed: Root mean square speed of a body below which it can be at rest [m/s].
        time: For twice this long it must have been slow, have gone nowhere and not have fallen [s].
    """

    speed: float = number(0.003, unit="m/s", above=0, high=10.0)
    time: float = number(0.25, unit="s", above=0, high=1e3)


def finish(table: Sleep, model: Model, parts: Parts, build: Callable[[Model], Parts]) -> Parts:
    """Take steps only while something moves."""
    from tripod_sim.steps.sleep import Sleeping

    stepper = Sleeping(
        parts.stepper, parts.system, parts.mass, speed=table.speed, time=table.time, rigid=parts.rigid
    )
    return replace(parts, stepper=stepper)


EFFECT = Effect(
    Sleep,
    rank=200,
    rigid=True,
    rest=False,
    needs=(Need("inertia", "without velocity every step is at rest; add [inertia], or leave sleep out"),),
    modules=("steps.sleep",),
    stages={"steps.sleep.Sleeping": {"step": "sleep"}},
    steps=("sleep",),
    finish=finish,
)
