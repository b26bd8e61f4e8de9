"""Equilibrium among obstacles: a scene with contact and without inertia."""

import re

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tests.sim.contact_scenes import refusal
from tests.sim.implicit_schemes import IMPLICIT
from tripod_sim import Simulation, load_scene
from tripod_sim.contact.statics import ContactStatics
from tripod_sim.errors import StepError

MODES = ["lagrange", "penalty"]

STILL = ["inertia=off", "damping=off"]

POST = [
    *STILL, "mesh.level=1", "solver.tolerance=1e-7",
    "obstacles=[{source='cube.obj', scale=0.1, position=[0,0,-0.0155]}]",
]  # fmt: skip
"""A cube of 2 cm under the disc."""


def touching(friction: float, response: str = "lagrange") -> str:
    return (
        f"contact={{contact_distance=5e-4, alarm_distance=1.5e-3, friction={friction}, response='{response}', "
        "tolerance=1e-4}"
    )


@pytest.mark.parametrize("response", MODES)
def test_the_servos_that_press_the_tripod_on_a_post_do_the_work_that_bends_it(response: str) -> None:
    simulation = Simulation(load_scene("tripod", [*POST, touching(0.0, response)]))
    found = []
    for angle in (0.03, 0.036):
        report = simulation.step(np.array([angle, angle, angle, 0.0]))
        assert report.residual < 1e-7
        assert not simulation.state.velocities.any()
        energies = simulation.energies()
        found.append((energies.strain + energies.gravity, float(simulation.efforts.sum())))
    (low, first), (high, second) = found
    slack = 0.01 if response == "lagrange" else 0.05  # springs of penalty take a part of the work
    assert (high - low) / 0.006 == pytest.approx((first + second) / 2, rel=slack)
    assert report.contact
    assert report.contact.force > 0.1
    assert simulation.effector
    # the lower side of the disc at the contact distance from the top of the post
    assert simulation.effector.position[2] == pytest.approx(-0.0055 + 5e-4 + 0.0025, abs=4e-4)


@pytest.mark.parametrize("scheme", IMPLICIT)
def test_the_motion_of_every_scheme_comes_to_rest_in_the_equilibrium(scheme: str) -> None:
    goal, words = (
        np.array([0.03, 0.03, 0.03, 0.0]),
        [touching(0.0), *POST[len(STILL) :]],
    )
    still = Simulation(load_scene("tripod", [*STILL, *words]))
    still.step(goal)
    damped = ["damping={mass=30.0, stiffness=2e-3}", "solver.mode=newton", f"inertia.scheme={scheme}"]
    moving = Simulation(load_scene("tripod", [*words, *damped]))
    for k in range(80):
        report = moving.step(goal * min(1.0, (k + 1) / 20))
        assert report.contact
        assert report.contact.smallest_gap > -1e-6
    assert not report.contact.restarted
    assert report.contact.pressed
    np.testing.assert_allclose(moving.positions, still.positions, atol=1e-6)
    np.testing.assert_allclose(moving.efforts, still.efforts, rtol=1e-3)


def test_without_friction_the_way_is_forgotten_and_with_it_it_is_not() -> None:
    def left(friction: float) -> float:
        simulation = Simulation(load_scene("tripod", [*POST, touching(friction)]))
        there, away = np.array([0.03, 0.03, 0.03, 0.0]), np.array([0.03, -0.1, 0.03, 0.0])
        simulation.step(there)
        first = simulation.positions.copy()
        simulation.step(away)
        assert np.abs(simulation.positions - first).max() > 1e-3
        report = simulation.step(there)
        assert report.contact
        assert report.contact.pressed
        return float(np.abs(simulation.positions - first).max())

    assert left(0.0) < 1e-7
    assert left(0.5) > 1e-5


CLOTH = [
    "springs.source=grid", "springs.nodes=9", "springs.size=0.8", "springs.fixed_corners=[0,1,2,3]", "sleep=off",
    "springs.position=[0,0,0.205]", "contact.friction=0.0", "contact.tolerance=1e-5",
]  # fmt: skip


@pytest.mark.parametrize("response", MODES)
def test_a_cloth_held_over_a_sphere_is_where_its_motion_comes_to_rest(response: str) -> None:
    words = [*CLOTH, f"contact.response={response}"]
    still = Simulation(load_scene("drape", [*words, *STILL, "solver.tolerance=1e-10"]))
    report = still.step()
    assert report.contact
    assert report.contact.pressed
    assert np.linalg.norm(still.positions, axis=1).min() > 0.19
    moving = Simulation(load_scene("drape", [*words, "damping.mass=5"]))
    moving.state.positions[:] = still.positions
    for _ in range(60):
        moving.step()
    rough = Simulation(load_scene("drape", [*words, *STILL]))
    rough.step()
    assert 1e-5 < np.abs(rough.positions - still.positions).max() < (1e-3 if response == "lagrange" else 2e-3)
    # by penalty how deep bodies sink in depends on the step
    assert np.abs(moving.positions - still.positions).max() < (1e-6 if response == "lagrange" else 2e-3)
    assert moving.report.contact
    if response == "lagrange":
        assert moving.report.contact.force == pytest.approx(report.contact.force, rel=1e-4)


@pytest.mark.parametrize("response", MODES)
def test_a_strip_that_sags_does_not_pass_a_plate(response: str) -> None:
    """The silicone piece hangs on one arm, its weight fifty times as large, a plate 2 mm below."""
    words = [
        *STILL, "mesh.level=1", "fixed=[{low=[0.03,-0.02,-0.01], high=[0.06,0.02,0.01]}]", "mesh.element=h8_mean",
        "gravity.acceleration=[0,0,-50]",
    ]  # fmt: skip
    plate = ["obstacles=[{source='plate.obj', position=[0,0,-0.005]}]", touching(0.3, response)]
    free, held = (
        Simulation(load_scene("silicone", words)),
        Simulation(load_scene("silicone", [*words, *plate])),
    )
    free.step()
    report = held.step()
    assert free.positions[:, 2].min() < -0.01
    assert held.positions[:, 2].min() > -0.005
    assert report.contact
    assert 0.2 * 0.032 * 50 < report.contact.force < 0.032 * 50
    again = held.step()
    assert again.iterations <= report.iterations
    assert held.positions[:, 2].min() > -0.005


def test_where_nothing_touches_the_equilibrium_is_that_without_contact() -> None:
    far = ["contact={}", "obstacles=[{source='plate.obj', position=[0,0,-0.9]}]"]
    words = [*STILL, "mesh.level=1", "solver.tolerance=1e-8"]
    bare, among = (Simulation(load_scene("tripod", [*words, *more])) for more in ([], far))
    for goal in ([-0.4, -0.2, 0.1, 0.01], [0.2, 0.2, 0.2, 0.0]):
        for simulation in (bare, among):
            simulation.step(np.array(goal))
        np.testing.assert_allclose(among.positions, bare.positions, atol=1e-8)
        np.testing.assert_allclose(among.efforts, bare.efforts, atol=1e-6)


def test_what_finds_no_equilibrium_ends_with_the_state_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = Simulation(load_scene("drape", [*CLOTH, *STILL]))
    before = simulation.positions.tobytes()
    monkeypatch.setattr(ContactStatics, "MOST", 1)
    with raises_naming(StepError, "no equilibrium", "unbalanced force", "0.0001 N") as caught:
        simulation.step()
    forces = [float(f) for f in re.findall(r"(\d[\d.]*(?:e[+-]?\d+)?) N\b", str(caught.value))]
    assert max(forces) > min(forces) == 1e-4, "the unbalanced force, and the tolerance that it is above"
    assert simulation.positions.tobytes() == before
    assert simulation.state.step == 0


def test_what_nothing_holds_is_refused() -> None:
    assert_names(refusal("stack", ["inertia=off"]), "nothing holds")
    ball = "rigid=[{shape='ball', radius=0.05, position=[0,0,0.5]}]"
    assert_names(
        refusal("drape", [*CLOTH, *STILL, ball]), "rigid needs inertia", "[inertia]", "[[obstacles]]"
    )
    assert_names(refusal("silicone_drop", STILL), "nothing holds")
