"""Where a dead pressure is far from that of a gas or a liquid, the run says so."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.blocks import brick
from tests.messages import assert_names, line_naming
from tripod_bringup.cli import app
from tripod_sim import Simulation, load_scene
from tripod_sim.forces.dead_pressure import TurnWatch
from tripod_sim.mesh.closed_surface import encloses
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import SolidMesh

BAR = """
name = "bar"
dt = 0.005
duration = 0.1
[mesh]
source = "block"
corners = [[0, 0, 0], [0.1, 0, 0], [0.1, 0.01, 0], [0, 0.01, 0],
           [0, 0, 0.01], [0.1, 0, 0.01], [0.1, 0.01, 0.01], [0, 0.01, 0.01]]
cells = [10, 1, 1]
[material]
young = 1e6
poisson = 0.3
mass = 0.01
[inertia]
[[set]]
name = "top"
along = [0, 0, 1]
at = 0.01
[[fixed]]
low = [-1e-6, -1.0, -1.0]
high = [1e-6, 1.0, 1.0]
[[load]]
"""


def bar(folder: Path, load: str) -> Path:
    path = folder / "bar.toml"
    path.write_text(BAR + load)
    return path


def hollow(element: str) -> SolidMesh:
    """A cube of 3 x 3 x 3 cells without the middle one."""
    mesh = brick("h8", [np.linspace(0, 3, 4)] * 3)
    inside = np.abs(mesh.nodes[mesh.elements].mean(axis=1) - 1.5).max(axis=1) < 0.1
    cells = SolidMesh.of(mesh.nodes, mesh.elements[~inside], mesh.kind)
    return cells if element == "h8" else convert(cells, element)


@pytest.mark.parametrize("element", ["h8", "t10", "h20", "h27"])
def test_a_chamber_and_a_whole_surface_are_closed_and_a_part_of_them_is_not(element: str) -> None:
    mesh = hollow(element)
    (faces,) = mesh.boundary
    inner = (np.abs(mesh.nodes[faces.nodes] - 1.5).max(axis=2) < 0.6).all(axis=1)
    assert inner.sum() == (6 if faces.shape.corners == 4 else 12)
    chamber, outside = (faces._replace(nodes=faces.nodes[own]) for own in (inner, ~inner))
    assert encloses([faces]) and encloses([chamber]) and encloses([outside])
    assert not encloses([chamber._replace(nodes=chamber.nodes[1:])])
    assert encloses([chamber, outside._replace(nodes=outside.nodes[:5])]), "a closed part counts"


def test_a_pressure_on_a_closed_surface_is_told_of_at_the_start(tmp_path: Path) -> None:
    notes = Simulation(load_scene(bar(tmp_path, 'set = "all"\npressure = 1.0'))).notes
    assert_names(notes[-1], "load.0.pressure", "closed surface", "'all'", "dead pressure")
    for load in ('set = "all"\nforce = [0.0, 0.0, 0.1]', 'set = "top"\npressure = 1.0'):
        assert not any("pressure" in note for note in Simulation(load_scene(bar(tmp_path, load))).notes)


def test_it_is_told_once_from_the_step_in_which_a_face_has_turned_by_ten_degrees(tmp_path: Path) -> None:
    simulation = Simulation(load_scene(bar(tmp_path, 'set = "top"\npressure = 600.0')))
    rest, last = simulation.positions, np.argsort(simulation.positions @ [1e3, 1, 1])[-8:]
    (tip,), (before,) = ([k for k in last if np.allclose(rest[k], [x, 0, 0.01])] for x in (0.1, 0.09))
    turned, told = list[float](), list[int]()
    for _ in range(20):
        simulation.step()
        slope = simulation.positions[tip] - simulation.positions[before]
        turned.append(float(np.degrees(np.arctan2(-slope[2], slope[0]))))
        told.append(sum("load.0.pressure" in note for note in simulation.notes))
    assert turned[0] < 5 and max(turned) > 15
    assert told == [int(max(turned[: k + 1]) > 10) for k in range(20)]
    assert_names(simulation.notes[-1], "load.0.pressure", "dead pressure", 10)


def test_what_turns_less_is_not_told_of(tmp_path: Path) -> None:
    simulation = Simulation(load_scene(bar(tmp_path, 'set = "top"\npressure = 20.0')))
    for _ in range(20):
        simulation.step()
    assert not any("pressure" in note for note in simulation.notes)


@pytest.mark.parametrize("corners", [3, 4])
def test_the_turn_is_that_of_the_normal(corners: int) -> None:
    rest = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    watch = TurnWatch("load.0", [np.arange(corners)[None]], rest)
    for degrees, told in ((9.9, False), (10.1, True), (170.0, True)):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        assert bool(watch(rest @ [[1, 0, 0], [0, c, s], [0, -s, c]])) == told
    assert not watch(rest @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]), "about the normal nothing turns"


def test_run_tells_it(tmp_path: Path) -> None:
    words = ["run", str(bar(tmp_path, 'set = "top"\npressure = 600.0')), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0
    line_naming(done.stderr, "load.0.pressure", "dead pressure")
    assert_names(" ".join(json.loads(done.stdout)["notes"]), "load.0.pressure", "dead pressure")
