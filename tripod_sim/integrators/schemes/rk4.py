"""The classical Runge-Kutta scheme of fourth order, for reference."""

from dataclasses import dataclass

from tripod_sim.integrators.scheme import ExplicitScheme


@dataclass(frozen=True)
class RungeKutta4(ExplicitScheme):
    """See the module."""

    def limit(self, omega: float, rate: float) -> float:
        """Return 2.6 / max(w, d) [s]; without damping it is 2.83 / w."""
        return 2.6 / max(omega, rate)


SCHEME = RungeKutta4("rk4", 4, weights=(1.0, 2.0, 2.0, 1.0), reach=(0.5, 0.5, 1.0))
