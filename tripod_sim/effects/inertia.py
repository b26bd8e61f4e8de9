"""Effect: mass and velocity; without it every step is a static equilibrium."""

from dataclasses import dataclass

from tripod_sim.effect import Draft, Effect
from tripod_sim.tables.fields import one_of

ORDER = {
    "implicit_euler": 1, "auto": 1, "bdf2": 2, "tr_bdf2": 2, "semi_implicit_euler": 1, "explicit_euler": 1, "rk4": 4,
}  # fmt: skip
"""Power of the time step with which a scheme's error falls."""


EXPLICIT = ("semi_implicit_euler", "explicit_euler", "rk4")
"""Time integrators that solve nothing."""


@dataclass(frozen=True)
class Inertia:
    """Mass and velocity; without it every step is a static equilibrium.

    Attributes:
        scheme: Time integrator: `implicit_euler` (first order), `bdf2` or `tr_bdf2` (second order); explicit are
            `semi_implicit_euler` (first order), `rk4` (fourth order) and `explicit_euler` (first order, unstable: what
            is not damped grows whatever the step; for teaching). `auto`: with a fixed dt implicit Euler; with
            `dt = "auto"`, which asks for it unless a scheme is named beside it, chosen with the steps: for a solid
            implicit Euler and TR-BDF2, for springs Verlet and RK4, whichever does with less.
        substeps: Of explicit schemes: `auto` divides a step until it is stable; `off` shows the instability.
    """

    scheme: str = one_of(
        "implicit_euler",
        "bdf2",
        "tr_bdf2",
        "semi_implicit_euler",
        "explicit_euler",
        "rk4",
        "auto",
        default="implicit_euler",
    )
    substeps: str = one_of("auto", "off", default="auto")


def act(inertia: Inertia, draft: Draft) -> None:
    """Add the terms of inertia that implicit schemes have; explicit ones move the masses of nodes alone."""
    if inertia.scheme not in EXPLICIT:
        from tripod_sim.bodies.soft_build import element_masses
        from tripod_sim.forces.anchor import Anchor

        draft.inertia = Anchor(len(draft.rest))
        if found := element_masses(draft.assembly, draft.sets):
            from tripod_sim.forces.element_inertia import ElementInertia

            draft.terms += [ElementInertia(masses, draft.inertia) for masses in found]


EFFECT = Effect(
    Inertia,
    rank=20,
    springs=True,
    rigid=True,
    rest=False,
    modules=(
        "forces.anchor",
        "forces.element_inertia",
        "integrators.schemes",
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
    act=act,
)
