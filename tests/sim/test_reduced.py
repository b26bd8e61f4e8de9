"""The reduced model against the full one."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import nnls

from tests.checks import assert_symmetric
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.build import build
from tripod_sim.reduced import store
from tripod_sim.reduced.basis import Basis, free_rows
from tripod_sim.reduced.fit import rest_stiffness, static_lift
from tripod_sim.reduced.sampling import nonnegative
from tripod_sim.reduced.train import train
from tripod_sim.scene import Scene
from tripod_sim.system import System

SMALL = ["mesh.level=1", "reduced.samples=12"]
WORKING = np.array([-1.4965, -1.4965, -1.4965, 0.035])
AT_WORK = ["servos.angles=[-1.4965, -1.4965, -1.4965]", "servos.slide=0.035"]
STATIC = ["inertia=off", "damping=off", "solver.tolerance=1e-8"]


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A cache of this file's own."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder))
        patch.setattr(store, "_recent", {})
        yield folder / "tripod" / "reduced"


def simulation(*overrides: str) -> Simulation:
    return Simulation(load_scene("tripod", [*SMALL, *overrides]))


def full(*overrides: str) -> Simulation:
    return Simulation(load_scene("tripod", ["mesh.level=1", *overrides]))


def held_out(count: int) -> np.ndarray:
    """Joints that training has not seen, about the working pose."""
    away = np.random.default_rng(99).uniform(-0.3, 0.3, (count, 3))
    return np.column_stack([WORKING[:3] + away, np.full(count, WORKING[3])])


# the whole basis ------------------------------------------------------------------------------------------------


def whole_basis(scene: Scene, parts: object) -> Basis:
    """Every free node is free: nothing is reduced, only the coordinates differ."""
    found = build(replace(scene, reduced=None, inertia=None, damping=None))
    assert isinstance(found.system, System)
    free = free_rows(found.system.groups)
    lift = static_lift(found.system, rest_stiffness(found.system))
    shapes = np.diag(np.repeat(found.mass, 3)[free] ** -0.5)
    return Basis(lift, shapes, np.ones(len(found.system.solid.elements)), 1.0)


CASES = {
    "implicit_euler": [],
    "bdf2": ["inertia.scheme=bdf2"],
    "tr_bdf2, mass damping, maze": ["inertia.scheme=tr_bdf2", "damping.mass=2.0", "maze={}"],
    "clamp, no stiffness damping": ["clamp={}", "damping.stiffness=0"],
    "tetrahedra, no gravity, no damping": [
        "mesh.element=t4", "material.law=corotational", "gravity=off", "damping=off"
    ],
    "static": ["inertia=off", "damping=off"],
}  # fmt: skip

BENT = np.array([-0.25, -0.25, -0.25, 0.006])


@pytest.mark.parametrize("case", CASES)
def test_with_every_shape_it_is_the_full_model(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "stored_basis", whole_basis)
    options = ["solver.mode=newton", "solver.tolerance=1e-10", *CASES[case]]
    options += [f"servos.angles={BENT[:3].tolist()}", f"servos.slide={BENT[3]}"]
    both = full(*options), full("reduced={}", *options)
    assert both[1].state.reduced is not None
    size = np.abs(both[0].positions - both[0].mesh.nodes).max()
    for k in range(3):
        goal = BENT + np.array([0.03, -0.02, 0.01, -1e-4]) * min(k + 1, 2)
        for s in both:
            s.step(goal)
        np.testing.assert_allclose(both[1].positions, both[0].positions, rtol=0, atol=1e-8 * size)
        np.testing.assert_allclose(both[1].torques, both[0].torques, rtol=0, atol=1e-8)
        speeds = [s.state.velocities[: len(s.mesh.nodes)] for s in both]  # ghosts of clamps have no mass
        np.testing.assert_allclose(speeds[1], speeds[0], atol=1e-6 * max(np.abs(speeds[0]).max(), 1e-3))
    energies = [s.energies() for s in both]
    assert energies[1].kinetic == pytest.approx(energies[0].kinetic, rel=1e-6, abs=1e-15)
    assert energies[1].strain == pytest.approx(energies[0].strain, rel=1e-8)
    assert energies[1].gravity == pytest.approx(energies[0].gravity, abs=1e-10)
    if case != "static":
        return  # out of equilibrium the compliance depends on the coordinates
    w = [s.compliance() for s in both]
    np.testing.assert_allclose(w[1].w, w[0].w, rtol=1e-6, atol=1e-9 * np.abs(w[0].w).max())
    np.testing.assert_allclose(w[1].torques, w[0].torques, atol=1e-7)


# derivatives ----------------------------------------------------------------------------------------------------


def test_residual_torques_and_hessian_are_derivatives_of_the_potential() -> None:
    s = simulation("reduced.modes=8", "reduced.tolerance=0", "damping=off", *AT_WORK)
    system, rng, start = s._system, np.random.default_rng(3), s.state.reduced
    system.inertia.weight[:] = 1e3 * system.rows.masses
    start.q += 3e-5 * rng.standard_normal(start.q.shape)
    system.drive(start, start.joints.copy())
    count = system.unknowns
    along = np.append(rng.standard_normal(count), rng.standard_normal(3))
    along[:6] *= 1e-2
    along[6:count] *= 1e-3

    def at(h: float) -> tuple[float, np.ndarray]:
        """The potential, and its derivatives, `h` along the direction, at fixed incompatible modes."""
        out = start.copy()
        out.joints[:3] += h * along[count:]
        system.move(start, h * along[:count], system.rest, 1.0, out)
        out.modes[:] = start.modes
        system.forget()
        return system.evaluate(out), np.append(system.residual, system.torques)

    h = 1e-5
    gradient, (before, after) = at(0.0)[1], (at(-h), at(h))
    assert abs(gradient[count:] @ along[count:]) > 1e-3
    assert (after[0] - before[0]) / (2 * h) == pytest.approx(gradient @ along, rel=1e-6)

    h = 1e-4
    system.forget()
    system.assemble(start, project=False)
    system.evaluate(start)
    system.factor()
    moment = system.residual[3:6].copy()
    matrix, drive = system.linear.matrix.copy(), system.reduction.drive.copy()
    drive_drive = system.reduction.drive_drive.copy()
    turn = np.zeros_like(along)
    turn[3:6] = 0.1, -0.2, 0.3  # of the disc alone: else the shapes' forces hide its second-order term
    for d in (along, turn):
        ends = []
        for sign in (1, -1):
            out = start.copy()
            out.joints[:3] += sign * h * d[count:]
            system.move(start, sign * h * d[:count], system.rest, 1.0, out)
            out.modes[:] = start.modes
            system.evaluate(out)  # with the condensation of `assemble`: as if the modes stayed in equilibrium
            ends.append(np.append(system.residual, system.torques))
        found = (ends[0] - ends[1]) / (2 * h)
        product = np.append(
            matrix @ d[:count] + drive @ d[count:], drive.T @ d[:count] + drive_drive @ d[count:]
        )
        product[3:6] += 0.5 * np.cross(d[3:6], moment)  # rotations compose from the left (see test_system)
        for part in (slice(0, 3), slice(3, 6), slice(6, count), slice(count, None)):
            size = np.abs(product[part]).max()
            assert size > 0
            np.testing.assert_allclose(found[part], product[part], atol=1e-4 * size)


@pytest.mark.parametrize("tolerance", [0.0, 0.1])
def test_the_tangent_is_symmetric_and_positive_where_the_full_one_is(tolerance: float) -> None:
    s = simulation("reduced.modes=10", f"reduced.tolerance={tolerance}", *AT_WORK)
    system = s._static.system
    system.assemble(s.state, project=False)
    system.evaluate(s.state)
    assert system.factor()
    assert_symmetric(system.linear.matrix)
    assert np.linalg.eigvalsh(system.linear.matrix).min() > 0


@pytest.mark.parametrize("tolerance", [0.0, 0.1])
def test_the_compliance_predicts_small_turns_of_the_servos(tolerance: float) -> None:
    s = simulation("reduced.modes=10", f"reduced.tolerance={tolerance}", *STATIC, *AT_WORK)
    goal, h = held_out(1)[0], 1e-4
    s.step(goal)
    w = s.compliance().w
    np.testing.assert_array_equal(w, w.T)
    stiffness = np.linalg.inv(w[6:, 6:])
    jacobian = w[:6, 6:] @ stiffness
    for servo in range(3):
        ends = []
        for sign in (1, -1):
            joints = goal.copy()
            joints[servo] += sign * h
            s.step(joints)
            ends.append((s.effector.position, s.torques.copy()))
        moved = (ends[0][0] - ends[1][0]) / (2 * h)
        np.testing.assert_allclose(moved, jacobian[:3, servo], atol=1e-4 * np.abs(jacobian[:3]).max())
        loaded = (ends[0][1] - ends[1][1]) / (2 * h)
        np.testing.assert_allclose(loaded, stiffness[:, servo], atol=1e-4 * np.abs(stiffness).max())


# accuracy -------------------------------------------------------------------------------------------------------


def test_static_error_falls_with_the_number_of_modes() -> None:
    """At poses that training has not seen: of nodes, effector, torques, and of the compliance."""
    goals, reference, truth = held_out(4), full(*STATIC, *AT_WORK), []
    for goal in goals:
        reference.step(goal)
        w = reference.compliance().w
        truth.append((reference.positions.copy(), reference.effector.position, reference.torques.copy(), w))
    errors = []
    for modes in (4, 12, 30):
        s, worst = simulation(f"reduced.modes={modes}", "reduced.tolerance=0", *STATIC, *AT_WORK), np.zeros(4)
        for goal, (positions, effector, torques, w) in zip(goals, truth, strict=True):
            s.step(goal)
            off = s.compliance().w
            found = [
                np.linalg.norm(s.positions - positions, axis=1).max(),
                np.linalg.norm(s.effector.position - effector),
                np.abs(s.torques - torques).max(),
                np.abs(held(off) - held(w)).max() / np.abs(held(w)).max(),
            ]
            worst = np.maximum(worst, found)
        errors.append(worst)
    errors = np.array(errors)
    assert (errors[1:] < errors[:-1]).all()
    assert (errors[-1] < 0.2 * errors[0]).all()
    assert errors[-1, 0] < 1e-4  # [m]: of moves of up to 10 mm
    assert errors[-1, 1] < 3e-5
    assert errors[-1, 3] < 0.1


def held(w: np.ndarray) -> np.ndarray:
    """The effector's translations under forces, the servos held, from the whole compliance."""
    return (w[:6, :6] - w[:6, 6:] @ np.linalg.inv(w[6:, 6:]) @ w[6:, :6])[:3, :3]


@pytest.mark.parametrize(
    "option", ["inertia.scheme=implicit_euler", "inertia.scheme=tr_bdf2", "servo_dynamics={}"]
)
def test_it_follows_a_fast_move_of_a_servo(option: str) -> None:
    options = [option, *AT_WORK]
    both = full(*options), simulation("reduced.modes=30", *options)
    error, travel, start = 0.0, 0.0, both[0].effector.position
    for k in range(30):
        goal = WORKING + np.array([0.3 * min(1.0, (k + 1) / 6), 0, 0, 0])
        for s in both:
            s.step(goal)
        error = max(error, np.linalg.norm(both[0].effector.position - both[1].effector.position))
        travel = max(travel, np.linalg.norm(both[0].effector.position - start))
    assert travel > 3e-3
    assert error < 0.02 * travel


def test_few_elements_stand_for_all() -> None:
    exact, sampled = (
        simulation("reduced.modes=4", f"reduced.tolerance={t}", *STATIC, *AT_WORK) for t in (0.0, 0.1)
    )
    assert len(sampled._system.solid.elements) < 0.8 * len(exact._system.solid.elements)
    for goal in held_out(3):
        for s in (exact, sampled):
            s.step(goal)
        assert np.linalg.norm(sampled.positions - exact.positions, axis=1).max() < 2e-4
        np.testing.assert_allclose(sampled.torques, exact.torques, atol=0.05 * np.abs(exact.torques).max())
        assert sampled.energies().strain == pytest.approx(exact.energies().strain, rel=0.1)


def test_nonnegative_least_squares_ends_at_the_tolerance_or_at_the_minimum() -> None:
    rng = np.random.default_rng(5)
    a = rng.standard_normal((40, 25))
    wanted = np.where(rng.uniform(size=25) < 0.5, rng.uniform(0.5, 2.0, 25), 0.0)
    x = nonnegative(a, a @ wanted, 1e-9)
    np.testing.assert_allclose(x, wanted, atol=1e-7)
    b = rng.standard_normal(40)
    best, norm = nnls(a, b)
    np.testing.assert_allclose(nonnegative(a, b, 1e-9), best, atol=1e-8)
    coarse = nonnegative(a, a @ wanted, 0.3)
    assert (coarse >= 0).all()
    assert 0 < np.count_nonzero(coarse) < np.count_nonzero(wanted)
    assert np.linalg.norm(a @ coarse - a @ wanted) <= 0.3 * np.linalg.norm(a @ wanted)
    assert norm > 0.3 * np.linalg.norm(b)


# robustness -----------------------------------------------------------------------------------------------------


def test_a_hard_jump_dies_away_and_is_told_of() -> None:
    s = simulation("reduced.modes=12")
    s.step(np.array([-1.5, -1.5, -1.5, 0.0]))
    assert "servo_0 at -1.500 rad (trained -0.400 to 0.400)" in s.report.beyond
    assert s.report.beyond in s.notes
    before, kinetic = np.inf, []
    for _ in range(60):
        s.step()
        e = s.energies()
        total = e.kinetic + e.strain + e.gravity
        assert total <= before + 1e-6
        before = total
        kinetic.append(e.kinetic)
    assert np.isfinite(s.positions).all()
    assert kinetic[-1] < 1e-6 * max(kinetic)
    s.step(np.array([0.0, 0.0, 0.0, 0.0]))
    assert not s.report.beyond


def test_at_rest_it_stays_at_rest_and_resets_and_restores_to_the_same_bits() -> None:
    s = simulation("reduced.modes=8", *AT_WORK)
    start = s.positions.copy()
    for _ in range(10):
        s.step()
    assert np.abs(s.positions - start).max() < 1e-7

    def go() -> bytes:
        for k in range(6):
            s.step(WORKING + np.array([0.04 * k, 0, 0, 0]))
        return s.state.positions.tobytes() + s.state.velocities.tobytes() + s.torques.tobytes()

    s.reset()
    first = go()
    saved = s.save()
    s.restore(saved)
    onward = go()
    s.reset()
    assert go() == first
    s.restore(saved)
    assert go() == onward


# training and cache ---------------------------------------------------------------------------------------------


def trained(*overrides: str) -> Basis:
    return train(load_scene("tripod", ["mesh.level=1", "reduced.modes=6", "reduced.samples=8", *overrides]))


def bits(basis: Basis) -> bytes:
    return basis.lift.tobytes() + basis.shapes.tobytes() + basis.weights.tobytes()


def test_training_depends_on_the_seed_and_not_on_what_has_no_part_in_it() -> None:
    first = bits(trained())
    assert bits(trained("dt=0.01", "inertia=off", "damping=off", "servo_dynamics={}", *AT_WORK)) == first
    assert bits(trained("reduced.seed=1")) != first


def test_the_cache_is_used_and_what_is_damaged_in_it_is_not(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = ["reduced.modes=5", "reduced.samples=8"]
    scene, count = load_scene("tripod", [*SMALL, *options]), []
    monkeypatch.setattr(store, "train", lambda *a: count.append(1) or train(*a))
    parts = build(replace(scene, reduced=None))
    name = store.key(scene, parts)
    file = cache / f"{name}.basis"

    def again() -> tuple[bytes, int]:
        count.clear()
        monkeypatch.setattr(store, "_recent", {})
        return bits(store.stored_basis(scene, parts)), len(count)

    first, trainings = again()
    assert trainings == 1
    assert again() == (first, 0)
    good = file.read_bytes()
    flipped = bytearray(good)
    flipped[len(good) // 2] ^= 1
    numbers = np.frombuffer(good, offset=store.DIGEST).copy()
    numbers[7] = np.nan
    poisoned = store._digest(name, numbers.tobytes()) + numbers.tobytes()
    other = store._digest("another", good[store.DIGEST :]) + good[store.DIGEST :]
    assert store.read(file, name, scene, parts) is not None
    for bad in (b"", b"\x80\x04cos\nsystem\n", good[:-8], good + b"\0" * 8, bytes(flipped), poisoned, other):
        file.write_bytes(bad)
        assert store.read(file, name, scene, parts) is None, len(bad)
    assert again() == (first, 1)
    assert file.read_bytes() == good
    file.unlink()
    file.mkdir()  # what cannot be written
    assert again() == (first, 1)
    file.rmdir()


def test_long_training_is_told_of(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(store._Note, "SOON", 0.0)
    simulation("reduced.modes=3", "reduced.samples=8", "reduced.seed=7")
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2
    assert told[0].startswith("scene 'tripod': training the reduced model, about ")
    assert "kept in" in told[1]
    simulation("reduced.modes=3", "reduced.samples=8", "reduced.seed=7")
    assert not capsys.readouterr().err


# bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["reduced.modes=0"], "reduced.modes is 0; it must be at least 1"),
        (["reduced.modes=2.5"], "reduced.modes is 2.5; it must be a whole number"),
        (["reduced.tolerance=nan"], "reduced.tolerance is nan"),
        (["reduced.tolerance=0.6"], "reduced.tolerance is 0.6"),
        (["reduced.samples=7"], "reduced.samples is 7; it must be at least 8"),
        (["reduced.spread=0"], "reduced.spread is 0"),
        (["reduced.angle=-2.5"], "reduced.angle is -2.5 rad; the servos allow -2.1 to 0.6 rad"),
        (["reduced.slide=0.05"], "reduced.slide is 0.05 m; it must be at most servos.slide_max, 0.04 m"),
        (["reduced.seed=-1"], "reduced.seed is -1"),
        (["reduced={}", "effector=off"], "reduced needs servos and effector"),
        (["reduced={}", "ball={}"], "reduced and ball exclude each other"),
        (["reduced={}", "time_error={}"], "time_error"),
        (["reduced={}", "inertia.scheme=rk4"], "inertia.scheme is 'rk4'"),
        (["reduced.size=3"], "field reduced.size is unknown"),
    ],
)
def test_what_a_scene_may_not_ask(overrides: list[str], words: str) -> None:
    with pytest.raises(SceneError) as caught:
        load_scene("tripod", overrides)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_more_shapes_than_training_has_found_are_refused() -> None:
    with pytest.raises(SceneError, match=r"reduced.modes is 900; training has found \d+ independent shapes"):
        simulation("reduced.modes=900", "reduced.samples=8")


def test_training_that_the_full_model_cannot_follow_is_refused() -> None:
    with pytest.raises(
        SceneError, match="finds no equilibrium in the flat pose: step 1 at 0 s cannot be saved"
    ):
        simulation("material.young=1e3", "gravity.acceleration=[0, 0, -1e5]", "solver.max_halvings=0")
