"""Explicit schemes over lists of terms: several bodies, materials and springs: order, agreement, limit, momentum."""

import numpy as np
import pytest
import scipy.linalg
from numba import typeof

from tripod_sim import Simulation, load_scene
from tripod_sim.forces.spring_force import SpringForce, write_networks
from tripod_sim.integrators.explicit import ExplicitSteps
from tripod_sim.scene.file import scene_from_toml, scene_to_toml
from tripod_sim.system import System

CABLE = ["damping={mass=5.0, stiffness=1e-5}", "body.1.springs.damping=0.02"]
"""A finger that its cable bends, with dampers along the cable."""


def bent(scheme: str, dt: float, *words: str) -> np.ndarray:
    """Positions after 4 ms [m]."""
    simulation = Simulation(load_scene("finger", [*CABLE, f"inertia.scheme={scheme}", f"dt={dt}", *words]))
    for _ in range(round(0.004 / dt)):
        simulation.step()
    return simulation.positions.copy()


def test_a_cable_bends_a_finger_at_the_order_of_each_scheme_and_as_implicitly() -> None:
    reference = bent("rk4", 2e-5)
    assert np.abs(reference - Simulation(load_scene("finger")).positions).max() > 2e-4
    for scheme, order, steps in (
        ("semi_implicit_euler", 1, (4e-5, 2e-5)),
        ("rk4", 4, (8e-5, 4e-5)),
        ("tr_bdf2", 2, (5e-5, 2.5e-5)),
    ):
        errors = [np.abs(bent(scheme, dt, "solver.tolerance=1e-8") - reference).max() for dt in steps]
        assert np.log2(errors[0] / errors[1]) > order - 0.3, scheme
        assert errors[1] < 5e-6, scheme


@pytest.mark.parametrize("element", ["h8_modes", "t10"])
@pytest.mark.parametrize("scheme", ["semi_implicit_euler", "rk4"])
def test_two_equal_materials_are_one(element: str, scheme: str) -> None:
    words = ["mesh.level=1", f"mesh.element={element}", f"inertia.scheme={scheme}", "dt=2e-4",
             "damping={mass=5.0, stiffness=2e-6}"]  # fmt: skip
    whole = load_scene("silicone_free", words)
    half = '\n[[set]]\nname = "half"\nalong = [1, 0, 0]\nbeyond = 0.0\n[[region]]\nset = "half"\n'
    material = whole.material
    assert material
    text = (
        scene_to_toml(whole)
        + half
        + f'young = {material.young}\npoisson = {material.poisson}\nlaw = "{material.law}"\n'
    )
    found = [Simulation(whole), Simulation(scene_from_toml(text))]
    assert len(found[1]._system.elastic.terms) == 2  # type: ignore[union-attr]
    one, two = (typeof(simulation._stepper._solids_of(simulation.state)) for simulation in found)
    assert one == two, "nothing is compiled once more for a second material"
    for simulation in found:
        simulation.state.velocities[:] = np.cross([9.0, 6.0, 12.0], simulation.state.positions)
        simulation.state.velocities[:, 2] += 200.0 * simulation.state.positions[:, 0] ** 2
        for _ in range(6):
            simulation.step()
    moved = np.abs(found[0].positions - found[0].mesh.nodes).max()
    np.testing.assert_allclose(found[1].positions, found[0].positions, rtol=0, atol=1e-9 * moved)


def test_bodies_apart_move_as_each_alone_and_keep_their_momentum() -> None:
    """A solid and a net that never meet; the net is also moved by the compiled loop of springs alone."""
    net = """
[[body]]
name = "net"
position = [0.0, 0.0, 1.0]
[body.springs]
source = "grid"
nodes = 4
size = 0.1
stiffness = 50.0
damping = 0.01
compressed = "slack"
"""
    words = ["mesh.level=1", "gravity=off", "damping={mass=1.0, stiffness=1e-6}", "dt=4e-5",
             "inertia.scheme=rk4"]  # fmt: skip
    solid = load_scene("silicone_free", words)
    scene = scene_from_toml(scene_to_toml(solid) + net)
    alone = scene_from_toml(
        scene_to_toml(solid).partition("[mesh]")[0]
        + '[inertia]\nscheme = "rk4"\n[damping]\nmass = 1.0\nstiffness = 1e-6\n'
        + net.partition("position")[2].partition("\n")[2].replace("[body.springs]", "[springs]")
    )
    both, first, second = Simulation(scene), Simulation(solid), Simulation(alone)
    n = len(first.positions)
    rng = np.random.default_rng(0)
    kick = 0.3 * rng.standard_normal(both.positions.shape)
    for simulation, own in ((both, slice(None)), (first, slice(n)), (second, slice(n, None))):
        simulation.state.velocities[:] = kick[own]
    parts = 0
    for _ in range(100):
        parts = max(parts, both.step().parts)
        first.step()
        second.step()
    assert parts == 1  # else lengths of parts would differ
    np.testing.assert_allclose(both.positions[:n], first.positions, rtol=0, atol=1e-12)
    lifted = second.positions + np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(both.positions[n:], lifted, rtol=0, atol=1e-12)
    assert np.abs(lifted - both.mesh.nodes[n:]).max() > 1e-3


def test_the_limit_is_that_of_all_terms() -> None:
    """The largest frequency of solid, springs at their stiffest, and the largest rate of the dampers."""
    words = ["damping=off", "body.1.springs.damping=0.5", "body.1.springs.stiffness=20000.0",
             "inertia.scheme=semi_implicit_euler", "dt=1e-5"]  # fmt: skip
    simulation = Simulation(load_scene("finger", words))
    report = simulation.step()
    system, stepper, mass = simulation._system, simulation._stepper, simulation._mass
    assert isinstance(system, System)
    assert isinstance(stepper, ExplicitSteps)
    springs = next(t for t in system.elastic.terms if isinstance(t, SpringForce))
    free = np.flatnonzero(~system.groups.held().all(axis=1))
    rows = (3 * free[:, None] + np.arange(3)).ravel()

    def largest(terms: list) -> float:
        K = np.zeros((3 * len(mass), 3 * len(mass)))
        for term in terms:
            for nodes, block in zip(term.elements, term.matrices, strict=True):
                own = (3 * nodes[:, None] + np.arange(3)).ravel()
                K[np.ix_(own, own)] += block
        M = np.diag(np.repeat(mass, 3))
        return float(scipy.linalg.eigh(K[np.ix_(rows, rows)], M[np.ix_(rows, rows)], eigvals_only=True)[-1])

    solid = largest([t for t in system.elastic.terms if t.matrices.shape[1] > 6])
    system.elastic.limit()
    square = 1.05**2 * largest([*system.elastic.terms])
    write_networks(springs.links.damping, springs.matrices)
    rate = 1.05**2 * largest([springs])
    assert square > 1.5 * solid
    assert rate > 0.1 * np.sqrt(square)
    limit = 4.0 / (np.sqrt(rate**2 + 4 * square) + rate)
    assert report.dt_limit == pytest.approx(limit, rel=0.01)


def test_another_term_that_becomes_the_stiffest_is_seen() -> None:
    net = '[[body]]\nname = "net"\nposition = [0, 0, 1]\n[body.springs]\nsource = "grid"\nnodes = 4\nsize = 0.1\n'
    solid = scene_to_toml(load_scene("silicone_free", ["mesh.level=1", "dt=1e-4", "inertia.scheme=rk4"]))
    simulation = Simulation(scene_from_toml(solid + net + "stiffness = 50.0\n"))
    simulation.step()
    system, stepper = simulation._system, simulation._stepper
    assert isinstance(system, System)
    assert isinstance(stepper, ExplicitSteps)
    before, springs = stepper._frequency.largest(simulation.state), system.elastic.terms[1]
    springs.matrices *= 1e7
    first = stepper._frequency.largest(simulation.state)
    assert first > 10 * before
    for _ in range(20):
        last = stepper._frequency.largest(simulation.state)
    assert first == pytest.approx(last, rel=0.05)


def test_reset_of_several_bodies_returns_the_same_bits() -> None:
    simulation = Simulation(load_scene("finger", [*CABLE, "inertia.scheme=semi_implicit_euler", "dt=1e-3"]))
    ends = []
    for _ in range(2):
        for _ in range(3):
            simulation.step()
        ends.append(simulation.positions.tobytes())
        simulation.reset()
    assert ends[0] == ends[1]


@pytest.mark.parametrize("scheme", ["semi_implicit_euler", "rk4"])
def test_a_free_body_with_a_disc_moves_though_nothing_resists(scheme: str) -> None:
    """Its static tangent is singular, so it may have no compliance."""
    words = ["mesh.level=1", "mesh.element=h8_modes", f"inertia.scheme={scheme}", "dt=2e-4", "effector={}",
             "damping={mass=5.0, stiffness=2e-6}"]  # fmt: skip
    net = '[[body]]\nname = "net"\nposition = [0, 0, 1]\n[body.springs]\nsource = "grid"\nnodes = 4\nsize = 0.1\n'
    simulation = Simulation(scene_from_toml(scene_to_toml(load_scene("silicone_free", words)) + net))
    simulation.step()
    assert simulation.state.velocities[:, 2].max() < 0
