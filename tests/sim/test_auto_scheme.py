"""`dt = "auto"` alone chooses the scheme, too: implicit Euler and TR-BDF2 for solids."""

import itertools
from dataclasses import fields

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_sim import Simulation, load_scene
from tripod_sim.integrators import newton
from tripod_sim.integrators.added_error_control import AddedErrorControl
from tripod_sim.scene.file import scene_to_toml
from tripod_sim.steps import steppers

NEWTON = ("solver.mode=newton", "solver.tolerance=1e-8", "mesh.level=1")


def tripod(*words: str) -> Simulation:
    return Simulation(load_scene(SHARP, [*NEWTON, "dt=0.01", *words]))


def turned(t: float) -> np.ndarray:
    return np.array([-0.3 * min(t / 0.03, 1.0), 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("name", "words", "scheme"),
    [
        (SHARP, ["dt=auto"], "auto"),
        ("pendulum", ["dt=auto"], "auto"),
        ("pendulum", ["dt=auto", "time_error.tolerance=1e-4", "dt=0.1", "dt=auto"], "auto"),
        (SHARP, ["dt=auto", "inertia.scheme=bdf2"], "bdf2"),
        (SHARP, ["inertia.scheme=implicit_euler", "dt=auto"], "implicit_euler"),
        (SHARP, ["inertia={scheme='tr_bdf2'}", "dt=auto"], "tr_bdf2"),
        (SHARP, ["inertia={}", "dt=auto"], "auto"),
        (SHARP, ["dt=auto", "dt=0.02"], "implicit_euler"),
    ],
)
def test_the_scheme_of_a_fixed_dt_makes_room_and_a_named_one_stays(
    name: str, words: list[str], scheme: str
) -> None:
    scene = load_scene(name, words)
    assert scene.inertia
    assert scene.inertia.scheme == scheme


def test_a_file_with_auto_keeps_the_scheme_that_it_names(tmp_path) -> None:
    path = tmp_path / "scene.toml"
    text = scene_to_toml(load_scene(SHARP, ["inertia.scheme=bdf2"])).replace("dt = 0.005", 'dt = "auto"')
    path.write_text(text)
    assert load_scene(path).inertia.scheme == "bdf2"
    assert load_scene(path, ["inertia={}"]).inertia.scheme == "auto"
    path.write_text(text.replace('scheme = "bdf2"\n', ""))
    assert load_scene(path).inertia.scheme == "auto"
    assert load_scene(path, ["inertia.scheme=tr_bdf2"]).inertia.scheme == "tr_bdf2"
    path.write_text(scene_to_toml(load_scene(SHARP, ["dt=auto"])))
    assert load_scene(path) == load_scene(SHARP, ["dt=auto"])


@pytest.mark.parametrize("name", ["tripod", "pendulum", "cloth"])
def test_with_a_fixed_dt_it_is_implicit_euler_to_the_bit(name: str) -> None:
    few = {"tripod": "mesh.level=1", "pendulum": "springs.nodes=5", "cloth": "springs.nodes=5"}[name]
    ends = []
    for words in (("inertia.scheme=implicit_euler",), ("inertia.scheme=auto",)):
        for more in ((), ("time_error={}",)):
            simulation = Simulation(load_scene(name, [few, *words, *more]))
            simulation.advance(5)
            ends.append(simulation.state.positions.tobytes())
    assert len(set(ends)) == 1


def test_where_the_tolerance_allows_an_interval_is_one_step_of_implicit_euler(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(newton, "UNSOLVED", 0.0)
    monkeypatch.setattr(
        steppers,
        "_solver_to_tolerance",
        lambda model, system: newton.Newton(system, model.solver.tolerance, model.solver.max_iterations),
    )
    auto, fixed = tripod("dt=auto", "time_error.tolerance=1.0"), tripod("inertia.scheme=implicit_euler")
    for k in range(6):
        report, other = auto.step(turned(0.01 * (k + 1))), fixed.step(turned(0.01 * (k + 1)))
        assert (report.parts, report.rejected) == (1, 0)
        assert report.iterations <= other.iterations + 1
    np.testing.assert_allclose(auto.positions, fixed.positions, rtol=0, atol=1e-8)
    assert np.abs(auto.positions - tripod().positions).max() > 1e-3


def test_the_error_falls_with_the_tolerance_and_no_part_adds_more() -> None:
    fine = tripod("inertia.scheme=tr_bdf2", "dt=1.25e-4")
    exact = []
    for k in range(480):
        fine.step(turned((k + 1) * 1.25e-4))
        if (k + 1) % 80 == 0:
            exact.append(fine.positions.copy())
    errors, parts = [], []
    for tolerance in (1e-2, 1e-4, 1e-5, 1e-6):
        simulation, found, count = tripod("dt=auto", f"time_error.tolerance={tolerance}"), [], 0
        for k in range(6):
            report = simulation.step(turned(0.01 * (k + 1)))
            assert report.time_error
            assert 0 < report.time_error.added <= tolerance
            count += report.parts
            found.append(simulation.positions.copy())
        errors.append(np.linalg.norm(np.array(found) - exact, axis=2).max())
        parts.append(count)
    assert errors[0] > 1.3 * errors[1] > 1.5 * errors[2] > 3 * errors[3]
    assert errors[3] < 5e-5  # of 4 mm
    assert parts[0] == 6 < parts[1] < parts[2] < parts[3]


def test_both_schemes_take_turns_and_what_is_taken_back_leaves_no_trace(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(newton, "UNSOLVED", 0.0)
    simulation = tripod("dt=auto", "time_error.tolerance=5e-4", "solver.tolerance=1e-9")
    stepper, tried = simulation._stepper, []
    assert isinstance(stepper.control, AddedErrorControl)
    scheme = stepper.integrator
    plain, recall = scheme.advance, scheme.recall_history

    def part(state, joints, h):
        euler = not scheme.looks_back
        report = plain(state, joints, h)
        tried.append((h, euler, joints.copy()))
        return report

    def recalled() -> None:
        tried.pop()
        recall()

    monkeypatch.setattr(stepper.integrator, "advance", part)
    monkeypatch.setattr(stepper.integrator, "recall_history", recalled)
    rejected = 0
    for k in range(10):  # at rest all would end alike
        rejected += simulation.step(turned(0.01 * (k + 1))).rejected
    assert rejected > 0
    assert np.abs(simulation.state.velocities).max() > 1e-3
    assert 3 < sum(euler for _, euler, _ in tried) < len(tried) - 3
    assert sum(a[1] != b[1] for a, b in itertools.pairwise(tried)) >= 2
    again = tripod("inertia.scheme=tr_bdf2", "time_error={}", "solver.tolerance=1e-9")
    for h, euler, joints in tried:
        if euler:
            again._stepper.integrator.drop_history()
        again._stepper.integrator.advance(again.state, joints, h)
    np.testing.assert_allclose(again.positions, simulation.positions, rtol=0, atol=1e-8)


def test_reset_and_restore_bring_the_choice_back() -> None:
    simulation = tripod("dt=auto", "time_error.tolerance=6e-5")

    def go(first: int, last: int) -> bytes:
        for k in range(first, last):
            simulation.step(turned(0.01 * (k + 1)))
        return simulation.positions.tobytes() + repr(simulation.state.errors.order).encode()

    ends = []
    for _ in range(2):
        ends.append(go(0, 8))
        simulation.reset()
    assert ends[0] == ends[1]
    go(0, 4)
    saved, after = simulation.save(), []
    for _ in range(2):
        simulation.restore(saved)
        after.append(go(4, 8))
    assert after[0] == after[1]


def test_nothing_that_the_estimate_remembers_is_lost_in_a_copy() -> None:
    estimate = tripod("dt=auto").state.errors
    assert estimate
    for k, field in enumerate(fields(estimate)):
        value = getattr(estimate, field.name)
        setattr(estimate, field.name, np.full_like(value, k + 1) if isinstance(value, np.ndarray) else k + 1)
    other = tripod("dt=auto").state.errors
    assert other
    estimate.copy_to(other)
    for copy in (other, estimate.copy()):
        for k, field in enumerate(fields(estimate)):
            np.testing.assert_array_equal(getattr(copy, field.name), k + 1)


POSE = (-1.4965, -1.4965, -1.4965, 0.035)
AT_WORK = (f"servos.angles={list(POSE[:3])}", f"servos.slide={POSE[3]}", "solver.mode=one_solve")


def largest_error(tolerance: float, *exact: str) -> float:
    """Of automatic steps of 10 ms over 80 ms, servo 0 by 0.3 rad in 30 ms, from steps of 0.25 ms with `exact`."""
    words = [*AT_WORK, "dt=0.01", "dt=auto", f"time_error.tolerance={tolerance}"]
    auto = Simulation(load_scene(SHARP, words))
    fine = Simulation(load_scene(SHARP, [*AT_WORK, "inertia.scheme=tr_bdf2", "dt=2.5e-4", *exact]))
    error = 0.0
    for k in range(8):
        for part in range(40):
            fine.step(np.add(POSE, [0.3 * min((k + (part + 1) / 40) / 3, 1.0), 0, 0, 0]))
        auto.step(np.add(POSE, [0.3 * min((k + 1) / 3, 1.0), 0, 0, 0]))
        error = max(error, float(np.linalg.norm(auto.positions - fine.positions, axis=1).max()))
    return error


def test_where_a_servo_stops_a_step_of_tr_bdf2_does_not_take_over_at_any_length() -> None:
    """After implicit Euler's was too long, TR-BDF2's estimate for one much longer counts on a smooth motion."""
    assert largest_error(3.48e-4) < 4.2e-4


def test_where_the_step_is_worth_no_more_one_solve_moves_the_servos() -> None:
    """The first step, along with the driven nodes, has a rate at which the force falls as any other."""
    simulation = tripod("dt=auto", "time_error.tolerance=0.1")
    assert [simulation.step(turned(0.001 * (k + 1))).iterations for k in range(5)] == [1] * 5


def test_in_one_solve_mode_too_the_error_falls_as_far_as_the_tolerance() -> None:
    """With a fixed dt left-over forces set a floor, which shorter steps alone do not lower."""
    assert largest_error(1e-6, "solver.mode=newton", "solver.tolerance=1e-8") < 7e-6
