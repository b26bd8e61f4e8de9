"""The compliant clamp: its limit is the ideal one, its torques are the slope of the energy, absent it costs nothing."""

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.scenes import SHARP
from tests.sim.implicit_schemes import IMPLICIT
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.forces.foundation import Foundation

STATIC = ["inertia=off", "damping=off", "mesh.level=1", "solver.tolerance=1e-8"]
POSE = np.array([-0.7, -0.6, -0.8, 0.0])


def at(pose: np.ndarray, *overrides: str) -> Simulation:
    simulation = Simulation(load_scene(SHARP, [*STATIC, *overrides]))
    for k in range(1, 11):
        simulation.step(pose * k / 10)
    return simulation


def test_a_stiff_bedding_is_the_ideal_clamp() -> None:
    ideal = at(POSE)
    gaps = []
    for stiffness in (1e12, 1e13, 1e14):
        bedded = at(POSE, f"clamp.stiffness={stiffness}")
        gaps.append(np.abs(bedded.positions - ideal.positions).max())
    # the bedding's slip falls with the square root of its stiffness near the edge, at last in proportion to it
    assert gaps[0] > 1e-5
    assert gaps[1] < 0.4 * gaps[0]
    assert gaps[2] < 0.4 * gaps[1]


def test_a_soft_bedding_yields() -> None:
    torques = [at(POSE, f"clamp.stiffness={s}").efforts[0] for s in (1e9, 1e10, 1e11)]
    assert torques[0] > torques[1] > torques[2] > at(POSE).efforts[0]  # all negative: the softer, the weaker


def test_torques_are_the_slope_of_the_energy() -> None:
    simulation, h = at(POSE, "clamp={}"), 1e-4
    torques = simulation.efforts.copy()
    for servo in range(3):
        energies = []
        for sign in (1, -1):
            moved = POSE.copy()
            moved[servo] += sign * h
            simulation.step(moved)
            e = simulation.energies()
            energies.append(e.strain + e.gravity)
        assert (energies[0] - energies[1]) / (2 * h) == pytest.approx(torques[servo], rel=1e-4)


def test_compliance_predicts_the_effector_through_the_bedding() -> None:
    simulation, h = at(POSE, "clamp={}"), 1e-4
    w = simulation.compliance().w
    jacobian = w[:3, 6:] @ np.linalg.inv(w[6:, 6:])
    ends = []
    for sign in (1, -1):
        simulation.step(POSE + np.array([sign * h, 0, 0, 0]))
        ends.append(simulation.state.centres[0].copy())
    np.testing.assert_allclose(jacobian[:, 0], (ends[0] - ends[1]) / (2 * h), atol=1e-7)


def test_only_the_mesh_is_shown_and_the_mass_stays() -> None:
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1", "clamp={}"]))
    assert simulation.positions.shape == simulation.mesh.nodes.shape
    assert len(simulation.state.positions) > len(simulation.positions)
    assert simulation._mass.sum() == pytest.approx(0.032)
    for scheme in IMPLICIT:
        moving = Simulation(load_scene(SHARP, ["mesh.level=1", "clamp={}", f"inertia.scheme={scheme}"]))
        for k in range(20):
            moving.step(np.array([-0.02 * k, 0, 0, 0]))
        assert np.isfinite(moving.state.positions).all()
        assert np.isfinite(moving.state.velocities).all()


@pytest.mark.parametrize("name", sorted(ELEMENTS))
def test_the_energy_of_the_bedding_is_the_integral_of_the_slip_squared(name: str) -> None:
    """A slip that a slanted cell carries exactly: linear in a tetrahedron, else of its highest power along edges."""
    kind, kappa = ELEMENTS[name], 3e9
    A, shift = (
        np.array([[0.02, 0.003, 0.0], [0.001, 0.01, 0.002], [0.0, 0.001, 0.03]]),
        np.array([0.1, 0.2, -0.1]),
    )
    nodes = kind.reference @ A.T + shift
    power = 1 if kind.corners == 4 else 2 if kind.size > 8 else 1
    x, y, z = kind.reference.T
    slip = np.column_stack([x**power, 0.3 + y * (1 if kind.corners == 4 else z), z**power - x]) * 1e-4
    if kind.corners == 4:  # integrals of 1, x, x² and xy over the tetrahedron of the three unit vectors
        one, first, square, mixed = 1 / 6, 1 / 24, 1 / 60, 1 / 120
        parts = square + (0.09 * one + 0.6 * first + square) + (2 * square - 2 * mixed)
    elif kind.plain.cell == "wedge":  # over the unit triangle times [-1, 1]; odd powers of z drop out
        slip = np.column_stack([x, 0.3 + y, z - x]) * 1e-4
        parts = 1 / 6 + (0.09 + 0.6 / 3 + 1 / 6) + (1 / 3 + 1 / 6)
    else:  # over the cube [-1, 1]³; odd powers drop out
        even = 8 / (2 * power + 1)
        parts = even + (0.09 * 8 + 8 / 9) + (even + 8 / 3)
    expected = 0.5 * kappa * abs(np.linalg.det(A)) * parts * 1e-8
    n = kind.size
    bedding = Foundation(kind, np.vstack([nodes, nodes]), np.arange(n)[None], n + np.arange(n)[None], kappa)
    moved, g = np.vstack([nodes + slip, nodes]), np.zeros((2 * n, 3))
    assert bedding.add_gradient(moved, g) == pytest.approx(expected, rel=1e-9)
    assert np.vdot(g[:n], slip) == pytest.approx(2 * expected, rel=1e-9)  # the energy is a square
    np.testing.assert_allclose(g[n:], -g[:n], rtol=0, atol=1e-12 * np.abs(g).max())


@pytest.mark.parametrize("element", ["t4", "t10", "h8", "h8_mean", "h20", "h27"])
def test_every_element_can_be_bedded(element: str) -> None:
    bedded = at(np.array([-0.3, -0.3, -0.3, 0.0]), "clamp={}", f"mesh.element={element}")
    assert bedded.efforts.max() < -0.05
    assert np.ptp(bedded.efforts) < 0.02  # alike but for the cut of tetrahedra


def test_a_clamp_without_servos_is_refused() -> None:
    with raises_naming(SceneError, "clamp", "servos"):
        load_scene("silicone", ["clamp={}"])
    with raises_naming(SceneError, "clamp.stiffness is 0.0", "above 0 N/m⁴"):
        load_scene(SHARP, ["clamp.stiffness=0.0"])
