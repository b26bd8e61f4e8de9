"""Response: forces that keep bodies apart, by penalty or by multipliers, with Coulomb friction.

Multipliers are found by the augmented Lagrangian method: minimise the step's potential with the multipliers fixed,
then set them to the forces that the minimum asks for [AlartCurnier1991], [NocedalWright2006, chapter 17]. The bound of
friction is that of the round before. Every minimisation costs a few sparse factorisations in the bodies' own pattern,
so the time grows with the bodies and the contacts, not with the square of the contacts. Multipliers of the step before
are where the next begins: at rest one round is enough.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.contact import response_kernels as kernels
from tripod_sim.contact.condensed_contact import CondensedContact
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.contact.problem import StepProblem

if TYPE_CHECKING:  # only with soft bodies
    from tripod_sim.contact.solid_nodes import SolidNodes


@dataclass(frozen=True)
class Law:
    """What contacts do.

    Attributes:
        response: `penalty` or `lagrange`.
        friction: Coulomb's coefficient.
        restitution: Normal speed after a hit over that before it.
        rest_speed: Hits below it do not bounce [m/s].
        distance: Contact distance [m].
        tolerance: Of gaps and slips, as a fraction of the contact distance.
        max_solves: Linear solves of a step by multipliers.
    """

    response: str = "lagrange"
    friction: float = 0.3
    restitution: float = 0.0
    rest_speed: float = 0.05
    distance: float = 1e-3
    tolerance: float = 1e-3
    max_solves: int = 30


@dataclass
class Outcome:
    """How a response ended.

    Attributes:
        rounds: Of multipliers.
        residual: Largest error of a gap, of complementarity or of a slip [m].
        smallest: Smallest gap beyond the contact distance [m].
        done: Whether more solves are of no use: the tolerance is met, or as many made as are allowed.
        solved: Whether the tolerance is met.
        way: See `ContactReport`.
    """

    rounds: int = 0
    done: bool = True
    solved: bool = True
    residual: float = 0.0
    smallest: float = np.inf
    way: str = "multipliers"


class Response:
    """Solves steps with one set of contacts."""

    NORMAL, TANGENTIAL = 5.0, 5.0
    """Stiffness of contacts with multipliers over that of the bodies at the contact: the error falls by about this
    factor a round."""

    SOFT, SOFT_TANGENTIAL = 1.0, 1.0
    """The same by penalty."""

    DEEPEST = 0.5
    """Share of the contact distance that penalty lets bodies sink in before it stiffens."""

    ROUGH, ROUNDS = 12, 40
    """Linear solves of a rough response; minimisations of one by penalty."""

    FEW, FIRST = 8, 0.05
    """Linear solves of one minimisation; error of the multipliers that a step begins with, in contact distances."""

    SLOW, STIFFER = 0.8, 8.0
    """Share of the error that a slow round leaves, at least, and by how much it makes contacts stiffer along their
    normals: what presses many at once gives more than each of them alone."""

    THOROUGH = 4
    """How many times more solves a body takes whose strains are bounded, as stiffly as that is done."""

    def __init__(
        self,
        law: Law,
        problem: StepProblem,
        contacts: ContactSet,
        bounded: "SolidNodes | None" = None,
        *,
        apart: bool = False,
    ) -> None:
        """`bounded`: the first body of `problem`, if its strains are bounded; `apart`: whether more than one moves."""
        self.law, self._problem, self._contacts, self._bounded = law, problem, contacts, bounded
        self._times = self.THOROUGH if bounded else 1
        self._pressure, self._friction = np.zeros(256), np.zeros((256, 3))
        few = apart and law.response == "lagrange" and problem.lasting
        self._condensed = CondensedContact(problem, contacts) if few else None

    def warm_up(self) -> None:
        """Compile what is needed only when something touches, so that the first hit is no slower than others."""
        c, u = self._contacts.arrays, np.zeros(self._problem.unknowns)
        kernels.set_stiffness(c, 0, u, 1.0, 1.0)
        kernels.set_limits(c, 0, 0.0)
        kernels.forces(c, 0, u, 0.0, self._pressure, self._friction)
        self._problem.warm_up()
        if self._condensed:
            self._condensed.warm_up()

    def solve(self, u: FloatArray, *, rough: bool = False) -> Outcome:
        """Move `u` to the end of the step; the contacts hold the forces afterwards. Raises DescentError.

        Args:
            u: Shape (unknowns,), in place.
            rough: Whether multipliers may be as far off as they are where a step begins, and few solves are made.
        """
        c, law = self._contacts, self.law
        if len(self._pressure) < c.count:
            self._pressure, self._friction = np.zeros(2 * c.count), np.zeros((2 * c.count, 3))
        if law.response == "penalty":
            return self._penalty(u)
        c.arrays.gain[: c.count] = 1.0
        if self._condensed and (outcome := self._solve_condensed(u)):
            return outcome
        self._problem.prepare(u)
        kernels.set_stiffness(c.arrays, c.count, self._problem.give, self.NORMAL, self.TANGENTIAL)
        outcome, aim = Outcome(), law.tolerance * law.distance
        error = self.FIRST * law.distance if c.count else 0.0
        enough, most = (max(aim, error), min(self.ROUGH, law.max_solves)) if rough else (aim, law.max_solves)
        spent, most, few = 0, self._times * most, self._times * self.FEW
        while True:
            kernels.set_limits(c.arrays, c.count, law.friction)
            # no more exact than the multipliers are: Newton's last steps are wasted on a wrong potential
            tolerance = 0.1 * max(aim, error)
            before = self._problem.effort.iterations
            size = self._problem.solve(u, tolerance, few)
            spent += self._problem.effort.iterations - before
            gap, slip, outcome.smallest = self._forces(u)
            outcome.rounds += 1
            last, error = error, max(gap, slip, self._settle(u, aim))
            outcome.residual = max(error, size)
            self._take()
            exact = size <= 0.1 * max(aim, error)
            if (exact and error <= enough) or spent >= most:
                outcome.solved = exact and error <= aim
                outcome.done = outcome.solved or not rough
                return outcome
            if outcome.rounds > 1 and size <= tolerance and gap == error > self.SLOW * last:
                c.arrays.stiffness[: c.count, 0] *= self.STIFFER
                self._problem.renew()

    def _solve_condensed(self, u: FloatArray) -> Outcome | None:
        """Solve by the compliance of the bodies, if it leads to the end, else return None and leave `u`."""
        c, aim = self._contacts, self.law.tolerance * self.law.distance
        assert self._condensed
        start, count = u.copy(), c.count
        pressure, friction = c.arrays.pressure[:count].copy(), c.arrays.friction[:count].copy()
        error = self._condensed.solve(u, self.law.friction, aim)
        if error <= aim:
            return Outcome(
                rounds=self._condensed.rounds,
                residual=error,
                smallest=self._condensed.smallest(u),
                way="compliance",
            )
        self._problem.serves = False
        u[:] = start
        c.arrays.pressure[:count], c.arrays.friction[:count] = pressure, friction
        return None

    def _penalty(self, u: FloatArray) -> Outcome:
        """The same without multipliers of pressure; friction is that of springs that slide where Coulomb's law says."""
        c, law = self._contacts, self.law
        self._problem.prepare(u)
        kernels.set_stiffness(c.arrays, c.count, self._problem.give, self.SOFT, self.SOFT_TANGENTIAL)
        outcome, tolerance = Outcome(way="penalty"), 0.1 * law.tolerance * law.distance
        pressure = c.arrays.pressure
        limit = c.arrays.limit
        kernels.set_limits(c.arrays, c.count, law.friction)
        pressure[: c.count] = 0.0
        while True:
            size = self._problem.solve(u, tolerance, 60)
            _, _, outcome.smallest = self._forces(u)
            outcome.rounds += 1
            found = self._pressure[: c.count]
            change = np.abs(law.friction * found - limit[: c.count]) / np.maximum(
                c.arrays.stiffness[: c.count, 1], 1e-300
            )
            stretch = self._settle(u, law.tolerance * law.distance)
            change_most = max(float(change.max(initial=0.0)), stretch)
            outcome.residual = max(change_most, size if size > tolerance else 0.0)
            limit[: c.count] = law.friction * found
            outcome.solved = change_most <= law.tolerance * law.distance
            if outcome.rounds >= self.ROUNDS:
                break
            deep = kernels.stiffen(c.arrays, c.count, u, self.DEEPEST * law.distance, 4.0)
            if deep:
                self._problem.renew()
            elif outcome.solved:
                break
        self._forces(u)
        self._take()
        return outcome

    def _settle(self, u: FloatArray, aim: float) -> float:
        """Let the bound of strains take its tensions from `u`; return the error, `aim` [m] where it is small enough."""
        return aim * self._bounded.settle(u[: self._bounded.unknowns]) if self._bounded else 0.0

    def _forces(self, u: FloatArray) -> tuple[float, float, float]:
        c = self._contacts
        return kernels.forces(c.arrays, c.count, u, self.law.friction, self._pressure, self._friction)

    def _take(self) -> None:
        c = self._contacts
        c.arrays.pressure[: c.count] = self._pressure[: c.count]
        c.arrays.friction[: c.count] = self._friction[: c.count]
