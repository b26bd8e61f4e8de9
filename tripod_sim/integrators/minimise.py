"""Newton's method with line search: the one way down a potential.

Every step goes down. A step with the Hessian at hand, perhaps of an earlier point or stage, is taken whole while such
steps converge; else the Hessian is renewed, positive definite, and the step ends about where the potential is least
along it [NocedalWright2006, chapter 3].
"""

from abc import ABC, abstractmethod

import numpy as np

from tripod_host.arrays import FloatArray

LOWERS, LEVEL, ENOUGH, NOTHING = 1e-4, 0.3, 0.1, 1e-4
"""Shares: of the fall that the slope foretells, what a step has to make; of the slope at its start, what may be left at
its end; of the unbalanced force, what a step may leave that need not lower the potential; of the rounding of the
potential, a fall along a step that is nothing: slopes are rounding, too."""

CLOSER, TRIES = 5, 20
"""Shares of a step that are tried for a level end, and for any that is lower."""


class Descent(ABC):
    """A potential Phi, the point that goes down in it, and a trial point; steps p are subtracted: x - c p.

    Attributes:
        phi: Phi at the point [J].
    """

    phi: float

    @abstractmethod
    def ends(self) -> bool:
        """Return whether the point is near enough to the minimum. Raises where that is not to be hoped for."""

    @abstractmethod
    def holds(self) -> bool:
        """Return whether there is a factorisation at hand that is worth a step."""

    @abstractmethod
    def factor(self) -> None:
        """Factor the Hessian at the point, positive definite, and write Phi and gradient there; raises if it cannot."""

    @abstractmethod
    def propose(self) -> FloatArray:
        """Return p = H^-1 g with the factorisation at hand, shape (unknowns,), an array of the caller's own."""

    @abstractmethod
    def walk(self, p: FloatArray, share: float) -> float:
        """Put the trial point at x - share p; return Phi there, infinite where there is none."""

    @abstractmethod
    def slope(self, p: FloatArray, *, trial: bool) -> float:
        """Return g . p [J], g the gradient at the point or at the trial point."""

    @abstractmethod
    def left(self) -> float:
        """Return the unbalanced force at the trial point over that at the point."""

    @abstractmethod
    def converges(self) -> bool:
        """Return whether whole steps with the factorisation at hand are worth going on: one led to the trial point."""

    @abstractmethod
    def slack(self) -> float:
        """Return the rounding of Phi [J]."""

    @abstractmethod
    def take(self, phi: float, share: float) -> None:
        """Let the trial point be the point: `share` of a step led there, Phi is `phi` there [J]."""

    @abstractmethod
    def rests(self, *, fresh: bool) -> bool:
        """Return whether rounding alone keeps the point from the minimum.

        `fresh`: whether a step with the Hessian of the point has failed; then this raises where it is not so.
        """


def minimise(descent: Descent) -> None:
    """Move the point of `descent` to the minimum, as near as it asks for. Raises what it raises."""
    while not descent.ends():
        if descent.holds():
            phi = descent.walk(descent.propose(), 1.0)
            if np.isfinite(phi) and descent.converges() and phi <= descent.phi + descent.slack():
                descent.take(phi, 1.0)
                continue
        if descent.rests(fresh=False):
            return
        descent.factor()
        share, phi = search(descent, descent.propose())
        if share:
            descent.take(phi, share)
        elif descent.rests(fresh=True):
            return


def search(descent: Descent, p: FloatArray) -> tuple[float, float]:
    """Put the trial point about where Phi is least along -p.

    Where the whole step goes too far, the slopes on both sides of the minimum tell where it is, for between them the
    potential is nearly a parabola, or two.

    Returns:
        The share of p, 0 where none is lower, and the potential there.
    """
    slope, slack = descent.slope(p, trial=False), descent.slack()
    share, low, high, falls = 1.0, 0.0, 1.0, slope
    for tries in range(TRIES):
        phi = descent.walk(p, share)
        finite = bool(np.isfinite(phi))
        there = descent.slope(p, trial=True) if finite else -np.inf
        lowers = phi <= descent.phi - LOWERS * share * slope + slack
        level = abs(there) <= LEVEL * slope or slope <= NOTHING * slack or not tries
        if (lowers and (level or tries >= CLOSER)) or (finite and descent.left() < ENOUGH):
            return share, phi
        if lowers and there > 0.0:
            low, falls = share, there
        else:
            high, rises = share, -there
        part = falls / (falls + rises) if 0.0 < rises < np.inf else 0.3
        share = low + (high - low) * min(max(part, 0.1), 0.9)
    return 0.0, descent.phi
