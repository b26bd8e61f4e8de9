"""Cloth: budgets of momentum and energy, free fall, static shape, the same result from every solver."""

import numpy as np
import pytest

from tests.memory import kept
from tests.messages import raises_naming
from tests.sim.springs import net_of
from tests.tiers import sampled
from tripod_sim import SceneError, Simulation, load_scene

FREE = ["springs.fixed_corners=[]", "springs.nodes=8"]


def tumbling(words: list[str]) -> Simulation:
    """A cloth in the air with random velocities."""
    simulation = Simulation(load_scene("cloth", [*FREE, *words]))
    rng = np.random.default_rng(0)
    simulation.state.velocities[:] = rng.standard_normal(simulation.positions.shape)
    return simulation


def momenta(simulation: Simulation) -> tuple[np.ndarray, np.ndarray]:
    m, x, v = simulation.mesh.mass, simulation.positions, simulation.state.velocities
    return m @ v, np.cross(x, m[:, None] * v).sum(axis=0)


SCHEMES = ("implicit_euler", "bdf2", "tr_bdf2", "semi_implicit_euler", "explicit_euler", "rk4")


@pytest.mark.parametrize("scheme", SCHEMES)
def test_momentum_is_what_gravity_gives(scheme: str) -> None:
    steps = 5 if scheme == "explicit_euler" else 100  # before what is unstable outgrows rounding
    simulation = tumbling([f"inertia.scheme={scheme}", "solver.tolerance=1e-12", "dt=0.002"])
    start, _ = momenta(simulation)
    simulation.advance(steps)
    end, _ = momenta(simulation)
    gained = simulation.mesh.mass.sum() * np.array([0, 0, -9.81]) * 0.002 * steps
    np.testing.assert_allclose(end, start + gained, atol=1e-12)


@pytest.mark.parametrize(
    ("scheme", "loss"), [("semi_implicit_euler", 1e-12), ("rk4", 1e-5), ("tr_bdf2", 1e-2)]
)
def test_angular_momentum_is_kept(scheme: str, loss: float) -> None:
    """Exactly by the semi-implicit scheme, to their order by the others; springs and dampers pull along themselves."""
    simulation = tumbling([f"inertia.scheme={scheme}", "gravity=off", "solver.tolerance=1e-12", "dt=0.001"])
    start = momenta(simulation)[1]
    simulation.advance(100)
    np.testing.assert_allclose(momenta(simulation)[1], start, atol=loss * np.linalg.norm(start))
    assert np.linalg.norm(start) > 1e-3


@pytest.mark.parametrize("scheme", SCHEMES)
def test_free_fall_is_exact(scheme: str) -> None:
    """An unstrained cloth falls as a point does by the same scheme: by g t² / 2 and the scheme's own error."""
    h, n = 0.01, 30
    words = [*FREE, f"inertia={{scheme='{scheme}', substeps='off'}}", f"dt={h}", "solver.tolerance=1e-13"]
    simulation = Simulation(
        load_scene("cloth", [*words, "springs.node_mass=0.1", "springs.stiffness=100", "springs.shear=0"])
    )
    simulation.advance(n)
    t = n * h
    fallen = simulation.positions[:, 2]
    assert np.ptp(fallen) < 1e-12
    # of first order an error of h t / 2; of second order that of the first step alone, which is implicit Euler's
    own = {"implicit_euler": -h * t / 2, "semi_implicit_euler": -h * t / 2, "explicit_euler": h * t / 2, "rk4": 0.0,
           "bdf2": -0.75 * h * h, "tr_bdf2": -0.5 * h * h}[scheme]  # fmt: skip
    assert fallen.mean() == pytest.approx(9.81 * (own - t * t / 2), abs=1e-9)
    assert simulation.state.velocities[:, 2] == pytest.approx(-9.81 * t, abs=1e-9)


def total(simulation: Simulation) -> float:
    e = simulation.energies()
    return e.kinetic + e.strain + e.gravity


def test_the_energy_budget_closes() -> None:
    """What the dampers take is what is missing: work of the damping forces integrated along the motion."""
    words = [
        "springs.nodes=8",
        "springs.compressed=push",
        "inertia={scheme='rk4', substeps='off'}",
        "springs.damping=0.5",
        "springs.node_mass=0.02",
        "dt=2e-5",
    ]
    simulation = Simulation(load_scene("cloth", words))
    body = simulation.mesh
    i, j = body.ends.T

    def power() -> float:
        d = simulation.positions[j] - simulation.positions[i]
        n = d / np.linalg.norm(d, axis=1)[:, None]
        w = simulation.state.velocities[j] - simulation.state.velocities[i]
        return float(body.damping @ ((n * w).sum(axis=1) ** 2))

    start, taken, before = total(simulation), 0.0, power()
    for _ in range(3000):
        simulation.advance(5)
        now = power()
        taken += 0.5 * (before + now) * 5 * 2e-5
        before = now
    assert taken > 1e-3
    assert total(simulation) - start == pytest.approx(-taken, rel=1e-4)


@pytest.mark.parametrize("compressed", ["push", "slack"])
@pytest.mark.parametrize("scheme", ["implicit_euler"])
def test_the_energy_of_the_cloth_never_grows(compressed: str, scheme: str) -> None:
    simulation = Simulation(
        load_scene(
            "cloth", ["springs.nodes=12", f"springs.compressed={compressed}", f"inertia.scheme={scheme}"]
        )
    )
    before = total(simulation)
    for _ in range(100):
        simulation.step()
        now = total(simulation)
        assert now <= before + 1e-9
        before = now
    assert before < -0.01


@pytest.mark.parametrize("compressed", ["push", "slack"])
def test_a_hanging_cloth_comes_to_rest_in_the_static_shape(compressed: str) -> None:
    words = ["springs.nodes=8", f"springs.compressed={compressed}", "solver.tolerance=1e-11", "springs.bending=20",
             "springs.node_mass=0.01"]  # fmt: skip
    moving = Simulation(load_scene("cloth", [*words, "damping={mass=4.0, stiffness=0.01}"]))
    moving.advance(8000)
    assert moving.energies().kinetic < 1e-14
    static = Simulation(load_scene("cloth", [*words, "inertia=off"]))
    if compressed == "push":  # it folds in one of many ways
        static.state.positions[:] = moving.positions + 1e-4
        static.state.positions[moving.mesh.fixed] = moving.positions[moving.mesh.fixed]
    assert static.step().residual <= 1e-11 + static.system.rounding(static.state)
    assert static.system.rounding(static.state) < 1e-10
    assert static.positions[:, 2].min() < -0.8
    np.testing.assert_allclose(moving.positions, static.positions, atol=1e-6)


def test_static_equilibrium_balances_the_weight_in_every_node() -> None:
    static = Simulation(load_scene("cloth", ["springs.nodes=10", "inertia=off", "solver.tolerance=1e-10"]))
    static.step()
    body, x = static.mesh, static.positions
    force = np.zeros_like(x)
    force[:, 2] = -9.81 * body.mass
    for (i, j), rest, k in zip(body.ends, body.rest_length, body.stiffness, strict=True):
        d = x[j] - x[i]
        length = np.linalg.norm(d)
        pull = k * max(0.0, length - rest) * d / length
        force[i] += pull
        force[j] -= pull
    assert np.abs(force[body.free]).max() < 1e-9
    assert force[body.fixed].sum(axis=0) == pytest.approx([0, 0, -9.81 * body.mass.sum()], abs=1e-8)


@pytest.mark.parametrize("n", sampled([5, 16, 32], 5, 16))
def test_the_result_does_not_depend_on_the_linear_solver(n: int) -> None:
    """Of slack springs: their potential is convex, so that nothing buckles; compressed springs multiply rounding."""
    ends = []
    for linear in ("ldl", "cg"):
        words = [f"springs.nodes={n}", f"solver.linear={linear}", "dt=0.04", "solver.tolerance=1e-9"]  # fmt: skip
        simulation = Simulation(load_scene("cloth", words))
        simulation.advance(25)
        ends.append(simulation.positions.copy())
    assert ends[0][:, 2].min() < -0.3
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)


@pytest.mark.parametrize("linear", ["ldl", "cg"])
def test_a_step_of_one_solve_is_the_linear_equation_of_implicit_euler(linear: str) -> None:
    """((1 + h a) M + h² K + h C) dv = h (f - a M v - (h K + C) v), K = - df/dx here by differences of the force.

    C is the sum of b k n n^T over the springs.
    """
    a, b, h = 0.3, 0.02, 0.01
    words = [f"solver.linear={linear}", "solver.linear_tolerance=1e-12", "solver.mode=one_solve", "springs.nodes=4",
             "springs.damping=0",
             f"damping={{mass={a}, stiffness={b}}}", f"dt={h}", "inertia.scheme=implicit_euler"]  # fmt: skip
    simulation = Simulation(load_scene("cloth", words))
    body = net_of(simulation.scene)
    state, rng = simulation.state, np.random.default_rng(7)
    x = 1.3 * body.nodes + 0.01 * rng.standard_normal(body.nodes.shape)  # every spring stretched
    v = np.where(np.isin(np.arange(len(x)), body.free)[:, None], rng.standard_normal(x.shape), 0.0)
    state.positions[:], state.velocities[:] = x, v
    i, j = body.ends.T
    assert (np.linalg.norm(x[j] - x[i], axis=1) > body.rest_length).all()

    def pulls(y: np.ndarray) -> np.ndarray:
        d = y[j] - y[i]
        length = np.linalg.norm(d, axis=1, keepdims=True)
        pull = body.stiffness[:, None] * (length - body.rest_length[:, None]) * d / length
        force = np.zeros_like(y)
        np.add.at(force, i, pull)
        np.add.at(force, j, -pull)
        return force

    free = (3 * body.free[:, None] + np.arange(3)).ravel()
    K, step = np.zeros((len(free), len(free))), 1e-6
    for column, dof in enumerate(free):
        e = np.zeros(x.size)
        e[dof] = step
        e = e.reshape(x.shape)
        K[:, column] = -(pulls(x + e) - pulls(x - e)).ravel()[free] / (2 * step)
    M = np.repeat(body.mass, 3)[free]
    force = pulls(x).ravel()[free] + M * np.tile([0.0, 0.0, -9.81], len(body.free))
    u = v.ravel()[free]
    n = (x[j] - x[i]) / np.linalg.norm(x[j] - x[i], axis=1, keepdims=True)
    rows = np.zeros((len(n), *x.shape))
    rows[np.arange(len(n)), j], rows[np.arange(len(n)), i] = n, -n
    rows = rows.reshape(len(n), -1)[:, free]
    C = b * rows.T @ (body.stiffness[:, None] * rows)
    dv = np.linalg.solve(
        (1 + h * a) * np.diag(M) + h * (h * K + C), h * (force - a * M * u - (h * K + C) @ u)
    )
    report = simulation.step()
    assert report.iterations == 1
    np.testing.assert_allclose(state.velocities.ravel()[free], u + dv, atol=1e-7 * np.abs(u).max())
    np.testing.assert_allclose(state.positions - x, h * state.velocities, atol=1e-12)


@pytest.mark.parametrize(("scheme", "solves"), [("implicit_euler", 1), ("bdf2", 1), ("tr_bdf2", 2)])
def test_one_solve_a_stage_stays_beside_the_solution_of_the_stage(scheme: str, solves: int) -> None:
    """A factorisation kept from earlier steps put the free end of the chain 0.1 to 1 m off, or out of the picture."""
    for dt, steps in ((0.005, 400), (0.01, 200)):
        words = [f"inertia.scheme={scheme}", f"dt={dt}"]
        solved, quick = (
            Simulation(load_scene("pendulum", [*words, f"solver.mode={mode}"]))
            for mode in ("newton", "one_solve")
        )
        solved.advance(steps)
        assert quick.advance(steps).iterations <= 1.05 * solves * steps
        assert np.abs(quick.positions - solved.positions).max() < 0.04  # a fiftieth of its length


def test_the_error_of_one_solve_falls_with_the_step_like_that_of_the_scheme() -> None:
    errors = []
    for steps in (100, 200, 400):
        words = ["inertia.scheme=tr_bdf2", f"dt={0.4 / steps}", "solver.tolerance=1e-10"]
        solved, quick = (
            Simulation(load_scene("pendulum", [*words, f"solver.mode={mode}"]))
            for mode in ("newton", "one_solve")
        )
        solved.advance(steps)
        quick.advance(steps)
        errors.append(np.abs(quick.positions - solved.positions).max())
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) > 1.7).all()


@pytest.mark.parametrize(
    "words", [["inertia.scheme=semi_implicit_euler"], ["solver.linear=ldl"], ["solver.linear=cg"]]
)
def test_a_steady_step_allocates_no_growing_memory(words: list[str]) -> None:
    simulation = Simulation(load_scene("cloth", ["springs.nodes=8", *words]))
    grown = kept(lambda _: simulation.step(), range(200), warm_up=100)
    assert grown < 20_000  # an array of the nodes in each step would be 150,000 bytes


def test_many_steps_of_a_solid_are_those_of_single_steps() -> None:
    simulation = Simulation(load_scene("silicone", ["mesh.level=1"]))
    report = simulation.advance(5)
    end = simulation.positions.tobytes()
    simulation.reset()
    singles = [simulation.step() for _ in range(5)]
    assert simulation.positions.tobytes() == end
    assert report.iterations == sum(r.iterations for r in singles)
    assert report.parts == 5
    with raises_naming(SceneError, "steps is 0", "whole number", "at least 1"):
        simulation.advance(0)


def test_a_cloth_of_slack_springs_forgets_a_billionth_of_a_metre() -> None:
    """Dampers act on slack springs, too: where they did not, 1e-12 m at the start became 0.5 mm in half a second."""
    ends = []
    for size in (0.0, 1e-9):
        simulation = Simulation(load_scene("cloth", ["springs.nodes=12", "inertia.scheme=rk4", "dt=1e-3"]))
        assert simulation.scene.springs
        assert simulation.scene.springs.compressed == "slack"
        rng = np.random.default_rng(1)
        simulation.state.positions[20:100] += size * rng.standard_normal((80, 3))
        simulation.advance(500)
        ends.append(simulation.positions.copy())
    assert np.abs(ends[1] - ends[0]).max() < 1e-6
