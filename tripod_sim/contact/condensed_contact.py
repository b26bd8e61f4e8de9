"""Steps with few contacts: by the compliance of the bodies, whose factorisation serves on while it is good enough.

With the Hessian A of the bodies alone, factored once, a step u of Newton's method among contacts is

    u' = u - A^-1 (r - J^T f),

r the bodies' gradient, f what the contacts press and pull with after it. Of the unknowns z that contacts touch this is
a problem of its own, small and dense, solved to the tolerance each time (`condensed_contact_kernels`). It needs the
rows of A^-1 that belong to z, by one back-substitution each, when something new is touched. A may be that of an earlier
pose, of a step before, too, as long as each step is much shorter than the one before. Where the last two steps of time
ended equally far from their moves without forces, the next begins there. The end is the same as that of the augmented
Lagrangian on all unknowns: the forces are in balance, gaps and slips within the tolerance.
"""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.contact import condensed_contact_kernels as kernels
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.contact.problem import StepProblem


class _NoWayError(Exception):
    """This way does not lead to the end."""


class CondensedContact:
    """Solves steps in which contacts touch few unknowns.

    Attributes:
        rounds: Of multipliers in the last solve.
    """

    MOST = 150
    """Touched unknowns, beyond which factorisations with the contacts in them are faster."""

    STEPS, SLOW, FEW = 20, 5, 8
    """Of Newton's method, and of those such that do not bring it nearer, after which the other way is gone; steps with
    one A so few that it is good enough for the next step of time, too."""

    def __init__(self, problem: StepProblem, contacts: ContactSet) -> None:
        self._problem, self._contacts, self._chosen = problem, contacts, ContactSet()
        n = problem.unknowns
        self._place, self._touched = np.full(n, -1, dtype=np.int64), np.zeros(n, dtype=np.int64)
        self._row = np.full(n, -1, dtype=np.int64)
        self._columns, self._known = np.zeros((24, n)), 0
        self._which, self._force, self._S = np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, 0))
        self._r, self._serves, self.rounds = np.zeros(n), False, 0
        self._reserve(256)
        self._missed, self._steady, self._rate = np.zeros(n), False, 0.0

    def warm_up(self) -> None:
        """Compile what is needed only when something touches."""
        c, mine, one = self._contacts.arrays, self._chosen.arrays, np.ones((1, 1))
        kernels.choose(c, 0, self._r, 0.0, self._taken, mine, self._numbers)
        kernels.touch(mine, 0, self._place, self._touched)
        kernels.condense(one, self._touched[:1], self._touched[:1], one.copy())
        kernels.stiffen(mine, 0, one)
        kernels.invert(one.copy(), one.copy())
        kernels.settle(mine, 0, one, one[0].copy(), one[0].copy(), 0.0, 1.0, self._pressure, self._friction)
        kernels.give_back(mine, 0, self._numbers, c)
        kernels.add_answers(one, one[0], one, self._touched[:1], one[0].copy(), one[0].copy())
        self.smallest(self._r)

    def _reserve(self, room: int) -> None:
        self._numbers = np.zeros(room, dtype=np.int64)
        self._taken = np.zeros(room, dtype=np.bool_)
        self._pressure, self._friction = np.zeros(room), np.zeros((room, 3))
        self._chosen.reserve(room)

    def solve(self, u: FloatArray, mu: float, aim: float) -> float:
        """Move `u` to the end of the step; the contacts hold the forces afterwards.

        Args:
            u: Shape (unknowns,), in place.
            mu: Coulomb's coefficient.
            aim: Error of gaps and slips that is let be [m].

        Returns:
            The error that is left [m]; infinite where this way does not lead to the end.
        """
        count = self._contacts.count
        if len(self._numbers) < count:
            self._reserve(2 * count)
        self._taken[:count] = False
        self._chosen.count, self.rounds, self._serves = 0, 0, False
        self._which, self._force = np.zeros(0, dtype=np.int64), np.zeros(0)
        if self._problem.begun:
            self._missed *= float(self._problem.serves)
            if self._steady:
                u += self._missed
        self._problem.begun = False
        try:
            self._choose(u, 0.0)
            return self._descend(u, mu, aim)
        except _NoWayError:
            return np.inf

    def _choose(self, u: FloatArray, least: float) -> bool:
        """Add the contacts to those at hand that press, or are nearer than `least` [m] after the moves `u`, if any."""
        c, mine = self._contacts, self._chosen
        new = kernels.choose(c.arrays, c.count, u, least, self._taken, mine.arrays, self._numbers)
        if new < 0:
            return False
        mine.count, self._serves = new, False
        m = kernels.touch(mine.arrays, new, self._place, self._touched)
        if m > self.MOST:
            raise _NoWayError
        self._which, self._force = self._touched[:m].copy(), np.zeros(m)
        return True

    def _descend(self, u: FloatArray, mu: float, aim: float) -> float:
        problem, r, before, since, slow = self._problem, self._r, np.inf, 0, 0
        for _ in range(self.STEPS):
            if not problem.ready:
                self._row[:], self._known, self._serves = -1, 0, False
                if not problem.factor_bodies(u):
                    raise _NoWayError
                since, before, self._rate = 0, np.inf, 0.0
            if not np.isfinite(problem.gradient(u, r)):
                raise _NoWayError
            free = -problem.solve_bodies(r)
            change, error = self._with_contacts(u, free, mu, 0.1 * aim)
            size = problem.size(change)
            u += change
            since += 1
            if 0.0 < before < np.inf:
                self._rate = min(1.0, size / before)
            if size <= 0.1 * aim and self._rate * size <= 0.01 * aim:
                problem.gradient(u, r)
                r[self._which] -= self._force
                if problem.balanced(r):
                    problem.serves = since <= self.FEW
                    missed = u - problem.guess
                    change, self._missed = missed - self._missed, missed
                    self._steady = problem.size(change) < 0.3 * problem.size(missed)
                    return max(error, size)
            if size >= 0.3 * before:
                slow += 1
                if slow > self.SLOW:
                    raise _NoWayError
                problem.serves = False
            before = size
        raise _NoWayError

    def _with_contacts(
        self, u: FloatArray, free: FloatArray, mu: float, aim: float
    ) -> tuple[FloatArray, float]:
        """Return the step from `u` that would be `free` without contacts, and the error of gaps and slips after it."""
        c, mine, error, solved, change = self._contacts, self._chosen, 0.0, False, free
        while True:  # until no others than those contacts at hand turn out to matter
            if not self._choose(u + change, -aim if solved else 0.0) and (solved or not mine.count):
                return change, error
            if not self._serves:
                self._condense()
            y = u[self._which] + free[self._which]
            z = y.copy()
            rounds, error = kernels.settle(
                mine.arrays, mine.count, self._S, y, z, mu, aim, self._pressure, self._friction
            )
            if not error <= aim:
                raise _NoWayError
            kernels.give_back(mine.arrays, mine.count, self._numbers, c.arrays)
            self.rounds, solved = self.rounds + rounds, True
            change = free.copy()
            kernels.add_answers(self._S, z - y, self._columns, self._row[self._which], self._force, change)

    def _condense(self) -> None:
        """Write N^-1 for the touched unknowns, having found the rows of A^-1 that are missing."""
        which = self._which
        new = which[self._row[which] < 0]
        if len(new):
            end = self._known + len(new)
            if end > len(self._columns):
                self._columns = np.concatenate([self._columns, np.zeros((end, self._problem.unknowns))])
            self._columns[self._known : end] = self._problem.rows(new)
            self._row[new] = np.arange(self._known, end)
            self._known = end
        N, self._S = np.empty((2, len(which), len(which)))
        kernels.condense(self._columns, self._row[which], which, N)
        kernels.stiffen(self._chosen.arrays, self._chosen.count, N)
        if not kernels.invert(N, self._S):
            raise _NoWayError
        self._serves = True

    def smallest(self, u: FloatArray) -> float:
        """Return the smallest gap beyond the contact distance after the moves `u` [m], infinite without contacts."""
        return float(kernels.smallest_gap(self._contacts.arrays, self._contacts.count, u))
