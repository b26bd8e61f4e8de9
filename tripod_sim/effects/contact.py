"""Effect: nothing passes through anything."""

from dataclasses import dataclass
from typing import Any, cast

from tripod_sim.effect import Described, Draft, Effect, Parts
from tripod_sim.errors import SceneError
from tripod_sim.integrators.schemes import IMPLICIT
from tripod_sim.scene_short import rigids_of, soft_bodies
from tripod_sim.tables.fields import number, one_of


@dataclass(frozen=True)
class Contact:
    """Bodies do not pass through obstacles and each other, nor through themselves if asked, in motion by implicit
    schemes and in statics.

    Attributes:
        response: `lagrange`: multipliers, which hold the contact distance and Coulomb's law; `penalty`: springs, faster
            and soft, which let bodies sink in by a part of the contact distance.
        contact_distance: At which surfaces are held [m].
        alarm_distance: Below which contacts are made [m]; larger.
        friction: Coulomb's coefficient.
        restitution: Normal speed after an impact over that before it; less for impacts that would gain energy.
        rest_speed: Impacts below it do not bounce [m/s].
        self_contact: Whether the soft body touches itself.
        start: Where bodies pass through each other or through an obstacle at the start: `refuse` names them, `lift`
            moves them against gravity until they do not.
        tolerance: Error of gaps and slips at which a step counts as solved, as a fraction of the contact distance.
            Where an accuracy A is asked for it is that of A = 0.02, else (A / 0.02)² times that, at most 0.03.
        max_solves: Linear solves of a step after which its error, which the report tells, is let be.
    """

    response: str = one_of("lagrange", "penalty", default="lagrange")
    contact_distance: float = number(0.002, unit="m", above=0, high=1.0)
    alarm_distance: float = number(0.005, unit="m", above=0, high=10.0)
    friction: float = number(0.3, low=0, high=10.0)
    restitution: float = number(0.0, low=0, high=1.0)
    rest_speed: float = number(0.05, unit="m/s", low=0, high=100.0)
    self_contact: bool = False
    start: str = one_of("refuse", "lift", default="refuse")
    tolerance: float = number(1e-3, low=1e-9, high=0.1)
    max_solves: int = number(30, low=1, high=10_000)


NEAR, ALARM = 1 / 16, 3 / 16
"""Contact and alarm distance of a ball in a scene without [contact], in its radii."""


def contact_of(scene: Described) -> Contact | None:
    """Return the contact of a scene: its table, or what a ball outside of a maze brings along."""
    ball, own = scene.ball, scene.contact
    if own or not ball or scene.maze:
        return cast("Contact | None", own)
    return Contact(
        contact_distance=NEAR * ball.radius, alarm_distance=ALARM * ball.radius, friction=ball.friction,
        restitution=ball.restitution, rest_speed=ball.rest_speed,
    )  # fmt: skip


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


def place(contact: Contact, draft: Draft) -> None:
    """Put bodies where they pass through nothing."""
    from tripod_sim.contact.solid_build import placed_bodies

    draft.assembly = placed_bodies(draft.assembly, draft.sets, draft.scene, contact)
    draft.rest = draft.assembly.nodes


def act(contact: Contact, draft: Draft) -> None:
    """At rest, too, the response works on a potential with an anchor, of no weight then."""
    if draft.inertia is None:
        from tripod_sim.forces.anchor import Anchor

        draft.inertia = Anchor(len(draft.rest))


def step(contact: Contact, draft: Draft, system: Any) -> Parts:
    """Let contact make the steps."""
    from tripod_sim.contact.solid_build import solid_parts

    return solid_parts(draft, system, contact)


CONTACT = "contact"

EFFECT = Effect(
    Contact,
    rank=150,
    found=contact_of,
    rigid=True,
    rest=False,
    check=check,
    modules=("contact", "shapes"),
    stages={
        "contact.stepper.ContactStepper": {"step": f"{CONTACT}: bookkeeping"},
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
