"""Semi-implicit Euler: v' = v + h a, x' = x + h v'. First order; keeps the energy of long motions."""

from dataclasses import dataclass

import numpy as np

from tripod_sim.integrators.scheme import ExplicitScheme


@dataclass(frozen=True)
class SemiImplicitEuler(ExplicitScheme):
    """See the module."""

    def limit(self, omega: float, rate: float) -> float:
        """Return (sqrt(d² + 4 w²) - d) / w² [s]: 2 / w without damping."""
        return float(4.0 / (np.sqrt(rate**2 + 4 * omega**2) + rate))


SCHEME = SemiImplicitEuler("semi_implicit_euler", 1, swaps=True)
