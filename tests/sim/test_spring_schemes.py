"""Every scheme on springs: its own recurrence, its order against a reference, its stability, many steps in one call."""

from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.messages import raises_naming
from tripod_sim import SceneError, Simulation, StepError, load_scene
from tripod_sim.integrators.scheme import Tableau

ORDERS = {
    "explicit_euler": 1,
    "semi_implicit_euler": 1,
    "rk4": 4,
    "implicit_euler": 1,
    "bdf2": 2,
    "tr_bdf2": 2,
}
IMPLICIT = ("implicit_euler", "bdf2", "tr_bdf2")
EXPLICIT = ("semi_implicit_euler", "explicit_euler", "rk4")

M, K, C, A, B, REST = (
    0.7,
    40.0,
    0.9,
    0.3,
    0.004,
    0.5,
)  # mass, spring, damper, drag, Rayleigh stiffness, rest length


def recurrence(scheme: str, h: float, steps: int) -> tuple[float, float]:
    """Stretch and its speed of one mass on one spring, by each scheme's formulas, from rest at the speed 1."""
    w, d = K / M, (C + B * K) / M + A  # x'' = -w x - d x'
    x, v, x_old, v_old, a = 0.0, 1.0, 0.0, 0.0, 0.0

    def stage(z: float, u: float, s: float) -> tuple[float, float]:
        """Solve x' = z + s v', v' = u + s (-w x' - d v')."""
        speed = (u - s * w * z) / (1 + s * d + s * s * w)
        return z + s * speed, speed

    for n in range(steps):
        if scheme == "explicit_euler":
            x, v = x + h * v, v + h * (-w * x - d * v)
        elif scheme == "semi_implicit_euler":
            v = v + h * (-w * x - d * v)
            x = x + h * v
        elif scheme == "rk4":
            y, rate = np.array([x, v]), np.array([[0, 1], [-w, -d]])
            k1 = rate @ y
            k2 = rate @ (y + h / 2 * k1)
            k3 = rate @ (y + h / 2 * k2)
            k4 = rate @ (y + h * k3)
            x, v = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        elif scheme == "bdf2" and n > 0:
            z, u = (4 * x - x_old) / 3, (4 * v - v_old) / 3
            x_old, v_old = x, v
            x, v = stage(z, u, 2 * h / 3)
        elif scheme == "tr_bdf2" and n > 0:
            g = 2 - np.sqrt(2)
            s, p = g * h / 2, 1 / (g * (2 - g))
            q = (1 - g) ** 2 * p
            x_g, v_g = stage(x + s * v, v + s * a, s)
            x, v = stage(p * x_g - q * x, p * v_g - q * v, s)
            a = -w * x - d * v
        else:
            x_old, v_old = x, v
            x, v = stage(x, v, h)
            a = -w * x - d * v
    return x, v


@pytest.mark.parametrize("scheme", ORDERS)
def test_one_mass_on_one_spring_follows_the_recurrence(scheme: str) -> None:
    """Damped in all three ways: along the spring, by mass and by stiffness."""
    simulation = Simulation(
        load_scene(
            "pendulum",
            [f"inertia={{scheme='{scheme}', substeps='off'}}", "gravity=off", "springs.nodes=2", f"springs.size={REST}",
             f"springs.node_mass={M}", f"springs.stiffness={K}", f"springs.damping={C}",
             f"damping={{mass={A}, stiffness={B}}}", "dt=0.01", "solver.tolerance=1e-13"],
        )
    )  # fmt: skip
    simulation.state.velocities[1, 0] = 1.0
    simulation.advance(40)
    x, v = recurrence(scheme, 0.01, 40)
    assert abs(x) > 1e-3
    assert simulation.positions[1, 0] - REST == pytest.approx(x, abs=3e-14)
    assert simulation.state.velocities[1, 0] == pytest.approx(v, abs=3e-13)
    assert np.array_equal(simulation.positions[0], [0, 0, 0])


def test_the_loop_of_springs_takes_any_scheme_from_its_weights() -> None:
    """The midpoint rule, which is not shipped, of one mass on one spring without damping."""
    words = ["inertia={scheme='rk4', substeps='off'}", "gravity=off", "springs.nodes=2", f"springs.size={REST}",
             f"springs.node_mass={M}", f"springs.stiffness={K}", "springs.damping=0", "dt=0.01"]  # fmt: skip
    simulation = Simulation(load_scene("pendulum", words))
    simulation._stepper._scheme = Tableau(np.array([0.5, 1.0]), np.array([0.0, 1.0]), 1.0, swaps=False)
    simulation.state.velocities[1, 0] = 1.0
    simulation.advance(3)
    rate, y = np.array([[0, 1], [-K / M, 0]]), np.array([0.0, 1.0])
    for _ in range(3):
        y = y + 0.01 * rate @ (y + 0.005 * rate @ y)
    assert simulation.positions[1, 0] - REST == pytest.approx(y[0], abs=3e-14)
    assert simulation.state.velocities[1, 0] == pytest.approx(y[1], abs=3e-13)


@pytest.mark.parametrize("scheme", ORDERS)
def test_the_recurrences_themselves_converge_to_the_solution(scheme: str) -> None:
    """So that the test above compares with the scheme and not with a twin of its mistakes."""
    w, d = K / M, (C + B * K) / M + A
    f = np.sqrt(w - d * d / 4)
    exact = np.exp(-d / 2 * 0.4) * np.sin(f * 0.4) / f
    errors = np.array([abs(recurrence(scheme, 0.4 / n, n)[0] - exact) for n in (100, 200, 400)])
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), ORDERS[scheme], atol=0.15)


SWING = ["springs={source='chain', nodes=4, size=0.6, node_mass=0.2, stiffness=400.0, damping=0.5, fixed_corners=[0]}",
         "damping={mass=0.2, stiffness=0.0}", "solver.tolerance=1e-12"]  # fmt: skip
END = 0.4


@pytest.fixture(scope="module")
def reference() -> np.ndarray:
    """Positions of the swinging chain at END, by DOP853 with tolerances of 1e-12 on equations written here."""
    rest, k, c, m, a = 0.2, 400.0, 0.5, 0.2, 0.2

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        x, v = y.reshape(2, 4, 3)
        f = np.tile([0.0, 0.0, -9.81 * m], (4, 1)) - a * m * v
        for i in range(3):
            d, w = x[i + 1] - x[i], v[i + 1] - v[i]
            length = np.linalg.norm(d)
            n = d / length
            pull = (k * (length - rest) + c * (n @ w)) * n
            f[i] += pull
            f[i + 1] -= pull
        f[0] = 0.0
        return np.concatenate([v, f / m]).ravel()

    start = np.zeros((2, 4, 3))
    start[0, :, 0] = np.linspace(0, 0.6, 4)
    done = solve_ivp(rate, (0.0, END), start.ravel(), method="DOP853", rtol=1e-12, atol=1e-12)
    return done.y[:12, -1].reshape(4, 3)


@pytest.mark.parametrize(
    ("scheme", "steps", "bound"),
    [("explicit_euler", 3200, 2e-3), ("semi_implicit_euler", 1600, 1e-3), ("rk4", 200, 1e-7),
     ("implicit_euler", 3200, 1e-3), ("bdf2", 800, 1e-4), ("tr_bdf2", 400, 1e-4)],
)  # fmt: skip
def test_error_of_the_pendulum_falls_at_the_order_of_the_scheme(
    scheme: str, steps: int, bound: float, reference: np.ndarray
) -> None:
    errors = []
    for n in (steps, 2 * steps, 4 * steps):
        words = [*SWING, f"inertia={{scheme='{scheme}', substeps='off'}}", f"dt={END / n}"]
        simulation = Simulation(load_scene("pendulum", words))
        simulation.advance(n)
        errors.append(np.abs(simulation.positions - reference).max())
    e = np.array(errors)
    np.testing.assert_allclose(np.log2(e[:-1] / e[1:]), ORDERS[scheme], atol=0.12)
    assert e[-1] < bound  # [m]


def total(simulation: Simulation) -> float:
    e = simulation.energies()
    return e.kinetic + e.strain + e.gravity


def test_the_energy_of_the_semi_implicit_scheme_does_not_drift() -> None:
    """Over 1e5 steps of the undamped pendulum the error stays what it is in the first thousands."""
    simulation = Simulation(load_scene("pendulum", ["springs.nodes=5", "springs.stiffness=5000", "dt=0.002"]))
    largest = []
    for _ in range(20):
        worst = 0.0
        for _ in range(50):
            report = simulation.advance(100)
            worst = max(worst, abs(total(simulation)))
        largest.append(worst)
    assert report.growth == 0.0
    swing = 4 * 9.81 * 1.0  # weight of the free nodes times the chain's length [J]
    assert max(largest) < 0.05 * swing
    assert np.mean(largest[-5:]) < 1.5 * np.mean(largest[:5])


@pytest.mark.parametrize("scheme", IMPLICIT)
@pytest.mark.parametrize("dt", [0.4, 1e-5])
def test_the_implicit_schemes_are_stable_for_all_values_of_the_report(scheme: str, dt: float) -> None:
    for k, m, g in product((0, 0.1, 1500, 5000), (0.001, 1, 5000), (9.81, 1000)):
        words = [f"springs.stiffness={k}", f"springs.node_mass={m}", f"gravity.acceleration=[0, 0, -{g}]",
                 f"dt={dt}", f"inertia.scheme={scheme}", "springs.nodes=4"]  # fmt: skip
        simulation = Simulation(load_scene("pendulum", words))
        scale = 3 * m * g  # energy of a fall of 1 m
        for _ in range(20):
            report = simulation.advance(5)
            assert report.halvings == 0
            assert np.isfinite(simulation.positions).all()
            # BDF2's and TR-BDF2's energy is not monotonous, but never grows beyond what the fall gives
            assert total(simulation) <= (1e-9 if scheme == "implicit_euler" else 0.05) * scale
        free_fall = -0.5 * g * (100 * dt) ** 2
        if k == 0 and scheme == "tr_bdf2":
            assert simulation.positions[-1, 2] == pytest.approx(free_fall, rel=0.02)


@pytest.mark.parametrize("scheme", ORDERS)
@pytest.mark.parametrize("source", ["pendulum", "cloth"])
def test_many_steps_in_one_call_give_the_bits_of_single_steps(source: str, scheme: str) -> None:
    words = [f"inertia.scheme={scheme}", "springs.nodes=6", "dt=0.003"]
    simulation = Simulation(load_scene(source, words))
    report = simulation.advance(60)
    end = (simulation.positions.tobytes(), simulation.state.velocities.tobytes(), simulation.state.time)
    assert simulation.state.step == 60
    simulation.reset()
    parts = sum(simulation.step().parts for _ in range(60))
    assert parts == report.parts
    assert (
        simulation.positions.tobytes(),
        simulation.state.velocities.tobytes(),
        simulation.state.time,
    ) == end


@pytest.mark.parametrize("scheme", ["semi_implicit_euler", "rk4"])
def test_steps_are_divided_until_they_are_stable(scheme: str) -> None:
    words = ["springs.stiffness=5000", "springs.node_mass=0.001", "dt=0.05", f"inertia.scheme={scheme}"]
    simulation = Simulation(load_scene("pendulum", words))
    report = simulation.advance(100)
    # largest frequency of a chain of 9 equal masses, one end fixed, the other free
    exact = 2 * np.sqrt(5000 / 0.001) * np.cos(np.pi / 19)
    limit = (2.0 if scheme == "semi_implicit_euler" else 2.6) / exact
    assert report.dt_limit == pytest.approx(limit, rel=0.02)
    assert report.dt_limit <= limit * 1.001
    assert report.parts == 100 * np.ceil(0.05 / (0.5 * report.dt_limit))
    assert report.growth == 0.0
    assert abs(total(simulation)) < 0.2 * 9 * 0.001 * 9.81


@pytest.mark.parametrize("scheme", EXPLICIT)
def test_undivided_steps_beyond_the_limit_are_flagged_at_once_and_stop_before_a_number_is_lost(
    scheme: str,
) -> None:
    words = [f"inertia={{scheme='{scheme}', substeps='off'}}", "springs.stiffness=5000", "springs.node_mass=0.001",
             "dt=0.005"]  # fmt: skip
    simulation = Simulation(load_scene("pendulum", words))
    grew = 0
    with raises_naming(StepError, "overflows", "explicit scheme", "unstable", "dt 0.005 s (limit"):
        for step in range(1, 10_000):
            report = simulation.step()
            if report.growth and not grew:
                grew = step
                assert report.grew_at == step
                assert np.abs(simulation.positions).max() < 100.0
    assert 1 < grew < 15
    assert np.isfinite(simulation.positions).all()
    assert np.isfinite(simulation.state.velocities).all()
    simulation.reset()
    assert simulation.step().growth == 0.0


@pytest.mark.parametrize("scheme", ["semi_implicit_euler", "rk4"])
@pytest.mark.parametrize(("ratio", "stable"), [(0.98, True), (1.1, False)])
def test_the_limit_is_the_limit(scheme: str, ratio: float, stable: bool) -> None:
    """One mass on one spring, damped; RK4's limit is a round number below its own."""
    words = [
        "springs.nodes=2",
        "gravity=off",
        "springs.stiffness=100",
        "springs.damping=1.0",
        "springs.node_mass=1.0",
    ]
    limit = Simulation(load_scene("pendulum", [*words, f"inertia.scheme={scheme}"])).advance(1).dt_limit
    words += [f"inertia={{scheme='{scheme}', substeps='off'}}"]
    reach = 1.1 if scheme == "rk4" and not stable else 1.0
    simulation = Simulation(load_scene("pendulum", [*words, f"dt={ratio * reach * limit}"]))
    simulation.state.velocities[1, 0] = 1e-6
    simulation.advance(60)
    assert (np.abs(simulation.state.velocities[1, 0]) < 1e-6) == stable


def test_too_many_parts_are_refused() -> None:
    with raises_naming(
        SceneError, "dt is 1 s", "substeps", 10_000_000, "implicit inertia.scheme", "smaller dt"
    ):
        Simulation(load_scene("pendulum", ["springs.stiffness=1e9", "springs.node_mass=1e-12", "dt=1.0"]))


def test_reset_forgets_history_and_growth() -> None:
    for scheme in ORDERS:
        simulation = Simulation(load_scene("cloth", ["springs.nodes=4", f"inertia.scheme={scheme}"]))
        ends = []
        for _ in range(2):
            simulation.advance(7)
            ends.append(simulation.positions.tobytes())
            simulation.reset()
        assert ends[0] == ends[1]
