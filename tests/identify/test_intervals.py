"""What an identification left unknown becomes the expected error of poses, and its bars hold."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.identify.robots import POSE as CHANNELS
from tests.identify.robots import commands, measured, tripod
from tests.messages import assert_names, raises_naming
from tripod_bringup.ik_command import expected_error, solution_rows
from tripod_identify.errors import DataError
from tripod_identify.identify import Wanted, identify
from tripod_identify.identify import as_json as result_json
from tripod_identify.intervals import (
    POSE,
    Linearised,
    Posterior,
    as_json,
    bars_of,
    pose_bars,
    posterior_from_json,
    read_posterior,
)
from tripod_identify.lack_of_fit import Smooth
from tripod_identify.measured import Measured
from tripod_identify.mesh_share import FACTOR, Amounts
from tripod_identify.model import plainly, predict
from tripod_identify.parameters import parameters, told
from tripod_identify.problem import refined
from tripod_ik.solve_once import solve_once

SCENE = tripod("servos.slide=0.02")
SD = {
    "material.young": 0.05,
    "servos.zero.0": 0.01,
    "servos.zero.1": 0.01,
    "servos.zero.2": 0.01,
    "servos.slide": 5e-4,
}
VALUES = {"material.young": SCENE.material.young, **dict.fromkeys(list(SD)[1:4], 0.0), "servos.slide": 0.02}
ANGLES = np.array([[-1.0, -1.2, -0.8], [-0.5, -0.4, -0.7], [-1.3, -1.2, -1.3]])
SLIDES = np.full(3, 0.02)


def posterior(amounts: Amounts | None = None, smooth: Smooth | None = None) -> Posterior:
    noise = np.diag([sd**2 for sd in SD.values()])
    noise[1, 2] = noise[2, 1] = 0.6 * noise[1, 1]
    return Posterior(VALUES, 10_000, amounts, smooth, tuple(range(6)), repr(SCENE.mesh), noise)


def poses(values: dict[str, float], scene=SCENE) -> np.ndarray:
    wanted = parameters(scene, list(values))
    assumed = told(plainly(scene), wanted, np.array([p.to_u(values[p.name]) for p in wanted]))
    return predict(assumed, Measured(None, ANGLES, None, POSE, np.zeros((3, 6))), ())


@pytest.mark.slow
def test_bars_hold_nine_of_ten_robots_drawn_from_the_posterior() -> None:
    known = posterior()
    bars = pose_bars(SCENE, known, ANGLES, SLIDES)
    assert not bars.known
    assert np.isnan(bars.mesh).all()
    rng, root, inside = np.random.default_rng(3), np.linalg.cholesky(known.noise), []
    for _ in range(40):
        draw = root @ rng.standard_normal(len(SD))
        values = {
            n: v * np.exp(d) if n == "material.young" else v + d
            for (n, v), d in zip(VALUES.items(), draw, strict=True)
        }
        inside.append(np.abs(poses(values) - bars.poses) <= bars.half)
    assert 0.85 <= np.mean(inside) <= 0.95


def amounts(count: int, sizes: np.ndarray, follow: float = 0.0) -> Amounts:
    """One change, of a finer mesh, that is there once and known to 0.3; then `count` polynomials of six numbers."""
    q = 1 + 6 * count
    covariance = np.diag([0.3**2, *np.full(q - 1, 0.1**2)])
    back = np.zeros((len(SD), q))
    back[4, 0] = follow
    mean = np.zeros(q)
    mean[0] = 1.0
    return Amounts(posterior().noise, back, mean, covariance, 1, 0, np.eye(10)[:, :count], sizes, 0 * back)


def test_the_mesh_shifts_the_pose_by_what_the_values_have_not_made_good() -> None:
    finer = FACTOR * (poses(VALUES, refined(plainly(SCENE)).scene) - poses(VALUES))
    known = posterior()
    plain = pose_bars(SCENE, known, ANGLES, SLIDES)
    along = Smooth.of(np.column_stack([commands(12)[0], np.full(12, 0.02)]))
    sizes = np.array([1e-4, 2e-4, 3e-4, 1e-2, 1e-2, 1e-2])
    bars = pose_bars(SCENE, posterior(amounts(1, sizes), along), ANGLES, SLIDES)
    assert bars.known
    assert bars.mesh == pytest.approx(finer, abs=2e-6)
    assert not bars.steps.any()
    assert bars.by_values == pytest.approx(plain.half)
    unknown = known.quantile * np.sqrt((0.3 * finer) ** 2 + (0.1 * sizes) ** 2)
    assert bars.by_mesh == pytest.approx(unknown, rel=0.02)
    assert bars.half == pytest.approx(np.hypot(bars.by_values, bars.by_mesh))
    # the slide has gone along: taken back, the pose moves by that, too
    moved = poses(VALUES | {"servos.slide": 0.02 - 1e-5}) - poses(VALUES)
    followed = pose_bars(SCENE, posterior(amounts(1, sizes, 1e-5), along), ANGLES, SLIDES)
    assert followed.mesh - bars.mesh == pytest.approx(moved, abs=1e-6)


def test_noise_of_a_motion_that_goes_with_the_amounts_is_in_the_bars() -> None:
    """Noise and amounts drawn together: the bars hold nine of ten errors, but not without what both share."""
    rng, a = np.random.default_rng(4), amounts(1, np.full(6, 1e-4), 2e-3)
    joint = np.block([[a.noise, np.zeros_like(a.follow)], [np.zeros_like(a.follow).T, a.covariance]])
    joint[4, 5] = joint[5, 4] = -0.8 * np.sqrt(joint[4, 4] * joint[5, 5])
    a = replace(a, cross=joint[:5, 5:])
    J = np.zeros((1, 6, 5))
    J[0, :, 4] = 1.0
    at = Linearised(
        np.zeros((1, 6)),
        J,
        np.concatenate([np.full((1, 6, 1), 1e-3), np.zeros((1, 6, 6))], 2),
        np.zeros((1, 6)),
    )
    draws = np.linalg.cholesky(joint) @ rng.standard_normal((12, 4000))
    c = a.mean[:, None] + draws[5:]
    error = J[0] @ (draws[:5] - a.follow @ c) + at.columns[0] @ c
    for known, low, high in ((a, 0.88, 0.92), (replace(a, cross=0 * a.cross), 0.0, 0.85)):
        bars = bars_of(at, replace(posterior(), amounts=known))
        inside = np.abs(error - (bars.mesh + bars.steps)[0, :, None]) <= bars.half[0, :, None]
        assert low < inside.mean() < high


@pytest.fixture(scope="module")
def result():
    """A Tripod of which the zeros and the slide were identified from twelve poses."""
    truth = told(plainly(SCENE), parameters(SCENE, ["servos.zero.0", "servos.slide"]), np.array([0.3, 2.1]))
    data = measured(truth, commands(12)[0], None, CHANNELS, (3e-4, 0.01))
    wanted = Wanted(("servos.zero", "servos.slide"), "translation", mesh=False, propose=False)
    return identify(SCENE, data, (), wanted)


def test_the_json_of_an_identification_gives_bars_to_the_answer_of_ik(result, tmp_path: Path) -> None:
    file = tmp_path / "robot.json"
    file.write_text(json.dumps(result_json(result), default=list))
    known = read_posterior(file)
    assert list(known.values) == ["servos.zero.0", "servos.zero.1", "servos.zero.2", "servos.slide"], (
        "no frame"
    )
    for j, found in enumerate(result.found):
        assert known.quantile * np.sqrt(known.noise[j, j]) == pytest.approx(0.5 * (found.high - found.low))
    scene, slide = result.told.scene, result.told.scene.servos.slide
    middle = pose_bars(scene, known, ANGLES[:1], np.array([slide])).poses[0, :3]
    answer = solve_once(scene, middle, slide=slide, start=ANGLES[0])
    answer |= expected_error(scene, file, answer, slide)
    half = answer["expected_error"]["half"]
    assert half == pytest.approx(
        pose_bars(scene, known, np.array([answer["angles"]]), np.array([slide])).half[0]
    )
    rows = solution_rows(answer)
    at = next(i for i, (name, _) in enumerate(rows) if name == "expected error")
    assert f"+0.000 ± {1e3 * half[0]:.3f}" in rows[at][1]
    assert_names(rows[at + 2][1], "mesh", "steps", "not known")
    with raises_naming(DataError, f"--slide {slide:.6f}", f"{slide:.6f} m", "0.035 m"):
        expected_error(scene, file, answer, 0.035)
    with raises_naming(DataError, "--posterior", "another pose", "mm"):
        expected_error(scene, file, answer | {"position": [0.0, 0.0, 0.1]}, slide)


def test_a_posterior_comes_back_from_json_whole() -> None:
    along = Smooth.of(commands(12)[0])
    before = posterior(amounts(10, np.full(6, 1e-4), 1e-4), along)
    after = posterior_from_json(json.loads(json.dumps(as_json(before))))
    assert as_json(after) == as_json(before)
    assert after.amounts.terms.shape == (10, 10)


def test_another_scene_and_a_broken_file_are_refused(tmp_path: Path) -> None:
    known, other = posterior(amounts(1, np.full(6, 1e-4))), replace(SCENE, mesh=replace(SCENE.mesh, level=2))
    remedy = "tripod identify --out"
    with raises_naming(DataError, "material.young", "250000 Pa", "'tripod'", 300000, remedy):
        pose_bars(tripod("servos.slide=0.02", "material.young=300e3"), known, ANGLES, SLIDES)
    with raises_naming(DataError, "level=2", "'tripod'", remedy):
        pose_bars(other, known, ANGLES, SLIDES)
    file = tmp_path / "robot.json"
    for text, named in (
        ("{}", ("no posterior", "--json > robot.json")),
        ("no json", ("no posterior", "--json > robot.json")),
        ('{"posterior": ' + "[" * 100_000, ("no posterior", "--json > robot.json")),
        (
            json.dumps({"posterior": as_json(known) | {"noise": json.loads("[" * 500 + "]" * 500)}}),
            ("tripod identify --json",),
        ),
        ('{"posterior": {}}', ("tripod identify --json",)),
        (json.dumps({"posterior": as_json(known) | {"noise": [[1.0]]}}), ("tripod identify --json",)),
        (
            json.dumps({"posterior": as_json(known) | {"values": {"servos.slide": float("nan")}}}),
            ("tripod identify --json",),
        ),
    ):
        file.write_text(text)
        with raises_naming(DataError, file, *named):
            read_posterior(file)
    with raises_naming(DataError, tmp_path / "missing.json"):
        read_posterior(tmp_path / "missing.json")
