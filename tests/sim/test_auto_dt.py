"""`dt = "auto"`: parts that nest in the interval, as long as the error that they add allows."""

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.scenes import SHARP
from tests.sim.implicit_schemes import IMPLICIT
from tripod_sim import SceneError, Simulation, StepError, load_scene
from tripod_sim.integrators import newton
from tripod_sim.integrators.added_error_control import AddedErrorControl
from tripod_sim.integrators.newton import NewtonError
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.scene.file import scene_to_toml
from tripod_study.run import run

SCHEMES = IMPLICIT
NEWTON = ("solver.mode=newton", "solver.tolerance=1e-8", "mesh.level=1")


def tripod(scheme: str, *words: str) -> Simulation:
    return Simulation(load_scene(SHARP, [*NEWTON, f"inertia.scheme={scheme}", *words]))


def turned(t: float) -> np.ndarray:
    return np.array([-0.3 * min(t / 0.03, 1.0), 0.0, 0.0, 0.0])


def motion(simulation: Simulation, steps: int, dt: float = 0.01) -> np.ndarray:
    """Positions every 10 ms."""
    found = []
    for k in range(round(0.01 / dt) * steps):
        simulation.step(turned((k + 1) * dt))
        if (k + 1) % round(0.01 / dt) == 0:
            found.append(simulation.state.positions.copy())
    return np.array(found)


def lengths(simulation: Simulation, monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, bool]]:
    """A list that grows by every part tried: its length [s] and whether it was accepted."""
    stepper, tried = simulation._stepper, []
    assert isinstance(stepper.control, AddedErrorControl)
    plain, recall = stepper.integrator.advance, stepper.integrator.recall_history

    def part(state, joints, h):
        report = plain(state, joints, h)
        tried.append((h, True))
        return report

    def recalled() -> None:
        tried[-1] = (tried[-1][0], False)
        recall()

    monkeypatch.setattr(stepper.integrator, "advance", part)
    monkeypatch.setattr(stepper.integrator, "recall_history", recalled)
    return tried


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_error_falls_with_the_tolerance(scheme: str) -> None:
    exact, errors, parts = motion(tripod("tr_bdf2", "dt=1.25e-4"), 6, 1.25e-4), [], []
    for tolerance in (1e-4, 1e-5, 1e-6):
        simulation = tripod(scheme, "dt=0.01", "dt=auto", f"time_error.tolerance={tolerance}")
        assert simulation.scene.dt == 0.01
        errors.append(np.linalg.norm(motion(simulation, 6) - exact, axis=2).max())
        assert simulation.state.time == pytest.approx(0.06, rel=1e-12)
        assert simulation.state.step == 6
        parts.append(simulation.report.parts)
    assert errors[0] > 1.5 * errors[1] > 2.25 * errors[2]
    assert errors[2] < 2e-4  # of 4 mm
    assert parts[2] > parts[0]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_parts_nest_and_rejected_ones_leave_no_trace(scheme: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same lengths without the rejected parts between give the same motion, history included."""
    monkeypatch.setattr(newton, "UNSOLVED", 0.0)
    words = ("dt=0.01", "dt=auto", "time_error={tolerance=2e-5, estimate='global'}", "solver.tolerance=1e-9")
    simulation = tripod(scheme, *words)
    tried, worst = lengths(simulation, monkeypatch), 0.0
    rejected = 0
    for k in range(5):
        report = simulation.step(turned(0.01 * (k + 1)))
        rejected += report.rejected
        assert report.time_error
        worst = max(worst, report.time_error.added)
    assert worst <= 2e-5
    accepted = [h for h, good in tried if good]
    assert rejected == sum(not good for _, good in tried) > 0
    assert len(set(accepted)) > 1
    done = 0.0
    for h in accepted:
        units = np.log2(0.01 / h)
        assert units == pytest.approx(round(units), abs=1e-9)
        assert (done / h) == pytest.approx(round(done / h), abs=1e-6)
        done = (done + h) % 0.01 if abs((done + h) % 0.01 - 0.01) > 1e-9 else 0.0
    plain = tripod(scheme, "dt=0.01", "time_error={}", "solver.tolerance=1e-9")
    state, t = plain.state, 0.0
    for h in accepted:
        interval = int((t + 1e-9) / 0.01)
        before, after = turned(0.01 * interval), turned(0.01 * (interval + 1))
        t += h
        assert isinstance(plain._stepper, Substeps)
        plain._stepper.integrator.advance(state, before + (after - before) * (t / 0.01 - interval), h)
    np.testing.assert_allclose(state.positions, simulation.state.positions, rtol=0, atol=1e-9)
    assert state.errors and simulation.state.errors
    np.testing.assert_allclose(state.errors.error[0], simulation.state.errors.error[0], rtol=0, atol=1e-8)


@pytest.mark.parametrize("scheme", [*SCHEMES, "auto"])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-5])
def test_solves_end_where_they_are_exact_enough_for_the_step(
    scheme: str, tolerance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They take fewer iterations, and their ends shift the motion by half of what its steps do at most."""
    exact, found, iterations = motion(tripod("tr_bdf2", "dt=1.25e-4"), 6, 1.25e-4), [], []
    simulation = tripod(scheme, "dt=0.01", "dt=auto", f"time_error.tolerance={tolerance}")
    for share in (0.0, newton.UNSOLVED):
        monkeypatch.setattr(newton, "UNSOLVED", share)
        simulation.reset()
        iterations.append(0)
        positions = []
        for k in range(6):
            iterations[-1] += simulation.step(turned(0.01 * (k + 1))).iterations
            positions.append(simulation.state.positions.copy())
        found.append(np.array(positions))
    assert iterations[1] < 0.85 * iterations[0]
    errors = [np.linalg.norm(x - exact, axis=2).max() for x in found]
    assert errors[1] < 1.5 * errors[0]


def test_the_shorter_a_part_the_better_it_is_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a solve leaves is a velocity, too: over h."""
    simulation = tripod("implicit_euler", "dt=0.02", "dt=auto", "time_error.tolerance=1e-5")
    stepper, left = simulation._stepper, {}
    assert isinstance(stepper.control, AddedErrorControl)
    plain = stepper.integrator.advance

    def part(state, joints, h):
        left[round(0.02 / h)] = stepper.newton.near
        return plain(state, joints, h)

    monkeypatch.setattr(stepper.integrator, "advance", part)
    simulation.step(turned(0.02))
    assert len(left) > 2
    for parts, near in left.items():
        assert near == pytest.approx(newton.UNSOLVED * 1e-5 * min(1.0, 2 / parts))


def test_the_same_bits_after_reset_and_restore() -> None:
    simulation = tripod("bdf2", "dt=0.01", "dt=auto", "time_error.tolerance=1e-5")
    ends = []
    for _ in range(2):
        motion(simulation, 4)
        ends.append(simulation.state.positions.tobytes())
        simulation.reset()
    assert ends[0] == ends[1]
    motion(simulation, 4)
    saved, after = simulation.save(), []
    for _ in range(2):
        simulation.restore(saved)
        motion(simulation, 2)
        after.append(simulation.state.positions.tobytes())
    assert after[0] == after[1]


def test_at_rest_the_whole_interval_is_one_part_and_one_factorisation_serves() -> None:
    simulation = tripod("implicit_euler", "dt=0.01", "dt=auto")
    reports = [simulation.step() for _ in range(10)]
    assert [r.parts for r in reports] == [1] * 10
    assert sum(r.factorisations for r in reports) == 0


def test_the_shortest_part_is_accepted_whatever_its_error() -> None:
    words = ("dt=0.01", "dt=auto", "time_error.tolerance=1e-12", "time_error.shortest=0.002")
    report = tripod("implicit_euler", *words).step(turned(0.03))
    assert report.parts == 4  # 2.5 ms is the last length that is not below 2 ms
    assert report.time_error
    assert report.time_error.added > 1e-12


def test_a_part_that_cannot_be_solved_is_halved_and_at_last_named(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = tripod("implicit_euler", "dt=0.01", "dt=auto", "solver.max_halvings=3")
    before = simulation.state.positions.tobytes()

    def failing(*_: object) -> None:
        raise NewtonError("on purpose")

    monkeypatch.setattr(simulation._stepper.integrator, "advance", failing)
    with raises_naming(StepError, "step 1", "0 s", "substeps", 0.00012, "on purpose"):
        simulation.step(turned(0.01))
    assert simulation.state.positions.tobytes() == before
    assert simulation.state.time == 0.0


def test_the_scene_says_so_and_is_written_and_read_back() -> None:
    scene = load_scene(SHARP, ["dt=auto", "time_error.tolerance=1e-5"])
    assert (scene.dt, scene.time_error.steps, scene.time_error.tolerance) == (0.005, "auto", 1e-5)
    assert load_scene(SHARP, ["dt=0.02", "dt=auto"]).dt == 0.02
    assert load_scene(SHARP, ["dt=auto", "dt=0.02"]).time_error is None


def test_a_scene_file_may_say_auto(tmp_path) -> None:
    scene = load_scene(SHARP, ["dt=auto"])
    path = tmp_path / "scene.toml"
    path.write_text(scene_to_toml(scene))
    assert load_scene(path) == scene
    path.write_text(path.read_text().replace("dt = 0.005", 'dt = "auto"').replace('\nsteps = "auto"', ""))
    assert load_scene(path) == scene


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["dt=fast"], ("dt is 'fast'", "seconds", "auto")),
        (["dt=true"], ("dt is True", "seconds", "auto")),
        (["dt=auto", "time_error.steps=fixed"], ("dt is 'auto'", "time_error.steps is 'fixed'")),
        (["dt=auto", "time_error.tolerance=0"], ("time_error.tolerance is 0.0", "above 0 m")),
        (["dt=auto", "time_error.shortest=0.1"], ("time_error.shortest is 0.1 s", "at most dt", "0.005 s")),
        (["dt=auto", "inertia=off", "damping=off"], ("time_error needs inertia",)),
    ],
)
def test_what_cannot_be_is_refused_by_name(words: list[str], named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named):
        load_scene(SHARP, words)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_local_estimate_steers_to_the_same_bits_and_tells_no_more(scheme: str) -> None:
    found = []
    for more in ((), ("time_error.estimate=global",), ("time_error.estimate=local",)):
        simulation = tripod(scheme, "dt=0.01", "dt=auto", "time_error.tolerance=1e-5", *more)
        positions = motion(simulation, 3)
        report, state = simulation.report, simulation.state.errors
        assert report.time_error
        assert state
        told, carried = report.time_error, "time_error.estimate=global" in more
        assert (told.largest > 0) == (told.effector > 0) == (told.node >= 0) == carried == state.error.any()
        assert np.isnan(told.largest) == np.isnan(told.effector) == (not carried)
        found.append((positions.tobytes(), report.parts, report.rejected, told.added))
    assert found[0] == found[1] == found[2]


def test_run_tells_what_a_part_added_at_most() -> None:
    words = [*NEWTON, "dt=auto", "time_error.tolerance=1e-6", "time_error.estimate=local"]
    error = run(SHARP, servo="0:0,0,0; 0.03:-0.3,0,0", duration=0.05, overrides=words)["time_error"]
    assert 0 < error["added"] <= 1e-6
    assert error["node"] == -1
    assert np.isnan([error[name] for name in ("effector", "largest")]).all()


def test_run_counts_parts_taken_back() -> None:
    words = [*NEWTON, "dt=auto", "time_error.tolerance=1e-6"]
    found = run(SHARP, servo="0:0,0,0; 0.03:-0.3,0,0", duration=0.05, overrides=words)
    assert found["rejected"] > 0
    assert found["parts"] > found["steps"] == 10
    assert found["time_error"]["added"] <= 1e-6
