"""Tensions that keep springs from being longer than their bound.

The bound l_b is held by multipliers t, the tensions [N]: the term

    B(x) = sum of max(0, t + K (l(x) - l_b))² / 2 K:   springs of rest length l_b - t / K that do not push,

is a part of the potential that a step minimises, and after each minimisation t becomes what it asks for, until it no
longer changes [NocedalWright2006, chapter 17]. Then l <= l_b, with t >= 0 and t = 0 where l < l_b, whatever K is: an
inequality among the constraints of the step, without a stiffness of its own. A spring that reaches its bound stays
there while it is pulled: the velocity along it ends with the step, nothing bounces.
"""

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.forces.spring_force import SpringTangents
from tripod_sim.forces.spring_kernels import add_gradient, lengths, links_of
from tripod_sim.forces.term import StageTerm

MARGIN = 1e-5
"""l_b is that share below the longest length, so that what is left of the error ends below it."""

WRONG = 0.01
"""Error of lengths at which the tensions are found, over s² of the stage: what it does to an acceleration [m/s²]. The
velocity that it gives is in proportion to s, so that steps of any length meet the bound alike."""

STIFF = 1e2
"""K at first, over the heaviest mass and s² of the stage."""


class StrainBound(SpringTangents, StageTerm):
    """The term B, its tensions and how well they are found.

    Attributes:
        elements, matrices: As of other terms.
        links: Springs of stiffness K that are slack up to l_b - t / K.
        longest: Longest length that is allowed [m], shape (m,).
        pulled: Whether there was a tension since somebody last made this False.
    """

    name = "strain_limit"

    def __init__(self, ends: IndexArray, rest_length: FloatArray, stretch: float, mass: FloatArray) -> None:
        """Bound springs.

        Args:
            ends: Nodes of each, shape (m, 2).
            rest_length: [m], shape (m,).
            stretch: Largest elongation, as a share of the rest length.
            mass: Of all nodes [kg], shape (n,).
        """
        count = len(ends)
        self.longest = (1 + stretch) * rest_length
        self._bound = (1 - MARGIN) * self.longest
        self._heaviest = float(mass[ends].max(initial=0.0))
        self._length, self._s, self._raised = np.zeros(count), 0.0, 1.0
        links = links_of(ends, self._bound, np.ones(count), np.zeros(count), True)
        super().__init__(links)
        self.pulled = False

    def aim(self, s: float) -> None:
        """Prepare a stage of `s` [s]; the tensions stay."""
        if s != self._s:
            self._s = s
            self._stiffen()

    def relax(self) -> None:
        """Drop tensions, and make K what it was at first."""
        self._raised = 1.0
        self.slacken()
        self._stiffen()

    def slacken(self) -> None:
        """Drop the tensions."""
        self.links.rest[:] = self._bound

    def harden(self) -> None:
        """Make K ten times larger; the tensions stay."""
        self._raised *= 10.0
        self._stiffen()

    def _stiffen(self) -> None:
        if not (self._s and len(self.longest)):  # before a stage, or where all springs are held
            return
        before, K = self.links.stiffness[0], self._raised * STIFF * self._heaviest / self._s**2
        self.links.rest[:] = self._bound - before / K * (self._bound - self.links.rest)
        self.links.stiffness[:] = K

    @property
    def pulls(self) -> bool:
        """Whether a spring has a tension."""
        return bool((self.links.rest < self._bound).any())

    def exceeded(self, x: FloatArray) -> bool:
        """Return whether a spring is too long at `x` [m], shape (n, 3), by more than the error that is left."""
        lengths(x, self.links, self._length)
        return bool((self._length > self._bound + self._wrong()).any())

    def rounding(self, x: FloatArray) -> tuple[float, float]:
        """Return what rounding of positions `x` [m], shape (n, 3), makes of the gradient [N] and of the term [J]."""
        size, K = 2e-15 * float(np.abs(x).max()), float(self.links.stiffness.max(initial=0.0))
        force, most = size * K, float((K * (self._bound - self.links.rest)).max(initial=0.0))
        count = len(self.longest)
        return force * count**0.5, (force + most) * size * count

    def _wrong(self) -> FloatArray:
        return np.minimum(0.5 * MARGIN * self.longest, np.maximum(WRONG * self._s**2, 1e-13 * self.longest))

    def worst(self, x: FloatArray) -> tuple[int, int]:
        """Return the nodes of the spring that is longest over its bound at `x` [m], shape (n, 3)."""
        lengths(x, self.links, self._length)
        i, j = self.elements[np.argmax(self._length / self.longest)].tolist()
        return i, j

    def settle(self, x: FloatArray) -> float:
        """Set the tensions to those that `x` asks for; return the error of the lengths: 1 is small enough."""
        rest = self.links.rest
        lengths(x, self.links, self._length)
        asked = self._bound - np.maximum(0.0, self._length - rest)
        off = np.abs(asked - rest) / self._wrong()
        rest[:] = asked
        self.pulled = self.pulled or self.pulls
        return float(off.max(initial=0.0))

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dB/dx [N] to `g`, shape (n, 3), and return B [J]."""
        return float(add_gradient(x, self.links, 0.0, self._none, g))

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Write `matrices`, with `project` positive semi-definite."""
        self.write(x, 0.0, self._none, project=project)
