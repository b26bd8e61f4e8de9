"""The potential of one step with contact, in the unknowns of all moving bodies, and how to go down in it."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import sparse

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.contact import response_kernels
from tripod_sim.contact.bodies import Body
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.contact.joint_hessian import JointHessian
from tripod_sim.errors import UnsolvedError
from tripod_sim.integrators.minimise import Descent, minimise
from tripod_sim.integrators.scheme import Stage
from tripod_sim.system_kernels import dot


class DescentError(UnsolvedError):
    """No lower potential was found, or a number is not finite."""


@dataclass
class Effort:
    """What solves took, summed until it is read.

    Attributes:
        iterations: Linear solves.
        factorisations: Hessians assembled and factored.
    """

    iterations: int = 0
    factorisations: int = 0


class StepProblem(Descent):
    """Sum of the bodies' potentials and of their contacts' (see `response_kernels`).

    The Hessian is factored with the contacts in it (`JointHessian`), or, for few contacts, without them.

    Attributes:
        unknowns: Of all bodies, one after the other.
        slices: Those of each body.
        given: Unknowns that are not sought, shape (g,).
        reach: See `Body`.
        give: 1 / diagonal of the Hessian without contacts at the start of the step, shape (unknowns,).
        guess, begun: Moves of the stage without forces, and whether it has just begun.
        effort: Counts.
        serves: Whether the Hessian of the bodies at hand is one of this step, or good enough for it.
        unbalanced: Largest force that the last descent left [N].
        balance: Which of these is small enough [N]: any, where bodies move on; see `statics`.
    """

    CHORD = 0.3
    """How much shorter than the one before a step is for the factorisation to serve on."""

    _u: FloatArray
    _tolerance: float
    _left: int
    _size: float
    _previous: float
    _fresh: bool
    _near: bool
    """Of a descent: its point; largest move of a last step [m]; linear solves left; largest move of the last step and
    of that before [m]; whether its Hessian was that of its point; whether it was small enough."""

    def __init__(self, bodies: list[Body], contacts: ContactSet) -> None:
        self._bodies, self._contacts = bodies, contacts
        first = np.cumsum([0, *[b.unknowns for b in bodies]]).tolist()
        self.slices, self.unknowns = [slice(*ends) for ends in pairwise(first)], first[-1]
        self.given = np.concatenate([k + b.given for b, k in zip(bodies, first, strict=False)])
        self.reach = np.concatenate([b.reach for b in bodies])
        patterns = [b.pattern for b in bodies]
        self._pattern: Any = _join(patterns)
        ends = np.cumsum([0, *[p.nnz for p in patterns]])
        self._parts = [
            (b.pattern.data, self._pattern.data[a:e]) for b, a, e in zip(bodies, ends, ends[1:], strict=False)
        ]
        self._joint = JointHessian(self._pattern)
        self._bare = self._joint.bare
        self._length, self._assembled, self._bare_factored = 0.0, False, False
        n = self.unknowns
        self.give, self._r, self._trial, self._next = np.ones(n), np.zeros(n), np.zeros(n), np.zeros(n)
        self._diagonal = self._pattern.indptr[1:] - 1
        self._factored = False
        self.guess, self.begun = np.zeros(n), False
        self.effort, self.unbalanced, self.balance, self.serves = Effort(), 0.0, np.inf, False

    def warm_up(self) -> None:
        """Compile what is needed only when something touches."""
        u = np.zeros(self.unknowns)
        response_kernels.add_gradient(self._contacts.arrays, 0, u, u)
        dot(u, u)
        self._joint.warm_up(self._contacts, u)

    def forget(self) -> None:
        """Drop what was kept from earlier steps."""
        self.serves = False
        self._joint.forget()

    def begin(self, stage: Stage, u: FloatArray) -> None:
        """Prepare a stage and write the moves without forces to `u`."""
        self.serves = self.serves and stage.key == self._length and self.lasting
        self._length, self._assembled, self._factored = stage.key, False, False
        for body, part in zip(self._bodies, self.slices, strict=True):
            body.served = self.serves
            body.begin(stage)
            body.guess(u[part])
        self.guess[:], self.begun = u, True

    def prepare(self, u: FloatArray) -> None:
        """Write `give`, from the Hessians at the start of the step, or of a step before that serve."""
        if not self._assembled and not self.serves:
            self._assemble(u, project=not self.lasting)
            np.divide(1.0, np.abs(self._pattern.data[self._diagonal]), out=self.give)
            self.serves = self.lasting
        self._assembled = True

    @property
    def ready(self) -> bool:
        """Whether `solve_bodies` has a factorisation that serves."""
        return self.serves and self._bare_factored

    def factor_bodies(self, u: FloatArray) -> bool:
        """Factor the Hessian of the bodies alone: the one at hand if it serves, else that at `u`."""
        self.effort.factorisations += 1
        self.prepare(u)
        self._bare_factored = self._fits(self._factor_bare, u)
        return self._bare_factored

    def _factor_bare(self) -> bool:
        return self._bare.factor() and self._bare.is_positive()

    def _fits(self, factor: Callable[[], bool], u: FloatArray) -> bool:
        """Let `factor` take the bodies' Hessian at hand if it serves, else that at `u`, as it is or else projected.

        Return whether one is positive definite.
        """
        if self.serves and factor():
            return True
        for project in (False, True):
            self._assemble(u, project=project)
            self.serves = factor()
            if self.serves:
                return True
        return False

    def solve_bodies(self, r: FloatArray) -> FloatArray:
        """Return A^-1 r with the last factorisation of the bodies alone."""
        self.effort.iterations += 1
        return self._bare.solve(r)

    def rows(self, which: IndexArray) -> FloatArray:
        """Return the rows `which` of A^-1, shape (k, unknowns), with the last factorisation of the bodies alone."""
        unit = np.zeros((self.unknowns, len(which)))
        unit[which, np.arange(len(which))] = 1.0
        return self._bare.solve_many(unit).T

    @property
    def lasting(self) -> bool:
        """Whether the bodies' Hessian of a step may serve in the next."""
        return all(body.lasting for body in self._bodies)

    def size(self, moves: FloatArray) -> float:
        """Return by how much `moves` of the unknowns move any point of the bodies at most [m]."""
        return float(np.abs(moves * self.reach).max(initial=0.0))

    def renew(self) -> None:
        """Drop the factorisation: the contacts have changed."""
        self._factored = False

    def _assemble(self, u: FloatArray, *, project: bool) -> None:
        self._bare_factored = False
        for body, part, (own, place) in zip(self._bodies, self.slices, self._parts, strict=True):
            body.hessian(u[part], project=project)
            place[:] = own

    def _evaluate(self, u: FloatArray, r: FloatArray) -> float:
        """Write the gradient to `r` and return the potential."""
        phi, c = self.gradient(u, r), self._contacts
        return phi + float(response_kernels.add_gradient(c.arrays, c.count, u, r))

    def gradient(self, u: FloatArray, r: FloatArray) -> float:
        """Write the gradient of the bodies alone to `r` and return their potential, infinite where there is none."""
        r[:] = 0.0
        phi = 0.0
        for body, part in zip(self._bodies, self.slices, strict=True):
            phi += body.add(u[part], r[part])
        return phi

    def balanced(self, r: FloatArray) -> bool:
        """Let `unbalanced` be the largest force of `r`, shape (unknowns,); return whether that is small enough.

        Moments count divided by `reach`, unknowns that are given not at all: their forces become zero.
        """
        r[self.given] = 0.0
        self.unbalanced = float(np.abs(r / self.reach).max(initial=0.0))
        return self.unbalanced <= self.balance

    def solve(self, u: FloatArray, tolerance: float, most: int) -> float:
        """Move `u` to the minimum for the contacts' present multipliers, in place.

        Args:
            u: Shape (unknowns,).
            tolerance: Largest move of a last step [m].
            most: Linear solves.

        Returns:
            The largest move of the step made last [m].

        Raises:
            DescentError: no lower potential was found.
        """
        way = u[self.given]
        for part in (1.0, 0.5, 0.5, 0.5, 0.0):  # moves without forces may turn elements inside out
            u *= part
            u[self.given] = way
            if np.isfinite(phi := self._evaluate(u, self._r)):
                break
        else:
            raise DescentError(
                "the step begins in a state without energy: a number is not finite, or an element has no "
                "equilibrium inside; take a smaller dt or another mesh.element"
            )
        self.phi, self._u, self._tolerance, self._left = phi, u, tolerance, most
        self._size = self._previous = np.inf
        self._fresh = self._near = False
        minimise(self)
        return self._size

    def ends(self) -> bool:
        """Return whether the last step was small enough, or as many as are allowed have been made."""
        if self._near and self.balanced(self._r):
            return True
        if self._left <= 0:
            self.balanced(self._r)
            return True
        return False

    def holds(self) -> bool:
        """Return whether a factorisation serves: that at hand, or one with the bodies' Hessian at hand."""
        if not self._factored and self.serves:
            self._factor(self._u)
        return self._factored

    def factor(self) -> None:
        """Factor with the contacts at the point, the bodies' Hessian renewed."""
        self.serves = False
        self._factor(self._u)
        self._fresh = True

    def _factor(self, u: FloatArray) -> None:
        """Factor with the contacts at `u`."""
        self.effort.factorisations += 1
        self.serves = self.serves and self.lasting
        self._fresh = not self.serves
        self._factored = self._fits(lambda: self._joint.factor(self._contacts, u), u)
        if not self._factored:
            raise DescentError(
                "the stiffness matrix is singular or not finite; is a part of the body held by nothing?"
            )

    def propose(self) -> FloatArray:
        """Return H^-1 r."""
        self.effort.iterations += 1
        self._left -= 1
        p = self._joint.linear.solve(self._r)
        self._previous, self._size = self._size, float(np.abs(p).max(initial=0.0))  # NaN, if p is
        return p

    def walk(self, p: FloatArray, share: float) -> float:
        """Write the trial moves, and the gradient there."""
        np.multiply(p, -share, out=self._trial)
        self._trial += self._u
        return self._evaluate(self._trial, self._next)

    def slope(self, p: FloatArray, *, trial: bool) -> float:
        """Return r . p."""
        return dot(self._next if trial else self._r, p)

    def left(self) -> float:
        """Return that the force says nothing: that of contacts jumps."""
        return np.inf

    def converges(self) -> bool:
        """Return whether steps become shorter fast enough."""
        return self._fresh or self._size <= self.CHORD * self._previous

    def slack(self) -> float:
        """Return the rounding of the potential [J]."""
        return 1e-12 * max(abs(self.phi), 1e-9)

    def take(self, phi: float, share: float) -> None:
        """Let the trial moves be the point."""
        self._u[:], self._r[:], self.phi = self._trial, self._next, phi
        size, previous = self._size, self._previous
        # of its error a step leaves what the one before did; a Hessian of another pose shows less of it
        enough = self._tolerance * (0.01 if self.lasting else 0.1)
        small = self._fresh or size * min(size, previous) <= enough * previous
        self._near = share == 1.0 and size <= self._tolerance and small
        if share < 1.0:
            self._factored = self.serves = False
        self._fresh = False

    def rests(self, *, fresh: bool) -> bool:
        """Return whether rounding of the potential hides the descent."""
        if not fresh:
            return False
        if self._size > 1e3 * self._tolerance:
            raise DescentError(
                f"the energy falls along no direction, at a step of {self._size:.3g} m; take a smaller dt"
            )
        self.balanced(self._r)
        return True


def _join(patterns: list[Any]) -> Any:
    """Return patterns as the diagonal blocks of one, its data theirs one after the other."""
    rows, indptr, at, entries = list[IndexArray](), [np.zeros(1, dtype=np.int64)], 0, 0
    for p in patterns:
        rows.append(p.indices.astype(np.int64) + at)
        indptr.append(p.indptr[1:].astype(np.int64) + entries)
        at, entries = at + p.shape[0], entries + p.nnz
    data = np.ones(entries)
    return sparse.csc_matrix((data, np.concatenate(rows), np.concatenate(indptr)), shape=(at, at))
