"""Every registered time integrator, whatever its name: order, start, save and restore, substeps that fail, spectrum."""

import inspect
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from tests.messages import raises_naming
from tests.sim.implicit_schemes import IMPLICIT, scheme_of
from tests.sim.test_damping import damped_system, stiffness_of
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.constraints.groups import Groups
from tripod_sim.forces.anchor import Anchor
from tripod_sim.forces.spring_force import SpringForce
from tripod_sim.integrators.explicit import ExplicitSteps
from tripod_sim.integrators.history import History
from tripod_sim.integrators.implicit import ImplicitSteps
from tripod_sim.integrators.newton import Newton, NewtonError
from tripod_sim.integrators.scheme import ExplicitScheme, ImplicitScheme, Scheme, euler_stage
from tripod_sim.integrators.schemes import EXPLICIT, SCHEMES
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.substeps import Substeps, halving
from tripod_sim.integrators.time_error import ErrorTransport
from tripod_sim.state import State
from tripod_sim.system import System

REPOSITORY = Path(__file__).parents[2]

W, C, DRAG, MASS = 7.0, 0.6, 0.3, 0.5
"""Of the oscillator: w [rad/s], rate of its damper and drag [1/s], mass [kg]."""

START, SPEED, END = 0.02, 0.1, 0.8
"""Stretch [m] and speed [m/s] at the start, and how long it swings [s]."""

ALPHA = scheme_of("generalised_alpha")


def with_radius(rho: float) -> ImplicitScheme:
    """Return generalised-alpha with a spectral radius."""
    return replace(ALPHA, rho_inf=rho)


class Midpoint(ExplicitScheme):
    """An explicit scheme that is not registered: its weights are all that loops need of it."""

    def limit(self, omega: float, rate: float) -> float:
        return 0.0


MIDPOINT = Midpoint("midpoint", 2, weights=(0.0, 1.0), reach=(0.5,))

EVERY = [*SCHEMES.values(), *(with_radius(rho) for rho in (0.0, 0.5, 1.0)), MIDPOINT]

ALL_IMPLICIT = [s for s in EVERY if isinstance(s, ImplicitScheme)]


def name_of(scheme: object) -> str:
    """Return the name of a case."""
    if not isinstance(scheme, Scheme):
        return str(scheme)
    own = [f"{getattr(scheme, p):g}" for p in scheme.parameters]
    return "-".join([scheme.name, *own])


def oscillator() -> tuple[System, Anchor, np.ndarray]:
    """Return a mass on a spring along x with a damper, the other end fixed: linear while the spring is taut."""
    return swinging(C)


def swinging(rate: float) -> tuple[System, Anchor, np.ndarray]:
    """Return the oscillator with the `rate` of its damper [1/s]."""
    nodes = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    ends, one = np.array([[0, 1]]), np.ones(1)
    spring = SpringForce(ends, one, MASS * W**2 * one, MASS * rate * one, slack=False, owner="spring")
    inertia, mass = Anchor(2), np.full(2, MASS)
    system = System(nodes, [spring], Groups(2, fixed=np.array([0])), [inertia], damped=rate > 0)
    return system, inertia, mass


def begun(system: System) -> State:
    """Return its state at the start."""
    state = system.start_state(np.zeros(1))
    state.positions[1, 0] += START
    state.velocities[1, 0] = SPEED
    return state


def steps_of(scheme: Scheme) -> tuple[Substeps | ExplicitSteps, State]:
    """Return what advances the oscillator, and its start."""
    system, inertia, mass = oscillator()
    if isinstance(scheme, ImplicitScheme):
        stepper = halving(
            ImplicitSteps(scheme, ImplicitStage(Newton(system, 1e-10, 100), inertia, mass, DRAG)), 4
        )
        return stepper, begun(system)
    assert isinstance(scheme, ExplicitScheme)
    system = System(system.rest, system.elastic.terms, system.groups)
    return ExplicitSteps(system, mass, scheme, drag=DRAG, divide=False), begun(system)


def exact_at(t: float) -> np.ndarray:
    """Return stretch and speed of the exact motion."""
    return np.asarray(expm(np.array([[0.0, 1.0], [-(W**2), -C - DRAG]]) * t) @ [START, SPEED])


def lengths(count: int, kind: str) -> np.ndarray:
    """Return the lengths of `count` steps [s], of which there are an even number: equal, or long and short in turn."""
    each = np.full(count, END / count)
    return each * np.where(np.arange(count) % 2, 1.4, 0.6) if kind == "uneven" else each


def swung(scheme: Scheme, count: int, kind: str) -> float:
    """Return the error of stretch and speed / w at the end [m]."""
    stepper, state = steps_of(scheme)
    for h in lengths(count, kind).tolist():
        stepper.step(state, np.zeros(1), h)
    off = np.array([state.positions[1, 0], state.velocities[1, 0]]) - exact_at(END)
    return float(np.abs(off / [1.0, W]).max())


def test_a_scheme_is_a_file_with_its_name_and_stands_in_the_docs() -> None:
    folder = Path(inspect.getfile(euler_stage)).parent / "schemes"
    assert {path.stem for path in folder.glob("*.py")} - {"__init__"} == set(SCHEMES)
    assert all(scheme.name == name for name, scheme in SCHEMES.items())
    assert set(IMPLICIT) | set(EXPLICIT) == {n for n, s in SCHEMES.items() if not s.is_automatic}
    table = (REPOSITORY / "docs" / "springs.md").read_text(encoding="utf-8")
    defects = (REPOSITORY / "docs" / "time_error.md").read_text(encoding="utf-8")
    assert not [name for name in SCHEMES if f"`{name}`" not in table]
    assert not [name for name in IMPLICIT if f"`{name}`" not in defects]


@pytest.mark.parametrize("kind", ["even", "uneven"])
@pytest.mark.parametrize("scheme", EVERY, ids=name_of)
def test_the_error_of_a_damped_oscillator_falls_at_the_order(scheme: Scheme, kind: str) -> None:
    """Steps of changing length, too; but implicit Euler starts a multistep scheme and leaves its part."""
    counts = (40, 80, 160) if scheme.order > 2 else (160, 320, 640)
    errors = np.array([swung(scheme, n, kind) for n in counts])
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), scheme.order, atol=0.12)
    assert errors[-1] < {1: 2e-3, 2: 1e-5, 3: 1e-6, 4: 1e-8}[scheme.order]


def growth(scheme: ExplicitScheme, h: float, omega: float, rate: float) -> float:
    """Return the largest factor by which a step of `h` [s] multiplies a mode x'' = -w² x - d x'."""
    one, rates = np.eye(2), np.array([[0.0, 1.0], [-(omega**2), -rate]])
    if scheme.swaps:
        step = (one + h * np.diag([1.0, 0.0]) @ rates) @ (one + h * np.diag([0.0, 1.0]) @ rates)
    else:
        step, stage = one, one
        for weight, reach in zip(scheme.weights, [*scheme.reach, 0.0], strict=True):
            step, stage = (
                step + h * weight / sum(scheme.weights) * rates @ stage,
                one + reach * h * rates @ stage,
            )
    return float(np.abs(np.linalg.eigvals(step)).max())


@pytest.mark.parametrize("rate", [0.0, 0.03, 1.0, 2.5, 40.0])
@pytest.mark.parametrize("name", EXPLICIT)
def test_a_mode_grows_beyond_the_stability_limit_and_not_within_it(name: str, rate: float) -> None:
    scheme, omega = SCHEMES[name], 3.0
    assert isinstance(scheme, ExplicitScheme)
    limit = scheme.longest_step(omega, rate)
    if limit == 0.0:
        assert rate == 0.0
        assert growth(scheme, 1e-2, omega, rate) > 1
        return
    for share in (0.01, 0.3, 1.0):
        assert growth(scheme, share * limit, omega, rate) < 1 + 1e-7
    assert growth(scheme, 1.5 * limit, omega, rate) > 1 + 1e-7


@pytest.mark.parametrize("scheme", ALL_IMPLICIT, ids=name_of)
def test_a_start_is_a_step_of_implicit_euler_and_forget_starts_anew(scheme: ImplicitScheme) -> None:
    stepper, state = steps_of(scheme)
    for k in range(5):
        if k in (0, 3):
            stepper.forget()
            x, v = state.positions[1, 0], state.velocities[1, 0]
        stepper.step(state, np.zeros(1), 0.01)
        if k in (0, 3):
            v = (v - 0.01 * W**2 * x) / (1 + 0.01 * (C + DRAG) + (0.01 * W) ** 2)
            x += 0.01 * v
            assert state.positions[1, 0] == pytest.approx(x, rel=1e-9)
            assert state.velocities[1, 0] == pytest.approx(v, rel=1e-9)
        assert stepper.integrator.looks_back == scheme.is_multistep


@pytest.mark.parametrize("scheme", ALL_IMPLICIT, ids=name_of)
def test_a_step_whose_first_try_fails_ends_as_its_two_halves(
    scheme: ImplicitScheme, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The try that fails, after each of its stages, leaves no trace in what the scheme remembers."""
    (plain, halves), (tried, state) = steps_of(scheme), steps_of(scheme)
    for k, h in enumerate((0.02, 0.01, 0.02, 0.03)):
        plain.step(halves, np.zeros(1), h)
        tried.step(state, np.zeros(1), h)
        for _ in range(2):
            plain.step(halves, np.zeros(1), 0.02)
        solve, calls, last = tried.integrator._stage.solve, [], 1 + k % len(scheme.stages(1.0, 1.0))

        def failing(*given, solve=solve, calls=calls, last=last):
            calls.append(1)
            report = solve(*given)
            if len(calls) == last:
                raise NewtonError("on purpose")
            return report

        monkeypatch.setattr(tried.integrator._stage, "solve", failing)
        report = tried.step(state, np.zeros(1), 0.04)
        monkeypatch.undo()
        assert (report.halvings, report.parts) == (1, 2)
        np.testing.assert_allclose(state.positions, halves.positions, rtol=0, atol=1e-13)
        np.testing.assert_allclose(state.velocities, halves.velocities, rtol=0, atol=1e-12)


@pytest.mark.parametrize("scheme", [s for s in ALL_IMPLICIT if s.is_multistep], ids=name_of)
def test_history_that_is_recalled_goes_on_with_the_same_bits(scheme: ImplicitScheme) -> None:
    stepper, state = steps_of(scheme)
    ends = []
    for _ in range(4):
        stepper.step(state, np.zeros(1), 0.01)
    stepper.integrator.keep_history()
    for _ in range(2):
        again = state.copy()
        stepper.step(again, np.zeros(1), 0.015)
        ends.append(again.positions.tobytes() + again.velocities.tobytes())
        stepper.integrator.recall_history()
    assert ends[0] == ends[1]


@pytest.mark.parametrize("name", [*SCHEMES])
def test_a_restored_scene_repeats_its_bits(name: str) -> None:
    words = ["dt=0.002", f"inertia.scheme={name}"]
    scene = (
        load_scene("pendulum", words)
        if SCHEMES[name].explicit
        else load_scene("silicone", ["mesh.level=1", *words])
    )
    simulation, ends = Simulation(scene), []
    for _ in range(6):
        simulation.step()
    saved = simulation.save()
    for _ in range(2):
        simulation.restore(saved)
        for _ in range(6):
            simulation.step()
        ends.append(simulation.positions.tobytes())
    assert ends[0] == ends[1]


@pytest.mark.parametrize("kind", ["even", "uneven"])
@pytest.mark.parametrize("scheme", [s for s in ALL_IMPLICIT if s.has_error_estimate], ids=name_of)
def test_the_estimate_is_the_error_of_short_steps(scheme: ImplicitScheme, kind: str) -> None:
    system, inertia, mass = oscillator()
    stepper = halving(
        ImplicitSteps(scheme, ImplicitStage(Newton(system, 1e-10, 100), inertia, mass, DRAG)), 4
    )
    stepper.integrator.errors = ErrorTransport(system, inertia, mass, local=False)
    state, t = begun(system), 0.0
    state.errors = stepper.integrator.errors.start(state.velocities)
    for h in lengths(640, kind).tolist():
        stepper.step(state, np.zeros(1), h)
        t += h
    true = exact_at(t) - [state.positions[1, 0], state.velocities[1, 0]]
    found = state.errors.error[:, 1, 0]
    means = kind == "uneven" and bool(scheme.stages(1.0, 1.0)[0].curves)
    share = 0.25 if means else 0.03  # means over uneven steps are no accelerations at times apart
    np.testing.assert_allclose(found, true, atol=share * np.abs(true / [1.0, W]).max() * W)


def amplification(scheme: ImplicitScheme, wh: float) -> np.ndarray:
    """Return what a step of 1 s makes of x, v and all that is remembered of them, for x'' = -(wh)² x: linear."""
    history, (stage,) = History((2, 1, 1), slice(1, 2)), scheme.stages(1.0, 1.0)
    columns, known = [], np.zeros((2, 1, 1))
    for unit in np.eye(8):
        y = unit[:2].reshape(2, 1, 1).copy()
        for array, part in zip(history.arrays(), unit[2:].reshape(3, 2, 1, 1), strict=True):
            array[:] = part
        history.known(y, stage, known)
        z, u = known.ravel()
        v = (u - stage.s_force * wh**2 * z) / (1 + stage.square * wh**2)
        after = np.array([z + stage.s * v, v]).reshape(2, 1, 1)
        history.note(y, known, after, stage)
        columns.append(np.concatenate([after.ravel(), *(a.ravel() for a in history.arrays())]))
    return np.array(columns).T


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.8, 1.0])
def test_generalised_alpha_has_its_spectral_radius_at_large_steps_and_no_more_at_any(rho: float) -> None:
    """[ChungHulbert1993]: rho_inf for w h to infinity, where three eigenvalues meet; 1 for none."""
    radii = [
        np.abs(np.linalg.eigvals(amplification(with_radius(rho), wh))).max() for wh in (1e-2, 0.3, 3.0, 30.0)
    ]
    assert max(radii) <= 1 + 1e-9
    if rho == 1.0:
        np.testing.assert_allclose(radii, 1.0, atol=1e-6)
    far = np.abs(np.linalg.eigvals(amplification(with_radius(rho), 1e5)))
    assert far.max() == pytest.approx(rho, abs=0.02)


def energy_left(scheme: ImplicitScheme, steps: int) -> float:
    """Return the share of the undamped oscillator's energy after `steps` of a tenth of a radian."""
    system, inertia, mass = swinging(0.0)
    stepper = halving(ImplicitSteps(scheme, ImplicitStage(Newton(system, 1e-10, 100), inertia, mass, 0.0)), 4)
    state, found = begun(system), []
    for k in range(steps):
        stepper.step(state, np.zeros(1), 0.1 / W)
        if k in (0, steps - 1):
            kinetic = 0.5 * MASS * state.velocities[1, 0] ** 2
            found.append(kinetic + 0.5 * MASS * W**2 * (state.positions[1, 0]) ** 2)
    return float(found[1] / found[0])


def test_generalised_alpha_without_damping_keeps_the_energy() -> None:
    """Within rounding and the solver's tolerance after 1000 steps; more damping takes more."""
    left = [energy_left(with_radius(rho), 1000) for rho in (1.0, 0.8, 0.5, 0.0)]
    assert left[0] == pytest.approx(1.0, abs=1e-9)
    assert left[0] > left[1] > left[2] > left[3]
    assert left[1] > energy_left(scheme_of("bdf2"), 1000)


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("scheme", [s for s in ALL_IMPLICIT if s.is_multistep], ids=name_of)
def test_a_small_solid_converges_at_second_order(scheme: ImplicitScheme, damped: bool) -> None:
    """A block of neo-Hooke's rubber, held at one side, in large motion: against much shorter steps of TR-BDF2."""
    system, inertia, mass = damped_system("h8_modes", "neo_hooke", np.arange(4))
    if not damped:
        system = System(system.rest, system.elastic.terms, system.groups, [inertia])
    fastest = float(np.sqrt(np.linalg.eigvalsh(stiffness_of(system) / mass[0]).max()))

    def swing(scheme: ImplicitScheme, steps: int) -> np.ndarray:
        stepper = halving(
            ImplicitSteps(scheme, ImplicitStage(Newton(system, 5e-6, 100), inertia, mass, 0.0)), 4
        )
        state = system.start_state(np.zeros(1))
        state.velocities[4:] = 1.0 * np.random.default_rng(1).standard_normal((len(mass) - 4, 3))
        for _ in range(steps):
            stepper.step(state, np.zeros(1), 12.0 / fastest / steps)
        return state.positions.copy()

    exact = swing(scheme_of("tr_bdf2"), 4800)
    errors = [np.abs(swing(scheme, n) - exact).max() for n in (300, 600)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.15)
    assert errors[1] < 0.02 * np.abs(exact - system.rest).max()


def test_a_parameter_belongs_to_its_scheme() -> None:
    scene = load_scene("silicone", ["inertia.scheme=generalised_alpha", "inertia.rho_inf=0.25"])
    assert scene.inertia.integrator == with_radius(0.25)
    for value in ("1.5", "-0.1"):
        with raises_naming(SceneError, "inertia.rho_inf", value, "1"):
            load_scene("silicone", ["inertia.scheme=generalised_alpha", f"inertia.rho_inf={value}"])
    with raises_naming(SceneError, "inertia.rho_inf is 0.25", "'bdf2'", "generalised_alpha"):
        load_scene("silicone", ["inertia.scheme=bdf2", "inertia.rho_inf=0.25"])
