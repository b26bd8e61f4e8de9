"""The implicit schemes as stages that look back on one stage at most.

Let the stage before have changed x and v by dx and dv, and v have ended at the rate a. A stage leads from x, v to

    x' = z + s v',                z = x + c dx + r v,
    v' = u + s M^-1 f(x', v'),    u = v + c dv + r a,

so that x' minimises |x' - z - s u|²_M / (2 s²) and the other potentials (see `stage`). Implicit Euler looks back on
nothing; BDF2 has one stage a step, which looks back on that of the step before (see `backward`); TR-BDF2 has two, the
first with the rates at its start, the second looking back on the first (see `tr_bdf2`).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tripod_sim.integrators.tr_bdf2 import HALF, G, Q


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


def implicit_euler(h: float) -> Stage:
    """Return the one stage of a step of `h` [s]."""
    return Stage(h, h)


def stages(scheme: str, h: float, before: float) -> tuple[Stage, ...]:
    """Return the stages of a step of `h` [s] of a second-order scheme, after one of `before` [s]."""
    if scheme == "tr_bdf2":
        return Stage(G * h, HALF * h, 0.0, HALF * h), Stage((1 - G) * h, HALF * h, Q)
    r = h / before
    return (Stage(h, h * (1 + r) / (1 + 2 * r), r * r / (1 + 2 * r)),)


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
        out[:] = now
        if stage.back:
            out += stage.back * self.change
        if stage.lead:
            out += stage.lead * self.rate

    def note(self, before: Any, known: Any, after: Any, stage: Stage) -> None:
        """Remember a stage that began at `before` and, with what it knew, led to `after`."""
        np.subtract(after, before, out=self.change)
        np.subtract(after, known, out=self.rate)
        self.rate /= stage.s
