"""Solid, reduction and system: gradients and Hessians in nodes and in unknowns, against differences."""

import numpy as np
import pytest
from scipy import sparse

from tests.checks import assert_symmetric, law_vector, random_rotation
from tests.messages import raises_naming
from tests.scenes import SHARP
from tripod_sim import load_scene
from tripod_sim.build import build
from tripod_sim.constraints.groups import Groups
from tripod_sim.errors import SceneError
from tripod_sim.forces.solid import Solid
from tripod_sim.mesh.y_piece import LEVELS, y_piece
from tripod_sim.state import State
from tripod_sim.system import System

LAWS = ("neo_hooke", "corotational")


def bent(law: str = "neo_hooke", seed: int = 0) -> tuple[System, State]:
    """A static system and a state off equilibrium: strips bent, then nodes shaken and the disc tilted."""
    parts = build(load_scene(SHARP, ["inertia=off", "damping=off", "mesh.level=1", f"material.law={law}"]))
    system, rng = parts.system, np.random.default_rng(seed)
    state = system.start_state(np.zeros(4))
    parts.stepper.step(state, np.array([-0.5, -0.3, 0.1, 0.003]), 0.0)
    solution = 3e-5 * rng.standard_normal(system.reduction.unknowns)
    solution[3 * system.reduction.free_count + 3 :] = [0.005, -0.004, 0.003]
    moved, dx = state.copy(), np.zeros_like(state.positions)
    system.update_levers(state)
    system.reduction.moves(solution, system.lever, dx)
    system.move(state, solution, dx, 1.0, moved)
    settle_modes(system, moved)
    return system, moved


def static_system() -> System:
    return build(load_scene(SHARP, ["inertia=off", "damping=off", "mesh.level=1"])).system


def settle_modes(system: System, state: State) -> None:
    """Bring the incompatible modes to their own equilibrium at fixed nodes."""
    still = np.zeros_like(state.positions)
    for _ in range(20):
        assert system.assemble(state, project=False) == -1
        system.evaluate(state)
        if system.elastic.mode_residual_squared < 1e-24:
            return
        system.elastic.advance_modes(state.modes.copy(), still, 1.0, state.modes)
    raise AssertionError("modes do not settle")


def along(system: System, state: State, solution: np.ndarray, turn: np.ndarray) -> State:
    """The state moved by a step of the unknowns and of the servo angles, its modes settled."""
    out, dx = state.copy(), np.zeros_like(state.positions)
    system.update_levers(state)
    system.reduction.moves(solution, system.lever, dx)
    system.drive(out, state.joints + np.append(turn, 0.0))
    system.move(state, solution, dx, 1.0, out)
    settle_modes(system, out)
    return out


@pytest.mark.parametrize("law", LAWS)
def test_solid_force_is_minus_the_energy_gradient(law: str) -> None:
    mesh, rng = y_piece(LEVELS[1]), np.random.default_rng(1)
    solid = Solid(mesh.nodes, np.array(mesh.elements), mesh.kind, law, law_vector(law, 1e5, 1e5))
    x = mesh.nodes + 2e-4 * rng.standard_normal(mesh.nodes.shape)
    modes, g = 1e-4 * rng.standard_normal(solid.rest_modes().shape), np.zeros_like(x)
    solid.add_gradient(
        x, modes, g
    )  # before any `stiffness` nothing is condensed: the gradient at fixed modes
    d, h = rng.standard_normal(x.shape), 1e-8
    slope = (solid.energy(x + h * d, modes) - solid.energy(x - h * d, modes)) / (2 * h)
    assert slope == pytest.approx(np.vdot(g, d), rel=1e-6)


@pytest.mark.parametrize("law", LAWS)
def test_a_rigid_motion_costs_nothing_and_rotates_the_forces(law: str) -> None:
    (system, state), rng = bent(law), np.random.default_rng(2)
    solid, x, modes = system.elastic, state.positions, state.modes
    Q, shift = random_rotation(rng), np.array([0.1, -0.2, 0.3])
    g, turned = np.zeros_like(x), np.zeros_like(x)
    solid.stiffness(x, modes, project=True)
    energy = solid.add_gradient(x, modes, g)
    solid.stiffness(x @ Q.T + shift, modes @ Q.T, project=True)
    assert solid.add_gradient(x @ Q.T + shift, modes @ Q.T, turned) == pytest.approx(energy, rel=1e-10)
    size = np.abs(g).max()
    np.testing.assert_allclose(turned, g @ Q.T, atol=1e-9 * size)
    np.testing.assert_allclose(g.sum(axis=0), 0, atol=1e-9 * size)
    np.testing.assert_allclose(np.cross(x, g).sum(axis=0), 0, atol=1e-9 * size)


@pytest.mark.parametrize("law", LAWS)
def test_residual_and_torques_are_the_potential_gradient(law: str) -> None:
    (system, state), rng = bent(law), np.random.default_rng(3)
    system.evaluate(state)
    residual, torques = system.residual.copy(), system.efforts.copy()
    d, turn, h = rng.standard_normal(len(residual)), rng.standard_normal(3), 1e-6
    d[-3:] *= 100  # the disc turns as far as its neighbours move
    energies = []
    for sign in (1, -1):
        energies.append(system.evaluate(along(system, state, sign * h * d, sign * h * turn)))
    slope = (energies[0] - energies[1]) / (2 * h)
    assert abs(torques @ turn) > 1e-3
    size = np.linalg.norm(residual) * np.linalg.norm(d)  # the sum below cancels most of it
    assert abs(residual @ d + torques @ turn) > 1e-3 * size
    assert slope == pytest.approx(residual @ d + torques @ turn, abs=1e-6 * size)


@pytest.mark.parametrize("law", LAWS)
def test_reduced_hessian_is_the_derivative_of_the_residual(law: str) -> None:
    """All blocks: free nodes, disc with its rotation's second-order term, servo angles."""
    (system, state), rng = bent(law), np.random.default_rng(4)
    system.assemble(state, project=False)
    system.evaluate(state)
    system.factor()
    upper = system.reduction.pattern.copy()
    K = (upper + sparse.triu(upper, 1).T).toarray()
    drive, drive_drive = system.reduction.drive.copy(), system.reduction.drive_drive.copy()
    assert_symmetric(drive_drive)
    d, turn, h = rng.standard_normal(len(K)), rng.standard_normal(3), 1e-6
    d[-3:] *= 100
    found = []
    for sign in (1, -1):
        moved = along(system, state, sign * h * d, sign * h * turn)
        system.evaluate(moved)
        found.append((system.residual.copy(), system.efforts.copy()))
    residual = (found[0][0] - found[1][0]) / (2 * h)
    torques = (found[0][1] - found[1][1]) / (2 * h)
    product = K @ d + drive @ turn
    np.testing.assert_allclose(residual[:-3], product[:-3], atol=1e-5 * np.abs(product).max())
    # the rotation is composed from the left: its second derivative is symmetric only where no moment acts on the
    # disc, else a half of the moment's cross product with the rotation remains
    moment, spin = system_moment(system, state), d[-3:]
    np.testing.assert_allclose(
        residual[-3:], product[-3:] + 0.5 * np.cross(spin, moment), atol=1e-5 * np.abs(product).max()
    )
    np.testing.assert_allclose(torques, drive.T @ d + drive_drive @ turn, rtol=1e-4)


def system_moment(system: System, state: State) -> np.ndarray:
    system.evaluate(state)
    return system.residual[-3:].copy()


def test_driven_frames_follow_circle_and_slide() -> None:
    """Worked out by hand: at -90 degrees the clamp's point above the axis lies outward of it, at the same distance."""
    system = static_system()
    state = system.start_state(np.zeros(4))
    system.drive(state, np.array([-np.pi / 2, 0, 0, 0.01]))
    nodes = system.groups.driven[0].nodes
    rest, now = system.rest[nodes], state.positions[nodes]
    radius, depth = 0.060, 0.02885
    np.testing.assert_allclose(now[:, 0], radius - 0.01 + rest[:, 2] + depth, atol=1e-15)
    np.testing.assert_allclose(now[:, 2], -depth - (rest[:, 0] - radius), atol=1e-15)
    np.testing.assert_allclose(now[:, 1], rest[:, 1], atol=1e-15)
    other = system.groups.driven[1].nodes
    np.testing.assert_allclose(
        state.positions[other], system.rest[other] + 0.01 * system.groups.driven[1].inward
    )


def test_groups_refuse_overlap_and_a_body_without_freedom() -> None:
    a, b = np.arange(4), np.arange(3, 8)
    with raises_naming(SceneError, "rigid body 1", "rigid body 0", "both", "nodes 3"):
        Groups(20, rigid=(a, b))
    with raises_naming(SceneError, "every node", "held", "hold fewer nodes"):
        Groups(8, rigid=(np.arange(4),), fixed=np.arange(4, 8))
