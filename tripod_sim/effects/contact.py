"""Effect: nothing passes through anything."""

from dataclasses import replace
from typing import Any

import numpy as np

from tripod_sim.effect import Described, Draft, Effect, Parts
from tripod_sim.errors import SceneError
from tripod_sim.integrators.schemes import IMPLICIT
from tripod_sim.model import Model
from tripod_sim.tables.contact import Contact
from tripod_sim.tables.short_forms import contact_of, rigids_of, soft_bodies


def check(contact: Contact, scene: Described) -> None:
    """Raise SceneError if contact lacks what it needs."""
    if scene.inertia and scene.inertia.explicit:
        raise SceneError(
            f"inertia.scheme is {scene.inertia.scheme!r}; contact needs an implicit scheme, which finds "
            f"the contact forces at the end of a step. Allowed with contact or a ball: {', '.join(IMPLICIT)}"
        )
    bodies = rigids_of(scene)
    if bodies and not scene.inertia:
        raise SceneError(
            f"{('rigid' if scene.rigid else 'ball')} needs inertia: nothing holds these bodies, so their "
            "place at rest is not determined; add [inertia], or make what stands still one of the "
            "[[obstacles]]"
        )
    soft = len(soft_bodies(scene))
    if contact.self_contact and not soft:
        raise SceneError(
            "contact.self_contact needs a soft body: a rigid one does not touch itself; leave it out"
        )
    if not (scene.obstacles or contact.self_contact or len(bodies) + soft > 1):
        others = "[[rigid]] or contact.self_contact = true" if soft else "or another [[rigid]]"
        raise SceneError(f"contact has nothing to act on; add [[obstacles]], {others}")
    if not contact.alarm_distance > contact.contact_distance:
        raise SceneError(
            f"contact.alarm_distance is {contact.alarm_distance:g} m; it must be above contact.contact_distance, "
            f"{contact.contact_distance:g} m"
        )


def lower(contact: Contact, scene: Described, model: Model) -> Model:
    """Give the model the contact, that of a ball too; velocities jump at impacts."""
    return replace(model, contact=contact, jumps=True)


def place(contact: Contact, draft: Draft) -> None:
    """Put bodies where they pass through nothing."""
    from tripod_sim.steps.contact import placed_bodies

    fixed = [body.nodes[body.net.fixed] for body in draft.assembly.bodies if body.net]
    held = np.concatenate(
        [*fixed, *(held.nodes for held in (*draft.fixed, *draft.moved)), np.zeros(0, np.int64)]
    )
    draft.assembly = placed_bodies(draft.assembly, held, draft.model, contact)
    draft.rest = draft.assembly.nodes


def act(contact: Contact, draft: Draft) -> None:
    """At rest, too, the response works on a potential with an anchor, of no weight then."""
    if draft.inertia is None:
        from tripod_sim.forces.anchor import Anchor

        draft.inertia = Anchor(len(draft.rest))


def step(contact: Contact, draft: Draft, system: Any) -> Parts:
    """Let contact make the steps."""
    from tripod_sim.steps.contact import solid_parts

    return solid_parts(draft, system, contact)


CONTACT = "contact"

EFFECT = Effect(
    Contact,
    rank=150,
    found=contact_of,
    rigid=True,
    rest=False,
    check=check,
    lower=lower,
    modules=("contact", "shapes"),
    stages={
        "contact.stepper.ContactStepper": {"_advance": f"{CONTACT}: bookkeeping"},
        "contact.contact_solver.ContactSolver": {
            "step": f"{CONTACT}: bookkeeping",
            "_finish": f"{CONTACT}: end of the step",
        },
        "contact.impact.Impact": {"solve": f"{CONTACT}: impacts"},
        "contact.detection.Detector": {
            "near": f"{CONTACT}: near pairs",
            "met": f"{CONTACT}: continuous detection",
        },
        "contact.response.Response": {"solve": f"{CONTACT}: response"},
        "contact.condensed_contact.CondensedContact": {"solve": f"{CONTACT}: compliance"},
        "contact.problem.StepProblem": {
            "solve": "Newton and line search",
            "_evaluate": f"{CONTACT}: gradient",
            "gradient": "gradient",
            "_assemble": "Hessian assembly",
            "_factor": f"{CONTACT}: Hessian",
            "propose": "back-substitution",
            "solve_bodies": "back-substitution",
            "rows": "back-substitution",
        },
    },
    steps=(CONTACT,),
    words=("contact={self_contact=true}",),
    place=place,
    act=act,
    step=step,
)
