"""Effect: weight."""

from dataclasses import dataclass, replace

from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.model import Model
from tripod_sim.tables.fields import number


@dataclass(frozen=True)
class Gravity:
    """Weight.

    Attributes:
        acceleration: [m/s²], three components in world.
    """

    acceleration: tuple[float, float, float] = number(
        (0.0, 0.0, -9.81), unit="m/s²", low=-1e6, high=1e6, usual=(0.0, 1e3)
    )


def lower(gravity: Gravity, scene: Described, model: Model) -> Model:
    """Give the model its acceleration."""
    return replace(model, gravity=gravity.acceleration)


def act(gravity: Gravity, draft: Draft) -> None:
    """Add the weight of the nodes, dead loads with it.

    Explicit schemes move the lumped masses of nodes: it is these that weigh then, so that free fall deforms nothing.
    """
    from tripod_sim.forces.gravity import GravityForce

    masses = draft.inert if draft.model.explicit else draft.load
    draft.terms.append(GravityForce(masses, gravity.acceleration, draft.rest, draft.dead))


EFFECT = Effect(
    Gravity,
    rank=10,
    rigid=True,
    modules=("forces.gravity",),
    stages={"forces.gravity.GravityForce": {"add_gradient": "gravity"}},
    steps=("gravity",),
    lower=lower,
    act=act,
)
