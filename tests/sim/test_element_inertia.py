"""Inertia of quadratic elements: as the continuum has it, where lumped masses of nodes turn it too hard."""

import numpy as np
import pytest

from tests.sim.implicit_schemes import IMPLICIT
from tripod_sim import Simulation, load_scene
from tripod_sim.bodies.soft_build import assembled, element_masses, masses, sets_of
from tripod_sim.mesh.described import described_mesh
from tripod_sim.scene import Scene
from tripod_sim.scene.lowering import lowered

QUADRATIC = ("h20", "h20_full", "h27", "t10")
CORNERS = [[0, 0, 0], [0.3, 0, 0], [0.3, 0.02, 0], [0, 0.02, 0], *([x, y, 0.01] for x, y in
           ((0, 0), (0.3, 0), (0.3, 0.02), (0, 0.02)))]  # fmt: skip
BAR = [f"mesh={{source='block', corners={CORNERS}, cells=[6,1,1]}}", "material={density=1000.0}"]
"""One element across: 0.06 kg."""


def bar(element: str, *words: str) -> Scene:
    return load_scene("silicone_free", [*BAR, f"mesh.element={element}", *words])


@pytest.mark.parametrize("element", QUADRATIC)
def test_a_bar_of_one_element_across_turns_and_moves_as_the_continuum(element: str) -> None:
    scene = bar(element)
    assembly, _ = assembled(lowered(scene), described_mesh)
    sets = sets_of(lowered(scene), assembly)
    x = assembly.nodes - [0.15, 0.01, 0.005]
    lumped, (blocks,) = masses(assembly, sets, len(x)).inert, element_masses(assembly, sets)

    def energy(v: np.ndarray) -> tuple[float, float]:
        """Return the kinetic energy with the velocities `v`, and that of lumped masses alone [J]."""
        alone = 0.5 * float(lumped @ (v**2).sum(axis=1))
        return alone + blocks.add(v, np.zeros_like(v)), alone

    assert energy(np.tile([0.3, 0.4, 1.2], (len(x), 1)))[0] == pytest.approx(0.5 * 0.06 * 1.69, rel=1e-12)
    for k, (a, b) in enumerate(((0.02, 0.01), (0.3, 0.01), (0.3, 0.02))):
        found, alone = energy(np.cross(np.eye(3)[k], x))
        assert found == pytest.approx(0.5 * 0.06 * (a**2 + b**2) / 12, rel=1e-12)
        assert element == "h27" or alone > 1.001 * found
        assert element == "h27" or k or alone > 1.3 * found, "about its axis they turn the bar far too hard"


def deformed(simulation: Simulation, steps: int) -> float:
    """Return how far nodes move otherwise than all together in some steps of a fall [m]."""
    start = simulation.positions.copy()
    for _ in range(steps):
        simulation.step()
    moved = simulation.positions - start
    assert moved[:, 2].mean() < -1e-3
    return float(np.abs(moved - moved.mean(axis=0)).max())


@pytest.mark.parametrize("scheme", IMPLICIT)
@pytest.mark.parametrize("element", QUADRATIC)
def test_a_body_that_falls_freely_is_not_deformed(element: str, scheme: str) -> None:
    simulation = Simulation(bar(element, f"inertia.scheme={scheme}"))
    assert deformed(simulation, 8) < 1e-12


@pytest.mark.parametrize("element", ["h20", "t10"])
def test_with_an_explicit_scheme_lumped_masses_weigh_so_that_free_fall_deforms_nothing(element: str) -> None:
    simulation = Simulation(bar(element, "inertia.scheme=semi_implicit_euler", "damping=off"))
    assert deformed(simulation, 4) < 1e-12


def test_of_a_spinning_bar_the_energy_is_told_and_kept() -> None:
    simulation = Simulation(bar("h20_full", "gravity=off", "inertia.scheme=tr_bdf2", "dt=0.001", "material.young=1e7",
                                "initial_velocity=[{spin=[20.0, 0.0, 0.0], centre=[0.15, 0.01, 0.005]}]"))  # fmt: skip
    before = simulation.energies()
    assert before.kinetic == pytest.approx(0.5 * 0.06 * (0.02**2 + 0.01**2) / 12 * 400, rel=1e-9)
    for _ in range(50):
        simulation.step()
    after = simulation.energies()
    assert after.kinetic + after.strain == pytest.approx(before.kinetic, rel=1e-3)


def test_in_contact_a_body_falls_undeformed_until_it_hits() -> None:
    simulation = Simulation(load_scene("silicone_drop", ["mesh.element=h20_full", "mesh.level=1"]))
    assert deformed(simulation, 6) < 1e-7
