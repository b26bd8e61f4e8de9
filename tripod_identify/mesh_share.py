"""What mesh and time steps make of predictions, and of the values that are found with them.

Nobody knows that error; known is what it looks like, from the same rows on other meshes. A number that a mesh gets
wrong by C h^p is corrected by D = (f_h/2 - f_h) / (1 - 2^-p) [Richardson1911]; p is 1 where a clamp's edge rules, 2
where the elements do: the middle of both is taken. But clamps and disc hold nodes, of which another kind of element has
others on any mesh, and the change D' to such elements on the same cells may have the opposite sign. So data y with the
noise e are taken as

    y = f(u) + c D + c' D' + r + e,    c ~ N(1, 1),  c' ~ N(0, 1),

r being a polynomial of second degree in the commands (in time, where none moves), another for each number, with factors
such that its root mean square is half that of D and D': what neither looks like [KennedyOHagan2001]. The error thus is
one and the same from pose to pose, and no noise that many poses average away. Linearised about the fit, u, c, c' and r
are found together: the data themselves say how much of D they need. Time steps have a D of their own.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

from tripod_host.arrays import FloatArray
from tripod_identify.fit import Fit, pseudo_residuals
from tripod_identify.hac_covariance import HacCovariance
from tripod_identify.lack_of_fit import Smooth
from tripod_identify.model import Rest, Told, closely, motion
from tripod_identify.problem import Problem, other_elements, refined
from tripod_sim.errors import SceneError, StepError
from tripod_sim.state import State
from tripod_sim.system import System

ROWS = 30
"""Poses at which other meshes are solved; between them their changes are polynomials of second degree."""

FACTOR = 5 / 3
"""Of f_h/2 - f_h: the correction."""

REST = 0.5
"""Root mean square of what is like none of the changes, over theirs."""


FEW = 5.0
"""Numbers as which the size of the errors that the fit has found counts."""

SETTLING = 10
"""Rounds in which noise and what other meshes explain are told apart."""


@dataclass(frozen=True, eq=False)
class Share:
    """What another mesh, or shorter steps, would change.

    Attributes:
        size: Root mean square of the correction of places [m]; of rotations [rad] where no places were measured.
        move: Of u, shape (p,): add it to be rid of the error.
        rows: Of how many rows.
    """

    size: float
    move: FloatArray
    rows: int


@dataclass(frozen=True, eq=False)
class Amounts:
    """Values and amounts of changes as found together, their number p and q.

    u is where the fit has it, by the noise of the covariance `noise`, less `follow` c.

    Attributes:
        noise: Of u, were c known, shape (p, p).
        follow: By which u goes back for a unit of each, shape (p, q).
        mean, covariance: Of c, shapes (q,), (q, q).
        cross: Covariance of the noise in u and of c, shape (p, q); none where no error has to do with another.
        meshes, steps: How many of the first c are of other meshes, and of shorter steps after them; the others are of
            the polynomial, for each number in turn.
        terms: Polynomials that have the root mean square 1 at the rows, of those of `Smooth`, shape (terms, t).
        sizes: What a unit of them is of each number [m, rad], shape (m,).
    """

    noise: FloatArray
    follow: FloatArray
    mean: FloatArray
    covariance: FloatArray
    meshes: int
    steps: int
    terms: FloatArray
    sizes: FloatArray
    cross: FloatArray

    @property
    def moves(self) -> list[FloatArray]:
        """Moves of u by other meshes, with what is like none of them, and by steps, shape (p,)."""
        ofstep = np.zeros(len(self.mean), dtype=bool)
        ofstep[self.meshes : self.meshes + self.steps] = True
        return [-self.follow @ np.where(own, self.mean, 0.0) for own in (~ofstep, ofstep)]

    @property
    def all(self) -> FloatArray:
        """Covariance of u, by noise and amounts, shape (p, p)."""
        crossed = self.cross @ self.follow.T
        return np.asarray(self.noise + self.follow @ self.covariance @ self.follow.T - crossed - crossed.T)


@dataclass(frozen=True, eq=False)
class Shares:
    """What both make of the values.

    Attributes:
        mesh, step: Each; `step` is None for poses, or where dt is chosen anyway.
        covariance: Of u with both moves added, by noise and what is unknown of both, shape (p, p).
        amounts: Of which these are made.
        smooth: Polynomials in the commands; in time, of a motion in which none moves.
    """

    mesh: Share
    step: Share | None
    covariance: FloatArray
    amounts: Amounts
    smooth: Smooth


def shares(problem: Problem, fit: Fit) -> Shares:
    """Return what mesh and steps make of what was fitted. Raises SceneError, StepError."""
    here = problem.at(fit.u)
    rows_along, times = problem.measured.joints(here.told.scene), problem.measured.times
    polynomials = Smooth.of(rows_along)
    if times is not None and not len(polynomials.columns):  # nothing is commanded
        rows_along = times[:, None]
        polynomials = Smooth.of(rows_along)
    smooth = polynomials.squares(rows_along)
    finer, rows = _change(refined(here.told), problem, fit, smooth)
    mesh = [FACTOR * finer]
    with contextlib.suppress(
        SceneError, StepError
    ):  # a mesh that cannot have them: the halved edges alone tell
        mesh.append(_change(other_elements(here.told), problem, fit, smooth)[0])
    scene, step = here.told.scene, []
    if here.rest is None and not scene.time_error:
        halved = replace(here.told, scene=replace(scene, dt=0.5 * scene.dt))
        step.append(FACTOR * _change(halved, problem, fit, smooth)[0])
    amounts = _solve(problem, fit, (mesh, step), smooth)
    moves = amounts.moves
    angle = np.array([c.angle for c in problem.measured.channels])
    kind = ~angle if (~angle).any() else angle

    def share(changes: Sequence[FloatArray], move: FloatArray) -> Share:
        return Share(float(np.sqrt(np.mean([(c[:, kind] ** 2).mean() for c in changes]))), move, rows)

    whole = share(mesh, moves[0])
    return Shares(whole, share(step, moves[1]) if step else None, amounts.all, amounts, polynomials)


def _change(other: Told, problem: Problem, fit: Fit, smooth: FloatArray) -> tuple[FloatArray, int]:
    """Return by how much all rows differ with another mesh, shape (k, m), and how many were computed."""
    here = problem.at(fit.u)
    if here.rest is None:
        closer = replace(other, scene=closely(other.scene))
        return motion(closer, problem.measured, problem.points) - here.values, len(here.values)
    good = np.flatnonzero(fit.sound)
    rows = np.unique(good[np.linspace(0, len(good) - 1, min(ROWS, len(good))).round().astype(np.int64)])
    mesh = Rest(other.scene, problem.measured, problem.points)
    joints = here.told.joints(problem.measured.joints(here.told.scene))
    there = between(here.rest, [here.states[k] for k in rows], mesh, joints[rows])
    own = [
        mesh.observer.see(state, here.told.sensor) - here.values[k]
        for k, state in zip(rows, there, strict=True)
    ]
    change = smooth @ np.linalg.lstsq(smooth[rows], np.array(own), rcond=None)[0]
    change[rows] = own
    return np.asarray(change), len(rows)


def _solve(
    problem: Problem, fit: Fit, families: tuple[list[FloatArray], list[FloatArray]], smooth: FloatArray
) -> Amounts:
    """Return u and the amounts of all changes, those of the families and of what is like none of them.

    With A = J / sigma, B the changes over sigma, s² the spread, z the pseudo residuals, P the covariance of the fit and
    c ~ N(m, 1), the least of |z - A du - B c|² / s² + |c - m|² has

        (B^T B / s² + 1 - N^T P N) (c - m) = B^T (z - B m) / s² - N^T P (A^T z / s² - N m),    N = A^T B / s²,

    and du = -P N c; the rest of it, P A^T z / s², is what the fit has left undone, and nothing but its tolerance.
    The fit has taken for noise what B explains, so s² is found from what is left, over the numbers less those that
    u and c use up: their count less the trace of the covariance of c [MacKay1992]. Where they use up all, nothing is
    left that tells noise apart, so what the fit took for it counts along, as `FEW` numbers.

    Errors of a motion hang together: those of size one have the covariance R (`together`), found from what is left
    as well. u and c are the same linear functions of the data; with Q = B - A P N and S the covariance of c above, c
    then has S + S Q^T (R - 1) Q S / s², the noise of u P + P A^T (R - 1) A P / s², and both P A^T (R - 1) Q S / s².
    """
    measured = problem.measured
    sigma = np.where([c.angle for c in measured.channels], fit.sigma[1], fit.sigma[0])
    use = np.isfinite(measured.values) & fit.sound[:, None]
    every = [change for changes in families for change in changes]
    columns = [change / sigma for change in every]
    size = (
        REST * np.sqrt(np.mean([(change[fit.sound] ** 2).mean(axis=0) for change in every], axis=0)) / sigma
    )
    left, sizes, right = np.linalg.svd(smooth[fit.sound], full_matrices=False)
    some = sizes > 1e-9 * sizes[0]
    even = np.sqrt(len(left) / some.sum())
    left, terms = even * left[:, some], even * right[some].T / sizes[some]
    for j, amount in enumerate(size):
        for term in left.T:
            column = np.zeros(use.shape)
            column[fit.sound, j] = amount * term
            columns.append(column)
    p, n = len(fit.u), len(every)
    whole = np.where(
        use[..., None], np.stack([*np.moveaxis(fit.jacobian / sigma[:, None], -1, 0), *columns], -1), 0
    )
    A, B = np.split(whole[use], [p], axis=1)
    first = len(families[0])
    m = np.zeros(B.shape[1])
    m[[0, *range(first, n)]] = 1.0  # Richardson's
    z = pseudo_residuals(((measured.values - fit.values) / sigma)[use])
    variance, more, given = fit.spread, np.zeros((p + len(m), p + len(m))), 0.0
    angle = np.array([c.angle for c in measured.channels])
    for _ in range(SETTLING):
        P = fit.inverse * variance
        N = A.T @ B / variance
        PN = P @ N
        normal = B.T @ B / variance + np.eye(len(m)) - N.T @ PN
        S = np.linalg.inv(normal)
        c = m + S @ (B.T @ (z - B @ m) / variance - PN.T @ (A.T @ z / variance - N @ m))
        lack_of_fit = z - B @ c - A @ (P @ (A.T @ z / variance - N @ c))
        if measured.times is not None:
            errors = np.zeros(use.shape)
            errors[use] = lack_of_fit
            ofu = np.hstack([P + PN @ S @ PN.T, -PN @ S])
            both = np.vstack([ofu, np.hstack([ofu[:, p:].T, S])]) / variance
            more = HacCovariance.of(errors, use, angle, whole, both).more(whole)
            given = float(np.sum(both * more))
        used = p + len(m) - float(np.trace(S)) + given
        variance = (float(lack_of_fit @ lack_of_fit) + FEW * fit.spread) / (max(len(z) - used, 0.0) + FEW)
    more /= variance
    toc = np.vstack([-PN, np.eye(len(m))]) @ S  # the noise in c is S Q^T
    noise, cross, covariance = P + P @ more[:p, :p] @ P, P @ more[:p] @ toc, S + toc.T @ more @ toc
    return Amounts(noise, PN, c, covariance, first, n - first, np.asarray(terms), size * sigma, cross)


def between(coarse: Rest, states: Sequence[State], fine: Rest, joints: FloatArray) -> list[State]:
    """Return the states of rest on a finer mesh at `joints`, shape (k, a + 1), begun from those on a coarser one.

    Where what is between its nodes leads nowhere the joints are played from the undeformed state. Raises StepError.
    """
    settled = []
    for k, bent in enumerate(bent_like(coarse.system, states, fine.system, joints)):
        start = bent
        try:
            fine.settle(start, joints[k])
        except StepError:
            start = fine.start()
            fine.settle(start, joints[k])
        settled.append(start)
    return settled


def bent_like(coarse: System, states: Sequence[State], fine: System, joints: FloatArray) -> list[State]:
    """Return states on another mesh of the same body, bent as `states` are, with its driven frames at `joints`.

    Displacements are interpolated linearly between the nodes of `coarse`. Modes and velocities are zero. The states are
    not in equilibrium.

    Args:
        coarse: Of `states`, whose rigid groups are those of `fine`.
        states: k of them.
        fine: Of what is returned.
        joints: Shape (k, a + 1).
    """
    places, own = coarse.rest, fine.rest
    moved = np.stack([state.positions - places for state in states], axis=1)
    found = LinearNDInterpolator(places, moved, rescale=True)(own)
    lost = ~np.isfinite(found).all(axis=(1, 2))
    found[lost] = NearestNDInterpolator(places, moved, rescale=True)(own[lost])
    placed, undeformed, bent = fine.groups.placed(own), coarse.groups.placed(places), list[State]()
    for k, state in enumerate(states):
        start = fine.undeformed(np.zeros_like(joints[k]))
        start.positions[:] = own + found[:, k]
        for b, nodes in enumerate(fine.groups.rigid):
            centre, R = placed[nodes].mean(axis=0), state.rotations[b]
            start.rotations[b] = R
            start.centres[b] = state.centres[b] + R @ (
                centre - undeformed[coarse.groups.rigid[b]].mean(axis=0)
            )
            start.positions[nodes] = start.centres[b] + (placed[nodes] - centre) @ R.T
        fine.drive(start, joints[k])
        bent.append(start)
    return bent
