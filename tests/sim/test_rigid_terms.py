"""Forces on free rigid bodies: terms that act on them, drags that do not, one state for all bodies."""

from collections.abc import Sequence

import numpy as np
import pytest

from tests.messages import assert_names
from tests.sim.implicit_schemes import IMPLICIT
from tripod_host.arrays import FloatArray
from tripod_host.rotations import rotation_matrix
from tripod_sim import Simulation, load_scene
from tripod_sim.constraints.groups import RigidMotion
from tripod_sim.forces.term import Term

A, V, W = 3.0, 0.4, 7.0
"""Drag over mass and speed [1/s]; speed [m/s] and spin [rad/s] at the start."""

ALONE = ["bounce", "gravity=off", "dt=0.01", f"rigid.0.velocity=[{V}, 0, 0]", f"rigid.0.spin=[0, 0, {W}]"]
BALL = f"shape='ball', radius=0.01, mass=0.02, position=[0, 0, 0.3], velocity=[{V}, 0, 0], spin=[0, 0, {W}]"
BESIDE = ["drape", "gravity=off", "dt=0.01", "springs.nodes=5", f"rigid=[{{{BALL}}}]"]


class Drag(Term):
    """A force -a m v and a moment -a I w on rigid bodies: in a stage the potential a s / 2 (m v² + w . I w)."""

    acts_on_rigid = True

    def __init__(self, a: float, mass: FloatArray, inertia: FloatArray, *, stiff: bool) -> None:
        """`inertia`: of balls, shape (b,); `stiff`: whether the Hessian is known."""
        self._a, self._mass, self._inertia, self._stiff = a, mass[:, None], inertia[:, None], stiff

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        return 0.0

    def add_rigid_gradient(self, motion: RigidMotion, s: float, g: FloatArray) -> float:
        force, moment = self._a * self._mass * motion.velocities, self._a * self._inertia * motion.spins
        g[:, :3] += force
        g[:, 3:] += moment
        return 0.5 * s * float((motion.velocities * force).sum() + (motion.spins * moment).sum())

    def add_rigid_stiffness(self, motion: RigidMotion, s: float, h: FloatArray) -> None:
        if self._stiff:
            h += (
                self._a
                / s
                * np.repeat(np.hstack([self._mass, self._inertia]), 3, axis=1)[:, None]
                * np.eye(6)
            )


def dragged(words: Sequence[str], a: float, *, stiff: bool) -> Simulation:
    simulation = Simulation(load_scene(words[0], list(words[1:])))
    rigid = simulation._parts.rigid
    simulation.system.take(Drag(a, rigid.mass, rigid.inertia[:, 0, 0], stiff=stiff))
    return simulation


@pytest.mark.parametrize("a", [A, 2000.0])
@pytest.mark.parametrize("words", [ALONE, BESIDE], ids=["alone", "beside a cloth"])
def test_a_drag_slows_rigid_bodies_as_the_scheme_says(words: list[str], a: float) -> None:
    """v' = v / (1 + a h) for implicit Euler, the spin alike, also where the drag is far stiffer than inertia."""
    simulation = dragged(words, a, stiff=True)
    for k in range(1, 4):
        simulation.step()
        share = (1 + a * simulation.scene.dt) ** -k
        np.testing.assert_allclose(simulation.state.rigid.velocities[0], [share * V, 0, 0], atol=1e-9 * V)
        np.testing.assert_allclose(simulation.state.rigid.spins[0], [0, 0, share * W], atol=1e-9 * W)
        assert simulation.report.iterations <= 2, "the Hessian is exact"


@pytest.mark.parametrize("scheme", IMPLICIT)
def test_a_drag_of_rigid_bodies_needs_no_hessian_and_converges_in_every_scheme(scheme: str) -> None:
    errors = []
    for dt in (0.01, 0.005):
        simulation = dragged([*ALONE, f"dt={dt}", f"inertia.scheme={scheme}"], A, stiff=False)
        for _ in range(round(0.1 / dt)):
            simulation.step()
        errors.append(abs(float(simulation.state.rigid.velocities[0, 0]) - V * np.exp(-0.1 * A)))
        assert simulation.state.rigid.spins[0, 2] / W == pytest.approx(
            simulation.state.rigid.velocities[0, 0] / V
        )
    order = 1.0 if scheme == "implicit_euler" else 2.0
    assert np.log2(errors[0] / errors[1]) > order - 0.35


class Spring(Term):
    """Ties what stands at `point` in the frame of body 0 to where it is at the start: k |c + R p - y|² / 2."""

    acts_on_rigid = True

    def __init__(self, stiffness: float, point: FloatArray, anchor: FloatArray) -> None:
        self._k, self._point, self._anchor = stiffness, point, anchor

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        return 0.0

    def add_rigid_gradient(self, motion: RigidMotion, s: float, g: FloatArray) -> float:
        arm = motion.rotations[0] @ self._point
        off = motion.centres[0] + arm - self._anchor
        g[0, :3] += self._k * off
        g[0, 3:] += self._k * np.cross(arm, off)
        return 0.5 * self._k * float(off @ off)


def test_moments_of_terms_are_per_small_turn() -> None:
    """The gradient that a step sees is the derivative of its potential after a large turn, too."""
    simulation = Simulation(load_scene("bounce", ["gravity=off"]))
    world = simulation._world
    bodies = world.rigid
    assert bodies
    simulation.step()
    simulation.system.take(Spring(30.0, np.array([0.02, -0.01, 0.03]), np.array([0.1, 0.2, 0.6])))
    u, rng = np.array([0.01, -0.02, 0.03, 0.9, -1.2, 0.4]), np.random.default_rng(0)
    found, unused = np.zeros(6), np.zeros(6)
    bodies.add(u, found)
    for _ in range(5):
        du = 1e-6 * rng.standard_normal(6)
        change = bodies.add(u + du, unused) - bodies.add(u - du, unused)
        assert change / 2 == pytest.approx(found @ du, rel=1e-6)


def test_mass_damping_beside_rigid_bodies_says_that_they_have_no_drag() -> None:
    words = [*BESIDE[1:], f"damping.mass={A}"]
    simulation = Simulation(load_scene("drape", words))
    note = next(note for note in simulation.notes if "damping.mass" in note)
    assert_names(note, "damping.mass", "rigid.0")
    simulation.advance(3)
    np.testing.assert_allclose(simulation.state.rigid.velocities[0], [V, 0, 0], atol=1e-12)
    assert not any(
        "damping.mass" in note
        for note in Simulation(load_scene("drape", [*words[:-1], "damping.mass=0"])).notes
    )


def test_free_rigid_bodies_come_behind_the_disc_in_the_one_state() -> None:
    simulation = Simulation(load_scene("tripod_ball", ["mesh.level=1"]))
    state, groups = simulation.state, simulation.system.groups
    assert (len(groups.rigid), groups.free, state.centres.shape) == (1, 1, (2, 3))
    assert simulation.unknowns == simulation.system.unknowns + 6
    assert simulation.effector
    assert simulation.ball
    state.centres[1] = 0.1, 0.2, 0.3
    state.rotations[1] = rotation_matrix(np.array([0.0, 0.0, 0.5]))
    np.testing.assert_array_equal(simulation.ball.position, [0.1, 0.2, 0.3])
    assert simulation.ball.quaternion[2] == pytest.approx(np.sin(0.25))
    other = state.copy()
    state.rigid.spins[:] = 1.0
    state.copy_to(other)
    np.testing.assert_array_equal(other.spins, np.ones((1, 3)))
    np.testing.assert_array_equal(other.rigid.centres, state.centres[1:])
