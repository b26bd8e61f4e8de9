"""The live estimate of the mesh's error at the effector, against the same scene on a finer mesh."""

import numpy as np
import pytest

from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.mesh.block import block
from tripod_sim.mesh_error import interpolation, richer, track

W = -1.4965
CLAMP = "clamp.stiffness=1.4e10"
ALWAYS = "mesh_error.share=1e6"
WORKING = (f"servos.angles=[{W},{W},{W}]", "servos.slide=0.035")
"""The estimate after each step."""


def effector(words: tuple[str, ...], way: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the effector along a way, and its estimated errors [m], NaN without."""
    simulation = Simulation(load_scene("tripod", [CLAMP, "solver.max_turn=0.3", *words]))
    places, errors = [], []
    for joints in way:
        report = simulation.step(joints)
        places.append(simulation.state.centres[0].copy())
        errors.append(report.mesh_error.effector if report.mesh_error else (np.nan,) * 3)
    return np.array(places), np.array(errors)


def test_poses_err_as_estimated_by_every_mesh() -> None:
    """The reference of the finer one is finer than what estimates its error."""
    still = ("inertia=off", "damping=off")
    way = [np.array([W / 2, W / 2, W / 2, 0.017]), np.array([-1.2, -1.6, W, 0.035])]
    true, _ = effector((*still, "mesh.element=h20", "mesh.level=9"), way)
    for words in (
        ("mesh.level=1",),
        ("mesh.level=2",),
        ("mesh.level=8",),
        ("mesh.element=h20", "mesh.level=2"),
    ):
        found, estimated = effector((*still, ALWAYS, *words), way)
        lengths = np.linalg.norm(true - found, axis=1)
        assert (lengths > 1e-4).all(), "there is an error to find"
        left = np.linalg.norm(true - found - estimated, axis=1)
        assert (left < 0.5 * lengths).all(), (words, left / lengths)


def test_quadratic_elements_are_held_against_half_their_edges() -> None:
    scene = load_scene("tripod", [CLAMP, "mesh.element=h20", "mesh.level=8", "mesh_error={}"])
    mesh = richer(scene).mesh
    assert mesh
    assert (mesh.element, mesh.level, mesh.refine) == ("h20", 8, 1)
    fast = richer(load_scene("tripod", [CLAMP, "mesh_error={}"])).mesh
    assert fast
    assert (fast.element, fast.level, fast.refine) == ("h20", 8, 0)


def test_a_fast_motion_errs_as_estimated_with_its_inertia() -> None:
    way = [np.array([W + 0.3 * min(1, k / 6), W, W, 0.035]) for k in range(1, 31)]
    true, _ = effector((*WORKING, "mesh.element=h20", "mesh.level=8", "solver.mode=newton"), way)
    found, estimated = effector((*WORKING, ALWAYS), way)
    left = np.linalg.norm(true - found - estimated, axis=1)
    assert (left < 0.1 * np.linalg.norm(true - found, axis=1)).all()
    rest, held = effector((*WORKING, ALWAYS, "gravity=off"), way)
    assert np.isfinite(held).all() and np.isfinite(rest).all()


def test_the_default_share_tells_it_seldom_and_the_same_within_a_part() -> None:
    way = [np.array([W + 0.3 * np.sin(0.05 * k), W, W, 0.035]) for k in range(1, 101)]
    _, each = effector((*WORKING, ALWAYS), way)
    _, told = effector((*WORKING, "mesh_error={}"), way)
    assert 1 <= len(np.unique(told, axis=0)) < len(np.unique(each, axis=0))
    assert np.linalg.norm(told - each, axis=1).max() < 0.5 * np.linalg.norm(each, axis=1).max()


def test_the_motion_is_the_same_to_the_bit_and_reset_begins_anew() -> None:
    way = [np.array([W + 0.02 * k, W, W, 0.035]) for k in range(1, 11)]
    plain, _ = effector(WORKING, way)
    watched, _ = effector((*WORKING, ALWAYS), way)
    assert plain.tobytes() == watched.tobytes()
    simulation = Simulation(load_scene("tripod", [CLAMP, *WORKING, ALWAYS]))
    first = [simulation.step(joints).mesh_error for joints in way]
    simulation.reset()
    assert [simulation.step(joints).mesh_error for joints in way] == first


def test_after_a_long_way_in_one_step_it_finds_its_rest_again() -> None:
    still = (CLAMP, "inertia=off", "damping=off", "mesh_error.share=1e-9")
    simulation = Simulation(load_scene("tripod", [*WORKING, *still]))
    simulation.step(np.zeros(4))
    found = simulation.mesh_error()
    fresh = Simulation(load_scene("tripod", still)).mesh_error()
    assert found and fresh
    np.testing.assert_allclose(found.effector, fresh.effector, atol=2e-5)
    assert fresh.distance > 1e-4


def test_values_go_to_other_nodes_by_the_elements_they_lie_in() -> None:
    size = ((0, 0), (0.03, 0), (0.033, 0.02), (0, 0.02))
    mesh = block(tuple((x, y, z) for z in (0.0, 0.01) for x, y in size), (3, 2, 1))
    rng = np.random.default_rng(3)
    points = rng.uniform(0, 1, (50, 3)) * (0.03, 0.02, 0.01)
    nodes, weights = interpolation(mesh, points)
    values = mesh.nodes @ np.array([[1.0, 2, 0], [0, 1, 3], [2, 0, 1]]) + 0.5
    expected = points @ np.array([[1.0, 2, 0], [0, 1, 3], [2, 0, 1]]) + 0.5
    np.testing.assert_allclose(np.einsum("pa,pai->pi", weights, values[nodes]), expected, atol=1e-12)


def test_accelerations_lag_as_stiffness_damping_lets_forces_lag() -> None:
    before, acceleration = np.zeros((1, 3)), np.zeros((1, 3))
    dt, lag, drag = 0.01, 0.03, 2.0
    a, v, g = np.array([[1.0, 0, -2]]), np.zeros((1, 3)), np.zeros((1, 3))
    for _ in range(3):
        v = v + dt * a
        g = (dt * (a + drag * v) + lag * g) / (dt + lag)  # g + lag (g - g_before) / dt = a + drag v
        track(v, 1 / dt, drag, dt / (dt + lag), before, acceleration)
    np.testing.assert_allclose(acceleration, g, rtol=1e-12)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["mesh_error={}"], "mesh_error needs clamp: at the edge of an ideal clamp the stress is singular"),
        ([CLAMP, "mesh_error={}", "effector=off"], "mesh_error needs effector"),
        ([CLAMP, "mesh_error={}", "mesh.element=t4"], "'h8_modes' and 'h20'; it is 't4'"),
        (["clamp={}", "mesh_error={}"], "by which strips of this material slip over 1.2 mm; .* at most 1.5e"),
        ([CLAMP, "material.young=1e5", "mesh_error={}"], "clamp.stiffness is 1.4e.10 N/m⁴"),
        ([CLAMP, "mesh_error={}", "maze={}"], "mesh_error and maze exclude each other"),
    ],
)
def test_what_has_no_estimate_is_refused(words: list[str], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        load_scene("tripod", words)
