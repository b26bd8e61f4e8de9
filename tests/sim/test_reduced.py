"""The reduced model against the full one."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.checks import assert_symmetric
from tripod_sim import Simulation, load_scene
from tripod_sim.build import build
from tripod_sim.reduced import store
from tripod_sim.reduced.basis import Basis, free_rows
from tripod_sim.reduced.fit import rest_stiffness, static_lift
from tripod_sim.scene import Scene
from tripod_sim.system import System

SMALL = ["mesh.level=1", "reduced.samples=16"]
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
    "tr_bdf2, mass damping": ["inertia.scheme=tr_bdf2", "damping.mass=2.0"],
    "one solve": ["solver.mode=one_solve", "solver.share=1e-9"],
    "clamp": ["clamp={}"],
    "maze": ["maze={}"],
    "no gravity, no damping": ["gravity=off", "damping=off"],
    "tetrahedra": ["mesh.element=t4", "material.law=corotational"],
    "servos": ["servo_dynamics={}"],
    "static": ["inertia=off", "damping=off"],
}


@pytest.mark.parametrize("case", CASES)
def test_with_every_shape_it_is_the_full_model(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "stored_basis", whole_basis)
    options = ["solver.mode=newton", "solver.tolerance=1e-10", *AT_WORK, *CASES[case]]
    both = full(*options), full("reduced={}", *options)
    assert both[1].state.reduced is not None
    size = np.abs(both[0].positions - both[0].mesh.nodes).max()
    for k in range(8):
        goal = WORKING + np.array([0.03, -0.02, 0.01, -1e-4]) * min(k + 1, 6)
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


def test_residual_and_torques_are_the_gradient_of_the_potential_and_the_hessian_is_theirs() -> None:
    s = simulation("reduced.modes=8", *AT_WORK)
    system, rng = s._system, np.random.default_rng(3)
    start = s.state.reduced
    start.q += 1e-4 * rng.standard_normal(start.q.shape)
    n = system.unknowns
    d, turn = rng.standard_normal(n) * 1e-2, rng.standard_normal(3)
    d[6:] *= 0.1

    def at(h: float) -> tuple[float, np.ndarray]:
        out = start.copy()
        out.joints[:3] += h * turn
        modes = system.solid.rest_modes() * 0
        system.solid.forget()
        base = start.copy()
        system.move(base, h * d, modes, 1.0, out)
        out.modes[:] = start.modes
        phi = system.evaluate(out)
        return phi, np.append(system.residual, system.torques)

    system.forget()
    _, gradient = at(0.0)
    assert np.abs(gradient).max() > 1e-3
    along, h = np.append(d, turn), 1e-6
    slope = (at(h)[0] - at(-h)[0]) / (2 * h)
    assert slope == pytest.approx(gradient @ along, rel=1e-6)


def test_the_tangent_is_symmetric_and_positive_where_the_full_one_is() -> None:
    for options in ([], ["reduced.tolerance=0.05"]):
        s = simulation("reduced.modes=10", *AT_WORK, *options)
        system = s._static.system
        system.assemble(s.state, project=False)
        system.evaluate(s.state)
        assert system.factor()
        assert_symmetric(system.linear.matrix)
        assert np.linalg.eigvalsh(system.linear.matrix).min() > 0


# accuracy -------------------------------------------------------------------------------------------------------


def test_static_error_falls_with_the_number_of_modes() -> None:
    goals = held_out(4)
    reference = full(*STATIC, *AT_WORK)
    truth = []
    for goal in goals:
        reference.step(goal)
        truth.append((reference.positions.copy(), reference.effector.position, reference.torques.copy()))
    errors = []
    for modes in (4, 12, 30):
        s = simulation(f"reduced.modes={modes}", *STATIC, *AT_WORK)
        worst = np.zeros(3)
        for goal, (positions, effector, torques) in zip(goals, truth, strict=True):
            s.step(goal)
            off = (
                np.linalg.norm(s.positions - positions, axis=1).max(),
                np.linalg.norm(s.effector.position - effector),
            )
            worst = np.maximum(worst, [*off, np.abs(s.torques - torques).max()])
        errors.append(worst)
    errors = np.array(errors)
    assert (errors[1:] < errors[:-1]).all()
    assert (errors[-1] < 0.2 * errors[0]).all()
    assert errors[-1, 0] < 1e-4  # [m]: of moves of up to 10 mm
    assert errors[-1, 1] < 5e-5
