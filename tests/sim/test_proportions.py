"""Inputs out of proportion: noted before the first step, and named as the cause where a step cannot be solved."""

import pytest

from tests.messages import assert_names, names
from tests.tiers import sampled
from tripod_sim import Simulation, StepError, load_scene
from tripod_sim.errors import Doubt
from tripod_sim.scene.file import scene_from_toml, scene_names

BAR = """
name = "bar"
dt = 0.005
duration = 0.05
[mesh]
source = "block"
corners = [[0, 0, 0], [0.1, 0, 0], [0.1, 0.02, 0], [0, 0.02, 0],
           [0, 0, 0.02], [0.1, 0, 0.02], [0.1, 0.02, 0.02], [0, 0.02, 0.02]]
cells = [10, 2, 2]
[material]
young = 250e3
density = 1070.0
[inertia]
[[set]]
name = "end"
low = [0.099, -1, -1]
high = [0.101, 1, 1]
[[fixed]]
low = [-0.001, -1, -1]
high = [0.001, 1, 1]
"""
"""Strain spreads in it with sqrt(E / density) = 15.3 m/s."""

TORN = 'prescribed=[{set="end", move="0: 0,0,0; 1: SPEED,0,0"}]'


def doubts(*overrides: str) -> list[str]:
    return [note for note in Simulation(scene_from_toml(BAR, overrides)).notes if isinstance(note, Doubt)]


def why_not(*overrides: str) -> str:
    """Return why the steps of the bar cannot be made."""
    with pytest.raises(StepError) as caught:
        simulation = Simulation(scene_from_toml(BAR, overrides))
        for _ in range(10):
            simulation.step()
    return str(caught.value)


IMPATIENT = ("solver.max_iterations=2", "solver.max_halvings=0", "solver.tolerance=1e-9")
"""So few iterations that no step is solved, whatever the arithmetic: what is looked at is which cause is named."""


def test_gravity_in_millimetres_is_named_where_a_step_cannot_be_solved() -> None:
    said = why_not("gravity.acceleration=[0, 0, -9810]", *IMPATIENT)
    assert_names(said, "gravity.acceleration", "-9810 m/s²", "0 to 1000 m/s²", "-9810mm/s²", "step 1", "node")
    assert not names(said, "solver.max_iterations")


def test_millimetres_read_as_metres_are_named_and_not_the_tolerance() -> None:
    corners = [[1000 * c for c in corner] for corner in scene_from_toml(BAR).mesh.corners]
    words = ("set.0.low=[99, -99, -99]", "set.0.high=[101, 99, 99]", "fixed.0.low=[-1, -99, -99]")
    said = why_not(f"mesh.corners={corners}", *words, "fixed.0.high=[1, 99, 99]", "gravity={}", *IMPATIENT)
    assert_names(said, "100 m", "millimetres", "mesh.scale = 0.001", "step 1")
    assert not names(said, "solver.tolerance")
    assert not names(said, "solver.max_iterations")


def test_a_set_that_is_torn_away_is_named_and_not_the_iterations() -> None:
    """100 m/s against the 15.3 m/s of strain in silicone: elements beside the set are stretched six-fold at once."""
    said = why_not(TORN.replace("SPEED", "100"), "solver.max_iterations=30")
    assert_names(said, "prescribed.0", "100 m/s", "15 m/s", "node")
    assert not names(said, "solver.max_iterations")


def test_what_moves_slower_than_strain_or_as_a_whole_is_no_doubt() -> None:
    assert doubts(TORN.replace("SPEED", "15")) == []
    assert_names(doubts(TORN.replace("SPEED", "16")), "prescribed.0", "16 m/s", "15 m/s")
    turned = 'prescribed=[{set="end", centre=[0.1, 0.01, 0.01], turn="0: 0,0,0; 0.001: 1.6,0,0"}]'
    assert_names(doubts(turned), "prescribed.0", "m/s")  # corners 14 mm off the axis, 1.6 rad in 1 ms: 20 m/s
    whole = ["fixed=off", "initial_velocity=[{velocity=[100.0, 0.0, 0.0]}]"]
    assert doubts(*whole) == []
    part = ["fixed=off", 'initial_velocity=[{set="end", velocity=[100.0, 0.0, 0.0]}]']
    assert_names(doubts(*part), "initial_velocity", "100 m/s", "15 m/s")


def test_loads_beyond_the_stiffness_are_named() -> None:
    """density g L / E is 1 at 250e3 / (1070 x 0.1) = 2336 m/s²; F L / (E V) at E times the cross-section, 100 N."""
    soft = "material.young=1e4"  # a 25th: 93.5 m/s², which is no unusual gravity
    assert doubts(soft, "gravity.acceleration=[0, 0, -93]") == []
    assert_names(doubts(soft, "gravity.acceleration=[0, 0, -94]"), "gravity.acceleration", "94 m/s²")
    load = 'load=[{set="end", force=[FORCE, 0.0, 0.0], share="even"}]'
    assert doubts(load.replace("FORCE", "99.0")) == []
    assert_names(doubts(load.replace("FORCE", "101.0")), "load", "101 N", "stiffness")


@pytest.mark.parametrize("name", sampled(scene_names(), "tripod", "throw", "finger", "column", "cloth"))
def test_no_shipped_scene_is_out_of_proportion(name: str) -> None:
    assert [note for note in Simulation(load_scene(name)).notes if isinstance(note, Doubt)] == []


def test_without_a_doubt_the_limit_of_the_solver_is_named() -> None:
    said = why_not("gravity={}", *IMPATIENT)
    assert_names(said, "solver.max_iterations is 2", "node", "smaller dt")


def test_a_doubt_of_one_body_names_it() -> None:
    words = ["body.0.material.young=1.0"]
    notes = [n for n in Simulation(load_scene("finger", words)).notes if isinstance(n, Doubt)]
    assert_names("; ".join(notes), "body.0.material.young", "1 Pa")
