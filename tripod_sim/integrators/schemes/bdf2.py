"""BDF2: with q = h / h_before, s = (1 + q) / (1 + 2 q) h and c = q² / (1 + 2 q) [HairerWanner1996, chapter V].

Second order; uses the step before; takes about w⁴ h⁴ / 4 of the amplitude of a mode of angular frequency w a step. Its
defect is -(1 + q) / (6 a_0 q) h³ (j, dj/dt), a_0 = (1 + 2 q) / (1 + q) [HairerNorsettWanner1993, chapter III.2].
"""

from dataclasses import dataclass
from functools import lru_cache

from tripod_sim.integrators.scheme import Defect, MultistepScheme, Stage, Weights


@dataclass(frozen=True)
class BDF2(MultistepScheme):
    """See the module."""

    @lru_cache  # noqa: B019 - one object
    def following(self, h: float, before: float) -> tuple[Stage, ...]:
        """See `MultistepScheme`."""
        q = h / before
        factor = -(h**3) * (1 + q) / (6 * ((1 + 2 * q) / (1 + q)) * q)
        weights = Weights(change=q * q / (1 + 2 * q))
        return (Stage(h, h * (1 + q) / (1 + 2 * q), weights, weights, defect=Defect(1, factor, factor)),)


SCHEME = BDF2("bdf2", 2)
