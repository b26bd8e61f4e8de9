"""Effect: Rayleigh damping."""

from dataclasses import dataclass

from tripod_sim.effect import Draft, Effect, Need
from tripod_sim.effects.inertia import EXPLICIT
from tripod_sim.tables.fields import number


@dataclass(frozen=True)
class Damping:
    """Rayleigh damping: the force -(a M + b K) v, K the tangent of the moment (b K v is the rate of elastic forces).

    Attributes:
        mass: a [1/s].
        stiffness: b [s].
    """

    mass: float = number(0.0, unit="1/s", low=0, high=1e6)
    stiffness: float = number(5e-4, unit="s", low=0, high=1e3)


def act(damping: Damping, draft: Draft) -> None:
    """Give implicit schemes the stiffness damping of the elastic terms; explicit ones have their own."""
    if draft.scene.inertia.scheme not in EXPLICIT:
        draft.damping = damping.stiffness


EFFECT = Effect(
    Damping,
    rank=30,
    springs=True,
    rest=False,
    needs=(Need("inertia", "without velocity there is nothing to damp"),),
    modules=("forces.rayleigh",),
    stages={"forces.rayleigh.StiffnessDamping": {"add_gradient": "damping", "hold": "damping"}},
    steps=("damping",),
    act=act,
)
