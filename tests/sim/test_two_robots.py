"""Robots beside each other: each moves as one alone does, and what is written for a body is about its own axis."""

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.scenes import SHARP
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.tables.short_forms import joints_of

STEPS = 60
TWO = ("body.0.mesh.level=1", "body.1.mesh.level=1", "solver.mode=newton", "solver.tolerance=1e-11")
ONE = ("mesh.level=1", "solver.mode=newton", "solver.tolerance=1e-11")
PLACE, TURN = np.array([0.17, 0.0, 0.0]), np.diag([-1.0, -1.0, 1.0])


def test_each_of_two_tripods_moves_as_one_alone_does() -> None:
    # No tangent has to be projected there: that would be done for both, and stiffness damping takes the projected.
    both = Simulation(load_scene("two_tripods", TWO))
    alone = [Simulation(load_scene(SHARP, ONE)) for _ in range(2)]
    most, moved = np.array([-0.7, -0.5, -0.6, -0.2, -0.7, -0.4, 0.01]), np.zeros(2)
    apart = 0.0
    for k in range(STEPS):
        joints = most * np.sin(np.pi * (k + 1) / STEPS) ** 2
        both.step(joints)
        for i, one in enumerate(alone):
            one.step(np.append(joints[3 * i : 3 * i + 3], joints[-1]))
        apart = max(apart, np.abs(alone[0].positions - alone[1].positions).max())
        nodes = np.split(both.positions, 2)
        for i, (place, turn) in enumerate(((np.zeros(3), np.eye(3)), (PLACE, TURN))):
            there = alone[i].positions @ turn.T + place
            np.testing.assert_allclose(nodes[i], there, rtol=0, atol=1e-9)
            moved[i] = max(moved[i], np.abs(there - alone[i].mesh.nodes @ turn.T - place).max())
            torques = both.efforts[3 * i : 3 * i + 3]
            np.testing.assert_allclose(torques, alone[i].efforts, rtol=0, atol=1e-8)
    assert (moved > 0.01).all()
    assert apart > 1e-3, "each has a motion of its own"
    assert both.effector.position == pytest.approx(alone[0].effector.position, abs=1e-9)


def test_the_compliance_is_that_of_the_first_and_the_other_has_no_part_in_it() -> None:
    both, one = Simulation(load_scene("two_tripods", TWO)), Simulation(load_scene(SHARP, ONE))
    for k in range(20):
        pose = np.array([-0.5, -0.3, -0.2]) * (k + 1) / 20
        one.step(np.append(pose, 0.01))
        both.step(np.concatenate([pose, -0.1 * np.ones(3), [0.01]]))
    w, alone = both.compliance().w, one.compliance().w
    assert w.shape == (12, 12)
    np.testing.assert_allclose(w[:9, :9], alone, rtol=1e-6, atol=1e-9 * np.abs(alone).max())
    assert np.abs(w[:9, 9:]).max() < 1e-9 * np.abs(w).max()


def test_arms_of_a_body_stand_about_its_own_axis() -> None:
    first, second = np.split(np.array([arm.hub for arm in joints_of(load_scene("two_tripods")).arms]), 2)
    np.testing.assert_allclose(second, first @ TURN.T + PLACE, atol=1e-15)


def test_at_rest_a_second_body_that_is_held_bends_as_one_alone() -> None:
    still = ["inertia=off", "damping=off", "motion=off"]
    both = Simulation(load_scene("two_tripods", ["body.0.mesh.level=1", "body.1.mesh.level=1", *still]))
    one = Simulation(load_scene(SHARP, ["mesh.level=1", *still]))
    assert both.notes == ()
    down = np.array([-0.4, -0.3, -0.2])
    both.step(np.concatenate([np.zeros(3), down, [0.01]]))
    one.step(np.append(down, 0.01))
    second = both.positions[len(one.positions) :]
    np.testing.assert_allclose(second, one.positions @ TURN.T + PLACE, rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("override", "named"),
    [
        ("body.1.servos.clamp_radius=0.06", ("body.1.servos.clamp_radius", "0.06 m", "servo_0", "no node", "nearest")),
        ("body.1.effector.radius=1e-4", ("body.1.effector.radius", "0.0001 m", "no node")),
        ("body.1.servos.angles=[0,0]", ("body.1.servos.angles", "2 values", "3")),
        ("body.1.servos.slide=0.01", ("body.1.servos.slide", "0.01 m", "body.0.servos.slide", "0.0 m", "same")),
        ("servos={}", ("servos", "body.0.servos", "first body", "leave one out")),
        ("clamp={}", ("clamp", "first body", "body.1.servos", "ideal clamps", "leave clamp out")),
    ],
)  # fmt: skip
def test_what_cannot_be_is_named(override: str, named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named):
        Simulation(load_scene("two_tripods", [override]))


def test_servos_on_springs_are_refused() -> None:
    with raises_naming(SceneError, "body.0.servos", "body.0.mesh", "solid"):
        load_scene("tripod_cloth", ["body.0.servos={}"])
