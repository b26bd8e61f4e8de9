"""How exactly steps are solved where the scene leaves it open: small bodies and small loads bend as large ones do."""

from pathlib import Path

import pytest

from tripod_sim import Simulation, load_scene

STATIC = "inertia=off"

BEAM = """name = "beam"
dt = 0.01

[mesh]
source = "block"
scale = {length}
corners = [[0, 0, 0], [1, 0, 0], [1, 0.2, 0], [0, 0.2, 0], [0, 0, 0.2], [1, 0, 0.2], [1, 0.2, 0.2], [0, 0.2, 0.2]]
cells = [6, 1, 1]

[material]
young = {young}
poisson = 0.3
density = 1000.0

[gravity]

[inertia]
scheme = "tr_bdf2"

[[fixed]]
set = "foot"

[[set]]
name = "foot"
along = [1, 0, 0]
at = 0.0
tolerance = 1e-9

[[set]]
name = "tip"
along = [1, 0, 0]
at = {length}
tolerance = 1e-9

[[marker]]
set = "tip"
"""


def beam(tmp_path: Path, length: float, *words: str) -> Simulation:
    """Return a beam of some length [m], as stiff as it takes for all to bend alike."""
    path = tmp_path / "beam.toml"
    path.write_text(BEAM.format(length=length, young=2e6 * length))
    return Simulation(load_scene(str(path), words))


def sag(simulation: Simulation, length: float) -> float:
    """Return how far the tip has sunk, over the length."""
    return float(simulation.undeformed(0)[2] - simulation.markers[0][2]) / length


@pytest.mark.parametrize("length", [1e-3, 1e-2, 1.0])
def test_beams_of_all_sizes_bend_alike(tmp_path: Path, length: float) -> None:
    known = beam(tmp_path, 0.1, STATIC, "solver.tolerance=1e-9")
    known.step()
    simulation = beam(tmp_path, length, STATIC)
    simulation.step()
    assert sag(simulation, length) == pytest.approx(sag(known, 0.1), rel=3e-3)


@pytest.mark.parametrize("words", [(), ("dt=auto",)])
def test_a_small_body_falls_as_its_mass_and_gravity_say(tmp_path: Path, words: tuple[str, ...]) -> None:
    exact = beam(tmp_path, 1e-3, "solver.tolerance=1e-13", *words)
    simulation = beam(tmp_path, 1e-3, *words)
    for _ in range(5):
        simulation.step()
        exact.step()
    assert sag(exact, 1e-3) > 0.1
    assert sag(simulation, 1e-3) == pytest.approx(sag(exact, 1e-3), rel=0.02)


def test_a_load_below_the_usual_tolerance_bends(tmp_path: Path) -> None:
    load = 'load=[{set="tip", force=[0.0, 0.0, -1e-5]}]'
    exact, simulation = (
        beam(tmp_path, 0.1, STATIC, "gravity=off", load, *words)
        for words in (("solver.tolerance=1e-12",), ())
    )
    exact.step()
    simulation.step()
    assert sag(exact, 0.1) > 1e-6
    assert sag(simulation, 0.1) == pytest.approx(sag(exact, 0.1), rel=3e-3)


@pytest.mark.parametrize("force", [1e-9, 1e-30])
def test_a_load_that_is_nothing_beside_the_weight_asks_for_nothing(tmp_path: Path, force: float) -> None:
    """It would be solved to what is rounded off, or be refused."""
    alone = beam(tmp_path, 0.1)
    with (tmp_path / "beam.toml").open("a") as file:
        file.write(f'\n[[load]]\nset = "tip"\nforce = [0, 0, {force}]\n')
    loaded = Simulation(load_scene(str(tmp_path / "beam.toml")))
    weight = 9.81 * 1000.0 * 0.1 * 0.02 * 0.02
    assert loaded.solver.tolerance == pytest.approx(1e-9 * weight)
    for simulation in (alone, loaded):
        for _ in range(5):
            simulation.step()
    assert sag(loaded, 0.1) == pytest.approx(sag(alone, 0.1), rel=1e-4)


def test_a_light_net_hangs_as_a_heavy_one_does() -> None:
    def net(mass: float) -> Simulation:
        k = 1e3 * mass
        words = [f"springs.node_mass={mass}", f"springs.stiffness={k}", f"springs.shear={k}"]
        scene = load_scene("cloth", ["springs.nodes=5", STATIC, "solver={}", *words])
        simulation = Simulation(scene)
        simulation.step()
        return simulation

    heavy, light = net(1.0), net(1e-8)
    assert light.positions[:, 2].min() == pytest.approx(heavy.positions[:, 2].min(), rel=1e-3)


def test_a_tolerance_that_is_named_and_that_of_heavy_bodies_is_kept(tmp_path: Path) -> None:
    assert beam(tmp_path, 1e-2, "solver.tolerance=1e-3").solver.tolerance == 1e-3
    assert beam(tmp_path, 1.0).solver.tolerance == 1e-4
