"""Steps that follow an asked accuracy where bodies touch (see `path_error_control`)."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.time_error_scenes import drawn
from benchmarks.time_promise import play
from tests.checks import assert_failing_leaves_the_state
from tests.messages import raises_naming
from tripod_host.rotations import rotation_matrix
from tripod_runtime.checkpoint import Checkpoint, checkpoint_bytes, read_checkpoint
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.ball.ball import BallOnPlate, BallState, PlateMotion
from tripod_sim.errors import UnsolvedError
from tripod_sim.integrators import newton
from tripod_sim.integrators import path_error_kernels as kernels
from tripod_sim.integrators.report import StepReport
from tripod_sim.maze.play import MazeBall
from tripod_sim.state import State
from tripod_sim.steps.path_error_control import PathErrorControl, after_hit

BOXES = (
    *("rigid.0.position=[0, 0, 0.055]", "rigid.1.position=[0.004, 0.002, 0.165]"),
    *("rigid.2.position=[-0.004, 0.003, 0.28]", "dt=0.01"),
)
ROLLING = ("mesh.level=1", "motion=off", "solver.mode=newton")
START = np.array([-1.4965, -1.4965, -1.4965, 0.035])
TURN = np.array([0.1, 0.0, -0.1, 0.0])


def made(scene: str, *words: str) -> Simulation:
    return Simulation(load_scene(scene, words))


def followed(simulation: Simulation, interval: float, count: int) -> tuple[np.ndarray, int, int]:
    """Return positions at the ends of all intervals, and parts of steps made and taken back."""
    rows, parts, rejected = [], 0, 0
    for _ in range(count):
        for _ in range(round(interval / simulation.scene.dt)):
            report = simulation.step()
            parts, rejected = parts + report.parts, rejected + report.rejected
        rows.append(simulation.positions.copy())
    return np.array(rows), parts, rejected


def off(rows: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest error over the largest move."""
    move = np.linalg.norm(exact - exact[0], axis=2).max()
    return float(np.linalg.norm(rows - exact, axis=2).max() / move)


def test_boxes_that_fall_on_each_other_keep_the_accuracy_in_few_parts() -> None:
    exact, _, _ = followed(made("stack", *BOXES[:3], "dt=1.25e-4", "inertia.scheme=bdf2"), 0.01, 20)
    coarse, _, _ = followed(made("stack", *BOXES, "inertia.scheme=bdf2"), 0.01, 20)
    assert off(coarse, exact) > 0.05
    made_parts = []
    for accuracy in (0.05, 0.01):
        simulation = made("stack", *BOXES, "dt=auto", f"time_error.accuracy={accuracy}")
        rows, parts, rejected = followed(simulation, 0.01, 20)
        assert off(rows, exact) < accuracy
        assert 0 < rejected < parts
        made_parts.append(parts)
        told = simulation.report.time_error
        assert 0 < told.largest < accuracy * np.linalg.norm(rows[-1] - rows[0], axis=1).max() * 2
        assert told.node >= 0
    assert made_parts[0] < made_parts[1] < 100


def test_a_part_that_is_taken_back_takes_the_ball_along() -> None:
    def path(*words: str) -> tuple[np.ndarray, int]:
        simulation, rows, rejected = made("maze", *ROLLING, *words), [], 0
        every = round(0.005 / simulation.scene.dt)
        for k in range(30 * every):
            share = min((k + 1) / (12 * every), 1.0)
            rejected += simulation.step(START + share * TURN).rejected
            if (k + 1) % every == 0:
                rows.append(simulation.ball.position.copy())
        return np.array(rows), rejected

    exact, _ = path("inertia.scheme=tr_bdf2", "dt=3.125e-4")
    found, rejected = path("dt=auto", "time_error.accuracy=0.02")
    assert rejected > 3
    move = np.linalg.norm(exact - exact[0], axis=1).max()
    assert np.linalg.norm(found - exact, axis=1).max() < 0.05 * move


def test_balls_ahead_and_behind_tell_what_the_place_of_the_ball_hangs_on() -> None:
    simulation, ways, apart = made("maze", *ROLLING, "dt=auto", "time_error.accuracy=0.04"), [], []
    start = simulation.ball.position.copy()
    for k in range(60):
        report = simulation.step(START + min((k + 1) / 6, 1.0) * TURN)
        ways.append(float(np.linalg.norm(simulation.ball.position - start)))
        apart.append(report.time_error.ball)
    assert max(ways) > 0.003
    assert 0.1 * 0.04 * ways[20] < apart[20] < 0.04 * ways[20]  # rolling: some of the way is the plate's
    last = simulation.ball.position.copy()
    simulation.drop_ball()
    assert simulation.step().time_error.ball < 6e-6 < 0.5 * max(apart)  # they start where it is
    simulation.reset()
    again = [simulation.step(START + min((k + 1) / 6, 1.0) * TURN).time_error.ball for k in range(60)]
    assert again == apart
    np.testing.assert_array_equal(simulation.ball.position, last)
    kept = checkpoint_bytes(Checkpoint(0, *simulation.save()))
    other = made("maze", *ROLLING, "dt=auto", "time_error.accuracy=0.04")
    read = read_checkpoint(kept, other)
    for own, kept_ball in zip(simulation.state.way.balls, read.state.way.balls, strict=True):
        np.testing.assert_array_equal(own.numbers, kept_ball.numbers)
    fixed = made("maze", *ROLLING, "time_error.tolerance=1e-5", "dt=auto")
    assert np.isnan(fixed.step().time_error.ball)


def test_the_plates_of_the_other_balls_are_ahead_and_behind_by_the_accuracy_s_part_of_the_phase(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    simulation = made("maze", *ROLLING, "dt=auto", "time_error.accuracy=0.04")
    simulation.step(START + TURN / 6)
    play, steps, known = simulation._ball, simulation._stepper.control, simulation.state.way
    assert isinstance(play, MazeBall) and isinstance(steps, PathErrorControl) and known
    seen, advance = list[tuple[np.ndarray, np.ndarray, np.ndarray]](), BallOnPlate.advance

    def noted(self: BallOnPlate, ball: BallState, motion: PlateMotion, time: float, dt: float) -> None:
        seen.append((motion.centre.copy(), motion.rotation.copy(), motion.twist.copy()))
        advance(self, ball, motion, time, dt)

    monkeypatch.setattr(BallOnPlate, "advance", noted)
    own, shift = play._motion, 0.04 * 2e-3 / 0.1
    known.furthest[-1], known.fastest = 2e-3, 0.1
    known.twist[:] = [[0.01, 0, 0.02], [0, 3.0, 0]]
    own.twist[:] = [[0.02, 0, 0.01], [1.0, 0, 0]]
    steps._follow(known, 0.005, 0.005)
    assert len(seen) == 2
    for (centre, rotation, twist), ahead in zip(seen, (shift, -shift), strict=True):
        for k, (velocity, spin) in enumerate((known.twist, own.twist)):
            np.testing.assert_allclose(centre[k], own.centre[k] + ahead * velocity, rtol=0, atol=1e-15)
            np.testing.assert_allclose(
                rotation[k], rotation_matrix(ahead * spin) @ own.rotation[k], atol=1e-15
            )
        np.testing.assert_allclose(twist, own.twist + ahead / 0.005 * (own.twist - known.twist), atol=1e-12)


def test_with_an_accuracy_solves_end_where_they_are_exact_enough_for_it() -> None:
    words, counts, ends = ("maze", *ROLLING, "dt=auto", "time_error.accuracy=0.05"), list[int](), []
    for share in (0.0, newton.UNSOLVED):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(newton, "UNSOLVED", share)
            simulation = made(*words)
            reports = [simulation.step(START + min((k + 1) / 6, 1.0) * TURN) for k in range(20)]
        counts.append(sum(r.iterations for r in reports))
        ends.append(simulation.state.positions.copy())
    assert counts[1] < 0.95 * counts[0]
    move = np.linalg.norm(ends[0] - made(*words).state.positions, axis=1).max()
    assert 0 < np.linalg.norm(ends[1] - ends[0], axis=1).max() < 0.001 * move


@pytest.mark.parametrize("kind", ["solids", "springs", "sag"])
def test_what_solves_leave_is_little_beside_the_accuracy(kind: str, tmp_path: Path) -> None:
    """A bar and nets that swing: what is left of each step moves them on, and adds up over all steps."""
    case, words, ends = drawn(kind, False, 20261201), ("dt=auto", "time_error.accuracy=0.1"), []
    for share in (0.0, newton.UNSOLVED):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(newton, "UNSOLVED", share)
            ends.append(play(case, tmp_path, *words)[0])
    assert 0 < off(ends[1], ends[0]) < 0.02


@pytest.mark.parametrize(("ratio", "given"), [(4.0, 0.25), (1.5, 0.9), (30.0, 0.0)])
def test_the_length_of_a_part_with_a_hit_follows_its_linear_law(ratio: float, given: float) -> None:
    x = after_hit(ratio, given)
    assert ratio * x == pytest.approx(0.9 * (given * x + 1 - given))
    assert after_hit(1.01, 0.0) == 0.5


def test_servos_that_start_cost_few_tries() -> None:
    """The jump of their speed adds as a hit does, so the second try that fails tells the length of the third."""
    rejected = [
        made("maze", *ROLLING, "dt=auto", f"time_error.accuracy={accuracy}").step(START + TURN / 6).rejected
        for accuracy in (0.1, 0.05)
    ]
    assert max(rejected) <= 2


def test_where_an_accuracy_is_asked_for_contact_forces_may_take_longer() -> None:
    words = ("dt=auto", "contact.max_solves=20")
    assert made("bounce", *words, "time_error.accuracy=0.01")._stepper.integrator.world.law.max_solves == 200
    assert made("bounce", *words, "time_error.tolerance=1e-4")._stepper.integrator.world.law.max_solves == 20


@pytest.mark.parametrize(
    ("accuracy", "asked", "found"),
    [(0.02, 1e-3, 1e-3), (0.04, 1e-3, 4e-3), (0.01, 1e-3, 2.5e-4), (0.5, 1e-3, 0.03), (0.5, 0.05, 0.05)],
)
def test_contact_forces_are_found_as_exactly_as_an_accuracy_is_worth(
    accuracy: float, asked: float, found: float
) -> None:
    words = ("dt=auto", f"contact.tolerance={asked}")
    law = made("bounce", *words, f"time_error.accuracy={accuracy}")._stepper.integrator.world.law
    assert law.tolerance == pytest.approx(found)
    assert (
        made("bounce", *words, "time_error.tolerance=1e-4")._stepper.integrator.world.law.tolerance == asked
    )


def test_a_part_goes_up_to_a_hit_that_adds_too_much(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ball that flies on a plate, which brakes it: how soon decides how far it comes."""
    simulation = made("bounce", "contact.restitution=0", "dt=0.02", "dt=auto", "time_error.accuracy=0.001")
    simulation.state.rigid.velocities[0, 0] = 2.0
    parts, awake = list[tuple[float, float, float]](), simulation._stepper.integrator
    advance = awake.advance

    def noted(state: State, joints: np.ndarray, h: float) -> StepReport:
        report = advance(state, joints, h)
        if not awake.restarts():
            parts.append((state.time, h, report.contact.meets))
        return report

    monkeypatch.setattr(awake, "advance", noted)
    followed(simulation, 0.02, 17)
    begin, length, meets = np.array(parts).T
    first = int(np.flatnonzero(np.isfinite(meets))[0])
    hit = begin[first] + meets[first] * length[first]
    assert hit == pytest.approx(np.sqrt(2 * 0.5 / 9.81), abs=0.05 * length[first])
    assert begin[first + 1] == pytest.approx(begin[first])
    assert length[first + 1] == pytest.approx(0.98 * meets[first] * length[first])
    assert not np.isfinite(meets[first + 1])
    assert begin[first + 2] == pytest.approx(begin[first] + length[first + 1])
    assert np.isfinite(meets[first + 2 :]).any()
    assert length[first + 2] < 0.5 * length[first]


@pytest.mark.parametrize(
    ("scene", "words"),
    [("bounce", ()), ("silicone_drop", ("mesh.level=1",)), ("drape", ("springs.damping=0.1",))],
)
def test_a_step_that_is_taken_back_leaves_what_the_next_looks_back_on(
    scene: str, words: tuple[str, ...]
) -> None:
    def after(taken_back: str) -> np.ndarray:
        simulation = made(scene, *words, "inertia.scheme=bdf2", "dt=0.004", "sleep=off")
        if len(simulation.state.spins):
            simulation.state.rigid.spins[0] = 5.0, 1.0, 2.0
        simulation.state.velocities[:, 0] = np.linspace(0.0, 0.2, len(simulation.state.velocities))
        stepper = simulation._stepper
        for _ in range(3):
            simulation.step()
        if taken_back:
            stepper.integrator.keep_history()
            state = simulation.state.copy()
            stepper.step(simulation.state, simulation.command, 0.003)
            state.copy_to(simulation.state)
            getattr(stepper.integrator, taken_back)()
        simulation.step()
        return simulation.positions.copy()

    straight = after("")
    np.testing.assert_allclose(after("recall_history"), straight, rtol=0, atol=1e-9)
    assert np.abs(after("forget") - straight).max() > 1e-7


def test_where_nothing_is_spared_parts_may_add_their_share_and_a_little() -> None:
    added, ways, far = np.array([1e-4, 0.0]), np.array([1e-3, 2e-3]), np.array([0.1, 0.2])
    spent = np.array([1.0, 0.0])  # far more than 5 % of 0.2 m
    share, little, much = 0.05 * 2e-3, 0.01 * 0.05 * 0.2, 0.25 * 0.05 * 0.4
    found = kernels.ratio_over_path(0.05, 0.0, 0.25, 0.01, added, ways, far, spent, 0.0)
    assert found == pytest.approx((1e-4 / (share + little), share / (share + little)))
    found = kernels.ratio_over_path(0.05, 0.0, 0.25, 0.01, added, ways, far, 0 * spent, 0.4)
    assert found == pytest.approx((1e-4 / (share + much), share / (share + much)))
    added[1] = np.nan
    assert np.isnan(kernels.ratio_over_path(0.05, 0.0, 0.25, 0.01, added, ways, far, spent, 0.0)[0])


@pytest.mark.parametrize(("w", "phase"), [(1.0, 0.0), (1e5, 0.0), (1e5, np.pi), (10.0, np.pi)])
def test_errors_of_velocities_add_up_as_those_of_vibrations(w: float, phase: float) -> None:
    """Parts of 10 ms with errors d e_x and their opposite: within 1 / w they add up, else their squares do."""
    h, speed, d, count = 0.01, 1.0, 1e-6, 40
    start, end, ends = np.zeros((2, 1, 3)), np.zeros((2, 1, 3)), np.zeros((1, 4))
    start[1, 0, 1] = end[1, 0, 1] = speed
    a, jerk = np.zeros((1, 3)), np.array([[0.0, 0.0, w * w * h * speed]])
    sums, free, out = np.zeros((1, 4)), np.ones(1, dtype=bool), np.zeros((3, 1))
    vector, square, positions = 0.0, 0.0, 0.0
    for k in range(count):
        errors = np.zeros((2, 1, 3))
        errors[0, 0, 2], errors[1, 0, 0] = 1e-7, d * w * np.cos(k * phase)
        kernels.write_lengths(h, 1.0, start, end, a, jerk, errors, start[0], free, sums, ends, *out)
        now = d * np.cos(k * phase)
        square += now * now + 2 * np.exp(-w * h) * vector * now
        vector = np.exp(-w * h) * vector + now
        grew = max(np.sqrt(ends[0, 0]) - np.sqrt(sums[0, 0]), 0.0)
        assert out[0, 0] == pytest.approx(1e-7 + grew, rel=1e-9)
        positions += out[0, 0] - grew
        sums[:] = ends
    assert positions == pytest.approx(count * 1e-7)
    assert np.sqrt(sums[0, 0]) == pytest.approx(np.sqrt(square), rel=1e-6)
    if phase == 0.0:
        assert np.sqrt(sums[0, 0]) == pytest.approx(d * (count if w == 1.0 else np.sqrt(count)), rel=0.1)


def test_errors_are_those_of_the_schemes() -> None:
    h, g, free = 0.01, -9.81, np.array([True, False])
    start, end, out = np.zeros((2, 2, 3)), np.zeros((2, 2, 3)), np.zeros((2, 2, 3))
    a, a_end = np.full((2, 3), g), np.zeros((2, 3))
    end[1] = h * g
    end[0] = h * end[1]  # a step of implicit Euler in free fall
    kernels.write_errors(h, 0.0, start, end, start[1], a, free, a_end, out)
    np.testing.assert_allclose(out[0, 0], h * h * g / 2)
    np.testing.assert_allclose(out[1], 0.0, atol=1e-15)
    np.testing.assert_allclose(out[0, 1], 0.0)
    end[0] = 0.5 * h * end[1]  # the exact one
    kernels.write_errors(h, 1.0, start, end, np.full((2, 3), -h * g), a, free, a_end, out)
    np.testing.assert_allclose(out, 0.0, atol=1e-15)
    np.testing.assert_allclose(a_end, g)


def test_what_is_pressed_does_not_err_along_the_normal() -> None:
    errors = np.ones((2, 3, 3))
    vertex, weight = np.array([[0, 2, 2, 2]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    row, body, first = np.array([0, -1, -1]), np.array([-1, 0, -1]), np.array([1, 3])
    up, none = np.array([[0.0, 0.0, 1.0]]), np.zeros(1)
    kernels.drop_normal(1, vertex, weight, up, none, row, body, first, errors)
    np.testing.assert_array_equal(errors, 1.0)
    kernels.drop_normal(1, vertex, weight, up, none + 1, row, body, first, errors)
    np.testing.assert_array_equal(errors[:, 0], [[1, 1, 0]] * 2)
    np.testing.assert_array_equal(errors[:, 1:], 1.0)
    vertex[0, 0] = 1  # a corner of the rigid body, whose two rows follow
    kernels.drop_normal(1, vertex, weight, up, none + 1, row, body, first, errors)
    np.testing.assert_array_equal(errors[..., 2], 0.0)


def test_a_step_that_fails_leaves_the_state(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = made("bounce", "dt=0.01", "dt=auto", "time_error.accuracy=0.05", "time_error.shortest=0.005")
    followed(simulation, 0.01, 5)
    assert_failing_leaves_the_state(simulation, simulation._stepper.integrator, monkeypatch)


def test_a_step_of_which_only_the_shortest_substeps_are_solved_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their lengths are rounded: one above the shortest by that counts as it, or the step would never end."""
    simulation = made("bounce", "dt=0.01", "dt=auto", "time_error.accuracy=0.05", "time_error.shortest=0.005")
    tried = [0]

    def fail(*_: object) -> None:
        tried[0] += 1
        assert tried[0] < 10000, "it goes on for ever"
        raise UnsolvedError("on purpose")

    monkeypatch.setattr(simulation._stepper.integrator, "advance", fail)
    followed(simulation, 0.01, 5)
    assert simulation.state.time == pytest.approx(0.05)
    assert tried[0] > 100


def test_fixed_steps_follow_no_accuracy() -> None:
    with raises_naming(SceneError, "time_error.accuracy", 0.05, "fixed dt", "dt = 'auto'"):
        load_scene("bounce", ["time_error={accuracy=0.05}"])


def test_the_first_step_of_a_ball_on_silicone_may_be_taken_back() -> None:
    simulation = made("tripod_ball", "mesh.level=1", "motion=off", "dt=auto", "time_error.accuracy=0.02")
    assert simulation.step().rejected
    for _ in range(5):
        simulation.step()
    assert simulation.ball
    assert simulation.ball.position[2] == pytest.approx(0.015 - 9.81 / 2 * 0.03**2, abs=5e-5), "it falls"
