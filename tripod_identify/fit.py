"""Values that fit data best, robustly, and how well the data tell them.

Least is the sum of rho((y - f(u)) / sigma) over all numbers y that were measured, with Cauchy's

    rho(r) = c² log(1 + (r / c)²) / 2,    c = 2.385,

which takes 95 % of what least squares would of normal errors, and next to nothing of wrong rows [HollandWelsch1977].
sigma, one of places and one of rotations, is the median absolute residual over 0.6745, found along with u; the p
smallest are left out of it [StreetEtAl1988]. With
J = df/du / sigma, psi = rho', n numbers and p values the covariance of u is [Huber1981, section 7.6]

    (J^T J)^-1  mean(psi²) n / (n - p) / mean(psi')².

Errors of one motion hang together in time: then it is longer by what `together` says of them.

What is assumed of a value before (a prior) is a row of its own.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import t as student

from tripod_host.arrays import FloatArray
from tripod_identify.errors import DataError, FitError
from tripod_identify.hac_covariance import HacCovariance
from tripod_identify.parameters import Parameter, told
from tripod_identify.problem import Problem
from tripod_sim.errors import SceneError, StepError

CAUCHY = 2.385
"""c."""

CLOSE = ((1e-5, 1e-7), (1e-4, 1e-4))
"""To which share of u and of the sum it is made least, of poses and of motions, which are solved less closely."""

REACH = 2.0
"""Plausible widths that values of a motion may go in a round: with a swing that is out of step derivatives mislead."""

SOONER = (0.25, 0.5)
"""Shares of a motion that are fitted first, one after the other: at its beginning its swing is hardly out of step."""

FINEST = (1e-6, 1e-6)
"""sigma is not taken to be less [m, rad]."""

ROUNDS = 12
"""Of u and sigma in turn, at most; they end where sigma changes by less than SETTLED."""

SETTLED = 0.02

CONFIDENCE = 0.90
"""Of the intervals."""

TOLD = 0.5
"""A value is told by the data where half its interval is at most this share of what was plausible before."""

AT_BOUND = 1e-3
"""Distance from a bound, over the plausible width, below which a value stands at it."""

OUTLIER = 6.0
"""A row that is further off than so many sigma is named."""

USUAL = (1e-3, 1e-2)
"""Errors of places [m] and rotations [rad], before they are known."""

SAME = 1e-6
"""Values count as doing the same where the smallest singular value of the Jacobian is this share of the largest."""

RIDGE = 30.0
"""Plausible widths: so weakly is each value held to where a fit begins, that it stays where the data say nothing."""

Note = Callable[[str], None]


@dataclass(frozen=True)
class Prior:
    """What is known of a value before: its mean and standard deviation, in SI."""

    value: float
    sd: float


@dataclass(frozen=True, eq=False)
class Fit:
    """Values and what is known of them.

    Attributes:
        wanted: The parameters, p of them.
        u: Their values as fitted, shape (p,).
        covariance: Of u, by noise alone, shape (p, p); infinite variance where the data say nothing.
        inverse: (J^T J)^-1; times `spread` it is the covariance where no error has to do with another.
        sigma: Of places [m] and rotations [rad].
        freedom: Numbers less parameters, as many of them as are worth one of their own.
        jacobian: d values / du at `u`, shape (k, m, p).
        values: Predicted [m, rad], shape (k, m).
        condition: Of the Jacobian, its columns in plausible widths.
        correlations: Of u, shape (p, p).
        rows: Used, shape (k,).
        outliers: Rows that were taken to be wrong, counted from 1.
        spread: mean(psi²) n / (n - p) / mean(psi')², the variance of `pseudo_residuals`; n - p less where errors hang
            together, of which the fit takes more along.
    """

    wanted: tuple[Parameter, ...]
    u: FloatArray
    covariance: FloatArray
    inverse: FloatArray
    sigma: tuple[float, float]
    freedom: int
    jacobian: FloatArray
    values: FloatArray
    condition: float
    correlations: FloatArray
    rows: NDArray[np.bool_]
    outliers: tuple[int, ...]
    spread: float

    @property
    def sound(self) -> NDArray[np.bool_]:
        """Rows that were used and not taken to be wrong, shape (k,); all that were used if none is right."""
        right = self.rows.copy()
        right[np.array(self.outliers, dtype=np.int64) - 1] = False
        return right if right.any() else self.rows

    @property
    def half(self) -> FloatArray:
        """Half the interval of u by noise, shape (p,)."""
        quantile = float(student.ppf(0.5 + 0.5 * CONFIDENCE, max(self.freedom, 1)))
        return np.asarray(quantile * np.sqrt(np.diag(self.covariance)))

    @property
    def longer(self) -> FloatArray:
        """How many times as long as if no error had to do with another, shape (p,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance) / (self.spread * np.diag(self.inverse))))

    @property
    def told(self) -> NDArray[np.bool_]:
        """Which values the data tell, shape (p,)."""
        width = np.array([p.width for p in self.wanted])
        return np.asarray((self.half <= TOLD * width) & ~self.at_bound)

    @property
    def at_bound(self) -> NDArray[np.bool_]:
        """Which stand at a bound, shape (p,)."""
        bounds = np.array([p.bounds for p in self.wanted]).reshape(-1, 2)
        near = AT_BOUND * np.array([p.width for p in self.wanted])
        return np.asarray((self.u <= bounds[:, 0] + near) | (self.u >= bounds[:, 1] - near))

    def partner(self, j: int) -> tuple[int, float]:
        """Return with which other value one is correlated most, and how; -1 where there is none."""
        row = self.correlations[j].copy()
        row[j] = 0.0
        i = int(np.argmax(np.abs(row)))
        return (i, float(row[i])) if len(row) > 1 else (-1, 0.0)


@dataclass(eq=False)
class _Weights:
    """Which numbers count, and what they are divided by."""

    use: NDArray[np.bool_]
    angle: NDArray[np.bool_]
    sigma: FloatArray = field(default_factory=lambda: np.ones(2))

    @property
    def scale(self) -> FloatArray:
        return np.broadcast_to(np.where(self.angle, self.sigma[1], self.sigma[0]), self.use.shape)[self.use]


def fit(
    problem: Problem, rows: NDArray[np.bool_], priors: Mapping[str, Prior] | None = None,
    start: FloatArray | None = None, note: Note | None = None,
) -> Fit:  # fmt: skip
    """Return the values that fit best.

    Args:
        problem: Data and parameters.
        rows: That count, shape (k,).
        priors: Of some parameters, by name.
        start: u to begin with; None: where the parameters say.
        note: Told what happens, one line each.

    Raises:
        DataError: fewer numbers than parameters.
        FitError: no values were found.
        SceneError, StepError: the start cannot be computed.
    """
    measured, wanted = problem.measured, problem.wanted
    count = len(wanted)
    use = np.isfinite(measured.values) & rows[:, None]
    weights = _Weights(use, np.array([c.angle for c in measured.channels]))
    sums = _Sums(problem, weights, priors or {})
    number = enough(problem, rows, priors or {})
    u = _in_step(problem, rows, priors or {}) if start is None else start.copy()
    weights.sigma = _sigma(measured.values - problem.at(u).values, weights, 0)
    for turn in range(ROUNDS):
        before, u = u, sums.least(u)
        sigma = _sigma(measured.values - problem.at(u).values, weights, count)
        moved = float(np.abs(np.log(sigma / weights.sigma)).max())
        if note:
            note(f"round {turn + 1}: {_size(sigma, weights.angle)}, {problem.evaluations} predictions")
        weights.sigma = sigma
        if moved < SETTLED and not sums.ends(before, u):
            return _known(sums, u, rows, number)
    raise FitError(f"the size of the errors was not found in {ROUNDS} rounds; are most of the rows wrong?")


def _in_step(problem: Problem, rows: NDArray[np.bool_], priors: Mapping[str, Prior]) -> FloatArray:
    """Return where to begin: of a motion with values that fit longer and longer beginnings of it.

    All of it may be fitted best, near by, by a modulus that makes it swing once more or less than it does; from there
    it takes many rounds, each of predictions of all of it. What a beginning does not tell is held within plausible
    widths.
    """
    u, measured = problem.start(), problem.measured
    for share in SOONER if measured.times is not None else ():
        assert measured.times is not None
        early = measured.times <= measured.times[0] + share * (measured.times[-1] - measured.times[0])
        part = Problem(problem.base, problem.wanted, measured.rows(early), problem.points)
        use = np.isfinite(part.measured.values) & rows[early, None]
        if use.sum() <= len(u):
            continue
        weights = _Weights(use, np.array([c.angle for c in measured.channels]))
        weights.sigma = _sigma(part.measured.values - part.at(u).values, weights, 0)
        u = _Sums(part, weights, priors, ridge=1.0).least(u, 10.0)
    return u


def enough(problem: Problem, rows: NDArray[np.bool_], priors: Mapping[str, Prior]) -> int:
    """Return how many numbers count. Raises DataError where they do not suffice for the parameters."""
    names = [p.name for p in problem.wanted]
    number = int((np.isfinite(problem.measured.values) & rows[:, None]).sum())
    if number + sum(name in priors for name in names) < len(names) + 1:
        raise DataError(
            f"{number} measured numbers for {len(names)} values ({', '.join(names)}): too few; give more "
            "rows, or fit fewer values"
        )
    return number


class _Sums:
    """The sum to be made least, with its rows and their derivatives."""

    def __init__(
        self, problem: Problem, weights: _Weights, priors: Mapping[str, Prior], ridge: float = RIDGE
    ) -> None:
        self.problem, self.weights = problem, weights
        self._reach = REACH * np.array([p.width for p in problem.wanted])
        self._held = 1.0 / (ridge * np.array([p.width for p in problem.wanted]))
        self._begin = problem.start()
        self.known = [(j, p, priors[p.name]) for j, p in enumerate(problem.wanted) if p.name in priors]

    def residual(self, u: FloatArray) -> FloatArray:
        """Return what is squared: errors over their size, then priors; NaN where there is no prediction."""
        weights, measured = self.weights, self.problem.measured
        try:
            values = self.problem.at(u).values
        except (SceneError, StepError):
            return np.full(int(weights.use.sum()) + len(self.known), np.nan)  # the step is shortened
        prior = [(u[j] - p.to_u(q.value)) * p.slope(p.to_u(q.value)) / q.sd for j, p, q in self.known]
        return np.concatenate([(values - measured.values)[weights.use] / weights.scale, prior])

    def slope(self, u: FloatArray) -> FloatArray:
        """Return the derivatives of `residual`."""
        jacobian = self.problem.jacobian(u)[self.weights.use] / self.weights.scale[:, None]
        own = np.zeros((len(self.known), len(u)))
        for i, (j, p, q) in enumerate(self.known):
            own[i, j] = p.slope(p.to_u(q.value)) / q.sd
        return np.concatenate([jacobian, own])

    def ends(self, begin: FloatArray, end: FloatArray) -> bool:
        """Return whether a value went as far as it may in a round: it might go on in another one."""
        if self.problem.measured.times is None:
            return False
        return bool((np.abs(end - begin) > 0.99 * self._reach).any())

    def cost(self, u: FloatArray) -> float:
        """Return the sum."""
        return float(0.5 * CAUCHY**2 * np.log1p((self.residual(u) / CAUCHY) ** 2).sum())

    def least(self, u: FloatArray, tolerance: float = 1.0) -> FloatArray:
        """Return where the sum is least, near `u`, to so many times `CLOSE`. Raises FitError."""
        xtol, ftol = (tolerance * close for close in CLOSE[self.problem.measured.times is not None])
        lows, highs = (np.array(b) for b in zip(*(p.bounds for p in self.problem.wanted), strict=True))
        if self.problem.measured.times is not None:
            lows, highs = np.maximum(lows, u - self._reach), np.minimum(highs, u + self._reach)
        found = least_squares(
            lambda v: np.concatenate([self.residual(v), self._held * (v - self._begin)]),
            np.clip(u, lows + 1e-9, highs - 1e-9),
            lambda v: np.concatenate([self.slope(v), np.diag(self._held)]), bounds=(lows, highs), loss="cauchy",
            f_scale=CAUCHY, x_scale="jac", xtol=xtol, ftol=ftol, gtol=1e-12, max_nfev=40,
        )  # fmt: skip
        if not np.isfinite(found.cost):
            raise FitError(
                "no values were found: the predictions are not finite; are units and signs of the data right?"
            )
        if found.status == 0:
            raise FitError(
                f"no convergence after {self.problem.evaluations} predictions; are units and signs of the data right?"
            )
        return np.asarray(found.x)


def hopeless(problem: Problem, rows: NDArray[np.bool_], priors: Mapping[str, Prior]) -> dict[int, str]:
    """Return which values no data like these could tell, and why: others, named before them, do the same."""
    use = np.isfinite(problem.measured.values) & rows[:, None]
    angle = np.array([c.angle for c in problem.measured.channels])
    sums = _Sums(problem, _Weights(use, angle, np.array(USUAL)), priors)
    scaled = sums.slope(problem.start()) * np.array([p.width for p in problem.wanted])
    found: dict[int, str] = {}
    kept: list[int] = []
    for j in range(scaled.shape[1]):
        sizes = np.linalg.svd(scaled[:, [*kept, j]], compute_uv=False)
        if len(sizes) > len(kept) and sizes.min() > SAME * max(float(sizes.max()), SAME):
            kept.append(j)
            continue
        found[j] = "no measured number depends on it"
        if kept and np.linalg.norm(scaled[:, j]) > SAME:
            mixture = np.abs(np.linalg.lstsq(scaled[:, kept], scaled[:, j], rcond=None)[0])
            names = [
                problem.wanted[i].name for i, m in zip(kept, mixture, strict=True) if m > 0.05 * mixture.max()
            ]
            found[j] = (
                f"{' and '.join(names)} have the same effect on these data; fit one of them, or give the "
                "other a --prior"
            )
    return found


def profile(
    fit: Fit, problem: Problem, j: int, priors: Mapping[str, Prior] | None = None
) -> tuple[float, float]:
    """Return the interval of one u by the profile of the sum: all others are fitted again at each of its values.

    The ends are where twice the sum, over mean(psi²) / mean(psi'), has grown by the square of Student's quantile; by as
    many times more as the variance is longer because errors hang together. They need not be as far to both sides, as
    those by the covariance are.

    Args:
        fit: Of `problem`.
        problem: With at least two parameters, or one.
        j: Which.
        priors: As in the fit.

    Raises:
        FitError: the others were not found, or no end.
    """
    weights = _Weights(
        np.isfinite(problem.measured.values) & fit.rows[:, None],
        np.array([c.angle for c in problem.measured.channels]),
        np.array(fit.sigma),
    )
    sums = _Sums(problem, weights, priors or {})
    lowest, (_, ratio) = sums.cost(fit.u), _robust(sums.residual(fit.u)[: int(weights.use.sum())])
    wanted = float(fit.longer[j] * student.ppf(0.5 + 0.5 * CONFIDENCE, max(fit.freedom, 1)))
    mine, others = problem.wanted[j], [i for i in range(len(fit.u)) if i != j]

    def root(value: float) -> float:
        fixed = told(problem.base, [mine], np.array([value]))
        part = Problem(fixed, [problem.wanted[i] for i in others], problem.measured, problem.points)
        beside = _Sums(part, weights, {k: q for k, q in (priors or {}).items() if k != mine.name})
        slide = fit.covariance[others, j] / fit.covariance[j, j] * (value - fit.u[j])
        cost = (
            beside.cost(beside.least(fit.u[others] + slide, 10.0)) if others else sums.cost(np.array([value]))
        )
        if mine.name in (priors or {}):
            q = (priors or {})[mine.name]
            cost += 0.5 * CAUCHY**2 * np.log1p(((mine.of_u(value) - q.value) / q.sd / CAUCHY) ** 2)
        return float(np.sqrt(max(2 * (cost - lowest) / ratio, 0.0)))

    ends = []
    for side, bound in zip((-1.0, 1.0), mine.bounds, strict=True):
        reach = float(fit.half[j])
        for _ in range(6):  # the root grows nearly in proportion
            value = fit.u[j] + side * reach
            if (value - bound) * side >= 0:
                reach = abs(bound - fit.u[j])
                break
            got = root(value)
            if abs(got - wanted) < 0.03 * wanted:
                break
            reach *= float(np.clip(wanted / max(got, 1e-6), 0.3, 3.0))
        else:
            raise FitError(f"the interval of {mine.name} has no end within {reach:.3g} of its value")
        ends.append(float(fit.u[j] + side * reach))
    return ends[0], ends[1]


def pseudo_residuals(residual: FloatArray) -> FloatArray:
    """Return psi(r) / mean(psi'): linear least squares with these goes on from a robust fit [Huber1981]."""
    z = (residual / CAUCHY) ** 2
    return np.asarray(residual / (1 + z) / max(float(((1 - z) / (1 + z) ** 2).mean()), 0.1))


def _robust(residual: FloatArray) -> tuple[float, float]:
    """Return mean(psi²) / mean(psi')² and mean(psi²) / mean(psi')."""
    z = (residual / CAUCHY) ** 2
    psi, bend = residual / (1 + z), (1 - z) / (1 + z) ** 2
    square, slope = float((psi**2).mean()), max(float(bend.mean()), 0.1)
    return square / slope**2, square / slope


def _size(sigma: FloatArray, angle: NDArray[np.bool_]) -> str:
    parts = [] if angle.all() else [f"places to {1e3 * sigma[0]:.3f} mm"]
    return ", ".join(parts + ([f"rotations to {np.degrees(sigma[1]):.3f} degrees"] if angle.any() else []))


def _sigma(residuals: FloatArray, weights: _Weights, count: int) -> FloatArray:
    """Return the size of errors of places and rotations, as if they were normal.

    Of `count` values that were fitted so many residuals may be next to nothing whatever the errors are, so the smallest
    are left out [StreetEtAl1988]: with few rows the others would be taken for outliers else.
    """
    found = np.array(FINEST)
    total = int(weights.use.sum())
    for i, kind in enumerate((~weights.angle, weights.angle)):
        own = residuals[:, kind][weights.use[:, kind]]
        if own.size:
            left_out = min(round(count * own.size / total), own.size - 1)
            size = float(np.median(np.sort(np.abs(own))[left_out:])) / 0.6745
            found[i] = max(size, FINEST[i])
    return found


def _known(
    sums: _Sums, u: FloatArray, rows: NDArray[np.bool_], number: int
) -> Fit:  # fmt: skip
    """Return what is known at the end of a fit."""
    problem, weights, slope, residual = sums.problem, sums.weights, sums.slope(u), sums.residual(u)
    wanted = problem.wanted
    count = len(wanted)
    width = np.array([p.width for p in wanted])
    _, sizes, vt = np.linalg.svd(slope * width, full_matrices=False)
    smallest = max(1e-10 * float(sizes.max(initial=0.0)), 1e-12)
    back = np.where(sizes > smallest, 1 / np.maximum(sizes, smallest), 1e12)
    inverse = (vt.T * back**2) @ vt
    together, more = HacCovariance(None, weights.angle), np.zeros((count, count))
    if problem.measured.times is not None:
        errors, columns = np.zeros(weights.use.shape), np.zeros((*weights.use.shape, count))
        errors[weights.use] = pseudo_residuals(residual[:number])
        columns[weights.use] = slope[:number] * width
        together = HacCovariance.of(errors, weights.use, weights.angle, columns, inverse)
        more = inverse @ together.more(columns)
    used = count + float(np.trace(more))
    spread = _robust(residual[:number])[0] * len(residual) / max(len(residual) - used, 1)
    freedom = max(round(together.worth(weights.use)) + len(residual) - number - count, 1)
    covariance = spread * (inverse + more @ inverse)
    sd = np.sqrt(np.diag(covariance))
    correlations = covariance / np.outer(sd, sd)
    solved = problem.at(u)
    errors = (problem.measured.values - solved.values) / np.where(
        weights.angle, weights.sigma[1], weights.sigma[0]
    )
    worst = np.nanmax(np.abs(np.where(weights.use, errors, 0.0)), axis=1)
    outliers = tuple((np.flatnonzero(worst > OUTLIER) + 1).tolist())
    condition = float(sizes.max() / sizes.min()) if sizes.size and sizes.min() > 0 else np.inf
    sigma = (float(weights.sigma[0]), float(weights.sigma[1]))
    return Fit(
        wanted, u, covariance * np.outer(width, width), inverse * np.outer(width, width), sigma, freedom,
        problem.jacobian(u), solved.values, condition, correlations, rows, outliers, spread,
    )  # fmt: skip
