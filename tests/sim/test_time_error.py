"""The estimated error of the time steps: beside the true one, without a trace in the motion, remembered by resets."""

import subprocess
import sys
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from tests.scenes import SHARP
from tests.sim.implicit_schemes import IMPLICIT
from tripod_sim import Simulation, load_scene
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.time_error import ErrorTransport
from tripod_sim.steps import steppers
from tripod_study.run import run

SCHEMES = IMPLICIT
WORKING = np.array([-1.4965, -1.4965, -1.4965, 0.035])
NEWTON = ("solver.mode=newton", "solver.tolerance=1e-8")
FINE, END = 1e-4, 0.06  # [s]


def tripod(scheme: str, dt: float, *words: str) -> Simulation:
    pose = (f"servos.angles={WORKING[:3].tolist()}", f"servos.slide={WORKING[3]}", "mesh.level=1")
    return Simulation(load_scene(SHARP, [*pose, f"inertia.scheme={scheme}", f"dt={dt!r}", *words]))


def turned(t: float) -> np.ndarray:
    return WORKING + np.array([0.3 * min(t / 0.03, 1.0), 0.0, 0.0, 0.0])


def motion(simulation: Simulation, steps: int) -> np.ndarray:
    dt, found = simulation.scene.dt, []
    for k in range(steps):
        simulation.step(turned((k + 1) * dt))
        found.append(simulation.state.positions.copy())
    return np.array(found)


@pytest.fixture(scope="module")
def reference() -> np.ndarray:
    return motion(tripod("tr_bdf2", FINE, *NEWTON), round(END / FINE))


@pytest.mark.parametrize("dt", [0.005, 0.001])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_estimate_is_within_a_factor_three_of_the_true_error(
    scheme: str, dt: float, reference: np.ndarray
) -> None:
    simulation = tripod(scheme, dt, *NEWTON, "time_error={}")
    disc, every = simulation._system.groups.rigid[0], round(dt / FINE)
    rows = []
    for k in range(round(END / dt)):
        report = simulation.step(turned((k + 1) * dt)).time_error
        assert report
        true = reference[(k + 1) * every - 1] - simulation.state.positions
        largest = np.linalg.norm(true, axis=1).max()
        rows.append((np.linalg.norm(true[disc].mean(axis=0)), report.effector, largest, report.largest))
    found = np.array(rows)
    worst = found.max(axis=0)
    for true_error, estimate in (worst[:2], worst[2:]):
        assert true_error / 3 < estimate < 3 * true_error


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "dt"), [("tr_bdf2", 0.005), ("bdf2", 0.005), ("implicit_euler", 0.0025)])
def test_in_a_long_swing_with_many_chord_steps_the_estimate_stays_near_the_true_error(
    scheme: str, dt: float
) -> None:
    """With a factorisation from the start of the step it grew by half of itself each step."""
    words, end, fine = ("material.young=500kPa",), 0.5, 0.0005
    exact = Simulation(load_scene("silicone", [*words, "inertia.scheme=tr_bdf2", f"dt={fine}"]))
    coarse = Simulation(
        load_scene("silicone", [*words, f"inertia.scheme={scheme}", f"dt={dt}", "time_error={}"])
    )
    true = estimate = 0.0
    for _ in range(round(end / dt)):
        exact.advance(round(dt / fine))
        report = coarse.step().time_error
        assert report
        true = max(true, float(np.linalg.norm(coarse.positions - exact.positions, axis=1).max()))
        estimate = max(estimate, report.largest)
    assert true / 3 < estimate < 3 * true


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_estimate_points_the_right_way(scheme: str, reference: np.ndarray) -> None:
    """Added to the motion it takes most of the error away."""
    dt = 0.0005
    simulation, every = tripod(scheme, dt, *NEWTON, "time_error={}"), round(dt / FINE)
    true = reference[80 * every - 1] - motion(simulation, 80)[-1]
    assert simulation.state.errors
    left = true - simulation.state.errors.error[0]
    assert np.linalg.norm(left, axis=1).max() < 0.5 * np.linalg.norm(true, axis=1).max()
    assert (simulation.state.errors.error[:, simulation._system.driven] == 0).all()


@pytest.mark.parametrize("mode", ["newton", "one_solve"])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_estimate_leaves_no_trace_in_the_motion(
    scheme: str, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the bit where the same method solves; it allows no quasi-Newton steps, which end within the tolerance."""
    ends, states = [], []
    for plain, words in ((True, ()), (False, ("time_error={}",)), (False, ("time_error=off",)), (False, ())):
        with monkeypatch.context() as patch:
            if plain:
                patch.setattr(
                    steppers,
                    "_solver_to_tolerance",
                    lambda model, system: Newton(system, model.solver.tolerance, model.solver.max_iterations),
                )
            simulation = tripod(scheme, 0.005, f"solver.mode={mode}", *words)
        motion(simulation, 12)
        states.append(simulation.state)
        state = simulation.state
        ends.append(state.positions.tobytes() + state.velocities.tobytes() + simulation.efforts.tobytes())
    assert ends[0] == ends[1]
    assert ends[2] == ends[3]
    assert (ends[0] == ends[2]) == (mode == "one_solve")
    np.testing.assert_allclose(states[0].positions, states[2].positions, rtol=0, atol=5e-6)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_reset_and_restore_bring_the_estimate_back(scheme: str) -> None:
    simulation = tripod(scheme, 0.005, "time_error={}")

    def errors() -> bytes:
        e = simulation.state.errors
        assert e
        return b"".join(a.tobytes() for a in (e.error, e.before, e.velocities, e.accelerations))

    start, ends = errors(), []
    for _ in range(2):
        motion(simulation, 8)
        ends.append(errors())
        simulation.reset()
        assert errors() == start
    assert ends[0] == ends[1] != start
    motion(simulation, 8)
    saved, after = simulation.save(), []
    for _ in range(2):
        motion(simulation, 4)
        after.append(errors())
        simulation.restore(saved)
        assert errors() == ends[0]
    motion(simulation, 4)
    assert after[0] != ends[0]
    assert errors() == after[1]


def test_a_failed_part_leaves_no_error_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step whose first try fails ends with the errors of its two halves."""
    from tripod_sim.integrators.newton import NewtonError

    simulation, halved = (tripod("bdf2", dt, "time_error={}", *NEWTON) for dt in (0.004, 0.002))
    stepper = simulation._stepper
    plain, calls = stepper.integrator.advance, []

    def failing(state, joints, h):
        calls.append(h)
        report = plain(state, joints, h)
        if len(calls) == 1:
            stepper.integrator.drop_history()  # as at the start
            raise NewtonError("on purpose")
        return report

    monkeypatch.setattr(stepper.integrator, "advance", failing)
    report = simulation.step(turned(0.004))
    assert (report.halvings, report.parts) == (1, 2)
    for t in (0.002, 0.004):
        halved.step(turned(t))
    assert simulation.state.errors and halved.state.errors
    np.testing.assert_allclose(simulation.state.errors.error, halved.state.errors.error, rtol=1e-4, atol=1e-9)
    assert np.abs(halved.state.errors.error[0]).max() > 1e-6


FREE = ["servos=off", "effector=off", "mesh.level=1", "solver.tolerance=1e-10"]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_falling_body_s_estimate_is_its_error(scheme: str) -> None:
    """v' = g - a v from rest, out of equilibrium: the exact solution is known."""
    drag, fall, dt, steps = 8.0, -9.81, 0.002, 100
    words = [*FREE, f"damping={{mass={drag}, stiffness=0.0}}", f"inertia.scheme={scheme}", f"dt={dt}"]
    simulation = Simulation(load_scene(SHARP, [*words, "time_error={}"]))
    rest = simulation.state.positions.copy()
    for _ in range(steps):
        simulation.step()
    t = dt * steps
    exact = fall / drag * (t - (1 - np.exp(-drag * t)) / drag)
    error = exact - (simulation.state.positions[:, 2] - rest[:, 2]).mean()
    assert simulation.state.errors
    np.testing.assert_allclose(simulation.state.errors.error[0][:, 2], error, rtol=0.25)
    assert abs(error) > 1e-7


def test_velocities_changed_from_outside_are_a_new_start() -> None:
    simulation = Simulation(load_scene(SHARP, [*FREE, "gravity=off", "damping=off", "time_error={}"]))
    simulation.state.velocities[:] = [0.0, 0.5, 0.0]
    for _ in range(5):
        report = simulation.step()
    assert report.time_error
    assert report.time_error.largest < 1e-9  # uniform motion: no scheme errs
    assert np.isnan(report.time_error.effector)


def test_run_tells_the_largest_estimate_of_the_run_and_not_the_last() -> None:
    """The servo stops after 0.1 s, so that the error at the end is below that of the motion."""
    words = ["mesh.level=1", "inertia.scheme=bdf2"]
    found = run("tripod", servo="0:0,0,0; 0.1:-0.3,0,0", duration=0.3, overrides=[*words, "time_error={}"])
    simulation = Simulation(load_scene("tripod", [*words, "motion=off", "time_error={}"]))
    told, dt = [], simulation.scene.dt
    for k in range(round(0.3 / dt)):
        angle = -0.3 * min((k + 1) * dt / 0.1, 1.0)
        told.append(simulation.step(np.array([angle, 0.0, 0.0, simulation.command[3]])).time_error)
    worst = max(told, key=lambda e: e.largest)
    error = found["time_error"]
    assert error["effector"] == pytest.approx(max(e.effector for e in told), rel=1e-6)
    assert (error["largest"], error["node"]) == (pytest.approx(worst.largest, rel=1e-6), worst.node)
    assert told[-1].effector < 0.9 * error["effector"]
    assert "time_error" not in run("tripod", duration=0.05, overrides=words)


def test_absent_it_is_not_imported_and_allocates_nothing() -> None:
    code = (
        "import sys; from tripod_sim import Simulation, load_scene;"
        "s = Simulation(load_scene('tripod', ['mesh.level=1'])); s.step(); assert s.state.errors is None;"
        "assert s.report.time_error is None;"
        "absent = {'tripod_sim.integrators.time_error', 'tripod_sim.integrators.added_error_control'};"
        "assert not absent & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("still", "known", "local", "moved"), list(product((True, False), (1, 2), (False, True), (False, True)))
)
def test_only_a_known_and_still_error_of_a_body_at_rest_stays_as_it_is(
    still: bool, known: int, local: bool, moved: bool
) -> None:
    state, start = SimpleNamespace(still=still, known=known, length=0.0), np.zeros((2, 3))
    rests = ErrorTransport.rests(SimpleNamespace(local=local), state, start, start + moved, 0.01)
    assert rests == (still and known == 2 and not local and not moved)
    assert state.length == (0.01 if rests else 0.0)
