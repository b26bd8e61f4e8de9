"""Explicit Euler: x' = x + h v, v' = v + h a. First order; unstable at every step without damping; for teaching."""

from dataclasses import dataclass

from tripod_sim.integrators.scheme import ExplicitScheme
from tripod_sim.integrators.schemes import semi_implicit_euler


@dataclass(frozen=True)
class ExplicitEuler(ExplicitScheme):
    """See the module."""

    def limit(self, omega: float, rate: float) -> float:
        """Return d / w² [s], or 2 / d if that is less; 0 without damping: it is never stable then."""
        return min(rate / omega**2, 2.0 / rate) if rate > 0.0 else 0.0

    def divisor(self, omega: float, rate: float) -> float:
        """Return the limit [s] of the semi-implicit scheme if that is longer: it grows all the same, as is shown."""
        other = semi_implicit_euler.SCHEME.longest_step(omega, rate)
        return max(self.longest_step(omega, rate), other)


SCHEME = ExplicitEuler("explicit_euler", 1)
