"""The classical Runge-Kutta scheme of fourth order, for reference."""

from dataclasses import dataclass

from tripod_sim.integrators.scheme import ExplicitScheme
from tripod_sim.integrators.stability import RK4


@dataclass(frozen=True)
class RungeKutta4(ExplicitScheme):
    """See the module."""

    def limit(self, omega: float, rate: float) -> float:
        """Return 2.6 / max(w, d) [s]; without damping it is 2.83 / w."""
        return 2.6 / max(omega, rate)


SCHEME = RungeKutta4("rk4", 4, RK4, forces=4)
