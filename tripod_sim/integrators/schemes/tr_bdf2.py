"""TR-BDF2: with g = 2 - sqrt 2 the trapezoidal rule over g h, then BDF2 over the rest [BankEtAl1985].

Both stages have s = g h / 2, so that they share a factorisation; the first has r = s, the second
c = (1 - g)² / (g (2 - g)). Second order; of one step, but for the acceleration at its start, which includes the forces
of constraints and so is that at the end of the step before; damps what it cannot resolve. The defects of its stages are
-(g h)³ / 12 (j, dj/dt) and -(1 - g)² / (6 (2 - g)) h³ (j, dj/dt).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from tripod_sim.integrators.scheme import Defect, MultistepScheme, Stage, Weights

G = float(2 - np.sqrt(2))
"""Share of a step that the first stage takes."""


@dataclass(frozen=True)
class TRBDF2(MultistepScheme):
    """See the module."""

    @property
    def over_difference(self) -> float:
        """See `ImplicitScheme`."""
        return 4 * abs(self.defect(1.0).v)

    @lru_cache  # noqa: B019 - one object
    def following(self, h: float, before: float) -> tuple[Stage, ...]:
        """See `MultistepScheme`."""
        s = 0.5 * G * h
        one, two = -((G * h) ** 3) / 12, -((1 - G) ** 2) / (6 * (2 - G)) * h**3
        lead, back = Weights(rate=s), Weights(change=(1 - G) ** 2 / (G * (2 - G)))
        return (
            Stage(G * h, s, lead, lead, defect=Defect(1, one, one)),
            Stage((1 - G) * h, s, back, back, defect=Defect(1, two, two)),
        )


SCHEME = TRBDF2("tr_bdf2", 2)
