"""Table of contact."""

from dataclasses import dataclass

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
