"""Scenes of springs: generators, files, fixed nodes, what is refused; the strain limit; what an absent effect costs."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tests.sim.springs import net_of
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.springs.generate import chain, grid


def body(source: str, *words: str):
    return net_of(load_scene(source, words))


def test_a_chain_has_its_nodes_in_a_line() -> None:
    b = body(
        "pendulum", "springs.nodes=4", "springs.size=0.6", "springs.bending=7", "springs.position=[0, 1, 2]"
    )
    np.testing.assert_allclose(b.nodes, [[0, 1, 2], [0.2, 1, 2], [0.4, 1, 2], [0.6, 1, 2]])
    assert b.ends.tolist() == [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    assert b.stiffness.tolist() == [1500, 7, 1500, 7, 1500]
    np.testing.assert_allclose(b.rest_length, [0.2, 0.4, 0.2, 0.4, 0.2])
    assert b.fixed.tolist() == [0]


@pytest.mark.parametrize("n", [2, 3, 8])
def test_a_grid_has_three_kinds_of_springs_and_faces_up(n: int) -> None:
    net = grid(n, 2.0)
    assert len(net.nodes) == n * n
    assert len(net.structural) == 2 * n * (n - 1)
    assert len(net.shear) == 2 * (n - 1) ** 2
    assert len(net.bending) == 2 * n * (n - 2)
    for pairs, length in ((net.structural, 1.0), (net.shear, np.sqrt(2)), (net.bending, 2.0)):
        d = net.nodes[pairs[:, 1]] - net.nodes[pairs[:, 0]]
        np.testing.assert_allclose(np.linalg.norm(d, axis=1), length * 2.0 / (n - 1))
    a, b, c = np.moveaxis(net.nodes[net.triangles], 1, 0)
    normal = np.cross(b - a, c - a)
    assert (normal[:, 2] > 0).all()
    assert 0.5 * normal[:, 2].sum() == pytest.approx(4.0)
    assert net.nodes[net.corners][:, :2].tolist() == [[-1, -1], [1, -1], [1, 1], [-1, 1]]


def test_chain_corners_are_its_ends() -> None:
    assert chain(5, 1.0).corners.tolist() == [0, 4]


OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nf 2 5 3\nf 1 2 3 4\n"


def obj_scene(folder: Path, text: str, springs: str = "") -> Path:
    (folder / "net.obj").write_text(text)
    scene = folder / "net.toml"
    scene.write_text(
        f"name = 'net'\n[springs]\nsource = 'net.obj'\nshear = 3.0\nbending = 5.0\n{springs}\n[gravity]\n[inertia]\n"
    )
    return scene


def test_edges_of_a_file_become_springs(tmp_path: Path) -> None:
    """A quadrangle has both diagonals as shear springs; bending springs go across the edge of two faces."""
    b = body(str(obj_scene(tmp_path, OBJ)))
    kinds = {k: b.ends[b.stiffness == k].tolist() for k in (1500, 3, 5)}
    assert kinds[1500] == [[0, 1], [0, 3], [1, 2], [1, 4], [2, 3], [2, 4]]
    assert kinds[3] == [[0, 2], [1, 3]]
    assert kinds[5] == [[0, 4]]
    assert len(b.triangles) == 3
    simulation = Simulation(load_scene(obj_scene(tmp_path, OBJ), ["springs.fixed_nodes=[0]", "dt=0.001"]))
    simulation.advance(50)
    assert simulation.positions[:, 2].min() < -0.01


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", ("surface", "no triangles")),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", ("line 4", "vertex 4", "3 vertices")),
        ("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", ("coordinate 'nan'", "not finite")),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", ("triangles 0", "no area")),
        ("v 0 0 0\nf 1\n", ("face", "at least 3 vertices")),
    ],
)
def test_what_is_wrong_with_a_file_is_named(tmp_path: Path, text: str, named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named) as error:
        Simulation(load_scene(obj_scene(tmp_path, text)))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("scene", "words", "named"),
    [
        ("pendulum", ["springs.fixed_nodes=[3, 10]"], ("fixed_nodes: 10", "nodes 0 to 9")),
        ("pendulum", ["springs.fixed_corners=[2]"], ("springs.fixed_corners: 2", "chain", "corners 0 to 1")),
        ("cloth", ["springs.fixed_corners=[4]"], ("springs.fixed_corners", "(4,)", "at least 0", "at most 3")),
        ("pendulum", ["springs.fixed_nodes=[-1]"], ("springs.fixed_nodes", "(-1,)", "at least 0")),
        ("pendulum", ["springs.nodes=2", "springs.fixed_nodes=[0, 1]"], ("every node", "fixed")),
        ("pendulum", ["springs.node_mass=0"], ("springs.node_mass", "0.0", "above 0 kg")),
        ("pendulum", ["springs.stiffness=-1"], ("springs.stiffness", "-1.0", "at least 0 N/m")),
        ("pendulum", ["springs.source=rope"], ("springs.source", "'rope'", "allowed: chain, grid", "path")),
        ("cloth", ["springs.source=no.obj"], ("springs.source", "no.obj")),
        ("cloth", ["springs.compressed=soft"], ("springs.compressed", "'soft'", "allowed: push, slack")),
        ("cloth", ["springs.nodes=100000"], ("springs.nodes", 100000, "at most 250000 nodes")),
        ("cloth", ["mesh={}"], ("field material", "missing", "mesh")),
        ("cloth", ["effector={}"], ("effector", "solid")),
        ("cloth", ["inertia=off", "springs.fixed_corners=[]"], ("nothing holds the body",)),
        ("cloth", ["fixed=[{low=[8, 8, 8], high=[9, 9, 9]}]"], ("fixed.0", "no node", "node 399")),
        ("cloth", ["inertia=off", "strain_limit={}"], ("strain_limit", "springs", "inertia")),
        ("silicone", ["strain_limit={}"], ("strain_limit", "springs", "inertia")),
        ("cloth", ["strain_limit.stretch=0"], ("strain_limit.stretch", "0.0", "at least 0.0001")),
        ("silicone", ["inertia.substeps=on"], ("inertia.substeps", "'on'", "allowed: auto, off")),
    ],
)  # fmt: skip
def test_bad_scenes_are_refused_in_one_line(scene: str, words: list[str], named: tuple[object, ...]) -> None:
    with raises_naming(SceneError, *named) as error:
        Simulation(load_scene(scene, words))
    assert "\n" not in str(error.value)


def test_off_is_a_word_of_substeps_and_switches_effects_off() -> None:
    scene = load_scene("pendulum", ["inertia.substeps=off"])
    assert scene.inertia
    assert scene.inertia.substeps == "off"
    assert load_scene("pendulum", ["gravity=off"]).gravity is None


def stretches(simulation: Simulation) -> np.ndarray:
    x, b = simulation.positions, simulation.mesh
    return np.linalg.norm(x[b.ends[:, 1]] - x[b.ends[:, 0]], axis=1) / b.rest_length - 1


@pytest.mark.parametrize("scheme", ["implicit_euler", "bdf2", "semi_implicit_euler"])
def test_the_strain_limit_bounds_every_spring_at_every_step(scheme: str) -> None:
    words = ["springs.nodes=8", "springs.node_mass=0.05", f"inertia.scheme={scheme}"]
    free = Simulation(load_scene("cloth", words))
    free.advance(150)
    assert stretches(free).max() > 0.03
    simulation = Simulation(load_scene("cloth", [*words, "strain_limit.stretch=0.02"]))
    worst = 0.0
    for _ in range(150):
        simulation.step()
        worst = max(worst, stretches(simulation).max())
    assert 0.015 < worst <= 0.02
    assert simulation.positions[:, 2].min() < -0.3


def test_the_strain_limit_stops_what_flies_beyond_it() -> None:
    """One node flies away from a fixed one: at the bound its speed is gone, beside it the other part of it stays."""
    words = ["springs={source='chain', nodes=2, size=1.0, node_mass=1.0, stiffness=1.0, fixed_corners=[0]}",
             "gravity=off", "inertia.scheme=semi_implicit_euler", "strain_limit.stretch=0.1", "dt=0.001"]  # fmt: skip
    simulation = Simulation(load_scene("pendulum", words))
    simulation.state.velocities[1, 0] = 4.0
    for _ in range(40):
        simulation.step()
    assert 1.09 < simulation.positions[1, 0] <= 1.1
    assert abs(simulation.state.velocities[1, 0]) < 0.15  # from the margin to the bound in one step
    simulation.state.velocities[1] = 4.0, 0.5, 0.0
    for _ in range(2):
        simulation.step()
    assert abs(simulation.state.velocities[1, 0]) < 0.15
    assert simulation.state.velocities[1, 1] == pytest.approx(0.5, abs=0.01)


def test_the_strain_limit_keeps_both_momenta() -> None:
    words = ["springs.nodes=6", "springs.fixed_corners=[]", "springs.node_mass=0.01", "springs.damping=0",
             "gravity=off", "inertia.scheme=semi_implicit_euler", "strain_limit.stretch=0.03"]  # fmt: skip
    simulation = Simulation(load_scene("cloth", words))
    rng = np.random.default_rng(0)
    m = simulation.mesh.mass[:, None]
    spin = np.cross([0.0, 8.0, 40.0], simulation.positions)
    simulation.state.velocities[:] = spin + 0.5 * rng.standard_normal(spin.shape)
    linear = (m * simulation.state.velocities).sum(axis=0)
    angular = np.cross(simulation.positions, m * simulation.state.velocities).sum(axis=0)
    limited = 0
    for _ in range(100):
        limited += simulation.step().iterations > 0
        assert stretches(simulation).max() <= 0.03
    assert limited > 20
    np.testing.assert_allclose((m * simulation.state.velocities).sum(axis=0), linear, atol=1e-8)
    after = np.cross(simulation.positions, m * simulation.state.velocities).sum(axis=0)
    np.testing.assert_allclose(after, angular, atol=1e-8 * np.linalg.norm(angular) + 1e-10)


@pytest.mark.parametrize("effect", ["gravity={}", "damping={mass=1.0}", "strain_limit={stretch=0.0005}"])
def test_adding_and_removing_an_effect_restores_the_same_bits(effect: str) -> None:
    def motion(words: list[str]) -> bytes:
        simulation = Simulation(
            load_scene("cloth", ["springs.nodes=5", "springs.node_mass=0.1", "gravity=off", *words])
        )
        simulation.state.velocities[:10, 2] = -2.0
        simulation.advance(20)
        return simulation.positions.tobytes()

    without = motion([])
    assert motion([effect]) != without
    assert motion([effect, f"{effect.partition('=')[0]}=off"]) == without


def test_what_a_scene_does_not_name_is_not_imported() -> None:
    code = (
        "import sys; from tripod_sim import Simulation, load_scene;"
        "Simulation(load_scene({!r}, {!r})).step();"
        "print(*[m for m in sys.modules if m.startswith('tripod_sim')])"
    )

    def loaded(scene: str, *words: str) -> set[str]:
        done = subprocess.run(
            [sys.executable, "-c", code.format(scene, list(words))],
            check=True,
            capture_output=True,
            text=True,
        )
        return set(done.stdout.split())

    explicit = loaded("pendulum")
    assert "tripod_sim.springs.explicit" in explicit
    for name in (
        "springs.automatic",
        "forces.strain_bound",
        "mesh.read_surface",
        "integrators.implicit",
    ):
        assert f"tripod_sim.{name}" not in explicit
    assert not {m for m in loaded("silicone", "mesh.level=1") if m.startswith("tripod_sim.springs")}
    assert "tripod_sim.integrators.strain_limit" in loaded("cloth", "strain_limit={}")


def test_a_chain_is_shown_by_a_surface_that_moves_with_it() -> None:
    simulation = Simulation(load_scene("pendulum", ["springs.nodes=3"]))
    skin = simulation.skin
    assert len(skin.surface) == 3 * 8 + 2 * 6
    assert skin.nodes.shape == (36, 3)
    assert skin.surface.max() == 35
    assert skin.topology_id != simulation.mesh.topology_id
    moved = simulation.shown(simulation.positions + np.array([0, 0, 1.0]))
    np.testing.assert_allclose(moved, skin.nodes + np.array([0, 0, 1.0]))
    cloth = Simulation(load_scene("cloth", ["springs.nodes=3"]))
    assert cloth.skin is cloth.mesh
    assert np.array_equal(cloth.shown(cloth.positions), cloth.positions)


def test_a_run_tells_of_instability_and_of_the_stability_limit() -> None:
    from tripod_bringup.run_summary import result_rows
    from tripod_study.run import run

    words = ["inertia.substeps=off", "springs.node_mass=0.005"]
    result = run("pendulum", duration=0.2, overrides=words)
    assert 1 < result["grew_at"] < 20
    rows = dict(result_rows(result))
    assert_names(result["instability"], "unstable", f"step {result['grew_at']}", "energy")
    assert_names(rows["stable up to"], f"{result['dt_limit'] * 1e3:.4g} ms")
    assert len(rows["energies"]) < 150
    fine = run("pendulum", duration=0.2, overrides=words[1:])
    assert fine["grew_at"] == 0
    assert fine["parts"] == 40 * np.ceil(0.005 / (0.5 * fine["dt_limit"]))
    assert fine["instability"] == ""
