"""Values of a scene from data: which the data tell, with bars; which they do not; what remains unexplained."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from tripod_host.arrays import FloatArray
from tripod_identify.errors import DataError, FitError
from tripod_identify.fit import CONFIDENCE, OUTLIER, Fit, Note, Prior, enough, fit, hopeless, profile
from tripod_identify.intervals import Posterior, posterior_of
from tripod_identify.intervals import as_json as posterior_json
from tripod_identify.lack_of_fit import LackOfFit, what_is_left
from tripod_identify.measured import Measured
from tripod_identify.mesh_share import Share, Shares, shares
from tripod_identify.model import Progress, Told, plainly
from tripod_identify.observe import Point
from tripod_identify.parameters import FRAME, START, Parameter, check_range, parameters
from tripod_identify.problem import Problem, rest_jacobian
from tripod_identify.propose import Proposal, candidates, propose
from tripod_identify.score import Score, score
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene
from tripod_sim.tables.short_forms import joints_of

LEFT = 0.02
"""Of the largest range of any number: what has moved farther has begun to move."""


WORTH = 0.5
"""Share of the numbers of a motion: where as many tell as much, errors hang together so far that it is said."""

MOST = 0.5
"""Share of rows: where a number is off in more, it is not the rows that are wrong."""


@dataclass(frozen=True)
class Wanted:
    """What is asked for.

    Attributes:
        names: Of the values, see `parameters`.
        align: What may be between the frames, fitted along: none, translation or rigid.
        priors: What is known of values before.
        hold_out: Share of the rows that are kept out of the fit.
        mesh: Whether the errors of mesh and steps are estimated.
        profile: Whether intervals are also found by profiles.
        propose: Whether poses are proposed.
    """

    names: tuple[str, ...]
    align: str = "none"
    priors: Mapping[str, Prior] = field(default_factory=dict)
    hold_out: float = 0.0
    mesh: bool = True
    profile: bool = False
    propose: bool = True


@dataclass(frozen=True)
class Found:
    """One value that the data tell, in SI; its interval holds with 90 %.

    Attributes:
        parameter: Which.
        value: That makes this scene, on its mesh, fit best.
        low, high: Interval by noise alone.
        mesh, step: What the value would move by on a mesh without error, and with steps without error.
        true: The value rid of both.
        true_low, true_high: Its interval, by noise and what is unknown of both.
        profile: Interval of `value` by the profile; None where nobody asked.
    """

    parameter: Parameter
    value: float
    low: float
    high: float
    mesh: float
    step: float
    true: float
    true_low: float
    true_high: float
    profile: tuple[float, float] | None = None


@dataclass(frozen=True)
class Untold:
    """A value that the data do not tell: it stays where it was, and `why`."""

    parameter: Parameter
    why: str


@dataclass(frozen=True, eq=False)
class Identified:
    """What data say of a scene.

    Attributes:
        told: The scene with what was found, its servos, its sensor.
        found, untold: The values that were asked for.
        before, after: Scores of the rows that were fitted; before with the alignment that is allowed.
        held_before, held_after: Of those held out; None without any.
        every: Score of all rows after.
        fit: The last fit.
        mesh, step: What mesh and time steps make; None where nobody asked, or they cannot be told.
        left: Of places [m]; of rotations [rad] where no place was measured.
        parameters: Root mean square of what the uncertainty of the values makes of places [m].
        held_out: Rows that were, a mask.
        proposals: Poses that would tell most.
        notes: Warnings, one sentence each.
        posterior: What is known of the values, for the bars of other poses.
    """

    told: Told
    found: tuple[Found, ...]
    untold: tuple[Untold, ...]
    before: Score
    after: Score
    held_before: Score | None
    held_after: Score | None
    every: Score
    fit: Fit
    mesh: Share | None
    step: Share | None
    left: LackOfFit
    parameters: float
    held_out: NDArray[np.bool_]
    proposals: tuple[Proposal, ...]
    notes: tuple[str, ...]
    posterior: Posterior


def identify(
    scene: Scene, measured: Measured, points: Sequence[Point], wanted: Wanted, *, note: Note | None = None,
    progress: Progress | None = None, poses: FloatArray | None = None,
) -> Identified:  # fmt: skip
    """Return what data say of the values that are asked for.

    Args:
        scene: Where to begin.
        measured: The data.
        points: Of the body, that the data know.
        wanted: What is asked for.
        note: Told each stage, one line.
        progress: Told the share of the rows of each prediction.
        poses: To propose from, shape (n, s + 1); None: within the range of the data.

    Raises:
        DataError: fewer numbers than values, a name that is no value, and so on.
        FitError: no values were found.
        SceneError, StepError: the scene cannot be built, or has no rest where the data have one.
    """
    say = note or (lambda _: None)
    asked = parameters(scene, wanted.names, align=wanted.align)
    if not [p for p in asked if not p.nuisance]:
        raise DataError("nothing to identify: name values with --fit, such as --fit material.young")
    for name, prior in wanted.priors.items():
        if name not in {p.name for p in asked}:
            raise DataError(f"--prior {name}: it is not among the fitted values; add it with --fit")
        check_range(next(p for p in asked if p.name == name), prior.value, scene)
    rows = ~held_rows(measured, wanted.hold_out)
    base = plainly(scene)
    asked = [replace(p, value=beginning(measured)) if p.name == START else p for p in asked]
    problem = Problem(base, asked, measured, points, progress)
    first = problem.at(problem.start())
    before = score(first.values[rows], measured.rows(rows), wanted.align)
    problem = Problem(base, _begun(asked, before), measured, points, progress)
    problem.lend(first)
    result, untold = _told_ones(problem, rows, wanted.priors, say)
    problem = result[1]
    last = result[0]
    notes = list(measured.notes)
    if last.outliers:
        which = ", ".join(map(str, last.outliers[:12])) + (", ..." if len(last.outliers) > 12 else "")
        notes.append(
            f"{len(last.outliers)} of {int(rows.sum())} rows are more than 6 standard deviations off and "
            f"get almost no weight: {which}; check these rows"
        )
        notes += _columns_off(last, measured)
    notes += _hang_together(last, measured)
    both: Shares | None = None
    if wanted.mesh:
        say("repeating the fit on other meshes")
        try:
            both = shares(problem, last)
        except (SceneError, StepError) as error:
            notes.append(f"the effect of the mesh is not known: {error}")
        if both and (far := _too_far(both, last)):
            notes.append(f"the effect of the mesh is not known: {far}; take a finer mesh, or more rows")
            both = None
    solved = problem.at(last.u)
    after = score(last.values[rows], measured.rows(rows))
    held = measured.rows(~rows)
    some = bool((~rows).any())
    own = _profiles(last, problem, wanted, say, notes)
    good = last.sound
    left = what_is_left((measured.values - last.values)[good], measured.rows(good), scene)
    if left.note:
        notes.append(left.note)
    notes += _against(last, wanted.priors)
    proposals: list[Proposal] = []
    if wanted.propose and measured.times is None and joints_of(scene):
        say("poses that would tell most")
        proposals = _proposals(problem, asked, last, poses)
    return Identified(
        solved.told,
        tuple(_found(last, j, both, own.get(j)) for j, p in enumerate(last.wanted) if not p.nuisance),
        tuple(untold), before, after,
        score(first.values[~rows] + _shift(before, first.values[~rows], measured), held) if some else None,
        score(last.values[~rows], held) if some else None,
        score(last.values, measured), last, both.mesh if both else None, both.step if both else None, left,
        _by_parameters(last, problem), ~rows, tuple(proposals), tuple(notes),
        posterior_of(last, both, solved.told, measured.channels, motion=measured.times is not None),
    )  # fmt: skip


def _hang_together(last: Fit, measured: Measured) -> list[str]:
    """Return what to say of a motion few of whose numbers would tell as much."""
    count = int(np.isfinite(measured.values[last.rows]).sum())
    if measured.times is None or last.freedom >= WORTH * count:
        return []
    return [
        (
            f"errors of rows close in time are correlated: {count} numbers say as much as {last.freedom} "
            f"independent ones, and intervals are up to {last.longer.max():.1f} times as long. The sensor "
            "may drift, the model may not explain the motion, or its swing may be out of step: look at "
            "the report, or start from a better value of the stiffness"
        )
    ]


def _columns_off(last: Fit, measured: Measured) -> list[str]:
    """Return a warning for each number that is off in most of its rows: it is not what it is taken to be."""
    found = []
    sigma = np.where([c.angle for c in measured.channels], last.sigma[1], last.sigma[0])
    errors = np.abs(measured.values - last.values)[last.rows] / sigma
    for channel, column in zip(measured.channels, errors.T, strict=True):
        count, off = int(np.isfinite(column).sum()), int((column > OUTLIER).sum())
        if off > MOST * count:
            found.append(
                f"{channel.label} is more than 6 standard deviations off in {off} of {count} rows, so it is "
                "not used: does it have another unit, another frame (--align) or another sensor?"
            )
    return found


def _too_far(both: Shares, last: Fit) -> str:
    """Return why what the mesh makes is beyond what first derivatives can tell; empty if it is not."""
    moved = both.mesh.move + (both.step.move if both.step else 0.0)
    for j, p in enumerate(last.wanted):
        if not (p.nuisance or (abs(moved[j]) <= p.width and both.covariance[j, j] >= 0)):
            return f"{p.name} would change by {abs(moved[j]) / p.width:.2g} times its plausible range"
    return ""


def beginning(measured: Measured) -> float:
    """Return the last time before a place or rotation has left where it began by `LEFT` of the largest range [s]."""
    if measured.times is None:
        return 0.0
    values = measured.values
    first = np.isfinite(values).argmax(axis=0)  # a sensor may see nothing at the beginning
    away = np.abs(values - values[first, np.arange(values.shape[1])])
    moved = (away > LEFT * np.nanmax(away)).any(axis=1)
    return float(measured.times[max(int(np.argmax(moved)) - 1, 0)])


def held_rows(measured: Measured, share: float) -> NDArray[np.bool_]:
    """Return which rows are held out: of poses every so many-th, of a motion the end. Raises DataError."""
    count = len(measured.values)
    if not 0 <= share <= 0.5:
        raise DataError(f"--hold-out is {share:g}; allowed: 0 to 0.5, the share of the rows")
    out = np.zeros(count, dtype=bool)
    if not share:
        return out
    if measured.times is not None:
        out[round((1 - share) * count) :] = True
        return out
    every = round(1 / share)
    out[every // 2 :: every] = True
    return out


def _begun(asked: Sequence[Parameter], before: Score) -> list[Parameter]:
    """Return the parameters with the frame begun where the alignment puts it."""
    place = {f"{FRAME}.{'xyz'[i]}": float(v) for i, v in enumerate(before.aligned.shift)}
    place |= {f"{FRAME}.r{'xyz'[i]}": float(v) for i, v in enumerate(before.aligned.turn)}
    return [replace(p, value=place[p.name]) if p.nuisance else p for p in asked]


def _shift(before: Score, values: FloatArray, measured: Measured) -> FloatArray:
    """Return what a translation found elsewhere adds to `values`; a rotation is left to the fit."""
    add = np.zeros_like(values)
    if not before.aligned.turn.any():
        for j, c in enumerate(measured.channels):
            add[:, j] = 0.0 if c.angle else before.aligned.shift[c.axis]
    return add


def _told_ones(
    problem: Problem, rows: NDArray[np.bool_], priors: Mapping[str, Prior], say: Note
) -> tuple[tuple[Fit, Problem], list[Untold]]:
    """Fit, hold the value that the data tell least where it was, and fit again until all are told."""
    untold: list[Untold] = []
    start: FloatArray | None = None
    enough(problem, rows, priors)
    near = problem.at(problem.start())
    same = hopeless(problem, rows, priors)
    for j, why in same.items():
        untold.append(Untold(problem.wanted[j], why))
        say(f"{problem.wanted[j].name} cannot be found from the data: {untold[-1].why}")
    if same:
        others = [i for i in range(len(problem.wanted)) if i not in same]
        if not [i for i in others if not problem.wanted[i].nuisance]:
            names = ", ".join(u.parameter.name for u in untold)
            raise FitError(f"the data determine none of the values: {names}; {untold[-1].why}")
        problem = Problem(problem.base, [problem.wanted[i] for i in others], problem.measured, problem.points)
        problem.lend(near)
    while True:
        last = fit(problem, rows, priors, start, say)
        halves = last.half / np.array([p.width for p in last.wanted])
        bad = [j for j, p in enumerate(last.wanted) if not (last.told[j] or p.nuisance)]
        if not bad:
            return (last, problem), untold
        j = max(bad, key=lambda j: (bool(not last.at_bound[j]), round(min(halves[j], 1e6), 6), j))
        untold.append(Untold(last.wanted[j], _why(last, j)))
        say(f"{untold[-1].parameter.name} cannot be found from the data: {untold[-1].why}")
        others = [i for i in range(len(last.wanted)) if i != j]
        if not [i for i in others if not last.wanted[i].nuisance]:
            names = ", ".join(u.parameter.name for u in untold)
            raise FitError(f"the data determine none of the values: {names}; {untold[-1].why}")
        near = problem.at(last.u)
        problem = Problem(problem.base, [last.wanted[i] for i in others], problem.measured, problem.points)
        problem.lend(near)
        start = last.u[others]


def _why(last: Fit, j: int) -> str:
    """Return why the data do not tell a value."""
    p = last.wanted[j]
    if last.at_bound[j] and last.half[j] <= p.width:
        end = p.low if last.u[j] - p.bounds[0] < p.bounds[1] - last.u[j] else p.high
        return f"it stops at its limit, {end:g} {p.unit}".rstrip()
    i, correlation = last.partner(j)
    reach = min(float(last.half[j] / p.width), 1e9)
    text = f"its 90 % interval is {reach:.2g} times its plausible range to each side"
    if i >= 0 and abs(correlation) > 0.9:
        text += f", correlation {correlation:.3f} with {last.wanted[i].name}"
    return text + f"; condition {last.condition:.2g}"


def _found(last: Fit, j: int, both: Shares | None, own: tuple[float, float] | None) -> Found:
    p, u, half = last.wanted[j], float(last.u[j]), float(last.half[j])
    moves = [float(s.move[j]) if s else 0.0 for s in ((both.mesh, both.step) if both else ())] or [0.0, 0.0]
    quantile = float(student.ppf(0.5 + 0.5 * CONFIDENCE, max(last.freedom, 1)))
    covariance = both.covariance if both else last.covariance
    true, reach = u + sum(moves), quantile * float(np.sqrt(covariance[j, j]))
    return Found(
        p, p.of_u(u), p.of_u(u - half), p.of_u(u + half), p.of_u(u + moves[0]) - p.of_u(u),
        p.of_u(u + moves[1]) - p.of_u(u), p.of_u(true), p.of_u(true - reach), p.of_u(true + reach),
        (p.of_u(own[0]), p.of_u(own[1])) if own else None,
    )  # fmt: skip


def _profiles(
    last: Fit, problem: Problem, wanted: Wanted, say: Note, notes: list[str]
) -> dict[int, tuple[float, float]]:
    found = {}
    for j, p in enumerate(last.wanted):
        if not wanted.profile or p.nuisance:
            continue
        say(f"profile of {p.name}")
        try:
            found[j] = profile(last, problem, j, wanted.priors)
        except (FitError, StepError) as error:
            notes.append(f"no interval of {p.name}: {error}")
    return found


def _against(last: Fit, priors: Mapping[str, Prior]) -> list[str]:
    """Return a sentence for each value that is found far from what was known of it before."""
    found = []
    for p, u in zip(last.wanted, last.u.tolist(), strict=True):
        if p.name in priors and (off := abs(p.of_u(u) - priors[p.name].value) / priors[p.name].sd) > OUTLIER:
            found.append(
                f"the data and --prior disagree: the data give {p.name} = {p.of_u(u):.4g}, {off:.0f} standard "
                "deviations from the prior; check the units of both"
            )
    return found


def _by_parameters(last: Fit, problem: Problem) -> float:
    angle = np.array([c.angle for c in problem.measured.channels])
    kind = ~angle if (~angle).any() else angle
    J = last.jacobian[:, kind].reshape(-1, len(last.u))
    return float(np.sqrt(np.einsum("ij,jk,ik->i", J, last.covariance, J).mean()))


def _proposals(
    problem: Problem, asked: Sequence[Parameter], last: Fit, poses: FloatArray | None
) -> list[Proposal]:
    """Return the poses that would tell most of all that was asked for."""
    base, here, measured = problem.base, problem.at(last.u), problem.measured
    at = {p.name: float(u) for p, u in zip(last.wanted, last.u, strict=True)}
    u = np.array([at.get(p.name, p.to_u(p.value)) for p in asked])
    jacobian = rest_jacobian(here, asked, u, base, measured, problem.points)
    size = np.where([c.angle for c in measured.channels], last.sigma[1], last.sigma[0])
    use = np.isfinite(measured.values) & last.rows[:, None]
    now = (jacobian / size[None, :, None])[use]
    if poses is None:
        poses = candidates(measured, measured.joints(base.scene))
    return propose(problem, asked, u, last.sigma, poses, now)


def as_json(result: Identified) -> dict[str, Any]:
    """Return the numbers, SI."""
    return {
        "found": {
            f.parameter.name: {
                "value": f.value, "low": f.low, "high": f.high, "unit": f.parameter.unit, "mesh": f.mesh,
                "step": f.step, "true": f.true, "true_low": f.true_low, "true_high": f.true_high, "profile": f.profile,
            }
            for f in result.found
        },
        "untold": {u.parameter.name: u.why for u in result.untold},
        "alignment": {
            p.name: p.of_u(float(u)) for p, u in zip(result.fit.wanted, result.fit.u, strict=True) if p.nuisance
        },
        "before": result.before.as_json(),
        "after": result.after.as_json(),
        "held_before": result.held_before.as_json() if result.held_before else None,
        "held_after": result.held_after.as_json() if result.held_after else None,
        "sigma": result.fit.sigma,
        "condition": result.fit.condition,
        "mesh": result.mesh.size if result.mesh else None,
        "step": result.step.size if result.step else None,
        "parameters": result.parameters,
        "rest": result.left.as_json(),
        "outliers": result.fit.outliers,
        "proposals": [p.joints.tolist() for p in result.proposals],
        "notes": result.notes,
        "posterior": posterior_json(result.posterior),
    }  # fmt: skip
