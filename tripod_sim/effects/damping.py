"""Effect: damping by mass and by stiffness."""

from dataclasses import dataclass, replace

from tripod_sim.effect import Described, Draft, Effect, Need
from tripod_sim.model import Model
from tripod_sim.tables.fields import number


@dataclass(frozen=True)
class Damping:
    """Damping: a force -a M v against velocity, and a viscous stress b C_0 : dE/dt against deformation.

    E is Green's strain, C_0 the law's tangent undeformed; springs get dampers of b times their stiffness, which
    act on slack springs while these are taut. Small vibrations about the unstressed shape are damped as by Rayleigh's
    b K v; motions that deform nothing, rotations among them, are not.

    Attributes:
        mass: a [1/s], of soft bodies: rigid ones move without drag.
        stiffness: b [s].
    """

    mass: float = number(0.0, unit="1/s", low=0, high=1e6)
    stiffness: float = number(5e-4, unit="s", low=0, high=1e3)


def lower(damping: Damping, scene: Described, model: Model) -> Model:
    """Give the model its drag."""
    return replace(model, drag=damping.mass)


def act(damping: Damping, draft: Draft) -> None:
    """Give solids and springs their dampers; say that rigid bodies have no drag."""
    draft.damping = damping.stiffness
    if damping.mass and (fields := [field for field, _ in draft.model.rigid]):
        draft.notes.append(f"damping.mass acts on soft bodies only: there is no drag on {', '.join(fields)}")


EFFECT = Effect(
    Damping,
    rank=30,
    rest=False,
    needs=(Need("inertia", "a scene at rest has no velocity to damp; add [inertia], or leave damping out"),),
    lower=lower,
    act=act,
)
