"""Forces that are applied while a simulation runs: what they do in every kind of stepper, and where they are not."""

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.scenes import SHARP
from tripod_sim import SceneError, Simulation, load_scene

FORCE = np.array([0.02, -0.01, 0.03])
LOOSE = ("cloth", "gravity=off", "springs.fixed_corners=[]")
COARSE = ("silicone_free", "gravity=off", "mesh.level=1", "dt=0.002")
FREE = {
    "implicit": COARSE,
    "explicit": (*COARSE, "inertia.scheme=semi_implicit_euler", "damping=off"),
    "spring loop": (
        "cloth",
        "gravity=off",
        "springs.fixed_corners=[]",
        "inertia.scheme=semi_implicit_euler",
        "dt=0.0005",
    ),
    "automatic": (*LOOSE, "dt=auto"),
    "implicit springs": (
        "cloth",
        "gravity=off",
        "springs.fixed_corners=[]",
        "inertia.scheme=implicit_euler",
        "dt=0.002",
    ),
    "contact": ("drape", "gravity=off", "sleep=off", "damping=off", "inertia.scheme=implicit_euler"),
}


def made(*words: str) -> Simulation:
    return Simulation(load_scene(words[0], list(words[1:])))


def momentum(simulation: Simulation) -> np.ndarray:
    return np.asarray(simulation._mass @ simulation.state.velocities)


@pytest.mark.parametrize("kind", FREE)
def test_a_free_body_gains_the_impulse(kind: str) -> None:
    """p = f t while the force acts, and no more after it."""
    simulation = made(*FREE[kind])
    simulation.step()
    nodes = len(simulation.mesh.nodes)
    begin, time = momentum(simulation), simulation.state.time
    simulation.apply_forces({3: FORCE, nodes - 1: FORCE})
    for _ in range(5):
        simulation.step()
    gained, duration = momentum(simulation) - begin, simulation.state.time - time
    np.testing.assert_allclose(gained, 2 * FORCE * duration, rtol=2e-3)
    assert not simulation.report.instability
    simulation.apply_forces({})
    assert not simulation.pushed
    for _ in range(5):
        simulation.step()
    np.testing.assert_allclose(momentum(simulation) - begin, gained, rtol=5e-2)


def test_at_rest_it_is_a_load() -> None:
    """The same pose as with [[load]] on that node."""
    words = (SHARP, "inertia=off", "damping=off")
    pushed = made(*words)
    node = int(np.argmax(pushed.mesh.nodes[:, 0] * (np.abs(pushed.mesh.nodes[:, 0]) < 0.03)))
    x, y, z = pushed.mesh.nodes[node]
    box = f"low=[{x - 1e-4},{y - 1e-4},{z - 1e-4}],high=[{x + 1e-4},{y + 1e-4},{z + 1e-4}]"
    load = "load=[{set='one',share='even',force=[0.05,0.02,0.1]}]"
    loaded = made(*words, f"set=[{{name='one',{box}}}]", load)
    pushed.apply_forces({node: np.array([0.05, 0.02, 0.1])})
    for _ in range(2):
        pushed.step()
        loaded.step()
    moved = np.linalg.norm(pushed.state.positions - made(*words).state.positions, axis=1).max()
    assert moved > 1e-3
    np.testing.assert_allclose(pushed.state.positions, loaded.state.positions, atol=1e-4 * moved)


def test_a_point_of_a_rigid_body_is_pushed_and_turned() -> None:
    """m dv = f t and I dw = r x f t, for steps that hardly turn it."""
    simulation = made("bounce", "gravity=off", "dt=0.001", "inertia.scheme=implicit_euler")
    rigid = simulation._parts.rigid
    assert rigid
    node, force = len(simulation.mesh.nodes) - 1, np.array([1e-3, 2e-3, -1e-3])
    arm = simulation.positions[node] - simulation.state.rigid.centres[-1]
    speed = simulation.state.rigid.velocities[-1].copy()
    simulation.apply_forces({node: force})
    simulation.step()
    dv = simulation.state.rigid.velocities[-1] - speed
    np.testing.assert_allclose(dv, force * 0.001 / rigid.mass[-1], rtol=1e-6)
    spin = np.linalg.solve(rigid.inertia[-1], np.cross(arm, force)) * 0.001
    np.testing.assert_allclose(
        simulation.state.rigid.spins[-1], spin, rtol=1e-3, atol=1e-6 * np.abs(spin).max()
    )


def test_reset_ends_them_and_gives_the_bits_of_the_start() -> None:
    for words in (FREE["implicit"], FREE["spring loop"], FREE["automatic"]):
        fresh, pushed = made(*words), made(*words)
        pushed.apply_forces({5: FORCE})
        pushed.step()
        pushed.reset()
        assert not pushed.pushed
        for _ in range(3):
            fresh.step()
            pushed.step()
        assert fresh.state.positions.tobytes() == pushed.state.positions.tobytes()


def test_a_sleeping_body_wakes() -> None:
    simulation = made("drape", "gravity=off", "sleep.time=0.02")
    for _ in range(60):
        simulation.step()
    assert simulation.report.asleep
    simulation.apply_forces({0: FORCE})
    assert not simulation.step().asleep


def test_the_error_of_the_mesh_is_not_known_meanwhile() -> None:
    words = (SHARP, "clamp.stiffness=1.4e10", "inertia=off", "damping=off", "mesh_error.share=1e6")
    simulation = made(*words)
    simulation.step()
    before = simulation.report.mesh_error
    assert before and before.distance > 0
    simulation.apply_forces({50: FORCE})
    report = simulation.step()
    assert report.mesh_error and np.isnan(report.mesh_error.distance)
    told = simulation.mesh_error()
    assert told and np.isnan(told.distance)
    simulation.apply_forces({})
    simulation.step()
    after = simulation.step().mesh_error
    assert after and after.distance == pytest.approx(before.distance, rel=1e-3)


def test_forces_are_shown_as_loads() -> None:
    simulation = made(*FREE["implicit"])
    simulation.keep_forces()
    assert "load" not in simulation.force_groups
    simulation.apply_forces({7: FORCE})
    simulation.step()
    [load] = [group for group in simulation.forces() if group.name == "load"]
    np.testing.assert_array_equal(load.vectors, FORCE[None])
    np.testing.assert_array_equal(load.points, simulation.state.positions[7][None])


def test_nothing_is_there_before_the_first_force() -> None:
    simulation = made(*FREE["implicit"])
    terms = len(simulation.system.terms)
    simulation.apply_forces({})
    assert len(simulation.system.terms) == terms
    simulation.apply_forces({1: FORCE})
    simulation.apply_forces({2: FORCE})
    assert len(simulation.system.terms) == terms + 1


def test_what_is_no_force_is_refused_and_changes_nothing() -> None:
    simulation = made(*FREE["implicit"])
    simulation.apply_forces({1: FORCE})
    nodes = len(simulation.mesh.nodes)
    for node in (-1, nodes):
        with raises_naming(SceneError, f"node {node}", nodes - 1):
            simulation.apply_forces({node: FORCE})
    for force in (np.array([np.nan, 0, 0]), np.array([0, np.inf, 0]), np.zeros(2), np.array([1e7, 0, 0])):
        with raises_naming(SceneError, "node 3"):
            simulation.apply_forces({3: force})
    assert simulation.pushed
