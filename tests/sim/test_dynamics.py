"""Implicit Euler against its recurrence, its order and the laws of motion."""

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_sim import Simulation, load_scene
from tripod_sim.forces.anchor import Anchor

FREE = ["servos=off", "effector=off", "damping=off", "mesh.level=1", "solver.tolerance=1e-9"]


def momenta(simulation: Simulation) -> tuple[np.ndarray, np.ndarray]:
    m, s = simulation._mass, simulation.state
    return m @ s.velocities, (m[:, None] * np.cross(s.positions, s.velocities)).sum(axis=0)


def test_mass_is_the_scene_s() -> None:
    simulation = Simulation(load_scene(SHARP, ["material.mass=0.05"]))
    assert simulation._mass.sum() == pytest.approx(0.05, rel=1e-12)
    assert simulation._mass.min() > 0


def test_free_fall_is_the_recurrence_exactly() -> None:
    """v_n = n dt g, x_n = x_0 + dt² g n (n + 1) / 2."""
    simulation = Simulation(load_scene(SHARP, FREE))
    rest, n, dt = simulation.state.positions.copy(), 50, simulation.scene.dt
    for _ in range(n):
        simulation.step()
    drop = dt**2 * -9.81 * n * (n + 1) / 2
    np.testing.assert_allclose(
        simulation.state.positions - rest, np.tile([0, 0, drop], (len(rest), 1)), atol=1e-9
    )
    np.testing.assert_allclose(simulation.state.velocities[:, 2], -9.81 * n * dt, rtol=1e-7)


def test_momentum_is_kept_and_energy_never_grows_in_free_flight() -> None:
    simulation = Simulation(load_scene(SHARP, [*FREE, "gravity=off", "dt=0.002"]))
    state, rng = simulation.state, np.random.default_rng(0)
    spin = np.array([2.0, -3.0, 5.0])
    state.velocities[:] = np.cross(spin, state.positions) + np.array([0.1, 0.2, -0.3])
    state.velocities += 0.05 * rng.standard_normal(state.velocities.shape)
    linear, angular = momenta(simulation)
    energies = simulation.energies()
    total = energies.kinetic + energies.strain
    for _ in range(100):
        simulation.step()
        e = simulation.energies()
        assert e.kinetic + e.strain <= total * (1 + 1e-9)
        total = e.kinetic + e.strain
    p, h = momenta(simulation)
    np.testing.assert_allclose(p, linear, atol=1e-9)  # tolerance 1e-9 N over 0.2 s
    # implicit Euler keeps angular momentum only to first order in dt: it loses some, and gains none
    assert 0.9 * np.linalg.norm(angular) < np.linalg.norm(h) <= np.linalg.norm(angular) * (1 + 1e-9)


def ringing(dt: float, scheme: tuple[str, ...] = ()) -> np.ndarray:
    """Effector height 40 ms after the servos moved, ideal angles ramped in 20 ms."""
    simulation = Simulation(
        load_scene(
            SHARP, ["mesh.level=1", f"dt={dt}", "solver.mode=newton", "solver.tolerance=1e-8", *scheme]
        )
    )
    for k in range(round(0.04 / dt)):
        angle = -0.2 * min(1.0, (k + 1) * dt / 0.02)
        simulation.step(np.array([angle, angle, angle, 0]))
    return simulation.state.centres[0].copy()


def test_error_falls_with_the_first_order() -> None:
    reference = 2 * ringing(0.04 / 1280)[2] - ringing(0.04 / 640)[2]  # extrapolated: second order
    errors = np.array([abs(ringing(0.04 / n)[2] - reference) for n in (80, 160, 320)])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(1.0, abs=0.15)
    assert errors[-1] < 2.5e-4


def test_damping_takes_energy_and_its_absence_leaves_it_to_the_scheme() -> None:
    """The same plucked piece, in small swings: each kind of damping takes more than implicit Euler alone."""
    left = []
    for damping in ("damping.stiffness=0.0", "damping.stiffness=0.02", "damping={mass=20.0, stiffness=0.0}"):
        simulation = Simulation(load_scene("silicone", ["mesh.level=1", "gravity=off", "dt=0.001", damping]))
        simulation.state.velocities[:, 2] = -0.05 * (simulation.state.positions[:, 0] < 0)
        for _ in range(60):
            simulation.step()
        e = simulation.energies()
        left.append(e.kinetic + e.strain)
    assert left[1] < 0.9 * left[0]
    assert left[2] < 0.5 * left[0]


def test_mass_damping_of_a_free_body_is_the_recurrence() -> None:
    """v_n = v_0 / (1 + a dt)^n."""
    simulation = Simulation(load_scene(SHARP, [*FREE, "gravity=off", "damping={mass=3.0, stiffness=0.0}"]))
    simulation.state.velocities[:] = [0.0, 0.4, 0.0]
    for _ in range(30):
        simulation.step()
    np.testing.assert_allclose(simulation.state.velocities[:, 1], 0.4 / (1 + 3.0 * 0.005) ** 30, rtol=1e-6)


def test_reset_returns_the_same_bits_and_the_same_motion() -> None:
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1"]))
    start = simulation.state.positions.tobytes()
    ends = []
    for _ in range(2):
        for k in range(30):
            simulation.step(np.array([-0.02 * k, 0.005 * k, 0, 0]))
        ends.append(simulation.state.positions.tobytes() + simulation.state.velocities.tobytes())
        simulation.reset()
        assert simulation.state.positions.tobytes() == start
        assert simulation.state.step == 0
    assert ends[0] == ends[1]
    assert ends[0][: len(start)] != start


def test_the_residual_of_a_step_is_the_gradient_of_its_potential() -> None:
    """Inertia and damping: line searches go by the one, Newton's method by the other."""
    simulation = Simulation(load_scene("silicone", ["mesh.level=1", "mesh.element=h8_mean", "servos=off"]))
    system, state, rng = simulation.system, simulation.state.copy(), np.random.default_rng(3)
    shape = state.positions.shape
    inertia = system.term(Anchor)
    assert inertia and system.damped
    inertia.weight[:] = rng.uniform(1.0, 9.0, len(inertia.weight))
    inertia.point[:] = state.positions + rng.normal(scale=1e-3, size=shape)
    system.aim(3e-3, rng.normal(scale=1e-2, size=system.remembers))
    state.positions[:] += rng.normal(scale=2e-4, size=shape)
    direction, fine = rng.normal(size=shape), 1e-8
    system.evaluate(state)
    gradient = system.gradient.copy()
    ends = []
    for side in (1, -1):
        moved = state.copy()
        moved.positions[:] += side * fine * direction
        ends.append(system.evaluate(moved))
    assert (ends[0] - ends[1]) / (2 * fine) == pytest.approx(float(np.vdot(gradient, direction)), rel=1e-5)
