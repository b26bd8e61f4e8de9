"""The bound of the stretch of springs in every scheme: exact motion, order, other bodies beside it, chosen steps."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.messages import raises_naming
from tests.sim.implicit_schemes import IMPLICIT
from tests.sim.test_bodies import assert_nothing_passes
from tripod_sim import SceneError, Simulation, StepError, load_scene
from tripod_sim.forces.strain_bound import MARGIN, StrainBound
from tripod_sim.system import System

SCHEMES = (*IMPLICIT, "semi_implicit_euler", "rk4")

THREAD = ["springs={source='chain', nodes=2, size=1.0, node_mass=1.0, stiffness=0.0, fixed_corners=[0]}",
          "strain_limit.stretch=0.02", "damping=off"]  # fmt: skip
END = 0.6

HUNG = """
name = "hung"
dt = 0.001
[[body]]
name = "block"
[body.mesh]
source = "block"
corners = [[-0.01, -0.01, -0.02], [0.01, -0.01, -0.02], [0.01, 0.01, -0.02], [-0.01, 0.01, -0.02],
           [-0.01, -0.01, 0.0], [0.01, -0.01, 0.0], [0.01, 0.01, 0.0], [-0.01, 0.01, 0.0]]
cells = [2, 2, 2]
[body.material]
young = 250e3
density = 1070.0
[[body]]
name = "rope"
orientation = [0.0, -0.7071067811865476, 0.0, 0.7071067811865476]  # its X points up
[body.springs]
source = "chain"
nodes = 6
size = 0.1
node_mass = 1e-3
stiffness = 2.0
[[set]]
name = "end"
body = "rope"
low = [-0.001, -0.001, -0.001]
high = [0.001, 0.001, 0.001]
[[set]]
name = "top"
body = "rope"
low = [-0.001, -0.001, 0.099]
high = [0.001, 0.001, 0.101]
[[tie]]
set = "end"
to = "block"
[gravity]
[inertia]
[damping]
mass = 1.0
stiffness = 1e-4
[strain_limit]
stretch = 0.02
"""
"""A block that hangs on a rope far too soft for it."""
HELD = "[[fixed]]\nset = 'top'\n"
WEIGHT = 9.81 * (1070 * 8e-6 + 5e-3)


def hung(folder: Path, text: str, *words: str) -> Simulation:
    path = folder / "hung.toml"
    path.write_text(HUNG + text, encoding="utf-8")
    return Simulation(load_scene(path, words))


def bound_of(simulation: Simulation):  # type: ignore[no-untyped-def]
    system = simulation._system
    found = system.term(StrainBound) if isinstance(system, System) else None
    found = found or getattr(simulation._stepper, "_bound", None)
    assert found
    return found


def stretch(simulation: Simulation) -> float:
    """Largest elongation of a spring over that allowed."""
    bound, x = bound_of(simulation), simulation.state.positions
    length = np.linalg.norm(x[bound.elements[:, 1]] - x[bound.elements[:, 0]], axis=1)
    return float((length / bound.longest).max())


def thrown() -> np.ndarray:
    """Where a mass on a thread of length l is that begins at a distance of 1 m beside its end, exactly.

    It falls freely until the thread is taut, where the velocity along the thread ends, and then swings.
    """
    length = 1.02 * (1 - MARGIN)
    drop = np.sqrt(length**2 - 1)
    taut, speed = np.sqrt(2 * drop / 9.81), np.sqrt(2 * 9.81 * drop)
    angle = np.arctan2(-drop, 1.0)

    def rate(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -9.81 / length * np.cos(y[0])]

    turn = -speed * np.cos(angle) / length
    end = solve_ivp(rate, (taut, END), [angle, turn], rtol=1e-11, atol=1e-12).y[0, -1]
    return length * np.array([np.cos(end), 0.0, np.sin(end)])


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_mass_on_a_thread_swings_as_it_must_at_the_first_order(scheme: str) -> None:
    """The smaller the steps the nearer, and none of them is longer than the thread."""
    errors = []
    for dt in (4e-4, 6.25e-5):
        simulation = Simulation(load_scene("pendulum", [*THREAD, f"inertia.scheme={scheme}", f"dt={dt}"]))
        for _ in range(round(END / dt)):
            simulation.step()
        assert simulation.positions[1, 0] ** 2 + simulation.positions[1, 2] ** 2 <= 1.02**2
        errors.append(np.abs(simulation.positions[1] - thrown()).max())
    assert errors[1] < 3e-4
    assert np.log(errors[0] / errors[1]) / np.log(6.4) == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_block_on_a_rope_hangs_at_the_bound(scheme: str, tmp_path: Path) -> None:
    simulation = hung(tmp_path, HELD, f"inertia.scheme={scheme}", "damping.mass=60.0")
    worst = 0.0
    for _ in range(300):
        report = simulation.step()
        worst = max(worst, stretch(simulation))
        assert not report.grew_at
    assert 0.9999 < worst <= 1.0
    block = simulation.positions[simulation.mesh.bodies[0].nodes]  # type: ignore[union-attr]
    assert block[:, 2].max() == pytest.approx(-0.002, abs=2e-4)
    if scheme in IMPLICIT:  # then the tensions are those of the whole step
        links = bound_of(simulation).links
        tension = links.stiffness * (1.02 * 0.02 * (1 - MARGIN) - links.rest)
        own = 2.0 * 0.02 * 0.02  # what the springs themselves pull
        assert (tension + own)[0] == pytest.approx(WEIGHT - 9.81 * 4e-3, rel=1e-3)
        assert (tension + own)[-1] == pytest.approx(WEIGHT, rel=1e-3)


def test_all_schemes_meet_as_steps_shrink(tmp_path: Path) -> None:
    """The block swings aside on a rope that is all but taut: some solve the bound with the step, some after it."""
    words = ["gravity.acceleration=[3.0, 0.0, -9.81]", "strain_limit.stretch=1e-4"]

    def end(scheme: str, dt: float) -> np.ndarray:
        simulation = hung(tmp_path, HELD, *words, f"inertia.scheme={scheme}", f"dt={dt}")
        for _ in range(round(0.08 / dt)):
            simulation.step()
        return simulation.positions[simulation.mesh.bodies[0].nodes].copy()  # type: ignore[union-attr]

    reference, start = end("tr_bdf2", 2.5e-5), hung(tmp_path, HELD).positions
    assert np.abs(reference - start[: len(reference)]).max() > 4e-3
    for scheme in ("implicit_euler", "bdf2", "semi_implicit_euler"):
        errors = [np.abs(end(scheme, dt) - reference).max() for dt in (4e-4, 1e-4)]
        assert errors[1] < 2e-5
        assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("scheme", ["implicit_euler", "semi_implicit_euler"])
def test_a_rope_that_is_drawn_up_takes_the_block_along(scheme: str, tmp_path: Path) -> None:
    """What moves does work, through the bound too: an explicit scheme takes none of it for growth."""
    move = "[[prescribed]]\nset = 'top'\nmove = '0: 0,0,0; 0.4: 0,0,0.2'\n"
    simulation = hung(tmp_path, move, f"inertia.scheme={scheme}", "strain_limit.stretch=0.005")
    low = simulation.positions[:, 2].min()
    for _ in range(400):
        report = simulation.step()
        assert stretch(simulation) <= 1.0
    assert not report.grew_at
    assert simulation.positions[:, 2].min() - low == pytest.approx(0.2, abs=3e-3)


@pytest.mark.parametrize("scheme", ["semi_implicit_euler", "rk4"])
def test_a_block_and_its_rope_in_the_air_keep_their_momenta(scheme: str, tmp_path: Path) -> None:
    words = ["gravity=off", "damping=off", f"inertia.scheme={scheme}"]
    simulation = hung(tmp_path, "", *words)
    state, m = simulation.state, simulation._mass[:, None]
    state.velocities[:] = np.cross([0.0, 20.0, 5.0], state.positions)

    def momenta() -> np.ndarray:
        p = m * state.velocities
        return np.concatenate([p.sum(axis=0), np.cross(state.positions, p).sum(axis=0)])

    before, pulled = momenta(), 0
    for _ in range(60):
        pulled += simulation.step().iterations > 0
        assert stretch(simulation) <= 1.0
    assert pulled > 20
    np.testing.assert_allclose(momenta(), before, rtol=0, atol=1e-7 * np.abs(before).max())


def test_cloths_that_fall_on_each_other_keep_their_bound_and_pass_through_nothing() -> None:
    words = [
        f"body.{k}.springs.{word}"
        for k in (0, 1)
        for word in ("nodes=5", "node_mass=0.004", "stiffness=20.0")
    ]
    free = Simulation(load_scene("two_cloths", words))
    simulation = Simulation(load_scene("two_cloths", [*words, "strain_limit.stretch=0.02"]))
    ends, rest = bound_of(simulation).elements, bound_of(simulation).longest / 1.02
    longest = worst = 0.0
    for k in range(40):
        free.step()
        simulation.step()
        x = free.positions
        longest = max(longest, float((np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1) / rest).max()))
        worst = max(worst, stretch(simulation))
        if k % 8 == 0:
            assert_nothing_passes(simulation)
    assert longest > 1.05
    assert 0.999 < worst <= 1.0


def test_steps_that_are_chosen_come_nearer_the_less_they_may_add() -> None:
    errors, parts = [], []
    for tolerance in (1e-4, 1e-6):
        chosen = f"time_error={{steps='auto', tolerance={tolerance}}}"
        simulation, count = Simulation(load_scene("pendulum", [*THREAD, "dt=0.01", chosen])), 0
        for _ in range(round(END / 0.01)):
            count += simulation.step().parts
        errors.append(np.abs(simulation.positions[1] - thrown()).max())
        parts.append(count)
    assert errors[1] < 0.25 * errors[0] < 0.01
    assert 3 * parts[0] < parts[1] < 100 * parts[0]


def test_a_bound_that_cannot_be_met_ends_with_the_last_good_state(tmp_path: Path) -> None:
    away = "[[fixed]]\nlow = [-0.01, -0.01, -0.021]\nhigh = [0.01, 0.01, 0.001]\n"
    for scheme in ("implicit_euler", "semi_implicit_euler"):
        move = "[[prescribed]]\nset = 'top'\nmove = '0: 0,0,0; 0.1: 0,0,0.05'\n"
        simulation = hung(tmp_path, away + move, f"inertia.scheme={scheme}")
        with raises_naming(StepError, "strain_limit", "between nodes") as caught:
            for _ in range(100):
                before = simulation.positions.copy()
                simulation.step()
        assert "\n" not in str(caught.value)
        np.testing.assert_array_equal(simulation.positions, before)
        assert simulation.state.time < 0.02


@pytest.mark.parametrize("scheme", SCHEMES)
def test_where_every_spring_is_held_there_is_nothing_to_bound(scheme: str, tmp_path: Path) -> None:
    held = "[[set]]\nname = 'all of it'\nbody = 'rope'\n[[fixed]]\nset = 'all of it'\n"
    simulation = hung(tmp_path, held, "tie=off", f"inertia.scheme={scheme}")
    block, rope = simulation.positions[:, 2].min(), simulation.positions[-6:].copy()
    simulation.advance(3)
    assert simulation.positions[:, 2].min() < block
    np.testing.assert_array_equal(simulation.positions[-6:], rope)


@pytest.mark.parametrize("scheme", ["tr_bdf2", "semi_implicit_euler"])
def test_servos_move_beside_a_bound_and_the_static_body_has_none(scheme: str) -> None:
    words = [
        "contact=off",
        "body.0.springs.nodes=4",
        "body.0.springs.stiffness=1.0",
        f"inertia.scheme={scheme}",
        "dt=1e-3",
    ]
    simulation, free = (
        Simulation(load_scene("tripod_cloth", [*words, *more]))
        for more in (["strain_limit.stretch=0.01"], [])
    )
    np.testing.assert_allclose(simulation.compliance().w, free.compliance().w, rtol=1e-9, atol=1e-15)
    simulation.state.velocities[-1] = free.state.velocities[-1] = 2.0
    for k in range(10):
        joints = np.array([-2e-3 * (k + 1)] * 3 + [0.0])
        simulation.step(joints)
        free.step(joints)
        assert stretch(simulation) <= 1.0
    bound, x = bound_of(simulation), free.state.positions
    length = np.linalg.norm(x[bound.elements[:, 1]] - x[bound.elements[:, 0]], axis=1)
    assert (length / bound.longest).max() > 1.01


def test_a_bound_without_springs_is_refused() -> None:
    with raises_naming(SceneError, "strain_limit", "springs", "inertia"):
        load_scene("silicone", ["strain_limit={}"])
