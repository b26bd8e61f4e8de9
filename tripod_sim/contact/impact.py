"""Impacts: restitution with friction, one problem of impulses on the masses after a step in which something is hit.

A step stops what hits, as without restitution, and its normal and friction forces give impulses to do so. The impulse
problem of `impact_kernels` then changes these impulses and the velocities. So friction is bounded by the whole normal
impulse: that which stops and that which throws back. What rests beside a hit takes part, so that impulses go through.

Rigid bodies under penalty need the problem without restitution, too: springs let them sink in, throw them out again,
and give friction too late for a hit. The problem leaves the moves as they are and corrects the velocities.

Newton's law of restitution with Coulomb friction can give energy to an oblique hit [KaneLevinson1985]. Where the
impulses would do work, the coefficient of restitution is lowered for the hits of this step until they do none.
"""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.contact import impact_kernels as kernels
from tripod_sim.contact.bodies import Body
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.contact.response import Law


class Impact:
    """Solves the impact problem of the bodies.

    Attributes:
        lowered: By how much the last problem lowered the coefficient of restitution.
        residual: Change of a relative velocity in its last round [m/s].
    """

    ROUNDS, EXACT = 500, 1e-10
    """Of Gauss-Seidel at most; change of a relative velocity at which they end, as a share of the fastest."""

    NOTHING, BISECTIONS = 1e-9, 20
    """Work that counts as none, as a share of the impulses of the step times the fastest speed; bisections for e."""

    def __init__(
        self, law: Law, contacts: ContactSet, bodies: list[Body], slices: list[slice], soft: int
    ) -> None:
        """`slices`: the unknowns of each body; `soft`: how many of all are those of deformable ones, the first."""
        self._law, self._contacts, self._bodies, self._slices, self._soft = (
            law,
            contacts,
            bodies,
            slices,
            soft,
        )
        self._before, self._after = np.zeros((2, slices[-1].stop))
        self._speed, self._among, self._given = np.zeros(0), np.zeros(0, dtype=bool), np.zeros((0, 3))
        self._work = self._fastest = self.lowered = self.residual = 0.0

    @property
    def wanted(self) -> bool:
        """Whether steps may end in impacts."""
        stiff = len(self._after) > self._soft
        return self._law.restitution > 0.0 or (stiff and self._law.response == "penalty")

    def warm_up(self) -> None:
        """Compile what is needed only when something hits."""
        if self.wanted:
            self._speeds()
            self._keep(1.0)
            self._solve(np.zeros((len(self._after) // 3, 3, 3)), self._after)

    def begins(self, u: FloatArray, s: float, noise: float) -> bool:
        """Return whether a step of implicit Euler ends in an impact.

        Args:
            u: Moves of the unknowns, which the bodies have not made yet, shape (unknowns,).
            s: Length of the step [s].
            noise: Speed up to which penalty may push out what has sunk in [m/s].
        """
        if not (self.wanted and self._contacts.count):
            return False
        for body, part in zip(self._bodies, self._slices, strict=True):
            body.free_rate(self._before[part])
            body.rate_at_end(u[part], self._after[part])
        meets, parts = self._speeds()
        hit = meets > 0.0 and meets >= self._law.rest_speed
        if not (hit or (self._law.response == "penalty" and parts > noise)):
            return False
        self._fastest = max(meets, parts)
        self._keep(s)
        return True

    def solve(self) -> None:
        """Give the bodies, which have made their moves, the velocities after the impact.

        The contacts are those of the step, with their arms and gaps at its end.
        """
        v = np.empty_like(self._after)
        for body, part in zip(self._bodies, self._slices, strict=True):
            body.rate_at_start(v[part])
        change = self._solve(inverse_masses(self._bodies, self._slices), v)
        for body, part in zip(self._bodies, self._slices, strict=True):
            body.add_velocity(change[part])

    def _speeds(self) -> tuple[float, float]:
        """Return how fast pressed contacts approach before the step, and stiff ones part before or after it [m/s]."""
        c, count = self._contacts.arrays, self._contacts.count
        base, self._speed = c.base[:count], np.empty(count)
        stiff = ((base < 0) | (base >= self._soft)).all(axis=1)
        self._among = stiff | (self._law.restitution > 0.0)
        _, after = kernels.normal_speeds(c, count, stiff, self._after, self._speed)
        _, before = kernels.normal_speeds(c, count, stiff, self._before, self._speed)
        meets, _ = kernels.normal_speeds(c, count, self._among, self._before, self._speed)
        return -meets, max(before, after)

    def _keep(self, s: float) -> None:
        """Keep the impulses of a step of `s` [s] and their work."""
        c, count = self._contacts.arrays, self._contacts.count
        self._given = np.empty((count, 3))
        kernels.step_impulses(c, count, s, self._given)
        self._work = float(kernels.work(c, count, self._given, self._before, self._after))

    def _solve(self, inverse: FloatArray, v: FloatArray) -> FloatArray:
        """Return by how much an impact changes the velocities `v` of bodies with the inverse masses `inverse`."""
        c, count, law = self._contacts.arrays, self._contacts.count, self._law
        W = np.empty((count, 3, 3))
        kernels.inverse_masses(c, count, inverse, W)
        n = c.normal[:count]
        touches = (c.pressure[:count] > 0.0) | (c.gap[:count] <= law.tolerance * law.distance)
        active = self._among & touches & (np.einsum("ki,kij,kj->k", n, W, n) > 0.0)
        hit = np.where(self._speed <= -law.rest_speed, -self._speed, 0.0)
        after, impulses = np.empty_like(v), np.empty_like(self._given)

        def work(e: float) -> float:
            """Solve with the coefficient `e` and return the work of all impulses [J]."""
            after[:], impulses[:] = v, self._given
            self.residual = kernels.solve_impact(
                c, count, active, W, inverse, e * hit, law.friction, self.ROUNDS, self.EXACT * self._fastest, after,
                impulses,
            )  # fmt: skip
            return self._work + float(kernels.work(c, count, impulses - self._given, v, after))

        none = self.NOTHING * float(np.abs(self._given).sum()) * self._fastest
        low, high = law.restitution, 0.0
        if work(low) > none and low > 0.0:
            low, high = 0.0, low
            for _ in range(self.BISECTIONS):
                middle = 0.5 * (low + high)
                low, high = (low, middle) if work(middle) > none else (middle, high)
            work(low)
        self.lowered = law.restitution - low
        return after - v


def inverse_masses(bodies: list[Body], slices: list[slice]) -> FloatArray:
    """Return the inverse masses of bodies in their present pose, shape (unknowns / 3, 3, 3); see `Body`."""
    out = np.zeros((slices[-1].stop // 3, 3, 3))
    for body, part in zip(bodies, slices, strict=True):
        body.inverse_mass(out[part.start // 3 : part.stop // 3])
    return out
