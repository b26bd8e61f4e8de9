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
from tripod_sim.integrators.scheme import Stage
from tripod_sim.system_kernels import dot


class DescentError(RuntimeError):
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


class StepProblem:
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

    TRIES, PAST, CHORD = 20, 0.3, 0.3
    """Shares of a step that are tried; slope at its end over that at its start; and how much shorter than the one
    before a step is for the factorisation to serve on."""

    NOTHING = 1e-4
    """Share of the rounding of the potential below which its fall along a step is nothing: slopes are rounding, too."""

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

    def _factor(self, u: FloatArray) -> None:
        """Factor with the contacts at `u`."""
        self.effort.factorisations += 1
        self.serves = self.serves and self.lasting
        self._factored = self._fits(lambda: self._joint.factor(self._contacts, u), u)
        if not self._factored:
            raise DescentError(
                "the stiffness matrix is singular or not finite; is a part of the body held by nothing?"
            )

    def _solve(self, r: FloatArray) -> FloatArray:
        """Return H^-1 r."""
        self.effort.iterations += 1
        return self._joint.linear.solve(r)

    def descend(self, u: FloatArray, tolerance: float, most: int) -> float:
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
        r, way = self._r, u[self.given]
        for part in (1.0, 0.5, 0.5, 0.5, 0.0):  # moves without forces may turn elements inside out
            u *= part
            u[self.given] = way
            if np.isfinite(phi := self._evaluate(u, r)):
                break
        else:
            raise DescentError(
                "the step begins in a state without energy: a number is not finite, or an element has no "
                "equilibrium inside; take a smaller dt or another mesh.element"
            )
        fresh, size, previous = False, np.inf, np.inf
        enough = tolerance * (
            0.01 if self.lasting else 0.1
        )  # a Hessian of another pose shows less of what is left
        for _ in range(most):
            if not self._factored:
                fresh = not self.serves
                self._factor(u)
            p = self._solve(r)
            size = float(np.abs(p).max(initial=0.0))  # NaN, if p is
            scale = 0.0
            if fresh or size <= self.CHORD * previous:
                scale, phi = self._search(u, p, phi)
            if not scale and fresh:
                if size <= 1e3 * tolerance:  # rounding of the potential hides the descent
                    break
                raise DescentError(
                    f"the energy falls along no direction, at a step of {size:.3g} m; take a smaller dt"
                )
            # of its error a step leaves what the one before did
            near = (
                scale == 1.0
                and size <= tolerance
                and (fresh or size * min(size, previous) <= enough * previous)
            )
            if near and self.balanced(r):
                return size
            if scale < 1.0:  # chord steps while they converge fast
                self._factored = self.serves = False
            previous, fresh = size, False
        self.balanced(r)
        return size

    def _search(self, u: FloatArray, p: FloatArray, phi: float) -> tuple[float, float]:
        """Move `u`, of the potential `phi` and the gradient in `_r`, along -p to about the minimum there.

        Where the full step goes too far, the slopes on both sides of the minimum tell where it is, for between them the
        potential is nearly a parabola, or two.

        Returns:
            The share of p, 0 where none is lower, and the potential there, its gradient in `_r`.
        """
        r, trial, after = self._r, self._trial, self._next
        slope, rounding = dot(r, p), 1e-12 * max(abs(phi), 1e-9)
        scale, low, falls = 1.0, 0.0, slope
        for tries in range(self.TRIES):
            np.multiply(p, -scale, out=trial)
            trial += u
            lower = self._evaluate(trial, after)
            there = dot(after, p) if np.isfinite(lower) else -np.inf
            lowers = lower <= phi - 1e-4 * scale * slope + rounding
            level = -self.PAST * slope <= there <= self.PAST * slope or slope <= self.NOTHING * rounding
            if lowers and (level or (not tries and there > 0.0) or tries > 4):
                u[:], r[:] = trial, after
                return scale, lower
            if lowers and there > 0.0:
                low, falls = scale, there
            else:
                high, rises = scale, -there
            share = falls / (falls + rises) if 0.0 < rises < np.inf else 0.3
            scale = low + (high - low) * min(max(share, 0.1), 0.9)
        return 0.0, phi


def _join(patterns: list[Any]) -> Any:
    """Return patterns as the diagonal blocks of one, its data theirs one after the other."""
    rows, indptr, at, entries = list[IndexArray](), [np.zeros(1, dtype=np.int64)], 0, 0
    for p in patterns:
        rows.append(p.indices.astype(np.int64) + at)
        indptr.append(p.indptr[1:].astype(np.int64) + entries)
        at, entries = at + p.shape[0], entries + p.nnz
    data = np.ones(entries)
    return sparse.csc_matrix((data, np.concatenate(rows), np.concatenate(indptr)), shape=(at, at))
