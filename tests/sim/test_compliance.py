"""The compliance against finite moves of the simulated robot."""

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.scenes import SHARP
from tripod_host.rotations import rotation_matrix
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.forces.gravity import GravityForce

STATIC = ["inertia=off", "damping=off", "solver.tolerance=1e-9"]
WORKING = np.array([-1.4965, -1.4965, -1.4965, 0.035])


def at(joints: np.ndarray) -> Simulation:
    simulation = Simulation(load_scene(SHARP, STATIC))
    for k in range(1, 21):
        simulation.step(joints * k / 20)
    return simulation


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    return at(WORKING + np.array([0.1, -0.05, 0.0, 0.0]))


def test_w_is_symmetric_and_yields_under_load_at_held_angles(simulation: Simulation) -> None:
    w = simulation.compliance().w
    np.testing.assert_array_equal(w, w.T)
    held = w[:6, :6] - w[:6, 6:] @ np.linalg.inv(w[6:, 6:]) @ w[6:, :6]
    assert np.linalg.eigvalsh(held).min() > 0


def test_servo_stiffness_is_positive_flat_and_indefinite_in_the_working_pose(simulation: Simulation) -> None:
    """Past its dead centre an arm needs less torque the further it goes: W has negative eigenvalues there."""
    flat = Simulation(load_scene(SHARP, STATIC)).compliance().w[6:, 6:]
    assert np.linalg.eigvalsh(flat).min() > 0
    assert np.linalg.eigvalsh(simulation.compliance().w[6:, 6:]).min() < 0


def test_servo_rows_predict_effector_and_torques(simulation: Simulation) -> None:
    c, h = simulation.compliance(), 1e-4
    start = simulation.state.joints.copy()
    jacobian = c.w[:6, 6:] @ np.linalg.inv(c.w[6:, 6:])
    stiffness = np.linalg.inv(c.w[6:, 6:])
    for servo in range(3):
        ends = []
        for sign in (1, -1):
            joints = start.copy()
            joints[servo] += sign * h
            simulation.step(joints)
            ends.append(
                (
                    simulation.state.centres[0].copy(),
                    simulation.state.rotations[0].copy(),
                    simulation.efforts.copy(),
                )
            )
        moved = (ends[0][0] - ends[1][0]) / (2 * h)
        turned = ends[0][1] @ ends[1][1].T
        spin = np.array(
            [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
        ) / (4 * h)
        # central differences: h² times third derivatives of order one leaves 1e-7 of about 0.01
        np.testing.assert_allclose(jacobian[:3, servo], moved, atol=2e-7)
        np.testing.assert_allclose(jacobian[3:, servo], spin, atol=2e-5)
        np.testing.assert_allclose(
            stiffness[:, servo], (ends[0][2] - ends[1][2]) / (2 * h), rtol=1e-4, atol=1e-5
        )
    simulation.step(start)


def test_effector_rows_predict_the_sag_under_more_weight() -> None:
    """Heavier by one part in a thousand: the disc's own nodes move as W says for their share of the weight."""
    base = at(WORKING)
    c = base.compliance()
    nodes = base._system.groups.rigid[0]
    weight = -9.81 * base._mass[nodes].sum() * 1e-3
    heavier = Simulation(load_scene(SHARP, STATIC))
    gradient = heavier._static.system.term(GravityForce)._gradient  # only the disc grows heavier
    gradient[nodes] *= 1.001
    for k in range(1, 21):
        heavier.step(WORKING * k / 20)
    # at held angles: the effector's block without the part that lets the servos yield
    held = c.w[:3, :3] - c.w[:3, 6:] @ np.linalg.inv(c.w[6:, 6:]) @ c.w[6:, :3]
    moved = heavier.state.centres[0] - base.state.centres[0]
    assert abs(moved[2]) > 1e-8
    assert moved[2] == pytest.approx((held @ [0, 0, weight])[2], rel=1e-3)


def test_offset_points_to_the_equilibrium() -> None:
    """A dynamic state off balance: the first-order offset leads near the static pose at the same angles."""
    moving = Simulation(load_scene(SHARP, [f"servos.angles={WORKING[:3].tolist()}", "servos.slide=0.035"]))
    for k in range(4):
        moving.step(WORKING + np.array([0.04 * (k + 1), 0, 0, 0]))
    c = moving.compliance()
    target = at(moving.state.joints.copy()).state
    before = np.linalg.norm(c.position - target.centres[0])
    after = np.linalg.norm(c.position + c.equilibrium_offset[:3] - target.centres[0])
    assert before > 1e-5
    assert after < 0.05 * before
    turned = rotation_matrix(c.equilibrium_offset[3:]) @ moving.state.rotations[0]
    assert np.linalg.norm(turned - target.rotations[0]) < 0.1 * np.linalg.norm(
        moving.state.rotations[0] - target.rotations[0]
    )


def test_asking_for_the_compliance_changes_no_bit_of_the_motion() -> None:
    results = []
    for ask in (False, True):
        simulation = Simulation(load_scene(SHARP, ["mesh.level=1"]))
        for k in range(40):
            simulation.step(np.array([-0.01 * k, 0, 0, 0]))
            if ask and k % 3 == 0:
                simulation.compliance()
        results.append(simulation.state.positions.tobytes())
    assert results[0] == results[1]


def test_a_scene_without_effector_has_no_compliance() -> None:
    with raises_naming(SceneError, "effector"):
        Simulation(load_scene("silicone", ["mesh.level=1"])).compliance()


def test_a_body_without_servos_tells_at_every_step_of_its_swing_where_it_would_hang() -> None:
    simulation = Simulation(load_scene("silicone", ["mesh.level=1", "effector={}"]))
    told = []
    for _ in range(200):
        simulation.step()
        compliance = simulation.compliance()
        told.append(simulation.effector.position + compliance.equilibrium_offset[:3])
    assert np.ptp(told[100:], axis=0).max() < 1e-9
