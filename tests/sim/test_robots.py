"""The shipped robots with cables and air: symmetry, convergence, sizes of their motions; their mesh files."""

import numpy as np
import pytest

from tools.robot_meshes import MESHES, SCENES, text
from tripod_sim import Simulation, load_scene

STILL = ("inertia=off", "damping=off", "solver.tolerance=1e-6")


def led(name: str, values: dict[str, float], *words: str, parts: int = 5) -> Simulation:
    """Return a robot at rest, its actuators led evenly from 0 to `values`."""
    simulation = Simulation(load_scene(name, [*STILL, *words]))
    assert simulation.joints
    names = [a.name for a in simulation.joints.actuators]
    goal = np.array([*(values.get(one, 0.0) for one in names), 0.0])
    for k in range(1, parts + 1):
        simulation.step(goal * k / parts)
    return simulation


def moved(simulation: Simulation) -> np.ndarray:
    """Return by how much the watched set has moved on average [m]."""
    return simulation.markers[0] - simulation.undeformed(0)


@pytest.mark.parametrize("name", MESHES)
def test_a_mesh_file_is_what_the_tool_writes(name: str) -> None:
    assert (SCENES / f"{name}.gidmsh").read_text(encoding="ascii") == text(MESHES[name]())


def test_four_equal_cables_lift_the_diamond_straight_and_one_more_leans_it_away() -> None:
    north, south, sides = "north", "south", {"west": 0.01, "east": 0.01}
    still = moved(led("diamond", {}))
    lifted = led("diamond", {north: 0.01, south: 0.01, **sides})
    assert moved(lifted)[:2] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert moved(lifted)[2] - still[2] == pytest.approx(0.0191, abs=0.0003)
    assert lifted.efforts == pytest.approx(lifted.efforts.mean(), rel=1e-4)
    one = moved(led("diamond", {north: 0.012, south: 0.008, **sides}))
    other = moved(led("diamond", {north: 0.008, south: 0.012, **sides}))
    assert one[1] == pytest.approx(-0.0034, abs=0.0002)
    assert one * [1, -1, 1] == pytest.approx(other, abs=1e-6)


def test_opposite_cables_of_the_trunk_mirror_each_other() -> None:
    north, south = (moved(led("trunk", {one: 0.02, f"{one}_half": 0.005})) for one in ("north", "south"))
    assert north[1] == pytest.approx(0.0481, abs=0.0005)
    assert north * [1, -1, 1] == pytest.approx(south, abs=1e-7)
    east = moved(led("trunk", {"east": 0.02, "east_half": 0.005}))
    assert east[[1, 0, 2]] == pytest.approx(north, abs=1e-7)


def test_the_half_cables_of_the_trunk_move_its_middle_more() -> None:
    ends = [led("trunk", {one: 0.01}) for one in ("north", "north_half")]
    z = ends[0].mesh.nodes[:, 2]
    middle = np.abs(z + 0.097) < 1e-6
    long, half = (simulation.positions[middle, 1].mean() for simulation in ends)
    assert half > 1.5 * long


def test_the_two_cables_of_the_finger_bend_it_and_their_difference_swings_it() -> None:
    both = moved(led("finger_cable", {"left": 0.01, "right": 0.01}))
    assert both[1] == pytest.approx(0.0, abs=1e-7)
    left, right = (moved(led("finger_cable", {one: 0.008})) for one in ("left", "right"))
    assert left[1] > 0.002
    assert left * [1, -1, 1] == pytest.approx(right, abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "values", "within"),
    [
        ("finger_cable", {"left": 0.01, "right": 0.01}, 0.03),
        ("finger_pneumatic", {"air": 10e3}, 0.25),
        ("diamond", {"north": 0.02, "west": 0.01, "east": 0.01}, 0.06),
        ("trunk", {"north": 0.02}, 0.15),
    ],
)
def test_a_finer_mesh_moves_alike(name: str, values: dict[str, float], within: float) -> None:
    coarse, fine = (moved(led(name, values, f"mesh.refine={n}")) for n in (0, 1))
    assert np.linalg.norm(coarse - fine) < within * np.linalg.norm(fine)


def test_air_bends_the_pneumatic_finger_by_some_twenty_millimetres() -> None:
    simulation = led("finger_pneumatic", {"air": 10e3})
    assert moved(simulation)[2] == pytest.approx(-0.0221, abs=0.0005)
    assert moved(simulation)[1] == pytest.approx(0.0, abs=1e-9)
    positions, _ = simulation.joint_work()
    assert positions[0] == pytest.approx(12.9e-6, abs=0.1e-6)
