"""Few contacts by the compliance of the bodies: Coulomb's law, the same end as the other way, few factorisations."""

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_sim import Simulation, load_scene
from tripod_sim.contact import condensed_contact_kernels
from tripod_sim.contact.contact_set import allocate
from tripod_sim.contact.stepper import ContactStepper
from tripod_sim.integrators.stepper import integrator_of

AIM = 1e-9


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(4))
def test_the_forces_on_what_is_touched_obey_coulomb(seed: int, mu: float) -> None:
    """Nodes and a rigid body pressed against each other and what is fixed, each with a compliance of its own."""
    rng, nodes = np.random.default_rng(seed), 4
    m = 3 * nodes + 6
    root = rng.standard_normal((m, m))
    N = (root @ root.T / m + 0.1 * np.eye(m)) * 1e-3
    c, count = allocate(8), 6
    for k in range(count):
        n = rng.standard_normal(3)
        c.normal[k], c.gap[k] = n / np.linalg.norm(n), rng.uniform(-1e-3, 5e-4)
        c.base[k, 0], c.lump[k, 0], c.width[k, 0] = 3 * (k % nodes), 1.0, 3
        if k % 2:
            c.base[k, 1], c.lump[k, 1], c.width[k, 1] = 3 * nodes, -1.0, 6
            c.moment[k, 1] = rng.standard_normal(3) * 0.5
    J = np.zeros((count, 3, m))
    for k in range(count):
        J[k, :, c.base[k, 0] : c.base[k, 0] + 3] = np.eye(3)
        if k % 2:
            r = c.moment[k, 1]
            J[k, :, m - 6 : m - 3] = -np.eye(3)
            J[k, :, m - 3 :] = np.array([[0, r[2], -r[1]], [-r[2], 0, r[0]], [r[1], -r[0], 0]])
    S = np.linalg.inv(N)
    condensed_contact_kernels.stiffen(c, count, N.copy())
    y = rng.standard_normal(m) * 1e-4
    z = y.copy()
    _, error = condensed_contact_kernels.settle(c, count, S, y, z, mu, AIM, np.zeros(8), np.zeros((8, 3)))
    assert error <= AIM
    p, f, n = c.pressure[:count], c.friction[:count], c.normal[:count]
    force = p[:, None] * n + f
    np.testing.assert_allclose(S @ (z - y), np.einsum("kim,ki->m", J, force), atol=1e-4 * np.abs(force).max())
    d = J @ z
    along = np.einsum("ki,ki->k", n, d)
    gap, slip = c.gap[:count] + along, d - along[:, None] * n
    assert (p > 0).any()
    assert gap.min() > -2 * AIM
    assert np.abs(gap[p > 0]).max() < 2 * AIM
    size = np.linalg.norm(f, axis=1)
    assert (size <= mu * p * (1 + 1e-9)).all()
    slides = np.linalg.norm(slip, axis=1) > 1e-7
    if mu:
        cosine = np.einsum("ki,ki->k", f, slip) / np.maximum(size * np.linalg.norm(slip, axis=1), 1e-300)
        both = slides & (p > 0)
        np.testing.assert_allclose(size[both], mu * p[both], rtol=1e-3)
        assert (cosine[both] < -0.999).all()


def test_what_sticks_neither_sinks_in_nor_slips() -> None:
    """A node of compliance 1 mm/N in all directions is driven 1 mm into a floor and 0.1 mm along it.

    It stays where it touches: the floor presses with 1 N and holds it with 0.1 N, less than Coulomb's 0.5 N.
    The gap comes to rest sooner than the slip: whoever looks at the gap alone stops while the node still slips.
    """
    c = allocate(1)
    c.normal[0], c.gap[0] = (0.0, 0.0, 1.0), 0.0
    c.base[0, 0], c.lump[0, 0], c.width[0, 0] = 0, 1.0, 3
    N = 1e-3 * np.eye(3)
    condensed_contact_kernels.stiffen(c, 1, N.copy())
    y = np.array([1e-4, 0.0, -1e-3])
    z = y.copy()
    _, error = condensed_contact_kernels.settle(
        c, 1, np.linalg.inv(N), y, z, 0.5, AIM, np.zeros(1), np.zeros((1, 3))
    )
    assert error <= AIM
    np.testing.assert_allclose(z, 0.0, atol=AIM)
    assert c.pressure[0] == pytest.approx(1.0, rel=1e-5)
    np.testing.assert_allclose(c.friction[0], [-0.1, 0.0, 0.0], atol=1e-6)


BALL = (
    "contact={contact_distance=5e-4, alarm_distance=1.5e-3}",
    'rigid=[{shape="ball", radius=0.008, mass=0.0005, position=[0.001,0.0005,0.0105]}]',
)


@pytest.mark.parametrize(
    ("scene", "words", "steps"),
    [
        ("stack", ("rigid.2.position=[0.004,0.002,0.256]",), 20),
        ("incline", ("contact.friction=0.3",), 20),
        (SHARP, ("mesh.level=1", *BALL), 6),
    ],
)
def test_the_end_is_that_of_factorisations_with_the_contacts_in_them(
    scene: str, words: tuple[str, ...], steps: int
) -> None:
    scene_words = [*words, "contact.tolerance=1e-6", "contact.max_solves=200"]
    few, many = Simulation(load_scene(scene, scene_words)), Simulation(load_scene(scene, scene_words))
    stepper = integrator_of(many._stepper)
    assert isinstance(stepper, ContactStepper)
    stepper.world.response._condensed = None
    ways, moved = list[str](), few.positions.copy()
    for _ in range(steps):
        ways.append(few.step().contact.way)
        assert many.step().contact.way == "multipliers"
    assert ways.count("compliance") >= 0.75 * steps  # a hit may need the other way
    assert few.report.contact.pressed
    travel = np.abs(few.positions - moved).max()
    assert travel > 1e-5
    np.testing.assert_allclose(few.positions, many.positions, atol=max(1e-3 * travel, 1e-8))
    assert few.report.contact.force == pytest.approx(many.report.contact.force, rel=1e-2)


def test_what_lies_still_is_factored_no_more() -> None:
    simulation = Simulation(load_scene("stack"))
    for _ in range(40):
        simulation.step()
    taken = [simulation.step() for _ in range(20)]
    assert sum(report.factorisations for report in taken) == 0
    assert max(report.iterations for report in taken) <= 3
    assert all(report.contact.way == "compliance" for report in taken)


def test_what_friction_wedges_in_a_hole_needs_no_other_way() -> None:
    """The strips jump up by 0.9 rad in 20 ms: the ball is pressed into the hole by twenty times its weight."""
    words = ["servos.angles=[-1.4,-1.4,-1.4]", "ball.position=[0,0,0.002]"]
    simulation = Simulation(load_scene("tripod_ball", words))
    for _ in range(60):
        simulation.step()
    weight, forces = 9.81 * simulation.scene.ball.mass, []
    for k in range(4):
        report = simulation.step(np.array([*np.full(3, -1.4 + 0.225 * (k + 1)), 0.0]))
        assert report.contact.way == "compliance"
        forces.append(report.contact.force)
    assert max(forces) > 10 * weight


def test_the_report_tells_the_way() -> None:
    words = ["springs.source=grid", "springs.nodes=5", "springs.size=0.3", "springs.position=[0,0,0.3]"]
    assert Simulation(load_scene("drape", words)).step().contact.way == "multipliers"
    assert Simulation(load_scene("stack", ["contact.response=penalty"])).step().contact.way == "penalty"


def test_turns_count_by_what_they_move_points_by() -> None:
    """A ball of 8 mm that bounces on the disc turns by 1e-6 rad without moving anything by more than 8 nm."""
    ball = "rigid=[{shape='ball', radius=0.008, mass=0.0005, position=[0.001,0.0005,0.015]}]"
    simulation = Simulation(
        load_scene("tripod", ["contact={contact_distance=5e-4, alarm_distance=1.5e-3}", ball])
    )
    stepper = integrator_of(simulation._stepper)
    assert isinstance(stepper, ContactStepper)
    problem = stepper.world.problem
    turn = np.zeros(problem.unknowns)
    turn[problem.slices[1].stop - 1] = 1e-6  # the servos' bodies come last
    assert problem.size(turn) == pytest.approx(8e-9)
    disc = problem.slices[0].stop - 1
    while problem.reach[disc] == 1.0:
        disc -= 1
    assert problem.reach[disc] == pytest.approx(0.01, rel=0.5)
    most = 0
    for _ in range(90):
        report = simulation.step()
        most = max(most, report.iterations)
        assert report.contact
        assert report.contact.way == "compliance"
    assert most <= 20  # 63 in units of one metre per radian
