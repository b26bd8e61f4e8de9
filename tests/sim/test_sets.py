"""Sets of nodes, what holds, moves, loads and starts them: against theory, and what is refused."""

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from numba import typeof

from tests.messages import names, raises_naming
from tests.scenes import SHARP
from tripod_sim import SceneError, Simulation, StepError, load_scene
from tripod_sim.forces.gravity import GravityForce
from tripod_study.run import run

BLOCK = """
name = "block"
dt = 0.01
[mesh]
source = "block"
corners = [[0,0,0],[2e-2,0,0],[2e-2,1e-2,0],[0,1e-2,0],[0,0,1e-2],[2e-2,0,1e-2],[2e-2,1e-2,1e-2],[0,1e-2,1e-2]]
cells = [3, 2, 2]
[material]
law = "st_venant_kirchhoff"
young = 1e5
poisson = 0.3
[solver]
tolerance = 1e-12
[[set]]
name = "end"
along = [3, 0, 0]
at = 0.02
[[marker]]
set = "end"
"""
ROLLERS = (
    'fixed=[{low=[0,0,0], high=[0,1,1], axes="x"}, {low=[0,0,0], high=[1,0,1], axes="y"}, '
    '{low=[0,0,0], high=[1,1,0], axes="z"}]'
)
ALONG = "fixed=[{low=[0,0,0], high=[0,1,1]}]"
END = {"force": 'load=[{set="end", force=[0.5, 0, 0]}]', "pressure": 'load=[{set="end", pressure=-5000.0}]'}
SCHEMES = ("implicit_euler", "bdf2", "tr_bdf2", "semi_implicit_euler", "rk4")


@pytest.fixture
def block(tmp_path: Path) -> str:
    (tmp_path / "block.toml").write_text(BLOCK)
    return str(tmp_path / "block.toml")


def moved(simulation: Simulation) -> np.ndarray:
    return simulation.positions - simulation.mesh.nodes


def solved(source: str, *words: str) -> Simulation:
    simulation = Simulation(load_scene(source, words))
    simulation.step()
    return simulation


def skewed(folder: Path) -> Path:
    """Write a cube of 1 cm of 7 skewed hexahedra, after [MacNealHarder1985]; its inner cell is the group `layer:1`."""
    outer = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], float)
    inner = [[0.249, 0.342, 0.192], [0.826, 0.288, 0.288], [0.850, 0.649, 0.263], [0.273, 0.750, 0.230],
             [0.320, 0.286, 0.643], [0.677, 0.305, 0.683], [0.788, 0.693, 0.644], [0.165, 0.745, 0.702]]  # fmt: skip
    faces = [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    cells = [[*range(8, 16)]]
    for face in faces:
        f, g = list(face), [n + 8 for n in face]
        x = np.concatenate([outer, inner])
        volume = np.linalg.det([x[f[1]] - x[f[0]], x[f[3]] - x[f[0]], x[g[0]] - x[f[0]]])
        cells.append(f + g if volume > 0 else g + f)
    nodes = 0.01 * np.concatenate([outer, inner])
    path = folder / "patch.vtk"
    meshio.Mesh(
        nodes, [("hexahedron", np.array(cells))], cell_data={"layer": [np.array([1] + [0] * 6)]}
    ).write(path)
    return path


@pytest.mark.parametrize("element", ["h8", "h8_modes", "h8_mean", "h20", "h20_full", "h27"])
def test_patch_of_skewed_elements_stretches_evenly(element: str, tmp_path: Path) -> None:
    """The patch test of [MacNealHarder1985]: under an even pull the strain is the same in elements of any shape."""
    skewed(tmp_path)
    text = BLOCK.replace('"block"\ncorners', '"patch.vtk"\ncorners').replace("at = 0.02", "at = 0.01")
    (tmp_path / "patch.toml").write_text(text)
    simulation = solved(str(tmp_path / "patch.toml"), f"mesh.element={element}", ROLLERS, END["pressure"])
    X, u = simulation.mesh.nodes, moved(simulation)
    slope = np.linalg.lstsq(X, u, rcond=None)[0]
    assert np.abs(u - X @ slope).max() < 1e-10 * 0.01
    stretch = 1 + slope[0, 0]
    # St. Venant-Kirchhoff under a dead pull p: P_xx = F_xx E (F_xx² - 1) / 2 = p
    assert stretch * 1e5 * (stretch**2 - 1) / 2 == pytest.approx(5000.0, rel=1e-9)
    assert slope[1, 1] == pytest.approx(np.sqrt(1 - 0.3 * (stretch**2 - 1)) - 1, rel=1e-9)


@pytest.mark.parametrize("kind", END)
@pytest.mark.parametrize("element", ["h8_modes", "h20", "h27", "t4", "t10"])
def test_a_load_on_a_face_is_divided_as_the_element_asks(kind: str, element: str, block: str) -> None:
    """Consistent nodal loads: the end of an even bar stays plane for every element, for force and pressure alike."""
    simulation = solved(block, f"mesh.element={element}", ROLLERS, END[kind])
    u = moved(simulation)[simulation._parts.watched[0]]
    assert np.ptp(u[:, 0]) < 1e-12
    stretch = 1 + u[0, 0] / 0.02
    assert stretch * 1e5 * (stretch**2 - 1) / 2 == pytest.approx(5000.0, rel=1e-8)


def test_evenly_shared_force_bends_the_end_out_of_its_plane(block: str) -> None:
    even = solved(block, "mesh.element=h20", ROLLERS, 'load=[{set="end", force=[0.5, 0, 0], share="even"}]')
    assert np.ptp(moved(even)[even._parts.watched[0], 0]) > 1e-6
    assert even._system.term(GravityForce).force.sum(axis=0) == pytest.approx([0.5, 0, 0])


def test_dead_mass_weighs_and_resists(block: str) -> None:
    """A spring of silicone with a mass at its end: half the period is where it turns, twice the static stretch.

    With nu = 0: else the mass, which has to come nearer to the axis, takes up some of the energy.
    """
    words = [
        "material.poisson=0.0",
        "material.mass=1e-9",
        "load=[{set='end', mass=0.01}]",
        ROLLERS,
        "gravity={acceleration=[0.1, 0, 0]}",
        "solver.tolerance=1e-9",
    ]
    static = solved(block, *words).markers[0][0] - 0.02
    area, stiffness = 1e-4, 1e5 * 1e-4 / 0.02
    assert static == pytest.approx(1e-3 / stiffness, rel=1e-3)
    assert area * 1e5 / 0.02 == pytest.approx(stiffness)
    half = np.pi * np.sqrt(0.01 / stiffness)
    moving = Simulation(load_scene(block, [*words, "inertia.scheme=tr_bdf2", f"dt={half / 100}"]))
    for _ in range(100):
        moving.step()
    assert moving.markers[0][0] - 0.02 == pytest.approx(2 * static, rel=1e-3)


@pytest.mark.parametrize("element", ["h20", "h27", "t10"])
def test_dead_mass_resists_at_every_node_of_its_faces(element: str, block: str) -> None:
    """Its weight is shared as the element asks, negatively at corners of `h20`; inertia may not be negative."""
    words = [f"mesh.element={element}", ALONG, "inertia={}", "gravity={}", "material.mass=1e-9"]
    simulation = Simulation(load_scene(block, [*words, "load=[{set='end', mass=0.01}]"]))
    mass, end = simulation._mass, simulation._parts.watched[0]
    assert mass.sum() == pytest.approx(0.01)
    assert mass[end].sum() == pytest.approx(0.01)
    assert mass[end].min() > 1e-5
    weight = simulation._system.term(GravityForce).force[:, 2]
    assert weight.sum() == pytest.approx(-0.01 * 9.81)
    moment = np.cross(simulation.mesh.nodes, np.outer(weight, [0, 0, 1])).sum(axis=0)
    np.testing.assert_allclose(moment[:2], weight.sum() * np.array([0.005, -0.02]), rtol=1e-6)


def test_explicit_kernels_are_compiled_once_with_and_without_rollers(block: str) -> None:
    words = ("inertia.scheme=rk4", "damping=off", "material.mass=2e-3")
    pull = 'prescribed=[{set="end", axes="x", move="0: 0,0,0; 0.2: 2e-4,0,0"}]'
    frames = [
        Simulation(load_scene(block, [*held, *words]))._stepper._frames  # type: ignore[attr-defined]
        for held in ((ROLLERS, pull), (ALONG,))
    ]
    assert len(frames[0].held)
    assert typeof(frames[0]) == typeof(frames[1])


@pytest.mark.parametrize("scheme", [None, *SCHEMES])
def test_rollers_leave_a_pulled_bar_to_get_thinner_in_every_scheme(scheme: str | None, block: str) -> None:
    """Pulled evenly and slowly by prescribed motion, the bar gets thinner by nu; its rollers and its end stay plane."""
    pull = 'prescribed=[{set="end", axes="x", move="0: 0,0,0; 0.2: 2e-4,0,0"}]'
    motion = [f"inertia={{scheme={scheme!r}}}", "damping={mass=200.0, stiffness=0.0}"] if scheme else []
    law = ["material.law=neo_hooke", "material.mass=2e-3", "solver.tolerance=1e-9"]
    simulation = Simulation(load_scene(block, [ROLLERS, pull, *motion, *law]))
    for _ in range(30):
        simulation.step()
    u = moved(simulation)
    held = [u[simulation.mesh.nodes[:, i] == 0, i] for i in range(3)]
    assert max(np.abs(h).max() for h in held) == 0.0
    assert u[simulation._parts.watched[0], 0] == pytest.approx(2e-4, abs=1e-15)
    assert u[simulation.mesh.nodes[:, 1] == 0.01, 1] == pytest.approx(-0.3e-4, rel=0.02)
    force = simulation.reactions(0)[0]
    assert force[0] == pytest.approx(1e5 * 0.01 * 1e-4, rel=0.02)
    assert simulation.report.growth == 0.0


def test_one_solve_follows_prescribed_nodes_as_newton_does(block: str) -> None:
    words = [ALONG, "inertia={}", "damping={}", "material.mass=0.01"]
    words.append('prescribed=[{set="end", turn="0: 0,0,0; 0.2: 1.0,0,0", move="0: 0,0,0; 0.1: 2e-3,0,0"}]')
    ends = [
        Simulation(load_scene(block, [*words, f"solver.mode={mode}"])) for mode in ("newton", "one_solve")
    ]
    for _ in range(25):
        for simulation in ends:
            simulation.step()
    assert np.abs(ends[0].positions - ends[1].positions).max() < 5e-6  # solver.position_tolerance
    assert ends[1].reactions(0)[1] == pytest.approx(ends[0].reactions(0)[1], rel=0.02, abs=1e-5)


def test_cooks_membrane_rises_to_the_known_height() -> None:
    """23.96 F / (E t) [SimoRifai1990]: from below, half as far with half the element, and at last within 0.1 %."""
    tips = []
    for cells in (4, 8, 16, 32):
        result = run("cook", overrides=[f"mesh.cells=[{cells}, {cells}, 1]"])
        tips.append(result["markers"][0]["moved"][1] / 1e-7)
    assert (np.diff(tips) > 0).all()
    gaps = 23.96 - np.array(tips)
    assert (gaps[1:] < 0.6 * gaps[:-1]).all()
    assert tips[-1] == pytest.approx(23.96, rel=1e-3)
    stiff = (
        run("cook", overrides=["mesh.cells=[8, 8, 1]", "mesh.element=h8"])["markers"][0]["moved"][1] / 1e-7
    )
    assert stiff < 0.95 * tips[1]  # linear elements lock in bending


def test_column_turns_once_and_stores_the_same_energy_in_motion_and_in_statics() -> None:
    ends = []
    for words in ([], ["inertia=off", "damping=off"]):
        simulation = Simulation(load_scene("column", words))
        for _ in range(125):
            simulation.step()
        ends.append(simulation)
        np.testing.assert_allclose(moved(simulation)[simulation._parts.watched[0]], 0.0, atol=1e-6)
        assert (
            simulation.state.joints[-1] == 2.0
        )  # where the timeline ends nothing changes, and a body may sleep
    assert ends[0].energies().strain == pytest.approx(ends[1].energies().strain, rel=1e-6)
    assert ends[1].energies().strain > 0.1


def test_a_plane_of_symmetry_stands_for_the_other_half(block: str) -> None:
    """Half of a bar, held across in its middle plane, bends under half of the force as the whole bar does."""
    ends = []
    for low, cells in ((-0.005, 4), (0.0, 2)):
        square = [[x, y, z] for z in (0, 0.01) for x, y in ((0, low), (0.02, low), (0.02, 0.005), (0, 0.005))]
        plane = ', {low=[0,0,0], high=[1,0,1], axes="y"}' if low == 0 else ""
        ends.append(
            solved(
                block, f"mesh.corners={square}", f"mesh.cells=[6, {cells}, 2]",
                f"{ALONG[:-1].replace('low=[0,0,0]', 'low=[0,-1,0]')}{plane}]",
                f'load=[{{set="end", force=[0, 0, {-0.01 * cells}]}}]',
            )
        )  # fmt: skip
    whole, half = ends
    same = whole.mesh.nodes[:, 1] > -1e-9
    assert np.abs(moved(half)).max() > 1e-4
    np.testing.assert_allclose(whole.positions[same], half.positions, atol=1e-12)


@pytest.mark.parametrize("scheme", [*SCHEMES])
def test_thrown_and_spinning_body_keeps_what_it_was_given(scheme: str) -> None:
    words = ["mesh.level=1", "gravity=off", "damping=off", f"inertia={{scheme={scheme!r}}}", "dt=1e-4"]
    words.append("initial_velocity=[{velocity=[0.3, 0, 0.1], spin=[0, 0, 2.0]}]")
    simulation = Simulation(load_scene("silicone_free", words))
    mass = simulation._mass
    start = mass @ simulation.state.velocities
    np.testing.assert_allclose(start, mass.sum() * np.array([0.3, 0, 0.1]), atol=1e-9)
    x, v = simulation.state.positions, simulation.state.velocities
    turning = mass @ np.cross(x, v)
    assert turning[2] == pytest.approx(2.0 * mass @ (x[:, 0] ** 2 + x[:, 1] ** 2), rel=1e-9)
    for _ in range(20):
        simulation.step()
    np.testing.assert_allclose(mass @ simulation.state.velocities, start, rtol=1e-5, atol=1e-9)


def test_groups_of_a_file_are_sets_and_go_with_refined_and_quadratic_meshes(tmp_path: Path) -> None:
    skewed(tmp_path)
    for name in ("patch.vtk", "patch.msh"):
        mesh = meshio.read(tmp_path / "patch.vtk")
        if name.endswith("msh"):
            bottom = np.array([[0, 3, 2, 1]])
            mesh = meshio.Mesh(
                mesh.points, [*mesh.cells, ("quad", bottom)],
                cell_data={k: [np.array([1] + [2] * 6), np.array([7])] for k in ("gmsh:physical", "gmsh:geometrical")},
                field_data={"core": np.array([1, 3]), "bottom": np.array([7, 2])},
            )  # fmt: skip
            mesh.write(tmp_path / name, file_format="gmsh22", binary=False)
        text = BLOCK.replace('"block"\ncorners', f'"{name}"\ncorners').replace("at = 0.02", "at = 0.01")
        core, bottom = ("layer:1", "low") if name.endswith("vtk") else ("core", "bottom")
        text += '[[set]]\nname = "low"\nhigh = [1, 1, 0]\n'
        (tmp_path / "groups.toml").write_text(text)
        for words in (["mesh.element=h8"], ["mesh.element=h27"], ["mesh.element=h20"], ["mesh.refine=1"]):
            scene = load_scene(
                tmp_path / "groups.toml",
                [*words, f'fixed=[{{set="{bottom}"}}]', f'marker=[{{set="{core}"}}]'],
            )
            simulation = Simulation(scene)
            low = np.flatnonzero(np.abs(simulation.mesh.nodes[:, 2]) < 1e-12)
            np.testing.assert_array_equal(simulation.fixed, low)
            inside = simulation.mesh.nodes[simulation._parts.watched[0]]
            assert len(inside) >= 8
            assert (np.abs(inside - 0.005).max(axis=1) < 0.004).all()
    with raises_naming(SceneError, "set.0", "'end'", "group is 'cor'", "bottom, core"):
        Simulation(
            load_scene(
                tmp_path / "groups.toml", ["mesh.element=h8", 'fixed=[{set="low"}]', 'set.0.group="cor"']
            )
        )


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (['fixed=[{set="ned"}]'], ("fixed.0.set", "'ned'", "all, body, end")),
        ([ALONG, 'set.0.at=0.021'],
         ("set.0", "'end'", "no node", "(0.02, ", "0.001 m", "[0.0, 0.0, 0.0]", "[0.02, 0.01, 0.01] m")),
        (['fixed=[{low=[1,1,1], high=[2,2,2]}]'],
         ("fixed.0", "no node", "node 35", "(0.02, 0.01, 0.01) m", "1.71 m")),
        (['fixed=[{set="end"}, {set="all", axes="x"}]',
          'prescribed=[{set="end", move="0: 0,0,0; 1: 1,0,0", axes="y"}]'],
         ("prescribed.0", "fixed.0", "nodes", "along y", "leave them out")),
        (['fixed=[{set="all"}]'], ("fixed.0", "every node")),
        ([ALONG, 'effector={radius=0.02}'], ("fixed.0", "effector", "nodes")),
        ([ALONG, 'set.0.name="body"'], ("set.0.name", "'body'", "of bodies")),
        ([ALONG, 'set=[{name="end", centre=[0.02,0,0]}]'], ("set.0", "centre", "radius")),
        ([ALONG, 'mesh.cells=[1000,1000,1000]'], ("1000000000 cells", "mesh.refine = 0", "at most 1000000")),
        ([ALONG, 'mesh.cells=[50,50,50]', 'mesh.refine=2'], ("8000000 cells", "mesh.refine = 2")),
        (['fixed=[{set="end", low=[0,0,0], high=[1,1,1]}]'], ("fixed.0", "either set", "low and high")),
        (['fixed=[{low=[0,0,0]}]'], ("fixed.0", "either set", "low and high")),
        (['fixed=[{set="end", axes="xw"}]'], ("fixed.0.axes", "'xw'", "x, y, z")),
        (['fixed=[{set="end", axes=""}]'], ("fixed.0.axes", "''")),
        (['fixed=[{set="end", axes="xx"}]'], ("fixed.0.axes", "'xx'")),
        (['fixed=[{set="end", axes="x"}]'], ("nodes", "can", "without inertia")),
        (['fixed=[{low=[0,0,0], high=[0,0,1]}]'], ("can turn about (0, 0, ", "through (0, 0, ")),
        ([ALONG, 'set.0.name="all"'], ("set.0.name", "'all'")),
        ([ALONG, 'set.0.at=nan'], ("set.0.at", "nan")),
        ([ALONG, 'set.0.along=[0,0,0]'], ("set.0.along", "direction", "cannot be zero")),
        ([ALONG, 'set=[{name="end", at=0.1}]'], ("set.0", "along", "at", "beyond", "below")),
        ([ALONG, 'set=[{name="end", axis=[1,0,0]}]'], ("set.0", "axis", "radius")),
        ([ALONG, 'load=[{set="end"}]'], ("load.0", "none", "force, pressure, mass")),
        ([ALONG, 'load=[{set="end", force=[1,0,0], mass=1.0}]'], ("load.0", "force and mass", "exactly one")),
        ([ALONG, 'load=[{set="end", mass=1.0}]'], ("load.0.mass", "gravity", "inertia")),
        ([ALONG, 'set.0.tolerance=0.0', 'set.0.low=[0,0.005,0.005]', 'set.0.high=[1,0.005,0.005]',
          'load=[{set="end", pressure=1.0}]'],
         ("load.0.set", "'end'", "1 nodes", "no whole face", "pressure")),
        ([ALONG, 'prescribed=[{set="end"}]'], ("prescribed.0", "move", "turn")),
        ([ALONG, 'prescribed=[{set="end", move="0: 1,0,0"}]'],
         ("prescribed.0.move", "[1.0, 0.0, 0.0]", "at 0 s")),
        ([ALONG, 'prescribed=[{set="end", move="0: 0,0"}]'],
         ("prescribed.0.move", "'0: 0,0'", "'time: value, ...'")),
        ([ALONG, 'initial_velocity=[{velocity=[1,0,0]}]'], ("initial_velocity", "inertia")),
        ([ALONG, 'set=[{name="end", high=[0, 1, 1]}]', 'inertia={}', 'initial_velocity=[{set="end", spin=[1,1,1]}]'],
         ("initial_velocity.0.set", "'end'", "fixed or prescribed")),
        ([ALONG, 'marker=[{set="x"}]'], ("marker.0.set", "'x'")),
        (["servos={count=2}", 'servo=[{set="end", hub=[0,0,0], axis=[0,1,0]}]'],
         ("1 [[servo]]", "servos.count is 2")),
        (['servo=[{set="end", hub=[0,0,0], axis=[0,1,0]}]', ALONG], ("1 [[servo]]", "no [servos]")),
        (["servos={count=2}", 'servo=[{set="end", hub=[0,0,0], axis=[0,0,0]}, {set="end", hub=[0,0,0], axis=[0,1,0]}]'],
         ("servo.0.axis", "direction", "cannot be zero")),
        (["servos={count=2}", 'servo=[{set="end", hub=[0,0,0], axis=[0,1,0]}, {set="end", hub=[0,0,0], axis=[0,1,0]}]'],
         ("servo_1", "servo_0", "nodes")),
        (['mesh.corners=[[0,0,0]]', ALONG], ("mesh.corners", "1 corners", 8)),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_in_one_line(words: list[str], named: tuple[object, ...], block: str) -> None:
    with raises_naming(SceneError, *named) as caught:
        Simulation(load_scene(block, words))
    assert "\n" not in str(caught.value)


def test_markers_of_bodies_in_a_list_tell_what_holds_them(tmp_path: Path) -> None:
    """As those of the short form do: the weight of the block."""
    listed = BLOCK.replace("[mesh]", '[[body]]\nname = "b"\n[body.mesh]').replace(
        "[material]", "[body.material]"
    )
    (tmp_path / "listed.toml").write_text(listed)
    words = ['fixed=[{set="end"}]', "gravity={}", "body.0.material.mass=2e-3", "solver.tolerance=1e-9"]
    held = run(str(tmp_path / "listed.toml"), duration=0.01, overrides=words)["markers"][0]["force"]
    assert held == pytest.approx([0.0, 0.0, 2e-3 * 9.81], abs=1e-7)


@pytest.mark.parametrize("words", [[], ["inertia={}", "damping={}", "material.mass=0.01"]])
def test_what_holds_a_marker_is_of_the_present_state_or_not_known(words: list[str], block: str) -> None:
    pull = 'prescribed=[{set="end", move="0: 0,0,0; 0.2: 2e-3,0,0"}]'
    simulation = Simulation(load_scene(block, [ALONG, pull, *words]))
    assert np.isnan(simulation.reactions(0)).all()
    simulation.advance(5)
    there, force = simulation.save(), simulation.reactions(0)[0]
    assert force[0] > 0.1
    simulation.reset()
    assert np.isnan(simulation.reactions(0)).all()
    simulation.restore(there)
    assert np.isnan(simulation.reactions(0)).all()
    simulation.step()
    assert simulation.reactions(0)[0][0] > force[0]


def test_what_holds_a_marker_stays_as_it_was_where_a_step_fails() -> None:
    watched = ['set=[{name="arm", low=[0.03,-1,-1], high=[1,1,1]}]', 'marker=[{set="arm"}]']
    rest = ["inertia=off", "damping=off", "solver.max_iterations=14", "solver.max_halvings=0"]
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1", *watched, *rest]))
    simulation.step()
    force, moment = simulation.reactions(0)
    assert np.abs(force).max() > 1e-3
    with pytest.raises(StepError):
        simulation.step(np.array([-2.1, 0.6, -2.1, 0.04]))
    assert np.array_equal(simulation.reactions(0), (force, moment))
    simulation.reset()
    start = simulation.reactions(0)[0]
    assert np.isfinite(start).all()


@pytest.mark.parametrize("marker", [1, -1, "end", 0.5])
def test_a_marker_that_is_not_there_is_told(marker: Any, block: str) -> None:
    simulation = Simulation(load_scene(block, [ALONG]))
    none = Simulation(load_scene("silicone", ["mesh.level=1"]))
    for ask in (simulation.reactions, simulation.undeformed):
        with raises_naming(SceneError, f"marker {marker!r}", "allowed", "0 to 0"):
            ask(marker)
    with raises_naming(SceneError, f"marker {marker!r}", "add [[marker]]"):
        none.undeformed(marker)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_nothing_holds_a_marker_that_falls(scheme: str, block: str) -> None:
    words = [f"inertia.scheme={scheme}", "gravity={}", "material.mass=2e-3", "solver.tolerance=1e-9"]
    assert run(block, duration=0.02, overrides=words)["markers"][0]["force"] == pytest.approx(
        [0, 0, 0], abs=1e-8
    )


@pytest.mark.parametrize(
    ("load", "moves"),
    [
        ('{set="left", force=[0, 0, -1e6]}', False),
        ('{set="left", pressure=1e9}', False),
        ('{set="left", mass=5.0}', False),
        ('{set="all", force=[0, 0, -1e-4]}', True),
        ('{set="low", force=[0, 0, -1e6]}', False),
        ('{set="low", force=[1e-4, 0, 0]}', True),
    ],
)
def test_a_load_that_moves_nothing_is_told_of(load: str, moves: bool, block: str) -> None:
    low = 'set=[{name="left", along=[1,0,0], at=0}, {name="low", along=[0,0,1], at=0}]'
    fixed = 'fixed=[{set="left"}, {set="low", axes="z"}]'
    notes = Simulation(load_scene(block, [low, "marker=[]", fixed, "gravity={}", f"load=[{load}]"])).notes
    assert any(names(note, "load.0", "no effect") for note in notes) != moves


def test_places_of_sets(block: str) -> None:
    """Box, sphere, cylinder, plane, beyond, below, and all of these at once."""
    tables = [
        ("low=[0.0, 0.0, 0.0], high=[0.01, 1, 1]", lambda x: x[:, 0] <= 0.01),
        ("high=[1, 1, 0.004]", lambda x: x[:, 2] <= 0.004),
        ("centre=[0.02, 0, 0], radius=0.012", lambda x: np.linalg.norm(x - [0.02, 0, 0], axis=1) <= 0.012),
        ("centre=[9, 0, 0], axis=[2, 0, 0], radius=0.007", lambda x: np.hypot(x[:, 1], x[:, 2]) <= 0.007),
        ("along=[0, 3, 0], at=0.0051, tolerance=2e-4", lambda x: x[:, 1] == 0.005),
        ("along=[-1, 0, 0], beyond=-0.01", lambda x: x[:, 0] <= 0.01),
        ("along=[1, 1, 0], below=0.01", lambda x: x[:, 0] + x[:, 1] <= 0.01 * np.sqrt(2)),
        ("radius=0.011, along=[0, 0, 1], below=0.0", lambda x: (np.linalg.norm(x, axis=1) <= 0.011) & (x[:, 2] == 0)),
        ("", lambda x: x[:, 0] >= 0),
    ]  # fmt: skip
    for text, rule in tables:
        table = f'name="s"{", " if text else ""}{text}'
        simulation = Simulation(load_scene(block, [f"set=[{{{table}}}]", 'marker=[{set="s"}]', ALONG]))
        expected = np.flatnonzero(rule(simulation.mesh.nodes))
        assert len(expected) > 0
        np.testing.assert_array_equal(simulation._parts.watched[0], expected, err_msg=text)


def test_servo_tables_stand_for_the_short_form() -> None:
    """The Tripod's three arms written out move as `[servos]` does, bit for bit."""
    words, sets = [], []
    for i in range(3):
        c, s = float(np.cos(2 * np.pi * i / 3)), float(np.sin(2 * np.pi * i / 3))
        sets.append(f'{{name="end {i}", along=[{c!r}, {s!r}, 0.0], beyond=0.045}}')
        words.append(
            f'{{set="end {i}", hub=[{0.06 * c!r}, {0.06 * s!r}, -0.02885], axis=[{s!r}, {-c!r}, 0.0], '
            f"inward=[{-c!r}, {-s!r}, 0.0]}}"
        )
    tables = [f"set=[{', '.join(sets)}]", f"servo=[{', '.join(words)}]"]
    ends = []
    for extra in ([], tables):
        simulation = Simulation(load_scene("tripod", ["mesh.level=1", *extra]))
        for k in range(20):
            simulation.step(np.array([-0.02, -0.01, 0.005, 0.0005]) * (k + 1))
        ends.append(simulation)
    np.testing.assert_allclose(ends[1].positions, ends[0].positions, atol=1e-12)
    np.testing.assert_allclose(ends[1].efforts, ends[0].efforts, rtol=1e-8)


def test_two_servos_bend_a_bar_by_equal_and_opposite_torques(block: str) -> None:
    """Pure bending: M = E I 2 turn / L, for a bar of nu = 0 turned at both ends about their middles."""
    words = [
        "mesh.corners=[[0,0,0],[0.1,0,0],[0.1,0.01,0],[0,0.01,0],[0,0,0.01],[0.1,0,0.01],[0.1,0.01,0.01],[0,0.01,0.01]]",
        "mesh.cells=[20,2,2]", "mesh.element=h20", "material.poisson=0.0", "solver.tolerance=1e-10",
        'set=[{name="end", along=[1,0,0], at=0.1}, {name="foot", along=[1,0,0], at=0.0}]', "servos={count=2}",
        'servo=[{set="foot", hub=[0,0,0.005], axis=[0,1,0]}, '
        '{set="end", hub=[0.1,0,0.005], axis=[0,3,0], inward=[-1,0,0]}]',
    ]  # fmt: skip
    simulation = Simulation(load_scene(block, words))
    turn = 1e-3
    simulation.step(
        np.array([turn, -turn, 0.1 * turn**2 / 6])
    )  # the chord of the arc is shorter than the bar
    expected = 1e5 * 0.01**4 / 12 * 2 * turn / 0.1
    np.testing.assert_allclose(simulation.efforts, [expected, -expected], rtol=2e-3)
    before = simulation.efforts.copy()
    simulation.step(np.array([turn, -turn, 1e-4]))
    assert simulation.state.positions[simulation._parts.watched[0], 0].mean() == pytest.approx(
        0.1 - 1e-4, abs=1e-12
    )
    assert np.abs(simulation.efforts - before).max() > 0
