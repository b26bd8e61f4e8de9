"""The error of the mesh in a motion: how it swings beyond that at rest."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.sparse.linalg import ArpackError

from tripod_sim import Simulation, load_scene
from tripod_sim.figures.errors import effector_error
from tripod_sim.mesh_error import swing
from tripod_sim.mesh_error.swing import Swing, propagator

W = -1.4965
WORKING = (f"servos.angles=[{W},{W},{W}]", "servos.slide=0.035")
EXACT = ("mesh.level=9", "dt=0.0005", "solver.mode=newton", "solver.tolerance=1e-6")
STILL, RAMP, STEPS = 3, 28, 80
"""After as many steps at rest servo 0 turns by 0.5 rad in as many others; then the body swings."""


def pressed(*words: str) -> Simulation:
    return Simulation(load_scene("tripod", [*WORKING, *words]))


def way(start: np.ndarray, parts: int = 1) -> list[np.ndarray]:
    """The joints at the end of each part of each step."""
    shares = np.clip((np.arange(1, STEPS * parts + 1) / parts - STILL) / RAMP, 0.0, 1.0)
    return [start + share * np.array([-0.5, 0.0, 0.0, 0.0]) for share in shares]


def test_a_swinging_body_errs_by_less_than_both_errors_in_sum_and_as_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its mesh makes it faster, its steps make it slower."""
    told, apart, places, errors = [], [], [], []
    for swings in (True, False):
        own = pressed("mesh_error.share=1e6", "time_error={}")
        if not swings:
            monkeypatch.setattr(Swing, "beyond", lambda _: np.zeros(3))
        for joints in way(own.command):
            report = own.step(joints)
            assert report.mesh_error and report.time_error
            if swings:
                places.append(own.state.centres[0].copy())
                told.append(effector_error(report))
                apart.append(report.mesh_error.distance + report.time_error.effector)
            else:
                errors.append(effector_error(report))
    true = pressed(*EXACT)
    exact = []
    for joints in way(true.command, 4):
        true.step(joints)
        exact.append(true.state.centres[0].copy())
    misses = np.linalg.norm(np.array(exact[3::4]) - places, axis=1)
    assert 0.6 * misses.max() < max(told) < 1.6 * misses.max()
    assert max(apart) > 2.0 * misses.max()
    assert max(errors) > 1.3 * max(told)


def test_at_rest_nothing_swings() -> None:
    simulation = pressed("mesh_error.share=1e6")
    at_start = simulation.report.mesh_error
    for _ in range(20):
        report = simulation.step()
    assert at_start and report.mesh_error
    assert report.mesh_error.effector == pytest.approx(at_start.effector, abs=2e-7)


BALL = "rigid=[{shape='ball', radius=0.01, mass=0.01, position=[0, 0, 0.02]}]"


@pytest.mark.parametrize("words", [("inertia=off", "damping=off"), ("contact={}", BALL)])
def test_nothing_swings_where_nothing_moves_or_more_than_the_body_does(words: tuple[str, ...]) -> None:
    assert pressed("mesh_error={}", *words)._mesh_error._swing is None  # type: ignore[union-attr]


def test_without_modes_the_error_at_rest_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise ArpackError(-9999)

    monkeypatch.setattr(swing, "eigsh", fails)
    simulation = pressed("mesh_error.share=1e6")
    for joints in way(simulation.command)[:20]:
        simulation.step(joints)
    told, at_rest = simulation.report.mesh_error, simulation.mesh_error()
    assert told and at_rest and at_rest.distance > 1e-6
    assert told.effector == pytest.approx(at_rest.effector, abs=2e-6)


def test_modes_are_the_lowest_of_the_body_and_a_coarse_mesh_is_too_stiff_for_each() -> None:
    simulation = pressed("mesh_error={}")
    estimate = simulation._mesh_error
    assert estimate and estimate._swing
    found, system = estimate._swing, estimate._outside.system
    own = estimate._outside.placed(simulation.state)
    system.assemble(own, project=False)
    assert system.factor()
    squares, modes = found._lowest(system)
    assert (np.diff(squares) > -1e-3 * squares[0]).all()
    flat = modes.reshape(len(modes), -1)
    inert = (found._inertia @ modes.transpose(1, 0, 2).reshape(len(own.positions), -1)).reshape(
        -1, len(modes), 3
    )
    inert = inert.transpose(1, 0, 2).reshape(len(modes), -1)
    np.testing.assert_allclose(inert @ flat.T, np.eye(len(modes)), atol=1e-9)
    for square, mode, force in zip(squares, modes, inert, strict=True):
        reduced, moved = np.zeros(system.unknowns), np.zeros_like(mode)
        system.reduction.gradient(force.reshape(-1, 3), reduced, np.zeros_like(system.torques))
        system.reduction.moves(system.linear.solve(reduced), system.lever, moved)
        np.testing.assert_allclose(moved * square, mode, atol=1e-4 * np.abs(mode).max())
    softer = np.diag(found._change) * squares
    assert ((softer > 0.0) & (softer < 0.1)).all(), "by this part the richer mesh yields more"


@pytest.mark.parametrize("damping", [(0.0, 0.0), (3.0, 5e-4), (2000.0, 0.1)])
def test_modes_are_carried_as_exactly_as_their_equation_can_be(damping: tuple[float, float]) -> None:
    squares, h = np.array([1.0, 4e4, 2e5]), 0.002
    found = propagator(squares, damping, h)
    for k, square in enumerate(squares.tolist()):
        expected = expm(np.array([[0.0, 1.0], [-square, -damping[0] - damping[1] * square]]) * h)
        np.testing.assert_allclose(found[:, :, k], expected, rtol=1e-9, atol=1e-12)
