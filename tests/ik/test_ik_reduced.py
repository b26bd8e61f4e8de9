"""Inverse kinematics through the reduced model: its own W, and how far off the whole body is at its solutions."""

from dataclasses import replace

import numpy as np
import pytest

from tests.ik.test_ik_compliance import assert_slopes
from tripod_ik.inverse import InverseSolver, Outcome
from tripod_ik.limits import AngleLimit
from tripod_ik.model import StaticModel, model_scene
from tripod_ik.tasks import PositionTask
from tripod_sim import load_scene
from tripod_sim.reduced import store

SMALL = ["mesh.level=1", "solver.tolerance=1e-9"]
OFF = 5e-5
"""How far the reduced model of 20 shapes is from the whole one within 0.3 rad of the working pose [m]."""


@pytest.fixture(scope="module")
def reduced(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        patch.setattr(store, "_recent", {})
        yield StaticModel(load_scene("tripod", [*SMALL, "reduced.samples=16"]))


@pytest.fixture(scope="module")
def whole():
    return StaticModel(load_scene("tripod", SMALL))


@pytest.mark.parametrize("pose", [[-1.4965] * 3, [-1.3, -1.65, -1.5]])
def test_its_compliance_is_that_of_its_own_finite_moves(reduced, pose):
    assert reduced.simulation.unknowns < 50
    assert_slopes(reduced, np.array(pose), 1e-3)


def test_targets_are_reached_to_its_own_error(reduced, whole):
    homes, errors = (reduced.save(), whole.save()), []
    solver = InverseSolver(reduced, AngleLimit(-2.1, 0.6))
    for angles in -1.4965 + np.random.default_rng(4).uniform(-0.3, 0.3, (8, 3)):
        reduced.restore(homes[0])
        whole.restore(homes[1])
        target = whole.move(angles).equilibrium.copy()
        solution = solver.solve([PositionTask(target)])
        assert solution.outcome is Outcome.REACHED
        assert solution.kkt < 1e-6
        assert solution.state.equilibrium == pytest.approx(target, abs=1e-6)  # by its own account
        found = whole.move(solution.state.angles).equilibrium
        errors.append(np.linalg.norm(found - target))
    assert 1e-7 < max(errors) < OFF


def test_any_scene_with_servos_has_a_reduced_model():
    for name in ("tripod", "maze"):
        scene = model_scene(name, "reduced")
        assert scene.reduced
        assert not scene.ball
        assert replace(scene, reduced=None, ball=model_scene(name, "quasi_static").ball) == load_scene(name)
