"""Sleep: what is at rest is left alone, what falls, creeps, slides or topples is not, however slowly."""

import subprocess
import sys

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.scenes import SHARP
from tripod_sim import Simulation, load_scene
from tripod_sim.errors import SceneError
from tripod_sim.integrators.report import StepReport

G, SPEED = 9.81, 0.003

HANGING = [
    "springs.nodes=5",
    "springs.damping=0.3",
    "damping={mass=6.0, stiffness=0.0}",
    "sleep={}",
    "dt=0.01",
]


def hanging(*words: str) -> Simulation:
    """A cloth held at two corners in a thick medium."""
    return Simulation(load_scene("cloth", [*HANGING, *words]))


def test_many_steps_that_end_asleep_count_the_work_of_the_others_once() -> None:
    words = ["sleep={}"]
    one, many = Simulation(load_scene("stack", words)), Simulation(load_scene("stack", words))
    work = [(r.iterations, r.parts) for r in (one.step() for _ in range(100))]
    together = many.advance(100)
    assert together.asleep
    assert work[-1] == (0, 0)
    assert (together.iterations, together.parts) == tuple(sum(column) for column in zip(*work, strict=True))


def until_asleep(simulation: Simulation, most: int) -> int:
    """Step until the body is asleep; return the number of steps."""
    for k in range(most):
        if simulation.step().asleep:
            return k + 1
    raise AssertionError(f"awake after {most} steps, {simulation.energies()}")


def test_a_body_at_rest_is_left_alone_until_something_changes() -> None:
    simulation = hanging()
    until_asleep(simulation, 1500)
    assert simulation.energies().kinetic == 0.0
    awake = hanging("sleep=off")
    awake.advance(3000)
    np.testing.assert_allclose(
        simulation.positions, awake.positions, atol=1e-4
    )  # it hangs where it would hang
    still, step = simulation.positions.tobytes(), simulation.state.step
    for _ in range(5):
        report = simulation.step()
        assert report.asleep
        assert (report.iterations, report.factorisations, report.parts) == (0, 0, 0)
    together = simulation.advance(5)
    assert (together.asleep, together.iterations, together.parts) == (True, 0, 0)
    assert simulation.positions.tobytes() == still
    assert simulation.state.step == step + 10
    assert simulation.state.time == pytest.approx((step + 10) * simulation.scene.dt)
    simulation.state.velocities[7, 2] = 0.1  # a push
    assert not simulation.step().asleep
    assert simulation.report.iterations > 0
    assert simulation.positions.tobytes() != still
    until_asleep(simulation, 1500)
    simulation.state.positions[7, 2] += 1e-3  # a hand
    assert not simulation.step().asleep
    until_asleep(simulation, 1500)
    simulation.reset()
    assert not simulation.step().asleep


def test_until_it_sleeps_a_body_moves_as_without_sleep() -> None:
    one, other = hanging(), hanging("sleep=off")
    for _ in range(100):
        one.step()
        other.step()
    assert one.state.positions.tobytes() == other.state.positions.tobytes()


@pytest.mark.parametrize("drag", [5e3, 1e5, 1e6])
def test_what_creeps_down_is_never_asleep(drag: float) -> None:
    """At g / a, 2 mm/s to 10 um/s: below the speed of rest, for ever, and yet falling."""
    words = [
        "springs.nodes=4",
        "springs.fixed_corners=[]",
        f"damping={{mass={drag}, stiffness=0.0}}",
        "sleep={}",
    ]
    simulation = Simulation(load_scene("cloth", [*words, "dt=0.02"]))
    start = simulation.positions[:, 2].mean()
    for _ in range(150):
        assert not simulation.step().asleep
    assert np.abs(simulation.state.velocities).max() < SPEED
    assert start - simulation.positions[:, 2].mean() == pytest.approx(3.0 * G / drag, rel=0.02)


@pytest.mark.parametrize("spread", [0.0, 0.5])
def test_what_slides_is_never_asleep(spread: float) -> None:
    """Without gravity and drag a slow body goes on for ever; `spread`: its corners at other speeds."""
    words = ["springs.nodes=4", "springs.fixed_corners=[]", "gravity=off", "sleep={}", "dt=0.02"]
    simulation = Simulation(load_scene("cloth", words))
    simulation.state.velocities[:, 0] = 0.9 * SPEED
    simulation.state.velocities[:8, 0] *= 1.0 - spread
    momentum = simulation.state.velocities.sum(axis=0)
    for _ in range(200):
        assert not simulation.step().asleep
    np.testing.assert_allclose(simulation.state.velocities.sum(axis=0), momentum, rtol=1e-6, atol=1e-9)


def test_what_topples_from_where_it_was_balanced_is_never_asleep() -> None:
    """A mass on an upright spring, 1 um beside the point where it would stand for ever."""
    words = ["springs.nodes=2", "springs.damping=50", "inertia.scheme=implicit_euler", "sleep={}", "dt=0.005"]
    simulation = Simulation(load_scene("pendulum", words))
    simulation.state.positions[1] = [1e-6, 0, 1.0 - G / 1500]
    for _ in range(1200):
        simulation.step()
        assert not simulation.report.asleep
        if simulation.positions[1, 2] < 0:
            break
    assert simulation.positions[1, 2] < 0


def test_what_swings_is_asleep_only_after_it_has_stopped() -> None:
    """At each turn a pendulum stands still."""
    words = [
        "springs.nodes=2",
        "inertia.scheme=tr_bdf2",
        "sleep={speed=0.05}",
        "damping={mass=0.05, stiffness=0.0}",
    ]
    simulation = Simulation(load_scene("pendulum", words))
    slowest = np.inf
    for _ in range(1000):
        assert not simulation.step().asleep
        slowest = min(slowest, float(np.linalg.norm(simulation.state.velocities[1])))
    assert slowest < 0.05


def test_a_solid_sleeps_too_and_wakes_with_its_servos() -> None:
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1", "sleep={}"]))
    until_asleep(simulation, 200)
    torques = simulation.efforts.copy()
    simulation.step()
    np.testing.assert_array_equal(simulation.efforts, torques)
    joints = simulation.state.joints.copy()
    joints[0] -= 0.05
    assert not simulation.step(joints).asleep
    assert np.abs(simulation.efforts - torques).max() > 1e-4
    until_asleep(simulation, 400)


LIGHT = (
    'rigid=[{shape="ball", radius=0.02, mass=0.001, position=[0.3, 0, 0.021], velocity=[0.02, 0, 0], spin=[0, 1, 0]}, '
    '{shape="box", mass=1.0, position=[0, 0, 0.051]}]'
)
"""A light ball that rolls beside a heavy box that lies: both together would count as slow."""


def test_a_stack_falls_asleep_and_wakes_where_something_changes() -> None:
    simulation, awake = (Simulation(load_scene("stack", ["dt=0.02", *w])) for w in (["sleep={}"], []))
    steps = until_asleep(simulation, 300)
    for _ in range(steps - 1):
        awake.step()
    before = simulation.save()
    assert np.abs(simulation.positions - awake.positions).max() < SPEED * 0.02
    assert simulation.energies().kinetic == 0.0
    still = simulation.positions.tobytes()
    assert simulation.step().asleep
    assert simulation.report.iterations == 0
    assert simulation.positions.tobytes() == still
    for name, place, change in (
        ("velocities", (2, 0), 0.05),
        ("spins", (2, 2), 0.5),
        ("centres", (2, 2), 1e-3),
    ):
        getattr(simulation.state.rigid, name)[place] += change
        assert not simulation.step().asleep, name
        assert simulation.positions.tobytes() != still
        simulation.restore(before)
        assert not simulation.step().asleep
        until_asleep(simulation, 300)
        still = simulation.positions.tobytes()


def test_what_rolls_is_awake_beside_a_heavy_body_that_lies() -> None:
    simulation = Simulation(load_scene("stack", ["dt=0.02", "sleep={}", LIGHT]))
    start = simulation.state.rigid.centres[0, 0]
    for _ in range(60):
        assert not simulation.step().asleep
    assert simulation.state.rigid.centres[0, 0] - start == pytest.approx(60 * 0.02 * 0.02, rel=0.02)


def test_what_spins_on_the_spot_is_awake() -> None:
    """Slower than the bound, about its centre."""
    turn = 0.9 * SPEED / (np.sqrt(0.4) * 0.05)
    words = ["gravity=off", "dt=0.02", "sleep={}", f"rigid.0.spin=[0, 0, {turn}]"]
    simulation = Simulation(load_scene("bounce", words))
    for _ in range(60):
        assert not simulation.step().asleep
    assert simulation.energies().kinetic == pytest.approx(0.5 * 0.2 * (0.9 * SPEED) ** 2)


def test_a_rigid_body_that_is_let_down_slowly_is_awake() -> None:
    """At 0.1 mm/s it is slow and goes nowhere, but the energy that it loses is far more than it has."""
    simulation = Simulation(load_scene("bounce", ["sleep={}", "dt=0.02"]))

    class Lowering:
        def step(self, state, joints, dt):
            state.rigid.velocities[:] = [0, 0, -speed]
            state.rigid.centres[:] += dt * state.rigid.velocities
            return StepReport()

    simulation._stepper._stepper = Lowering()
    speed = 1e-4
    for _ in range(60):
        assert not simulation.step().asleep
    speed = 0.0
    until_asleep(simulation, 40)


def test_four_points_have_mass_centre_and_inertia_of_a_rigid_body() -> None:
    words = [LIGHT.replace("mass=1.0", "mass=1.0, size=[0.1, 0.2, 0.05], orientation=[0.6, 0, 0, 0.8]")]
    simulation = Simulation(load_scene("stack", ["contact.start=lift", *words]))
    rigid, state = simulation._parts.rigid, simulation.state.rigid
    masses, points = rigid.point_mass, rigid.points(state).reshape(2, 4, 3)
    arms = points - state.centres[:, None]
    np.testing.assert_allclose(masses.sum(axis=1), rigid.mass)
    np.testing.assert_allclose(arms.mean(axis=1), 0.0, atol=1e-15)
    squares = np.einsum("kai,kai->ka", arms, arms)[:, :, None, None] * np.eye(3)
    found = (masses[:, :, None, None] * (squares - arms[..., None] * arms[:, :, None])).sum(axis=1)
    inertia = state.rotations @ rigid.inertia @ state.rotations.transpose(0, 2, 1)
    np.testing.assert_allclose(found, inertia, rtol=1e-12, atol=1e-12 * inertia.max())


def test_sleep_that_makes_no_sense_is_refused_and_absent_sleep_is_not_imported() -> None:
    with raises_naming(SceneError, "sleep", "inertia"):
        load_scene("cloth", ["sleep={}", "inertia=off"])
    with raises_naming(SceneError, "sleep.speed", "0.0"):
        load_scene("cloth", ["sleep={speed=0}"])
    code = (
        "import sys; from tripod_sim import Simulation, load_scene;"
        "Simulation(load_scene('cloth', ['springs.nodes=4'])).step();"
        "assert 'tripod_sim.steps.sleep' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
