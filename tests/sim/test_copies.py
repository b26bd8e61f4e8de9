"""Copies of simulations go on as the original does, and neither moves the other."""

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tripod_sim import SceneError, Simulation, load_scene
from tripod_study.explain.sampling import swing

SCENES = {
    "cloth": ("cloth", ["springs.nodes=5"]),
    "solid in contact": ("silicone_drop", ["mesh.level=1"]),
    "solid": ("silicone", ["mesh.level=1"]),
}


def pickled(simulation: Simulation) -> Simulation:
    """Return what is read from the bytes of a simulation."""
    found = pickle.loads(pickle.dumps(simulation))
    assert isinstance(found, Simulation)
    return found


def go_on(simulation: Simulation, steps: int) -> None:
    """Make steps during which servos turn, if there are any."""
    for _ in range(steps):
        simulation.step(swing(simulation, simulation.state.step))


@pytest.mark.parametrize("copied", [copy.deepcopy, copy.copy, pickled])
@pytest.mark.parametrize("name", SCENES)
def test_a_copy_goes_on_as_after_restore(name: str, copied: Callable[[Simulation], Simulation]) -> None:
    scene = load_scene(*SCENES[name])
    original, other = Simulation(scene), Simulation(scene)
    original.advance(5)
    other.restore(original.save())
    twin = copied(original)
    there = original.positions.copy()
    for _ in range(10):
        twin.step()
        other.step()
    assert np.array_equal(twin.positions, other.positions)
    assert not np.array_equal(twin.positions, there)
    assert np.array_equal(original.positions, there)


@pytest.mark.parametrize(
    ("source", "words", "steps"),
    [
        ("two_cloths", [], 30),
        ("two_cloths", ["inertia.scheme=tr_bdf2"], 30),
        ("pile", [], 20),
        ("pile", ["contact.response=penalty"], 20),
        ("pile", ["inertia.scheme=bdf2"], 20),
        ("maze", ["mesh.level=1"], 20),
    ],
)
def test_how_it_goes_on_depends_on_the_restored_state_alone(
    source: str, words: list[str], steps: int
) -> None:
    """What contacts there were, which decide in what order a Hessian is factored, how long dampers were, and where a
    ball lay.
    """
    scene = load_scene(source, words)
    original, fresh = Simulation(scene), Simulation(scene)
    go_on(original, steps)
    saved, found = original.save(), []
    for simulation in (original, fresh, fresh):
        simulation.restore(saved)
        go_on(simulation, 3)
        found.append(simulation.positions.copy())
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[1], found[2])


def test_a_name_in_place_of_a_scene_is_refused() -> None:
    with raises_naming(SceneError, "scene is 'tripod'", "load_scene"):
        Simulation("tripod")  # type: ignore[arg-type]


def test_what_a_program_keeps_of_a_step_stays_as_it_was() -> None:
    simulation = Simulation(load_scene("tripod", ["mesh.level=1", "mesh.element=h8_modes"]))

    def told() -> list[np.ndarray]:
        pose, c = simulation.effector, simulation.compliance()
        assert pose
        return [
            simulation.efforts, simulation.command, pose.position, pose.quaternion, c.w, c.efforts, c.angles,
            c.position, c.equilibrium_offset,
        ]  # fmt: skip

    go_on(simulation, 5)
    kept = told()
    then = [array.copy() for array in kept]
    for change in (simulation.step, lambda: go_on(simulation, 5), simulation.reset):
        change()
        told()
    assert all(np.array_equal(a, b) for a, b in zip(kept, then, strict=True))


def test_a_notebook_shows_a_simulation_and_a_state_in_one_line() -> None:
    simulation = Simulation(load_scene("cloth", ["springs.nodes=5"]))
    simulation.advance(3)
    state, whole = repr(simulation.save()[0]), repr(simulation)
    assert_names(state, "State", "25 nodes", "0.015 s", "step 3")
    assert_names(whole, "Simulation", "'cloth'", "69 unknowns")
    assert state in whole
    assert "\n" not in whole
