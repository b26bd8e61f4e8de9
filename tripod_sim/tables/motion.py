"""Tables of what moves a body: gravity, inertia, damping, the limit of strains, contact."""

from dataclasses import dataclass

from tripod_sim.tables.fields import number, one_of


@dataclass(frozen=True)
class Gravity:
    """Weight.

    Attributes:
        acceleration: [m/s²], three components in world.
    """

    acceleration: tuple[float, float, float] = number((0.0, 0.0, -9.81), unit="m/s²", low=-1e6, high=1e6)


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


@dataclass(frozen=True)
class Damping:
    """Rayleigh damping: the force -(a M + b K) v, K the tangent of the moment (b K v is the rate of elastic forces).

    Attributes:
        mass: a [1/s].
        stiffness: b [s].
    """

    mass: float = number(0.0, unit="1/s", low=0, high=1e6)
    stiffness: float = number(5e-4, unit="s", low=0, high=1e3)


@dataclass(frozen=True)
class StrainLimit:
    """Springs that cannot be stretched beyond a bound. Needs springs and inertia.

    Attributes:
        stretch: Largest elongation of a spring, as a share of its rest length.
    """

    stretch: float = number(0.1, low=1e-4, high=10.0)


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
        restitution: Normal speed after an impact over that before it.
        rest_speed: Impacts below it do not bounce [m/s].
        self_contact: Whether the soft body touches itself.
        start: Where bodies pass through each other or through an obstacle at the start: `refuse` names them, `lift`
            moves them against gravity until they do not.
        tolerance: Error of gaps and slips at which a step counts as solved, as a fraction of the contact distance.
            Where an accuracy A is asked for it is that of A = 0.01, else (A / 0.01)^1.5 times that, at most 0.03.
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


@dataclass(frozen=True)
class Sleep:
    """Bodies at rest are not solved for until something changes. Needs inertia.

    Attributes:
        speed: Root mean square speed of a body below which it can be at rest [m/s].
        time: For twice this long it must have been slow, have gone nowhere and not have fallen [s].
    """

    speed: float = number(0.003, unit="m/s", above=0, high=10.0)
    time: float = number(0.25, unit="s", above=0, high=1e3)
