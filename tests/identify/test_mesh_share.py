"""What other meshes foretell goes into the intervals as an error that all poses share."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.identify.robots import PLACE, beam
from tests.messages import raises_naming
from tripod_identify.fit import Fit, _robust
from tripod_identify.lack_of_fit import Smooth
from tripod_identify.mesh_share import REST, _solve
from tripod_identify.model import plainly
from tripod_identify.parameters import parameters
from tripod_identify.problem import other_elements, refined
from tripod_sim import load_scene
from tripod_sim.errors import SceneError

ROWS, SIGMA, DRAWS = 30, 3e-4, 400


def held(shared: float, rows: int = ROWS, more: int = 0) -> float:
    """Return how many of the 90 % intervals hold the truth of a linear model, its errors drawn as they are taken to be.

    `shared`: by how much the errors of the mesh in truth are larger; `more`: values besides two.
    """
    rng = np.random.default_rng(5)
    along = rng.uniform(-1, 1, (rows, 3))
    smooth = Smooth.of(along).squares(along)
    left = np.linalg.svd(smooth, full_matrices=False)[0] * np.sqrt(rows / smooth.shape[1])
    slope = rng.standard_normal((rows, 3, 2)) * 1e-3 + np.array([[2e-3, 0], [0, 2e-3], [1e-3, 1e-3]])
    slope = np.concatenate([slope, 1e-3 * rng.standard_normal((rows, 3, more))], axis=2)
    finer = 3e-4 * np.array([1.0, 0.5, -0.5]) + 1e-4 * along
    other = 3e-4 * np.array([-1.0, 0.5, 1.0]) * (1 + 0.3 * along[:, :1])
    size = REST * np.sqrt(0.5 * ((finer**2).mean(axis=0) + (other**2).mean(axis=0)))
    A = slope.reshape(-1, 2 + more)
    count = 0
    for _ in range(DRAWS):
        error = (1 + rng.standard_normal()) * finer + rng.standard_normal() * other
        error += size * (left @ rng.standard_normal((left.shape[1], 3)))
        y = shared * error + SIGMA * rng.standard_normal((rows, 3))  # the truth is u = 0
        u = np.linalg.lstsq(A, y.ravel(), rcond=None)[0]
        residual = y - slope @ u
        sigma = float(np.median(np.sort(np.abs(residual).ravel())[2 + more :])) / 0.6745
        spread = _robust(residual.ravel() / sigma)[0] * y.size / (y.size - 2 - more)
        wanted = tuple(parameters(beam(), ["load.0.mass", "material.young"]))
        inverse = sigma**2 * np.linalg.inv(A.T @ A)
        fit = Fit(
            wanted, u, spread * inverse, inverse, (sigma, 1.0), y.size - 2 - more, slope, slope @ u, 1.0,
            np.eye(2 + more), np.ones(rows, dtype=bool), (), spread,
        )  # fmt: skip
        problem = SimpleNamespace(measured=SimpleNamespace(channels=PLACE, values=y, times=None))
        amounts = _solve(problem, fit, ([finer, other], []), smooth)
        true = u + sum(amounts.moves)
        count += int((np.abs(true) <= 1.645 * np.sqrt(np.diag(amounts.all))).sum())
    return count / ((2 + more) * DRAWS)


def test_intervals_hold_what_all_poses_share() -> None:
    assert 0.85 <= held(1.0) <= 0.95


def test_intervals_hold_also_where_rows_are_too_few_to_tell_noise_apart() -> None:
    assert 0.85 <= held(1.0, 10, 12) <= 0.97


def test_intervals_are_too_short_for_errors_that_are_three_times_as_large() -> None:
    """So the test above would see bars that are too short, or endless."""
    assert held(3.0) < 0.8


def test_rows_that_are_wrong_tell_nothing_of_the_mesh() -> None:
    """There a finer mesh may have snapped elsewhere, too, and its change be of another size altogether."""
    rng, spoilt = np.random.default_rng(6), 4
    along = rng.uniform(-1, 1, (ROWS, 3))
    smooth, slope = Smooth.of(along).squares(along), rng.standard_normal((ROWS, 3, 1))
    change, values = 1e-3 * rng.standard_normal((2, ROWS, 3))
    fit = Fit(
        tuple(parameters(beam(), ["load.0.mass"])), np.zeros(1), np.eye(1), np.eye(1), (1e-3, 1.0), 3 * ROWS - 1, slope,
        np.zeros((ROWS, 3)), 1.0, np.eye(1), np.ones(ROWS, dtype=bool), (spoilt + 1,), 1.0,
    )  # fmt: skip
    problem = SimpleNamespace(measured=SimpleNamespace(channels=PLACE, values=values, times=None))
    found = _solve(problem, fit, ([change], []), smooth)
    snapped = change.copy()
    snapped[spoilt] += 1.0
    again = _solve(problem, fit, ([snapped], []), smooth)
    np.testing.assert_array_equal(again.mean, found.mean)
    np.testing.assert_array_equal(again.all, found.all)


@pytest.mark.parametrize(("element", "other"), [("h8_modes", "h20"), ("h20", "h27"), ("t4", "t10")])
def test_other_meshes_are_finer_or_of_another_element(element: str, other: str) -> None:
    scene = beam()
    scene = replace(scene, mesh=replace(scene.mesh, element=element))
    assert other_elements(plainly(scene)).scene.mesh == replace(scene.mesh, element=other)
    assert refined(plainly(scene)).scene.mesh == replace(scene.mesh, refine=1)


def test_a_scene_without_a_mesh_has_no_other() -> None:
    with raises_naming(SceneError, "'pendulum'", "no mesh"):
        other_elements(plainly(load_scene("pendulum")))
