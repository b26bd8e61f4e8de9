"""Statics tell of equilibria that a body in motion would leave."""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.messages import names
from tests.sim.actuator_scenes import BY_LENGTH, dome, finger
from tripod_sim import Simulation, load_scene
from tripod_sim.mesh import y_piece
from tripod_study.run import run

STATIC = ("inertia=off", "damping=off")
LENGTH, WIDTH, PRESSED = 0.1, 0.01, 0.006  # [m]
CORNERS = [
    [0.5 * WIDTH * x, 0.5 * WIDTH * y, z]
    for z in (0.0, LENGTH)
    for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
]
COLUMN = (
    *STATIC,
    f"mesh.corners={CORNERS}",
    "mesh.cells=[1,1,10]",
    f"prescribed=[{{set='head', move='0: 0,0,0; 1: 0,0,{-PRESSED}'}}]",
    "dt=0.05",
)


@pytest.mark.parametrize("element", ["h8_modes", "h20"])
def test_a_column_held_straight_is_unstable_beyond_euler_s_load(element: str) -> None:
    """Clamped at both ends it buckles once it is pressed by 4 pi² I / (A L²) = 3.3 % of its length, by Euler."""
    simulation = Simulation(load_scene("column", [*COLUMN, f"mesh.element={element}"]))
    found = [simulation.step().unstable for _ in range(20)]
    first = found.index(True)
    assert found == [False] * first + [True] * (20 - first)
    euler = np.pi**2 * WIDTH**2 / (3 * LENGTH**2)
    assert euler < PRESSED / LENGTH * (first + 1) / 20 < 1.25 * euler  # by 0.3 % more in each step


def test_a_run_says_when_it_became_unstable() -> None:
    told: list[str] = []
    notes = run("column", duration=1.0, overrides=COLUMN, noted=told.append)["notes"]
    assert notes == told
    (note,) = (note for note in notes if names(note, "steps", "unstable equilibrium"))
    first = re.search(r"\bat (\d\.\d+) s", note)
    assert first
    assert 0.6 <= float(first[1]) < 0.7
    assert "notes" not in run("column", duration=0.4, overrides=COLUMN)


def test_a_mesh_that_buckles_in_the_clamp_is_told_and_level_12_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def found() -> bool:
        simulation = Simulation(load_scene("tripod", [*STATIC, "mesh.element=h8_modes", "mesh.level=12"]))
        way = [share * np.array([-1.4965] * 3 + [0.035]) for share in np.linspace(0.2, 1, 5)]
        way += [np.array([a, a, a, 0.035]) for a in np.linspace(-1.55, -1.9, 8)]
        return sum(simulation.step(joints).unstable for joints in way) > 0

    assert not found()
    short = y_piece.YLevel(2, 1, 7, 1.31, clamped=3, clamped_grading=1.84)
    monkeypatch.setitem(y_piece.LEVELS, 12, short)
    assert found()


def test_a_dome_that_vacuum_everts_is_reported_as_snapped(tmp_path: Path) -> None:
    scene = dome(tmp_path)
    simulation = Simulation(load_scene(scene))
    top = int(np.argmax(simulation.mesh.nodes[:, 2]))
    heights, found = [simulation.positions[top, 2]], []
    for pressure in np.linspace(-10.0, -200.0, 20):
        found.append(simulation.step(np.array([pressure, 0.0])).snapped)
        heights.append(simulation.positions[top, 2])
    falls = -np.diff(heights)
    assert sum(found) == 1
    assert found.index(True) == np.argmax(falls)
    assert falls.max() > 0.01  # from an arch of 12 mm to one that hangs
    assert np.sort(falls)[-2] < 0.001
    (note,) = (note for note in run(scene)["notes"] if names(note, "snapped", "[inertia]"))
    assert " at 0 s" not in note


def test_a_cable_that_bends_a_robot_far_does_not_snap_it(tmp_path: Path) -> None:
    simulation = Simulation(load_scene(finger(tmp_path), [*STATIC, BY_LENGTH]))
    for pull in np.linspace(0.002, 0.03, 15):
        assert not simulation.step(np.array([pull, 0.0])).snapped
    assert simulation.markers[0][2] < -0.05
