"""Effect: compliant clamps between strips and arms."""

from dataclasses import dataclass, replace

from tripod_sim.effect import Draft, Effect, Need
from tripod_sim.tables.fields import number


@dataclass(frozen=True)
class Clamp:
    """Compliant clamps: the held ends of the strips are bedded on the arms, not tied to them. Needs servos.

    Attributes:
        stiffness: Of the bedding: force per volume and displacement [N/m⁴]. The default lets the strip of 250 kPa slip
            over about 2 mm at the edge; the ideal clamp is the limit of an infinite one.
    """

    stiffness: float = number(6e10, unit="N/m⁴", above=0, high=1e20)


def extend(clamp: Clamp, draft: Draft) -> None:
    """Bed the clamped elements on ghosts that the arms drive."""
    from tripod_sim.robot.clamp import bed_clamps

    solid = draft.assembly.bodies[0].among(draft.rest)
    draft.rest, frames, foundations = bed_clamps(solid, draft.groups.driven, clamp.stiffness)
    draft.groups = replace(draft.groups, size=len(draft.rest), driven=frames)
    draft.terms += foundations


EFFECT = Effect(
    Clamp,
    rank=100,
    needs=(Need("servos", "it is the elastic layer between a strip and its arm; add [servos]"),),
    modules=("robot.clamp", "forces.foundation"),
    stages={"forces.foundation.Foundation": {"add_gradient": "clamp"}},
    steps=("clamp",),
    extend=extend,
)
