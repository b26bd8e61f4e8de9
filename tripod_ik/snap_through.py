"""A limit that keeps the body off a snap.

Towards a limit point, where the equilibrium ends and the body snaps to another one, its stability margin ρ goes to
zero, see `tripod_sim.stability_margin`; ρ² falls there in proportion to the angles. So ρ² is what is limited, linearly,

    ρ² + 2 ρ (dρ/dα) δ ≥ least² + (1 - share) (ρ² - least²),

and each step uses up a share of what is left: a body that is carried there fast would swing beyond.
"""

from dataclasses import dataclass, field
from math import hypot, inf, sqrt

import numpy as np

from tripod_ik.row_limits import LimitRows, RowLimit
from tripod_ik.state import LinearState

SNAP = "snap"
"""Name of the limit."""

LEAST_MARGIN = 0.07
"""Stability margin at which a branch ends, for inverse kinematics."""

WITHIN = 0.9
"""Part of that which a way to a pose as soft may use."""

SOFTENING, HURRY = 0.1, 0.04
"""Times in which commands use up what is left of ρ² - LEAST_MARGIN², but for 1/e [s]: where it is not known how far the
body may go, and on ways that are known to end before a snap.
"""

BEND = 0.03
"""Square of the length of a step, for a distance of 1 rad from the snap [rad]: what the limit's curvature allows."""


BARRIER, SWING = 2.5e-3, 0.3
"""Swing of the effector [m] that may carry a body of stability margin 1 over a snap; and the time in which a swing
that is no longer seen is forgotten, but for 1/e [s].
"""


def firm_enough(swing: float) -> float:
    """Return the stability margin below which a body that swings about its rest by `swing` [m] may snap.

    Towards a limit point the energy between the equilibrium and the unstable one beyond it falls as ρ³, and that of a
    swing is as its square, so what carries a body over is as ρ^(3/2).
    """
    return float((swing / BARRIER) ** (2 / 3))


def longest_step(state: LinearState) -> float:
    """Return how far the limit's tangent is to be trusted [rad]: √(BEND ρ / 2|dρ/dα|)."""
    steep = hypot(*state.stability_margin_slope.tolist())
    return sqrt(BEND * max(state.stability_margin, 1e-3) / (2 * steep)) if steep > 0 else inf


@dataclass(frozen=True, eq=False)
class SnapThroughLimit(RowLimit):
    """The stability margin at rest stays above `least`.

    Attributes:
        least: Smallest ρ.
        share: What a step may use of ρ² - least², 0 to 1.
    """

    least: float = LEAST_MARGIN
    share: float = 1.0
    hard: bool = field(default=True, kw_only=True)

    @property
    def what(self) -> str:
        """What it limits."""
        return SNAP

    def size(self, n: int) -> int:
        """Return 1."""
        return 1

    def needs(self, state: LinearState) -> str:
        """Return the stability margin."""
        return (
            f"a lowest stiffness of {state.stability_margin:.2g} of that of the undeformed body (limit "
            f"{self.least:g})"
        )

    def rows(self, state: LinearState) -> LimitRows:
        """Return 2 ρ dρ/dα δ ≥ share (least² - ρ²); a row of zeros where the slope is not known."""
        rho = state.stability_margin
        left = rho * abs(rho) - self.least * abs(self.least)
        row = 2 * max(abs(rho), 1e-3) * state.stability_margin_slope
        low = -left * self.share if left > 0 else -left
        return LimitRows(row[None, :], np.array([low]), np.array([1e9]), (self.what,))
