"""The error of time steps by steps of half the length: contact, the strain limit, explicit schemes."""

import subprocess
import sys

import numpy as np
import pytest

from tests.checks import assert_failing_leaves_the_state
from tests.messages import raises_naming
from tripod_runtime.checkpoint import Checkpoint, checkpoint_bytes, read_checkpoint
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.contact.stepper import ContactStepper
from tripod_sim.integrators.stepper import integrator_of

BOUND = ("strain_limit={stretch=0.01}", "springs.stiffness=300", "dt=0.002")
EXPLICIT_SOLID = ("mesh.level=1", "damping=off", "dt=0.01")


def made(scene: str, *words: str) -> Simulation:
    return Simulation(load_scene(scene, words))


def moved(simulation: Simulation, end: float) -> Simulation:
    for _ in range(round(end / simulation.scene.dt)):
        simulation.step()
    return simulation


@pytest.mark.parametrize(
    ("scene", "words", "end", "fine"),
    [
        ("pendulum", ("inertia.scheme=semi_implicit_euler", "dt=0.005"), 0.5, "dt=5e-5"),
        ("pendulum", ("inertia.scheme=rk4", "dt=0.05"), 0.5, "dt=1e-4"),
        ("pendulum", ("inertia.scheme=rk4", "dt=0.02", *BOUND[:2]), 0.1, "dt=1e-4"),
        ("pendulum", ("inertia.scheme=implicit_euler", *BOUND), 0.5, "dt=2e-4"),
        ("pendulum", ("inertia.scheme=bdf2", *BOUND), 0.5, "dt=2e-4"),
        ("bounce", ("dt=0.002",), 0.3, "dt=2e-4"),
        ("bounce", ("dt=0.002",), 0.5, "dt=2e-4"),
        ("incline", (), 0.5, "dt=2e-4"),
        ("silicone_drop", ("mesh.level=1", "dt=0.004"), 0.2, "dt=5e-4"),
    ],
)
def test_the_estimate_is_the_true_error_and_leaves_the_motion_alone(
    scene: str, words: tuple[str, ...], end: float, fine: str
) -> None:
    simulation, plain = moved(made(scene, *words, "time_error={}"), end), moved(made(scene, *words), end)
    np.testing.assert_array_equal(simulation.positions, plain.positions)
    np.testing.assert_array_equal(simulation.efforts, plain.efforts)
    true = np.linalg.norm(moved(made(scene, *words, fine), end).positions - plain.positions, axis=1)
    report = simulation.report.time_error
    assert report
    assert true.max() > 1e-7
    assert report.largest == pytest.approx(true.max(), rel=0.5)
    assert true[report.node] > 0.5 * true.max()
    assert np.isnan(report.added)


@pytest.mark.parametrize(("scheme", "finer"), [("semi_implicit_euler", 16), ("rk4", 4)])
def test_an_explicit_solid_is_divided_twice_as_finely(scheme: str, finer: int) -> None:
    words = (*EXPLICIT_SOLID, f"inertia.scheme={scheme}")
    simulation, exact = made("silicone", *words, "time_error={}"), made("silicone", *words)
    exact._stepper.finer = finer
    for _ in range(3):
        simulation.step()
        exact.step()
    assert simulation.report.parts > 100
    assert exact.report.parts > 0.9 * finer * simulation.report.parts
    true = np.linalg.norm(exact.positions - simulation.positions, axis=1).max()
    assert simulation.report.time_error.largest == pytest.approx(true, rel=0.2)


def test_the_effector_has_its_share() -> None:
    words = ("mesh.level=1", "inertia.scheme=semi_implicit_euler", "dt=0.001", "time_error={}")
    simulation, exact = made("tripod", *words), made("tripod", *words[:-1])
    exact._stepper.finer = 4
    goal = simulation.command
    for k in range(2):
        goal[0] = -0.005 * (k + 1)
        simulation.step(goal)
        exact.step(goal)
    true = (
        4 / 3 * np.linalg.norm(exact.state.centres[0] - simulation.state.centres[0])
    )  # of a first-order scheme
    assert simulation.report.time_error.effector == pytest.approx(true, rel=0.1)
    report = simulation.report.time_error
    assert 0 < report.effector <= report.largest
    twin = simulation.state.twin.twin
    assert report.effector == pytest.approx(2 * np.linalg.norm(twin.centres[0] - simulation.state.centres[0]))
    np.testing.assert_array_equal(twin.joints, simulation.state.joints)


@pytest.mark.parametrize(
    ("scene", "words", "end"),
    [
        ("pendulum", ("inertia.scheme=semi_implicit_euler",), 0.3),
        ("bounce", (), 0.4),
    ],
)
def test_automatic_steps_follow_the_tolerance(scene: str, words: tuple[str, ...], end: float) -> None:
    exact, errors, parts = moved(made(scene, *words, "dt=5e-5"), end), [], []
    for tolerance in (1e-5, 1e-6):
        wanted = f"time_error={{steps='auto', tolerance={tolerance}}}"
        simulation, count = made(scene, *words, "dt=0.01", wanted), 0
        for _ in range(round(end / 0.01)):
            report = simulation.step()
            assert report.time_error.added <= tolerance
            assert np.isnan(report.time_error.largest)
            count += report.parts
        assert simulation.state.time == pytest.approx(end)
        assert simulation.state.step == round(end / 0.01)
        errors.append(np.linalg.norm(simulation.positions - exact.positions, axis=1).max())
        parts.append(count)
    assert errors[1] < 0.5 * errors[0]
    assert parts[1] > 2 * parts[0]


@pytest.mark.parametrize("steps", ["fixed", "auto"])
def test_reset_restore_and_checkpoints_bring_it_back(steps: str) -> None:
    simulation = made("bounce", "dt=0.01", f"time_error={{steps='{steps}', tolerance=1e-4}}")
    first = moved(simulation, 0.32).positions.tobytes(), simulation.report
    saved = simulation.save()
    data = checkpoint_bytes(Checkpoint(0, *saved))
    simulation._stepper.forget()  # as whoever keeps a checkpoint does
    after = [simulation.step() for _ in range(5)], simulation.positions.tobytes()
    for again in (saved, (read_checkpoint(data, simulation).state, saved[1])):
        simulation.restore(again)
        reports = [simulation.step() for _ in range(5)]
        assert simulation.positions.tobytes() == after[1]
        assert repr(reports) == repr(after[0])
    simulation.reset()
    assert moved(simulation, 0.32).positions.tobytes() == first[0]
    assert repr(simulation.report) == repr(first[1])


def test_a_body_that_somebody_moves_begins_without_error() -> None:
    simulation = moved(made("bounce", "dt=0.002", "time_error={}"), 0.2)
    before = simulation.report.time_error.largest
    simulation.state.rigid.velocities[0, 0] += 0.1
    simulation.step()
    assert simulation.report.time_error.largest < 0.1 * before


def test_a_step_that_fails_leaves_the_state(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = moved(made("bounce", "dt=0.01", "time_error={steps='fixed'}"), 0.1)
    assert_failing_leaves_the_state(simulation, simulation._stepper.integrator._twin, monkeypatch)


def test_a_sleeper_goes_on_knowing_what_touches() -> None:
    simulation = made("stack", "dt=0.02", "sleep={}", "time_error={}")
    for _ in range(200):
        if simulation.step().asleep:
            break
    assert simulation.report.asleep
    assert isinstance(integrator_of(simulation._stepper), ContactStepper)


def test_parts_that_are_chosen_carry_no_error_along() -> None:
    with raises_naming(
        SceneError, "time_error.estimate", "contact", "strain_limit", "explicit", "dt = 'auto'"
    ):
        load_scene("bounce", ["time_error={steps='auto', estimate='global'}"])


def test_absent_it_is_not_imported() -> None:
    code = (
        "import sys; from tripod_sim import Simulation, load_scene;"
        "s = Simulation(load_scene('pendulum', ['inertia.scheme=bdf2', 'time_error={}'])); s.step();"
        "assert s.state.twin is None; assert 'tripod_sim.steps.doubling' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
