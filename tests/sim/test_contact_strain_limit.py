"""The limit of strains beside contact: one minimum keeps both bounds."""

import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_sim import Simulation, StepError, load_scene
from tripod_study.variations.drape import crossings_of

MODES = ["lagrange", "penalty"]

HEAVY = [
    "springs.source=grid",
    "springs.nodes=9",
    "springs.size=0.8",
    "springs.node_mass=0.1",
    "damping.mass=5",
]
"""8 kg on the springs of `drape`: they stretch like rubber."""


def stretch(simulation: Simulation) -> float:
    x, b = simulation.positions, simulation.mesh
    return float((np.linalg.norm(x[b.ends[:, 1]] - x[b.ends[:, 0]], axis=1) / b.rest_length).max() - 1)


@pytest.mark.parametrize("response", MODES)
def test_a_heavy_cloth_on_a_sphere_is_neither_rubber_nor_through(response: str) -> None:
    words = [*HEAVY, f"contact.response={response}"]
    free, longest = Simulation(load_scene("drape", words)), 0.0
    for _ in range(40):
        free.step()
        longest = max(longest, stretch(free))
    assert longest > 0.2
    scene = load_scene("drape", [*words, "strain_limit.stretch=0.03"])
    simulation = Simulation(scene)
    assert scene.springs
    assert scene.contact
    watch = crossings_of(scene)
    worst, pressed = 0.0, 0
    for _ in range(45):
        report = simulation.step()
        assert report.contact
        assert report.contact.smallest_gap > -scene.contact.contact_distance
        assert report.contact.cut == 0.0
        assert not watch.found(simulation.positions, straight=report.contact.parts == 1)
        worst, pressed = max(worst, stretch(simulation)), max(pressed, report.contact.pressed)
    assert 0.02 < worst <= 0.03
    assert pressed > 5


def test_both_keep_the_momentum() -> None:
    """A cloth that may touch itself, alone in the air, thrown about: all forces are internal."""
    words = ["springs.nodes=6", "springs.fixed_corners=[]", "springs.node_mass=0.01", "gravity=off",
             "contact={self_contact=true, contact_distance=0.005, alarm_distance=0.015}"]  # fmt: skip
    simulation = Simulation(load_scene("cloth", [*words, "strain_limit.stretch=0.005"]))
    rng = np.random.default_rng(0)
    simulation.state.velocities[:] = rng.standard_normal(simulation.positions.shape)
    before = (simulation.mesh.mass[:, None] * simulation.state.velocities).sum(axis=0)
    worst = 0.0
    for _ in range(12):
        simulation.step()
        worst = max(worst, stretch(simulation))
    assert 0.004 < worst <= 0.005
    after = (simulation.mesh.mass[:, None] * simulation.state.velocities).sum(axis=0)
    np.testing.assert_allclose(after, before, atol=1e-6 * np.linalg.norm(before))


def test_the_limit_taken_away_and_reset_give_the_same_bits() -> None:
    def motion(words: list[str]) -> bytes:
        simulation = Simulation(load_scene("drape", [*HEAVY, *words]))
        ends = []
        for _ in range(2):
            for _ in range(18):
                simulation.step()
            ends.append(simulation.positions.tobytes())
            simulation.reset()
        assert ends[0] == ends[1]
        return ends[0]

    without = motion([])
    assert motion(["strain_limit.stretch=0.03"]) != without
    assert motion(["strain_limit.stretch=0.03", "strain_limit=off"]) == without


def test_a_limit_that_cannot_be_met_ends_with_the_last_good_state() -> None:
    """Two corners that never move are pulled apart by hand."""
    words = [*HEAVY, "springs.fixed_corners=[0, 1]", "strain_limit.stretch=0.03", "sleep=off"]
    simulation = Simulation(load_scene("drape", words))
    simulation.step()
    apart = simulation.state.positions
    apart[0, 0] -= 0.2
    kept = apart.copy()
    with raises_naming(StepError, "step 2", "strain_limit") as caught:
        simulation.step()
    assert "\n" not in str(caught.value)
    np.testing.assert_array_equal(simulation.positions, kept)


def test_a_limited_cloth_catches_a_heavy_ball() -> None:
    """Its moves come first among the unknowns, those of the ball behind them."""
    words = [
        "springs.nodes=7", "springs.size=0.6", "springs.fixed_corners=[0,1,2,3]", "springs.stiffness=500",
        "damping={mass=2.0, stiffness=0.0}", "contact={contact_distance=0.002, alarm_distance=0.006}", "dt=0.01",
        "rigid=[{shape='ball', mass=2.0, radius=0.06, position=[0.01,0.02,0.07]}]",
    ]  # fmt: skip
    free = Simulation(load_scene("cloth", words))
    for _ in range(30):
        free.step()
    simulation = Simulation(load_scene("cloth", [*words, "strain_limit.stretch=0.02"]))
    worst, b = 0.0, simulation.mesh.soft
    for _ in range(30):
        report = simulation.step()
        assert report.contact
        assert report.contact.smallest_gap > -0.002
        x = simulation.positions
        length = np.linalg.norm(x[b.ends[:, 1]] - x[b.ends[:, 0]], axis=1) / b.rest_length
        worst = max(worst, float(length.max()) - 1)
    assert 0.01 < worst <= 0.02
    assert free.rigid[0].position[2] < simulation.rigid[0].position[2] - 0.01
    assert report.contact.pressed > 0
