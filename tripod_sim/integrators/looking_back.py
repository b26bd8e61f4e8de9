"""The implicit schemes as stages that look back on one stage at most.

Let the stage before have changed x and v by dx and dv, and v have ended at the rate a. A stage leads from x, v to

    x' = z + s v',                z = x + c dx + r v,
    v' = u + s M^-1 f(x', v'),    u = v + c dv + r a,

so that x' minimises |x' - z - s u|²_M / (2 s²) and the other potentials (see `stage`). With h the length of a step and
q = h / h_before

    implicit Euler   s = h,                       c = r = 0                      first order
    BDF2             s = (1 + q) / (1 + 2 q) h,   c = q² / (1 + 2 q),  r = 0     second order, looks back on a step
    TR-BDF2          s = g h / 2,                 c = 0,               r = s     over g h, the trapezoidal rule, then
                     s = g h / 2,                 c = (1 - g)² / (g (2 - g))     over the rest; g = 2 - sqrt 2

[HairerWanner1996, chapter V], [BankEtAl1985]. All of them damp: implicit Euler takes about w² h² / 2 of the amplitude
of a mode of angular frequency w a step, BDF2 about w⁴ h⁴ / 4, TR-BDF2 what it cannot resolve. The rate a includes the
forces of constraints, so nodes of rigid bodies need no rule of their own.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit

G = float(2 - np.sqrt(2))
"""Share of a step of TR-BDF2 that its first stage takes; both have the same s, so that they share a factorisation."""


@dataclass(frozen=True)
class Stage:
    """One stage of an implicit scheme.

    Attributes:
        length: Time that it takes [s].
        s: [s].
        back: c.
        lead: r [s].
    """

    length: float
    s: float
    back: float = 0.0
    lead: float = 0.0

    @property
    def begins(self) -> bool:
        """Whether it looks back on nothing."""
        return self.back == 0.0 and self.lead == 0.0


@lru_cache
def implicit_euler(h: float) -> Stage:
    """Return the one stage of a step of `h` [s]."""
    return Stage(h, h)


@lru_cache
def stages(scheme: str, h: float, before: float) -> tuple[Stage, ...]:
    """Return the stages of a step of `h` [s] of a second-order scheme, after one of `before` [s]."""
    if scheme == "tr_bdf2":
        s = 0.5 * G * h
        return Stage(G * h, s, 0.0, s), Stage((1 - G) * h, s, (1 - G) ** 2 / (G * (2 - G)))
    q = h / before
    return (Stage(h, h * (1 + q) / (1 + 2 * q), q * q / (1 + 2 * q)),)


class Memory:
    """What the next stage may look back on, of one quantity.

    Attributes:
        change: What the last stage changed it by.
        rate: With which it ended.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.change, self.rate = np.zeros(shape), np.zeros(shape)

    def known(self, now: Any, stage: Stage, out: Any) -> None:
        """Write now + c change + r rate to `out`."""
        _known(now, self.change, stage.back, self.rate, stage.lead, out)

    def note(self, before: Any, known: Any, after: Any, stage: Stage) -> None:
        """Remember a stage that began at `before` and, with what it knew, led to `after`."""
        _note(before, known, after, stage.s, self.change, self.rate)


@njit(cache=True, error_model="numpy")
def _known(now: Any, change: Any, back: float, rate: Any, lead: float, out: Any) -> None:
    """Write now + back change + lead rate, contiguous arrays of any one shape."""
    x, dx, a, z = now.ravel(), change.ravel(), rate.ravel(), out.ravel()
    for k in range(x.shape[0]):
        z[k] = x[k] + back * dx[k] + lead * a[k]


@njit(cache=True, error_model="numpy")
def _note(before: Any, known: Any, after: Any, s: float, change: Any, rate: Any) -> None:
    """Write after - before and (after - known) / s, contiguous arrays of any one shape."""
    x, z, end, dx, a = before.ravel(), known.ravel(), after.ravel(), change.ravel(), rate.ravel()
    for k in range(x.shape[0]):
        dx[k], a[k] = end[k] - x[k], (end[k] - z[k]) / s
