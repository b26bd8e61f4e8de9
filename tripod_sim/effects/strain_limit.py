"""Effect: springs that cannot be stretched beyond a bound."""

from dataclasses import dataclass, replace

from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.errors import SceneError
from tripod_sim.model import Model
from tripod_sim.tables.fields import number
from tripod_sim.tables.short_forms import soft_bodies


@dataclass(frozen=True)
class StrainLimit:
    """Springs that cannot be stretched beyond a bound. Needs springs and inertia.

    Attributes:
        stretch: Largest elongation of a spring, as a share of its rest length.
    """

    stretch: float = number(0.1, low=1e-4, high=10.0)


def check(table: StrainLimit, scene: Described) -> None:
    """Raise SceneError if there are no springs, or nothing moves."""
    if not (scene.inertia and any(body.springs for body in soft_bodies(scene))):
        raise SceneError(
            "strain_limit needs springs and inertia: it limits how far springs stretch in motion; add "
            "them, or leave it out"
        )


def lower(table: StrainLimit, scene: Described, model: Model) -> Model:
    """Say that velocities jump where springs reach the bound."""
    return replace(model, jumps=True)


def act(table: StrainLimit, draft: Draft) -> None:
    """Bound the springs: in implicit stages as a term, after explicit steps by moving nodes."""
    from tripod_sim.bodies.soft_build import strain_bound

    draft.bound = strain_bound(draft.assembly, draft.groups, draft.inert, table.stretch)
    if not draft.model.explicit:
        draft.terms.append(draft.bound)


EFFECT = Effect(
    StrainLimit,
    rank=120,
    rest=False,
    check=check,
    lower=lower,
    modules=("forces.strain_bound", "integrators.strain_limit"),
    stages={
        "forces.strain_bound.StrainBound": {
            "add_gradient": "strain limit",
            "stiffness": "strain limit",
            "settle": "strain limit",
        },
        "integrators.strain_limit.StrainLimited": {"step": "strain limit"},
    },
    steps=("strain limit",),
    act=act,
)
