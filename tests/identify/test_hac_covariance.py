"""Errors of a motion that hang together make intervals as long as they have to be; others leave them alone."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.identify.robots import MOVING, POSE, beam
from tripod_identify.csv_columns import Channel
from tripod_identify.fit import fit, profile
from tripod_identify.hac_covariance import HacCovariance
from tripod_identify.lack_of_fit import Smooth
from tripod_identify.measured import Measured
from tripod_identify.mesh_share import REST, _solve
from tripod_identify.model import plainly, predict
from tripod_identify.parameters import parameters
from tripod_identify.problem import Problem

ROWS, STEP, DRAWS = 120, 0.01, 250
TIP = tuple(Channel("tip", axis) for axis in range(3))
ANGLE = np.array([c.angle for c in POSE])
SIZE = np.where(ANGLE, 0.01, 3e-4)
NAMES = ("material.young", "load.0.mass", "frame.x")


def slopes() -> np.ndarray:
    """Derivatives as of a swing: one that grows in time, one that dies out, and one that stays."""
    t = STEP * np.arange(ROWS)[:, None]
    phase = np.arange(len(POSE))
    one = t * np.sin(2 * np.pi * 5 * t + phase)
    two = np.exp(-2 * t) * np.cos(2 * np.pi * 3 * t + 2 * phase)
    three = np.broadcast_to(0.3 * np.cos(phase), two.shape)
    return SIZE[:, None] * np.stack([3 * one, 3 * two, three], axis=-1)


class Linear:
    """What `fit` asks of a problem, of predictions that are slopes times u."""

    def __init__(self, values: np.ndarray, times: np.ndarray | None) -> None:
        self.measured = Measured(times, None, None, POSE, values)
        self.wanted = tuple(parameters(beam(), list(NAMES)))
        self.evaluations, self.begin = 0, np.array([p.to_u(p.value) for p in self.wanted])

    def start(self) -> np.ndarray:
        return self.begin

    def at(self, u: np.ndarray) -> SimpleNamespace:
        return SimpleNamespace(values=slopes() @ (u - self.begin))

    def jacobian(self, u: np.ndarray) -> np.ndarray:
        return slopes()


def errors(rng: np.random.Generator, kind: str) -> np.ndarray:
    """Errors of unit size: without memory, with one of 5 rows, or half of them with one of 15."""
    white = rng.standard_normal((2, ROWS, len(POSE)))
    if kind == "alone":
        return white[0]
    memory = np.exp(-1 / (5 if kind == "close" else 15))
    red = np.empty_like(white[0])
    red[0] = white[0, 0]
    for k in range(1, ROWS):
        red[k] = memory * red[k - 1] + np.sqrt(1 - memory**2) * white[0, k]
    return red if kind == "close" else np.sqrt(0.5) * (red + white[1])


def held(kind: str, times: np.ndarray | None) -> np.ndarray:
    """Return how often the 90 % interval of each value holds the truth, and its mean half."""
    rng, inside, halves = np.random.default_rng(8), [], []
    for _ in range(DRAWS):
        problem = Linear(SIZE * errors(rng, kind), times)
        found = fit(problem, np.ones(ROWS, dtype=bool), start=problem.begin)
        inside.append(np.abs(found.u - problem.begin) <= found.half)
        halves.append(found.half)
    return np.array([np.mean(inside, axis=0), np.mean(halves, axis=0)])


TIMES = STEP * np.arange(ROWS)


@pytest.mark.parametrize("kind", ["alone", "close", "far"])
def test_intervals_of_a_motion_hold_whatever_its_errors_remember(kind: str) -> None:
    share = held(kind, TIMES)[0]
    assert (share[:2] >= 0.85).all()
    assert share[2] >= (0.78 if kind == "far" else 0.84), "120 rows hardly tell a memory of 15 from an offset"
    assert (share <= 0.96).all()


def test_without_that_they_are_too_short() -> None:
    """As of poses, whose rows have nothing to do with each other."""
    assert (held("close", None)[0] < 0.7).all()


def test_errors_alone_make_intervals_that_are_no_longer_than_those_of_poses() -> None:
    np.testing.assert_allclose(held("alone", TIMES)[1], held("alone", None)[1], rtol=0.01)


@pytest.mark.slow
def test_intervals_hold_also_with_what_other_meshes_foretell() -> None:
    """The errors of mesh and noise as they are taken to be; values of noise alone as in the posterior, too."""
    rng, t = np.random.default_rng(9), TIMES[:, None]
    smooth = Smooth.of(t).squares(t)
    left = np.linalg.svd(smooth, full_matrices=False)[0] * np.sqrt(ROWS / smooth.shape[1])
    finer = SIZE * (0.3 + 2 * t * np.cos(2 * np.pi * 5 * t + np.arange(6)))
    other = SIZE * (np.exp(-3 * t) * np.cos(np.arange(6)))
    size = REST * np.sqrt(0.5 * ((finer**2).mean(axis=0) + (other**2).mean(axis=0)))
    inside, alone, drawn = [], [], []
    for _ in range(DRAWS):
        error = (1 + rng.standard_normal()) * finer + rng.standard_normal() * other
        error += size * (left @ rng.standard_normal((left.shape[1], 6)))
        problem = Linear(error + SIZE * errors(rng, "close"), TIMES)
        found = fit(problem, np.ones(ROWS, dtype=bool), start=problem.begin)
        amounts = _solve(problem, found, ([finer, other], []), smooth)
        off = found.u + sum(amounts.moves) - problem.begin
        inside.append(np.abs(off) <= 1.645 * np.sqrt(np.diag(amounts.all)))
        alone.append(np.abs(off) <= 1.645 * np.sqrt(np.diag(replace(amounts, cross=0 * amounts.cross).all)))
        drawn.append(np.diag(amounts.noise))
    assert (np.mean(inside, axis=0) >= 0.85).all()
    assert (np.mean(inside, axis=0) <= 0.96).all()
    assert np.mean(drawn) > 0
    print(np.mean(inside, axis=0), np.mean(alone, axis=0))


def test_the_profile_of_a_motion_is_as_long_as_its_interval() -> None:
    scene, times = beam(MOVING), np.arange(0, 0.3, 0.005)
    empty = Measured(times, None, None, TIP, np.zeros((len(times), 3)))
    seen = (
        predict(plainly(scene), empty, ())
        + 3e-4 * errors(np.random.default_rng(3), "close")[: len(times), :3]
    )
    problem = Problem(plainly(scene), parameters(scene, ["material.young"]), replace(empty, values=seen), ())
    found = fit(problem, np.ones(len(times), dtype=bool))
    assert found.longer[0] > 1.2
    low, high = profile(found, problem, 0)
    assert high - low == pytest.approx(2 * found.half[0], rel=0.1)


def nothing_fitted(rows: int) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros((rows, len(POSE), 1)), np.eye(1)


def test_the_spectrum_is_that_of_errors_which_remember() -> None:
    """Of one of five rows (1 - a²) / |1 - a exp(iw)|², whose mean is one."""
    rows, memory = 6000, np.exp(-1 / 5)
    rng = np.random.default_rng(5)
    red = rng.standard_normal((rows, len(POSE)))
    for k in range(1, rows):
        red[k] = memory * red[k - 1] + np.sqrt(1 - memory**2) * red[k]
    use = np.ones(red.shape, dtype=bool)
    use[::7] = False  # missing rows change nothing
    found = HacCovariance.of(np.where(use, red, np.nan), use, ANGLE, *nothing_fitted(rows))
    w = np.linspace(0, np.pi, rows + 1)
    expected = (1 - memory**2) / np.abs(1 - memory * np.exp(1j * w)) ** 2
    for spectrum in found.spectra:
        assert np.abs(spectrum - expected).max() < 0.12 * expected.max()
        assert spectrum[0] == pytest.approx(expected[0], rel=0.12)
    assert found.worth(use) == pytest.approx(use.sum() / ((1 + memory**2) / (1 - memory**2)), rel=0.1)
    slow, quick = np.ones((rows, 6, 1)), np.tile([1.0, -1.0], rows // 2)[:, None, None] * np.ones((1, 6, 1))
    for column, at in ((slow, 0), (quick, -1)):
        more = found.more(column)[0, 0] / (6 * rows) + 1
        assert more == pytest.approx(expected[at], rel=0.2)


def test_of_few_rows_or_none_nothing_is_said() -> None:
    for rows in (1, 2, 3):
        use = np.ones((rows, 6), dtype=bool)
        found = HacCovariance.of(np.zeros((rows, 6)), use, ANGLE, *nothing_fitted(rows))
        assert found.spectra is None
        assert not found.more(np.ones((rows, 6, 2))).any()
        assert found.worth(use) == 6 * rows
