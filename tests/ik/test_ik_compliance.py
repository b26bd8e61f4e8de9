"""The linearised state of every element and law, against finite moves of the simulated robot, gravity included."""

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_host.rotations import rotation_matrix
from tripod_ik.model import StaticModel, linear_state
from tripod_ik.rotation import tilt_between
from tripod_sim import Simulation, load_scene

POSE = np.array([-0.9, -1.1, -1.0])
SLIDE = 0.015


def turned(start, end):
    """Return the rotation vector of the small rotation from `start` to `end`."""
    R = end @ start.T
    return np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2


def assert_slopes(model, pose, h):
    """Central differences: h² of third derivatives and the rounding of the equilibria over h are left."""
    state = model.move(pose)
    assert np.abs(state.equilibrium_offset).max() < 1e-8
    for servo, step in enumerate(h * np.eye(3)):
        ahead, behind = model.move(pose + step), model.move(pose - step)
        slope = (ahead.equilibrium - behind.equilibrium) / (2 * h)
        spin = turned(behind.equilibrium_rotation, ahead.equilibrium_rotation) / (2 * h)
        torques = (ahead.efforts - behind.efforts) / (2 * h)
        assert np.abs(slope).max() > 1e-3
        assert state.jacobian[:3, servo] == pytest.approx(slope, abs=1e-3 * np.abs(slope).max())
        assert state.jacobian[3:, servo] == pytest.approx(spin, abs=1e-3 * np.abs(spin).max())
        assert state.stiffness[:, servo] == pytest.approx(torques, abs=1e-3 * np.abs(torques).max())


@pytest.mark.parametrize("element", ["t4", "t10", "h8", "h8_mean", "h8_modes", "h20", "h20_full", "h27"])
def test_every_element(element):
    scene = load_scene(SHARP, ["mesh.level=1", f"mesh.element={element}", "solver.tolerance=1e-9"])
    assert_slopes(StaticModel(scene, SLIDE, POSE), POSE, 1e-3)


@pytest.mark.parametrize(
    "material",
    [
        *(f"material.law={law}" for law in ("corotational", "stable_neo_hooke", "st_venant_kirchhoff")),
        "material={law='mooney_rivlin', parameters=[30e3, 13e3], mass=0.032}",
        "material={law='yeoh', parameters=[43e3, -2e3, 1e3], mass=0.032}",
        "material={law='ogden', parameters=[60e3, 1.6, -19e3, -4.0], mass=0.032}",
    ],
)
def test_every_law(material):
    scene = load_scene(SHARP, ["mesh.level=1", material, "solver.tolerance=1e-9"])
    assert_slopes(StaticModel(scene, 0.0, 0.3 * POSE), 0.3 * POSE, 1e-3)


@pytest.mark.parametrize("effect", ["clamp={}", "gravity=off", "gravity.acceleration=[30,10,-40]"])
def test_every_effect_that_is_there_at_rest(effect):
    scene = load_scene(SHARP, ["mesh.level=1", effect, "solver.tolerance=1e-9"])
    assert_slopes(StaticModel(scene, SLIDE, POSE), POSE, 1e-3)


def test_gravity_counts():
    """The check above would not notice if all forgot it; the equilibrium and its slopes do change with it."""
    with_it, without = (
        StaticModel(load_scene(SHARP, ["mesh.level=1", *words]), SLIDE, POSE).state()
        for words in ([], ["gravity=off"])
    )
    assert with_it.equilibrium[2] < without.equilibrium[2] - 1e-4
    assert np.abs(with_it.jacobian - without.jacobian).max() > 1e-3 * np.abs(without.jacobian).max()


def test_of_a_body_in_motion_it_is_that_of_the_rest_it_goes_to():
    """In mid-swing, linearised where it is: rest and Jacobian there differ from the true ones by the swing's second
    and first order.
    """
    words = ["mesh.level=1", f"servos.angles={POSE.tolist()}", f"servos.slide={SLIDE}", "solver.mode=newton"]
    moving = Simulation(load_scene(SHARP, words))
    shares, misses = [], []
    for speed in (0.1, 0.2):
        moving.reset()
        for k in range(3):
            goal = POSE + speed * (k + 1) * np.array([1.0, 0.0, 0.0])
            moving.step(np.append(goal, SLIDE))
        state = linear_state(moving.compliance())
        rest = StaticModel(load_scene(SHARP, words[:1]), SLIDE, state.angles).state()
        swing = np.linalg.norm(state.equilibrium_offset[:3])
        assert swing > 1e-5
        shares.append(np.linalg.norm(state.equilibrium - rest.equilibrium) / swing)
        misses.append(np.abs(state.jacobian - rest.jacobian).max() / np.abs(rest.jacobian).max())
        tilt = tilt_between(state.equilibrium_rotation[:, 2], rest.equilibrium_rotation[:, 2])
        whole = tilt_between(
            (rotation_matrix(-state.equilibrium_offset[3:]) @ state.equilibrium_rotation)[:, 2],
            rest.equilibrium_rotation[:, 2],
        )
        assert np.linalg.norm(tilt) < 0.1 * np.linalg.norm(whole)
    assert max(shares) < 0.05
    assert misses[0] < 0.5 * misses[1] < 0.1
