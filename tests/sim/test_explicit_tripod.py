"""Explicit schemes on bodies with servos, disc, clamps, plate and ball: recurrence, order, momentum, torque, limit."""

import numpy as np
import pytest
import scipy.linalg

from tests.memory import kept
from tests.messages import raises_naming
from tests.scenes import SHARP
from tripod_sim import SceneError, Simulation, StepError, load_scene
from tripod_sim.constraints.groups import Groups
from tripod_sim.integrators.explicit import ExplicitSteps
from tripod_sim.integrators.schemes import rk4
from tripod_sim.system import System

SCHEMES = ("explicit_euler", "semi_implicit_euler", "rk4")
SMALL = ["mesh.level=1", "mesh.element=h8", "solver.tolerance=1e-9", "solver.mode=newton"]
POSE = ["servos.angles=[-0.3, -0.4, -0.5]", "servos.slide=0.01"]
KNOTS = 8
"""Of a path of the joints over `END`: between knots they move evenly."""
END = 4e-4


def path(t: float) -> np.ndarray:
    """Joints at `t` [s]: a smooth motion, different for each servo, sampled at knots."""
    knots = np.linspace(0.0, END, KNOTS + 1)
    phases = np.array([0.0, 1.0, 2.0])
    angles = np.array([-0.3, -0.4, -0.5]) - 0.02 * np.sin(np.pi * knots[:, None] / END * (1 + 0.3 * phases))
    joints = np.column_stack([angles, 0.01 + 1e-4 * (1 - np.cos(2 * np.pi * knots / END))])
    return np.array([np.interp(t, knots, column) for column in joints.T])


def moved(steps: int, scheme: str, words: list[str], substeps: str = "off") -> np.ndarray:
    """Positions, velocities and rotation of the disc after `steps` steps along the path, all as lengths [m]."""
    inertia = f"inertia={{scheme='{scheme}', substeps='{substeps}'}}"
    simulation = Simulation(load_scene(SHARP, [*SMALL, *POSE, inertia, f"dt={END / steps!r}", *words]))
    for k in range(steps):
        simulation.step(path((k + 1) * END / steps))
    state = simulation.state
    return np.concatenate(
        [state.positions.ravel(), 1e-4 * state.velocities.ravel(), 0.01 * state.rotations.ravel()]
    )


def spun(scheme: str, **words: str) -> Simulation:
    """Return the free piece with a disc, turning fast about an oblique axis."""
    base = ["effector={}", f"inertia={{scheme='{scheme}', substeps='off'}}", "mesh.level=1", "gravity=off"]
    simulation = Simulation(load_scene("silicone_free", [*base, *(f"{k}={v}" for k, v in words.items())]))
    simulation.state.velocities[:] = np.cross([90.0, 60.0, 120.0], simulation.state.positions)
    simulation.state.velocities += np.array([0.1, 0.2, 0.3])
    return simulation


def momenta(simulation: Simulation) -> tuple[np.ndarray, np.ndarray]:
    m, s = simulation._mass, simulation.state
    return m @ s.velocities, (m[:, None] * np.cross(s.positions, s.velocities)).sum(axis=0)


@pytest.mark.parametrize(("scheme", "order", "steps"), [("explicit_euler", 1, 80), ("semi_implicit_euler", 1, 80),
                                                        ("rk4", 4, 32)])  # fmt: skip
def test_error_falls_at_the_order_of_the_scheme_while_servos_move(
    scheme: str, order: int, steps: int
) -> None:
    reference = moved(320, "rk4", ["damping=off"])
    errors = [np.abs(moved(n, scheme, ["damping=off"]) - reference).max() for n in (steps, 2 * steps)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)
    assert errors[1] < (1e-9 if order == 4 else 2e-5)
    start = Simulation(load_scene(SHARP, [*SMALL, *POSE])).state
    assert np.abs(reference[: start.positions.size] - start.positions.ravel()).max() > 1e-4


def test_rk4_keeps_its_order_with_incompatible_modes_and_stiffness_damping() -> None:
    words = ["mesh.element=h8_modes", "damping={mass=50.0, stiffness=2e-6}"]
    reference = moved(320, "rk4", words)
    errors = [np.abs(moved(n, "rk4", words) - reference).max() for n in (32, 64)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.3)
    assert (
        np.abs(moved(64, "rk4", ["mesh.element=h8_modes", "damping=off"]) - reference).max() > 100 * errors[0]
    )


@pytest.mark.parametrize("words", [["damping={mass=50.0, stiffness=2e-6}"], ["damping=off", "clamp={}"],
                                   ["damping=off", "maze={}"]])  # fmt: skip
def test_explicit_and_implicit_schemes_agree_while_servos_move(words: list[str]) -> None:
    explicit = moved(80, "rk4", words)
    loose = "solver.tolerance=1e-4"  # of m / dt² times the rounding of positions
    implicit = [moved(n, "tr_bdf2", [*words, loose]) for n in (32, 64, 128)]
    errors = [np.abs(x - explicit).max() for x in implicit]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.3)  # the order of the implicit scheme
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.3)
    assert errors[2] < 2e-7


@pytest.mark.parametrize("scheme", SCHEMES[:2])
def test_one_step_is_the_recurrence(scheme: str) -> None:
    """Nodes: v' = v + h f / m; the disc: momentum and angular momentum about its mass centre, turned by exp(h w)."""
    simulation = spun(scheme, dt="1e-5", damping="{mass=30.0, stiffness=0.0}")
    state, system, m, h = simulation.state, simulation._system, simulation._mass, 1e-5
    rng = np.random.default_rng(1)
    for _ in range(3):
        simulation.step()
    disc, free = system.groups.rigid[0], system.reduction.free
    state.velocities[free] += 0.5 * rng.standard_normal((len(free), 3))
    before = state.copy()
    system.elastic.forget()
    for _ in range(20):  # modes to equilibrium, as the scheme has them
        system.assemble(before, project=False)
        system.evaluate(before)
        system.elastic.advance_modes(before.modes, np.zeros_like(before.positions), 1.0, before.modes)
    system.evaluate(before)
    force = -system.gradient - 30.0 * m[:, None] * before.velocities
    simulation.step()
    v = before.velocities[free] + h * force[free] / m[free, None]
    x = before.positions[free] + h * (before.velocities[free] if scheme == "explicit_euler" else v)
    np.testing.assert_allclose(state.velocities[free], v, atol=1e-8)
    np.testing.assert_allclose(state.positions[free], x, atol=1e-13)

    total = m[disc].sum()
    centre = m[disc] @ before.positions[disc] / total
    r = before.positions[disc] - centre
    spin = np.cross(r, before.velocities[disc]) * m[disc, None]
    velocity, angular = m[disc] @ before.velocities[disc] / total, spin.sum(axis=0)
    new_velocity = velocity + h * force[disc].sum(axis=0) / total
    new_angular = angular + h * np.cross(r, force[disc]).sum(axis=0)

    def turning(arms: np.ndarray, moment: np.ndarray) -> np.ndarray:
        inertia = (m[disc] @ (arms**2).sum(axis=1)) * np.eye(3) - (arms * m[disc, None]).T @ arms
        return np.linalg.solve(inertia, moment)

    if scheme == "explicit_euler":
        w, drifted = turning(r, angular), velocity
    else:
        half = scipy.linalg.expm(_skew(0.5 * h * turning(r, new_angular)))
        w, drifted = turning(r @ half.T, new_angular), new_velocity
    arms = r @ scipy.linalg.expm(_skew(h * w)).T
    np.testing.assert_allclose(state.positions[disc], centre + h * drifted + arms, atol=1e-13)
    expected = new_velocity + np.cross(turning(arms, new_angular), arms)
    np.testing.assert_allclose(state.velocities[disc], expected, atol=1e-8)


def _skew(a: np.ndarray) -> np.ndarray:
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


@pytest.mark.parametrize(("scheme", "bound"), [("semi_implicit_euler", 1e-12), ("rk4", 1e-7)])
def test_a_free_body_with_a_disc_keeps_its_momenta_and_its_energy(scheme: str, bound: float) -> None:
    simulation = spun(scheme, dt="1e-5")
    simulation.step()
    before, e = momenta(simulation), simulation.energies()
    start = simulation.effector
    for _ in range(300):
        simulation.step()
    after, f = momenta(simulation), simulation.energies()
    np.testing.assert_allclose(after[0], before[0], rtol=1e-10)
    assert np.abs(after[1] - before[1]).max() < bound * np.linalg.norm(before[1])
    assert f.kinetic + f.strain == pytest.approx(e.kinetic + e.strain, rel=1e-2 if bound < 1e-10 else 1e-6)
    assert start
    assert simulation.effector
    assert abs(start.quaternion @ simulation.effector.quaternion) < 0.99  # it has turned by 0.3 rad and more
    R = simulation.state.rotations[0]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-13)
    disc = simulation._system.groups.rigid[0]
    arms = simulation._system.rest[disc] - simulation._system.rest[disc].mean(axis=0)
    np.testing.assert_allclose(
        simulation.state.positions[disc], simulation.state.centres[0] + arms @ R.T, atol=1e-12
    )


def test_order_on_a_tumbling_disc() -> None:
    def end(scheme: str, steps: int) -> np.ndarray:
        simulation = spun(scheme, dt=repr(4e-4 / steps))
        for _ in range(steps):
            simulation.step()
        return np.concatenate([simulation.state.positions, 1e-4 * simulation.state.velocities])

    reference = end("rk4", 160)
    for scheme, order, steps in (("explicit_euler", 1, 80), ("semi_implicit_euler", 1, 80), ("rk4", 4, 20)):
        errors = [np.abs(end(scheme, n) - reference).max() for n in (steps, 2 * steps)]
        assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3), scheme


@pytest.mark.parametrize("scheme", SCHEMES)
def test_driven_nodes_have_position_and_velocity_of_the_joints(scheme: str) -> None:
    simulation = Simulation(load_scene(SHARP, [*SMALL, *POSE, f"inertia.scheme={scheme}", "dt=1e-4"]))
    frames, rest = simulation.driven_frames, simulation._system.rest
    before = simulation.command
    goal = before + np.array([0.002, -0.003, 0.004, -2e-5])
    simulation.step(goal)
    rate = (goal - before) / 1e-4
    for i, frame in enumerate(frames):
        c, u, w = frame.swing(rest[frame.nodes])
        x = c + u * np.cos(goal[i]) + w * np.sin(goal[i]) + goal[-1] * frame.inward
        v = rate[i] * (w * np.cos(goal[i]) - u * np.sin(goal[i])) + rate[-1] * frame.inward
        np.testing.assert_allclose(simulation.state.positions[frame.nodes], x, atol=1e-15)
        np.testing.assert_allclose(simulation.state.velocities[frame.nodes], v, atol=1e-11)


@pytest.mark.parametrize("words", [[], ["clamp={}"], ["maze={}"], ["servo_dynamics={}"]])
def test_a_body_in_equilibrium_stays_at_rest_under_the_static_torque(words: list[str]) -> None:
    words = [*SMALL, *POSE, *words, "dt=2e-4"]
    static = Simulation(load_scene(SHARP, [*words, "inertia=off", "damping=off"])).efforts
    moving = [*words, "inertia.scheme=semi_implicit_euler", "damping={mass=1.0, stiffness=1e-6}"]
    simulation = Simulation(load_scene(SHARP, moving))
    start = simulation.positions.copy()
    for _ in range(5):
        report = simulation.step()
    assert np.abs(static).min() > 1e-3
    assert np.abs(simulation.positions - start).max() < 1e-9
    np.testing.assert_allclose(simulation.efforts, static, atol=1e-6)
    assert report.growth == 0.0


@pytest.mark.parametrize("words", [[], ["clamp={}"]])
@pytest.mark.parametrize("scheme", ["semi_implicit_euler", "rk4"])
def test_torques_of_accelerated_servos_are_those_of_the_implicit_scheme(
    scheme: str, words: list[str]
) -> None:
    base = [*SMALL, *POSE, "damping={mass=20.0, stiffness=1e-6}", *words]

    def torques(scheme: str, steps: int) -> np.ndarray:
        dt, accelerations = 2e-4 / steps, np.array([1e6, 5e5, -5e5, 1e4])
        words = [*base, f"inertia.scheme={scheme}", f"dt={dt!r}", "solver.tolerance=1e-4"]
        simulation = Simulation(load_scene(SHARP, words))
        for k in range(steps):
            joints = np.array([-0.3, -0.4, -0.5, 0.01]) + 0.5 * accelerations * ((k + 1) * dt) ** 2
            simulation.step(joints)
        return simulation.efforts

    static = Simulation(load_scene(SHARP, [*base, "inertia=off", "damping=off"])).efforts
    size = np.abs(torques(scheme, 20) - static)
    assert (size > 0.2).all()
    errors = [np.abs(torques(scheme, n) - torques("implicit_euler", n)) for n in (20, 40)]
    assert (errors[1] < 0.02 * size).all()
    np.testing.assert_allclose(errors[0] / errors[1], 2.0, atol=0.3)  # the order of the implicit scheme


def test_servos_with_dynamics_move_the_body_as_with_an_implicit_scheme() -> None:
    def end(scheme: str) -> Simulation:
        words = [*SMALL, *POSE, "servo_dynamics={}", "dt=5e-4", "damping={mass=20.0, stiffness=1e-5}"]
        words.append(f"inertia.scheme={scheme}")
        simulation = Simulation(load_scene(SHARP, words))
        for _ in range(12):
            simulation.step(np.array([-0.35, -0.4, -0.3, 0.01]))
        return simulation

    explicit, implicit = end("semi_implicit_euler"), end("tr_bdf2")
    turned = explicit.state.joints[:-1] - [-0.3, -0.4, -0.5]
    assert abs(turned[0]) > 0.02
    np.testing.assert_allclose(explicit.state.joints, implicit.state.joints, atol=2e-3)
    np.testing.assert_allclose(explicit.positions, implicit.positions, atol=2e-4)


def test_a_ball_on_the_plate_rolls_as_with_an_implicit_scheme() -> None:
    def ball(scheme: str) -> np.ndarray:
        words = [*SMALL, "servos.angles=[-0.8, -0.4, -0.4]", "maze={source='first'}", "ball={}", "dt=1e-3"]
        words.append(f"inertia.scheme={scheme}")
        simulation = Simulation(load_scene(SHARP, words))
        start = simulation.ball.position
        for _ in range(30):
            simulation.step()
        return simulation.ball.position - start

    explicit, implicit = ball("semi_implicit_euler"), ball("tr_bdf2")
    assert np.linalg.norm(implicit) > 1e-5
    np.testing.assert_allclose(explicit, implicit, atol=0.05 * np.linalg.norm(implicit))


def test_the_limit_is_the_largest_frequency_of_the_constrained_body() -> None:
    words = [*SMALL, *POSE, "clamp={}", "maze={}", "damping=off"]
    simulation = Simulation(load_scene(SHARP, [*words, "inertia.scheme=semi_implicit_euler", "dt=1e-5"]))
    report = simulation.step()
    system, mass, stepper = simulation._system, simulation._mass, simulation._stepper
    system.assemble(simulation.state, project=False)
    system.evaluate(simulation.state)
    system.gradient[:] = 0.0  # the terms of second order in rotations, which are far below the largest
    system.factor()
    upper = system.reduction.pattern.toarray()
    stiffness = np.triu(upper) + np.triu(upper, 1).T
    n = system.unknowns
    jacobian = np.zeros((n, len(mass), 3))
    for k in range(n):
        system.reduction.moves(np.eye(n)[k], system.lever, jacobian[k])
    masses = np.einsum("jni,n,kni->jk", jacobian, mass, jacobian)
    squares = scipy.linalg.eigh(stiffness, masses, eigvals_only=True)
    exact = squares[-1]
    assert isinstance(stepper, ExplicitSteps)
    operator = np.array([stepper._frequency._product(row) for row in np.eye(n)])
    np.testing.assert_allclose(np.linalg.eigvalsh(operator), squares, atol=1e-9 * exact)
    assert stepper._frequency.largest(simulation.state) == pytest.approx(exact, rel=2e-3)
    assert report.dt_limit == pytest.approx(2 / np.sqrt(exact) / 1.05, rel=5e-3)


def test_a_long_step_is_divided_and_what_servos_do_is_not_taken_for_growth() -> None:
    words = [*SMALL, "inertia.scheme=semi_implicit_euler", "damping={mass=0.0, stiffness=1e-6}", "dt=0.002"]
    simulation = Simulation(load_scene(SHARP, words))
    start = simulation.energies()
    for k in range(8):
        report = simulation.step(np.array([-0.03 * (k + 1)] * 3 + [0.0]))
        assert report.parts == np.ceil(0.002 / (0.5 * report.dt_limit))
        assert report.growth == 0.0
    stepper = simulation._stepper
    assert isinstance(stepper, ExplicitSteps)
    e = simulation.energies()
    grown = (e.kinetic + e.strain + e.gravity) - (start.kinetic + start.strain + start.gravity)
    assert stepper._given > 20 * start.strain
    assert stepper._given == pytest.approx(grown, rel=0.1)  # the damping took the rest


def test_a_long_step_renews_what_lags_behind_while_servos_move_fast() -> None:
    def end(dt: float) -> np.ndarray:
        words = ["mesh.level=1", "inertia.scheme=rk4", "damping={mass=20.0, stiffness=2e-5}", f"dt={dt}"]
        simulation = Simulation(load_scene(SHARP, words))
        for t in dt * np.arange(1, round(0.02 / dt) + 1):
            simulation.step(np.array([-10.0, -5.0, 5.0, 0.5]) * t)
        return simulation.positions.copy()

    np.testing.assert_allclose(end(0.005), end(0.001), atol=1e-7)


def test_a_steady_step_allocates_no_growing_memory() -> None:
    simulation = Simulation(load_scene(SHARP, [*SMALL, "inertia.scheme=semi_implicit_euler", "dt=1e-4"]))
    joints = [np.array([-1e-4 * k, 0, 0, 0]) for k in range(60)]
    assert kept(simulation.step, joints) < 4_000  # 100 bytes a step: no array of the mesh


def test_undivided_steps_are_flagged_and_stop_at_the_last_good_state() -> None:
    words = [*SMALL, "inertia={scheme='semi_implicit_euler', substeps='off'}", "damping=off", "dt=2.5e-4"]
    simulation = Simulation(load_scene(SHARP, words))
    flagged = 0
    with raises_naming(StepError, "limit is", "dt 0.00025 s", "substeps = 'auto'"):
        for step in range(1, 300):
            report = simulation.step(np.array([-1e-4 * step] * 3 + [0.0]))
            flagged = flagged or (step if "unstable: since step" in report.instability else 0)
    assert 0 < flagged <= simulation.state.step
    assert np.isfinite(simulation.positions).all()
    assert simulation.state.joints[0] == pytest.approx(-1e-4 * simulation.state.step)


def test_reset_returns_the_same_bits() -> None:
    words = [*SMALL, *POSE, "inertia.scheme=semi_implicit_euler", "servo_dynamics={}", "dt=1e-4"]
    simulation = Simulation(load_scene(SHARP, words))
    ends = []
    for _ in range(2):
        simulation.reset()
        for _ in range(4):
            simulation.step(np.array([-0.5, -0.5, -0.5, 0.01]))
        ends.append(simulation.state.positions.tobytes() + simulation.efforts.tobytes())
    assert ends[0] == ends[1]


def test_masses_in_a_line_are_refused() -> None:
    simulation = Simulation(load_scene("silicone", ["mesh.level=1", "inertia.scheme=rk4", "dt=1e-5"]))
    rest, mass, solid = simulation._system.rest, simulation._mass, simulation._system.elastic.terms[0]
    line = np.flatnonzero((np.abs(rest[:, 1]) < 1e-9) & (rest[:, 2] > 1e-9))[:3]
    assert len(line) == 3
    system = System(rest, [solid], Groups(len(rest), (line,)))
    with raises_naming(SceneError, "rigid body 0", "3 nodes", "on a line", "implicit_euler"):
        ExplicitSteps(system, mass, rk4.SCHEME, drag=0.0, divide=True)


@pytest.mark.parametrize(
    ("word", "named"), [("inertia.substeps=never", "inertia.substeps is 'never'"), ("dt=0", "dt is 0.0")]
)
def test_bad_input_is_refused(word: str, named: str) -> None:
    with raises_naming(SceneError, named):
        load_scene(SHARP, ["inertia.scheme=rk4", word])
