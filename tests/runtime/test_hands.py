"""Hands on a running simulation: springs that no stiffness makes unstable, loads, and what is refused."""

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.scenes import SHARP
from tripod_runtime.hands import MOST, PATIENCE, Hands
from tripod_sim import SceneError, Simulation, load_scene

SCENES = {
    "tripod": ("tripod", "mesh.level=1"),
    "static": (SHARP, "inertia=off", "damping=off"),
    "cloth": ("cloth",),
    "explicit cloth": ("cloth", "inertia.scheme=semi_implicit_euler", "dt=0.0005"),
    "drape": ("drape",),
    "rigid": ("stack",),
}


def made(*words: str) -> tuple[Simulation, Hands]:
    simulation = Simulation(load_scene(words[0], list(words[1:])))
    return simulation, Hands(simulation)


def stepped(simulation: Simulation, hands: Hands, now: float) -> None:
    simulation.apply_forces(hands.forces(now))
    simulation.step()


def loose(simulation: Simulation) -> int:
    """A vertex that nothing holds."""
    return int(np.argmin(np.linalg.norm(simulation.shown(simulation.mesh.nodes)[:, :2], axis=1)))


@pytest.mark.parametrize("kind", SCENES)
@pytest.mark.parametrize("stiffness", [None, 1e5])
def test_a_pull_brings_its_vertex_nearer_and_stays_bounded(kind: str, stiffness: float | None) -> None:
    simulation, hands = made(*SCENES[kind])
    size = float(np.linalg.norm(np.ptp(simulation.mesh.nodes, axis=0)))
    vertex = loose(simulation)
    start = simulation.shown(simulation.positions)[vertex].copy()
    goal = start + np.array([0.03, 0.0, 0.02]) * size
    steps = max(30, min(200, round(0.3 / simulation.scene.dt)))
    still, _ = made(*SCENES[kind])
    for _ in range(steps):
        hands.pull(1, vertex, start, goal, 0.0, stiffness)
        stepped(simulation, hands, 0.0)
        still.step()
    there, without = (s.shown(s.positions)[vertex] for s in (simulation, still))
    assert np.linalg.norm(goal - there) < np.linalg.norm(goal - without)
    assert np.linalg.norm(there - goal) < 0.2 * size
    assert not simulation.report.instability
    assert "pull" in hands.words()
    if kind == "static" and not stiffness:  # else the place is not known well enough
        grip = np.linalg.norm(goal - there) * hands.stiffness
        force = float(hands.words().split(" N")[0].split()[-1])
        assert force == pytest.approx(grip, rel=0.3)


def test_no_force_where_a_hand_takes_hold() -> None:
    simulation, hands = made(*SCENES["tripod"])
    vertex = loose(simulation)
    place = simulation.shown(simulation.positions)[vertex] + 1e-3
    hands.pull(1, vertex, place, place, 0.0)
    assert all(np.abs(force).max() < 1e-12 for force in hands.forces(0.0).values())


def test_a_hand_that_is_silent_lets_go_and_loads_stay() -> None:
    simulation, hands = made(*SCENES["tripod"])
    vertex, down = loose(simulation), np.array([0.0, 0.0, -0.1])
    hands.pull(1, vertex, np.zeros(3), np.zeros(3), 0.0)
    hands.load(vertex, down)
    assert hands.forces(PATIENCE)
    total = sum(hands.forces(PATIENCE + 0.1).values())
    np.testing.assert_allclose(total, down, atol=1e-12)
    assert "pull" not in hands.words()
    hands.load(vertex, np.zeros(3))
    assert hands.forces(0.0) == {}
    hands.pull(1, vertex, np.zeros(3), np.zeros(3), 0.0)
    hands.let_go(1)
    hands.let_go(2)
    assert hands.forces(0.0) == {}
    hands.load(vertex, down)
    hands.clear()
    assert hands.forces(0.0) == {}


def test_a_load_of_a_hanging_cloth_is_borne_by_what_holds_it() -> None:
    """The pose at rest under a load is the one of equilibrium: force and its reaction."""
    simulation, hands = made(*SCENES["static"])
    vertex = loose(simulation)
    hands.load(vertex, np.array([0.05, 0.0, 0.0]))
    before = simulation.effector
    for _ in range(3):
        stepped(simulation, hands, 0.0)
    after = simulation.effector
    assert before and after and after.position[0] > before.position[0] + 1e-5


def test_what_is_no_hand_is_refused() -> None:
    simulation, hands = made(*SCENES["tripod"])
    count = len(simulation.owners)
    with raises_naming(SceneError, f"vertex {count}", count - 1):
        hands.pull(1, count, np.zeros(3), np.zeros(3), 0.0)
    with raises_naming(SceneError, "vertex -1"):
        hands.load(-1, np.ones(3))
    for stiffness in (0.0, -1.0, np.nan, 1e9):
        with raises_naming(SceneError, "stiffness"):
            hands.pull(1, 0, np.zeros(3), np.zeros(3), 0.0, stiffness)
    for target in (np.array([np.nan, 0, 0]), np.zeros(2), np.array([1e9, 0, 0])):
        with raises_naming(SceneError, "target"):
            hands.pull(1, 0, np.zeros(3), target, 0.0)
        with raises_naming(SceneError, "takes hold"):
            hands.pull(1, 0, target, np.zeros(3), 0.0)
    for who in range(MOST):
        hands.pull(who, 0, np.zeros(3), np.zeros(3), 0.0)
        hands.load(who, np.ones(3))
    with raises_naming(SceneError, MOST):
        hands.pull(MOST, 0, np.zeros(3), np.zeros(3), 0.0)
    with raises_naming(SceneError, MOST):
        hands.load(MOST, np.ones(3))
