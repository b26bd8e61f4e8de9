"""What steps report."""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.integrators.newton import NewtonReport
    from tripod_sim.integrators.time_error import TimeErrorReport
    from tripod_sim.robot.servo import Stall


@dataclass(frozen=True)
class MeshErrorReport:
    """How far the effector is from where the richer mesh has it.

    Attributes:
        effector: Exact minus computed position of its centre [m]; NaN where the richer mesh has no equilibrium.
        time: Simulated time of the estimate [s].
    """

    effector: tuple[float, float, float]
    time: float

    @property
    def distance(self) -> float:
        """Length of the error [m]."""
        return math.hypot(*self.effector)


WORK = (
    "iterations", "factorisations", "parts", "increments", "halvings", "rejected", "linear_iterations",
)  # fmt: skip
"""What adds up of the reports of steps."""

SUMMED = tuple(name for name in WORK if name != "rejected")
"""What adds up of the substeps of one step, those that were accepted."""


@dataclass
class ContactReport:
    """What contact took in one step, or one substep.

    Attributes:
        contacts: Pairs within the alarm distance, or met.
        pressed: Those that carry a force.
        rounds: Of multipliers.
        residual: Largest error of gap, complementarity or slip at the end [m].
        smallest_gap: Smallest gap at the end beyond the contact distance, negative by how deep bodies sink in [m];
            infinite without contacts.
        force: Sum of the normal forces [N].
        passes: Times that the response was solved.
        met: Pairs that continuous detection added.
        cut: Fraction of the step that was given up to let nothing pass; 0 unless the response failed.
        parts: Parts that the step was divided into.
        restarted: Whether the step was one of implicit Euler although the scheme is another: something hit, or the next
            to last step did not end smoothly.
        lowered: By how much the coefficient of restitution was lowered at most, so that hits gave no energy.
        meets: Share of the last substep after which bodies that move on without forces hit; infinite where they do
            not, and where it was not one of implicit Euler.
        way: To the forces, of the last response: `compliance` (few contacts), `multipliers` on all unknowns, `penalty`.
    """

    contacts: int = 0
    pressed: int = 0
    rounds: int = 0
    residual: float = 0.0
    smallest_gap: float = np.inf
    force: float = 0.0
    passes: int = 0
    met: int = 0
    cut: float = 0.0
    parts: int = 0
    restarted: bool = False
    lowered: float = 0.0
    meets: float = np.inf
    way: str = ""

    def follow(self, before: "ContactReport") -> None:
        """Add the substeps `before` this one; forces are those at the end, the gap is the smallest of all."""
        for name in ("rounds", "passes", "met", "parts"):
            setattr(self, name, getattr(self, name) + getattr(before, name))
        self.cut, self.lowered = max(self.cut, before.cut), max(self.lowered, before.lowered)
        self.smallest_gap = min(self.smallest_gap, before.smallest_gap)
        self.restarted |= before.restarted


@dataclass
class StepReport:
    """What one step took, or several.

    Attributes:
        iterations: Linear solves, over all parts.
        factorisations: Hessians assembled and factored, over all parts.
        parts: Parts that the step was divided into; 1 is the whole.
        rejected: Parts that were taken back because they added too much error (`dt = "auto"`).
        halvings: Times a part, or an increment of a static load, failed and was halved.
        residual: Unbalanced force at the end [N].
        stalled: Servos that stand against their load at the end.
        contact: What contact took; None without it.
        linear_iterations: Of conjugate gradients, over all linear solves.
        increments: Of the load in statics, over all parts (see `load_steps`); 0 where none was needed.
        dt_limit: Longest stable part of an explicit scheme [s]; infinite for the others.
        growth: Energy that came from nothing, by an unstable explicit scheme [J]; zero while there is none.
        grew_at: Step at whose end that was first found, zero for none.
        time_error: Estimated error of the time steps; None where the scene does not ask for it.
        mesh_error: Last estimate of the error of the mesh at the effector; None where the scene does not ask for it.
        asleep: Whether the body is at rest and the next step will not solve for it.
        unstable: Whether a static step ended in an unstable equilibrium: one that a body in motion would leave.
        snapped: Whether the load of a static step moved the body past a limit point, to another branch of equilibria.
    """

    iterations: int = 0
    factorisations: int = 0
    parts: int = 0
    halvings: int = 0
    residual: float = 0.0
    stalled: "tuple[Stall, ...]" = ()
    contact: ContactReport | None = None
    linear_iterations: int = 0
    increments: int = 0
    dt_limit: float = np.inf
    growth: float = 0.0
    grew_at: int = 0
    time_error: "TimeErrorReport | None" = None
    mesh_error: MeshErrorReport | None = None
    rejected: int = 0
    asleep: bool = False
    unstable: bool = False
    snapped: bool = False

    def add(self, part: "StepReport | NewtonReport") -> None:
        """Add what one more substep took; what is no work is that of the last."""
        for name in SUMMED:
            setattr(self, name, getattr(self, name) + getattr(part, name))
        self.residual, self.unstable, self.snapped = (
            part.residual,
            part.unstable,
            self.snapped or part.snapped,
        )
        if not isinstance(part, StepReport):
            return
        self.dt_limit, self.growth, self.grew_at = part.dt_limit, part.growth, part.grew_at
        self.time_error = part.time_error
        if part.contact and self.contact:
            part.contact.follow(self.contact)
        self.contact = part.contact

    def after(self, before: "StepReport") -> "StepReport":
        """Return this report, which a stepper may keep, with the work of the steps before."""
        return replace(self, **{name: getattr(self, name) + getattr(before, name) for name in WORK})

    @property
    def instability(self) -> str:
        """What an unstable explicit scheme does to the energy, empty where it is stable."""
        if not self.grew_at:
            return ""
        return (
            f"unstable: since step {self.grew_at} the energy has grown by {self.growth:.3g} J, more than "
            f"the inputs explain (longest stable step {self.dt_limit:.3g} s); take a smaller dt or an "
            "implicit inertia.scheme"
        )
