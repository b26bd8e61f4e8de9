"""Generalised-alpha [ChungHulbert1993]: second order, with damping of fast modes as chosen.

With rho the spectral radius at infinite frequency, 0 to 1,

    alpha_m = (2 rho - 1) / (rho + 1),   alpha_f = rho / (rho + 1),
    gamma = 1/2 - alpha_m + alpha_f,     beta = (1 - alpha_m + alpha_f)² / 4,

a step advances x, v and an acceleration b of its own, A = M^-1 f at the ends of steps,

    x' = x + h v + h² ((1/2 - beta) b + beta b'),   v' = v + h ((1 - gamma) b + gamma b'),
    (1 - alpha_m) b' + alpha_m b = (1 - alpha_f) A' + alpha_f A.

Constraints and contacts hold at the end of the step, and their forces are part of A there [ArnoldBruls2007]. As a stage
(see `integrators.scheme`) it has s = h beta / gamma and s_f = h gamma (1 - alpha_f) / (1 - alpha_m). b is the
acceleration at the time alpha_m - alpha_f of a step after its end; so that steps of changing length keep the order, a
step of q times the length of that before takes A + q (b - A) in its place.

rho = 1 damps nothing and keeps the energy of linear oscillations, but not of large motions: what contacts, driven
frames and dampers stir then trembles on, and steps of a damped solid may fail. rho = 0 damps most.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

from tripod_sim.integrators.scheme import Curve, Defect, MultistepScheme, Stage, Weights, euler_stage

START = Curve(), Curve(rate=1.0)
"""After a start b is A."""


@dataclass(frozen=True)
class GeneralisedAlpha(MultistepScheme):
    """See the module.

    Attributes:
        rho_inf: rho.
    """

    parameters: ClassVar[tuple[str, ...]] = ("rho_inf",)
    takes_jumps: ClassVar[bool] = False
    rho_inf: float = 0.8

    @property
    def over_difference(self) -> float:
        """See `ImplicitScheme`."""
        return 4 * abs(self.defect(1.0).v)

    def start(self, h: float) -> Stage:
        """See `ImplicitScheme`."""
        return euler_stage(h, START)

    @lru_cache  # noqa: B019 - few objects
    def following(self, h: float, before: float) -> tuple[Stage, ...]:
        """See `MultistepScheme`."""
        rho, q = self.rho_inf, h / before
        am, af = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
        lag = am - af
        gamma, beta = 0.5 - lag, 0.25 * (1 - lag) ** 2
        ratio, keeps = beta / gamma, -(1 - gamma) / gamma
        own = h * (1 - gamma) - h * gamma * am / (1 - am)  # of b in u
        position = Weights(rate=h * (1 - ratio), curve=h * h * (0.5 - ratio))
        velocity = Weights(rate=h * gamma * af / (1 - am) + own * (1 - q), curve=own * q)
        curves = (
            Curve(rate=1 / (h * gamma), before=-1 / (h * gamma), curve=keeps),
            Curve(change=1 / (h * gamma), before=keeps * (1 - q), curve=keeps * q),
        )
        newmark = h**3 * (1 / 24 - gamma * (1 - gamma) / 2)
        averages = h**3 * gamma * (am * (1 - am) - af * (1 - af)) / (2 * (1 - am))
        uneven = lag**2 * h * (before - h) / 2  # of A + q (b - A), times d²a/dt²
        x = h**3 * (1 / 6 - lag / 2 - beta) + h**2 * (0.5 - ratio) * lag * (h - before)
        defect = Defect(1, x, newmark + averages - own * uneven, -newmark / (h * gamma) - keeps * uneven)
        s_force = h * gamma * (1 - af) / (1 - am)
        return (Stage(h, h * ratio, position, velocity, s_force, defect, curves, lag),)


SCHEME = GeneralisedAlpha("generalised_alpha", 2)
