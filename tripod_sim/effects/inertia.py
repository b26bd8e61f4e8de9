"""Effect: mass and velocity; without it every step is a static equilibrium."""

from dataclasses import dataclass, replace

from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.errors import SceneError
from tripod_sim.integrators.scheme import Scheme
from tripod_sim.integrators.schemes import SCHEMES, implicit_euler
from tripod_sim.model import Model
from tripod_sim.tables.fields import number, one_of


@dataclass(frozen=True)
class Inertia:
    """Mass and velocity; without it every step is a static equilibrium.

    Attributes:
        scheme: Time integrator: `implicit_euler` (first order), `bdf2`, `tr_bdf2` or `generalised_alpha` (second
            order); explicit are `semi_implicit_euler` (first order), `rk4` (fourth order) and `explicit_euler` (first
            order, unstable: what is not damped grows whatever the step; for teaching). `auto`: with a fixed dt implicit
            Euler; with `dt = "auto"`, which asks for it unless a scheme is named beside it, chosen with the steps: for
            a solid implicit Euler and TR-BDF2, for springs Verlet and RK4, whichever does with less.
        substeps: Of explicit schemes: `auto` divides a step until it is stable; `off` shows the instability.
        rho_inf: Of `generalised_alpha`: what a step leaves of the fastest modes' amplitude, from 0 (damps most) to 1
            (damps nothing); left out it is 0.8.
    """

    scheme: str = one_of(*SCHEMES, default=implicit_euler.SCHEME.name)
    substeps: str = one_of("auto", "off", default="auto")
    rho_inf: float | None = number(None, low=0.0, high=1.0)

    @property
    def integrator(self) -> Scheme:
        """Return the scheme with its parameters."""
        scheme = SCHEMES[self.scheme]
        given = {name: getattr(self, name) for name in scheme.parameters}
        return replace(scheme, **{name: value for name, value in given.items() if value is not None})

    @property
    def explicit(self) -> bool:
        """Whether steps solve no equations."""
        return SCHEMES[self.scheme].explicit


PARAMETERS = {name: [s.name for s in SCHEMES.values() if name in s.parameters]
              for name in sorted({n for s in SCHEMES.values() for n in s.parameters})}  # fmt: skip
"""Fields of [inertia] that only some schemes take, and which."""


def check(inertia: Inertia, scene: Described) -> None:
    """Raise SceneError for a parameter of another scheme."""
    for name, takers in PARAMETERS.items():
        if getattr(inertia, name) is not None and name not in SCHEMES[inertia.scheme].parameters:
            raise SceneError(
                f"inertia.{name} is {getattr(inertia, name):g}, but inertia.scheme is {inertia.scheme!r}, which does "
                f"not use it; leave it out, or set inertia.scheme to {' or '.join(takers)}"
            )


def lower(inertia: Inertia, scene: Described, model: Model) -> Model:
    """Give the model its time integrator."""
    return replace(model, scheme=inertia.integrator, divide=inertia.substeps == "auto")


def act(inertia: Inertia, draft: Draft) -> None:
    """Add the terms of inertia that implicit schemes have; explicit ones move the masses of nodes alone."""
    if not inertia.explicit:
        from tripod_sim.bodies.soft_build import element_masses
        from tripod_sim.forces.anchor import Anchor

        draft.inertia = Anchor(len(draft.rest))
        if found := element_masses(draft.assembly, draft.sets):
            from tripod_sim.forces.element_inertia import ElementInertia

            draft.terms += [ElementInertia(masses, draft.inertia) for masses in found]


EFFECT = Effect(
    Inertia,
    rank=20,
    rigid=True,
    rest=False,
    modules=(
        "forces.anchor",
        "forces.element_inertia",
        "integrators.implicit",
        "integrators.history",
        "integrators.stage",
        "integrators.explicit",
        "integrators.explicit_kernels",
        "integrators.force_kernels",
        "integrators.frequency",
    ),
    stages={
        "forces.anchor.Anchor": {"add_gradient": "inertia"},
        "forces.element_inertia.ElementInertia": {"add_gradient": "inertia", "add_products": "inertia"},
        "integrators.explicit.ExplicitSteps": {
            "_longest_part": "stability limit",
            "_advance": "explicit parts",
        },
        "integrators.frequency.LargestFrequency": {"largest": "stability limit"},
    },
    steps=("inertia", "stability limit", "explicit parts"),
    check=check,
    lower=lower,
    act=act,
)
