"""The error of the mesh in a motion: how it swings beyond that at rest; that of the steps in the same modes."""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from tests.tiers import sampled
from tripod_sim import Simulation, load_scene
from tripod_sim.integrators.time_error import ErrorTransport
from tripod_sim.linear.solver import LinearError
from tripod_sim.mesh_error import modal_error
from tripod_sim.mesh_error.modal_error import ModalError, propagator
from tripod_sim.mesh_error.modal_integration import ModalIntegration
from tripod_sim.mesh_error.modes import Modes
from tripod_study.summary.errors import effector_error

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


@pytest.mark.slow
def test_a_swinging_body_errs_by_less_than_both_errors_in_sum_and_as_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its mesh makes it faster, its steps make it slower."""
    told, apart, places, errors = [], [], [], []
    for swings in (True, False):
        own = pressed("mesh_error.share=1e6", "time_error={}")
        if not swings:
            monkeypatch.setattr(ModalError, "beyond", lambda _: np.zeros(3))
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


def test_from_one_estimate_on_the_error_follows_what_moves() -> None:
    """Only that at the start is made; then the inertia of the modes says how the error goes on."""
    each, first = pressed("mesh_error.share=1e6"), pressed("mesh_error.share=1e-9")
    told = []
    for joints in way(each.command)[:20]:
        reports = [simulation.step(joints).mesh_error for simulation in (each, first)]
        told.append([report.effector for report in reports if report])
    at_each, from_first = np.array(told).transpose(1, 0, 2)
    size = np.linalg.norm(at_each, axis=1).max()
    assert size > 1.5e-5
    assert np.linalg.norm(from_first - at_each, axis=1).max() < 0.35 * size


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
    assert pressed("mesh_error={}", *words)._mesh_error._modal_error is None  # type: ignore[union-attr]


def test_without_modes_the_error_at_rest_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise LinearError("did not converge")

    monkeypatch.setattr(modal_error, "modes", fails)
    simulation = pressed("mesh_error.share=1e6", "time_error={}")
    assert simulation.state.errors and simulation.state.errors.error.shape[2] == 3
    for joints in way(simulation.command)[:20]:
        simulation.step(joints)
    told, at_rest = simulation.report.mesh_error, simulation.mesh_error()
    assert told and at_rest and at_rest.distance > 1e-6
    assert told.effector == pytest.approx(at_rest.effector, abs=2e-6)


def test_modes_are_those_of_the_body_within_their_span_and_a_coarse_mesh_is_too_stiff_for_each() -> None:
    simulation = pressed("mesh_error={}")
    estimate = simulation._mesh_error
    assert estimate and estimate._modal_error
    swinging, system = estimate._modal_error, estimate._outside.system
    found, inertia = swinging.modes, swinging._inertia
    own = estimate._outside.placed(simulation.state)
    system.assemble(own, project=False)
    assert system.factor()
    for force, shape in zip(found.inert, found.shapes, strict=True):
        np.testing.assert_allclose(inertia @ shape, force, atol=1e-9 * np.abs(force).max())
    np.testing.assert_allclose(
        np.tensordot(found.shapes, found.inert, ((1, 2), (1, 2))), np.eye(len(found.squares)), atol=1e-9
    )

    def yielding(force: np.ndarray) -> np.ndarray:
        reduced, moved = np.zeros(system.unknowns), np.zeros_like(force)
        system.reduction.gradient(force.copy(), reduced, np.zeros_like(system.efforts))
        system.reduction.moves(system.linear.solve(reduced), system.lever, moved)
        return moved

    answers = np.array([yielding(force) for force in found.inert])
    within = np.tensordot(found.inert, answers, ((1, 2), (1, 2)))
    np.testing.assert_allclose(
        within * np.sqrt(np.outer(found.squares, found.squares)), np.eye(len(within)), atol=1e-6
    )
    assert (np.diff(found.squares) > 0.0).all()
    parallel = np.tensordot(found.inert, answers, ((1, 2), (1, 2))).diagonal() / np.sqrt(
        [np.vdot(answer, inertia @ answer) for answer in answers]
    )
    assert (parallel[:3] > 0.998).all(), "the lowest are modes of the whole body"
    effector = np.zeros_like(own.positions)
    effector[system.groups.rigid[0], 2] = 1.0
    moved = yielding(effector)
    np.testing.assert_allclose(
        np.tensordot(np.tensordot(found.inert, moved, ((1, 2), (0, 1))), found.shapes, 1), moved,
        atol=1e-6 * np.abs(moved).max(), err_msg="what the effector yields to a force is in the span",
    )  # fmt: skip
    softer = np.diag(swinging._change) * found.squares
    assert ((softer > 0.0) & (softer < 0.15)).all(), "by this part the richer mesh yields more"


@pytest.mark.parametrize("scheme", ["tr_bdf2", "bdf2", "implicit_euler"])
def test_the_error_of_the_steps_is_carried_in_the_modes_as_by_all_nodes(scheme: str) -> None:
    words = ("time_error={}", f"inertia.scheme={scheme}")
    few, all_nodes = pressed("mesh_error.share=1e-9", *words), pressed(*words)
    assert few.state.errors and few.state.errors.error.shape[2] == 1
    told, expected, largest = [], [], []
    for joints in way(few.command):
        one, other = few.step(joints).time_error, all_nodes.step(joints).time_error
        assert one and other and one.vector and other.vector
        assert one.effector == pytest.approx(np.linalg.norm(one.vector))
        told.append(one.vector)
        expected.append(other.vector)
        largest.append((one.largest, other.largest))
    np.testing.assert_array_equal(few.positions, all_nodes.positions)
    size = np.linalg.norm(expected, axis=1).max()
    ramp = RAMP + STILL
    assert np.linalg.norm(np.subtract(told, expected)[:ramp], axis=1).max() < 0.35 * size
    assert np.linalg.norm(told, axis=1).max() == pytest.approx(size, rel=0.25)
    assert np.max(largest, axis=0)[0] == pytest.approx(np.max(largest, axis=0)[1], rel=0.25)


def test_the_largest_error_is_that_of_the_node_that_the_modes_move_most() -> None:
    """Or of its mirror image, which moves as far but for rounding."""
    simulation = pressed("mesh_error.share=1e-9", "time_error={}")
    for joints in way(simulation.command)[:20]:
        simulation.step(joints)
    told, errors, estimate = simulation.report.time_error, simulation.state.errors, simulation._mesh_error
    assert told and errors and estimate and estimate._modal_error
    moves = np.linalg.norm(np.tensordot(errors.error[0][:, 0], estimate._modal_error.modes.shapes, 1), axis=1)
    assert moves[told.node] == pytest.approx(moves.max(), rel=1e-5)
    assert told.largest == pytest.approx(moves.max(), rel=1e-5)


def test_at_rest_no_error_of_the_steps_is_carried_and_a_reset_begins_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    simulation = pressed("mesh_error.share=1e-9", "time_error={}")
    stages: list[int] = []
    solve = ModalIntegration.stage

    def counted(self: ModalIntegration, *words: Any) -> None:
        stages.append(1)
        solve(self, *words)

    monkeypatch.setattr(ModalIntegration, "stage", counted)
    for _ in range(5):
        simulation.step()
    assert not stages
    first = [simulation.step(joints).time_error for joints in way(simulation.command)]
    assert len(stages) > STEPS
    for _ in range(1500):
        report = simulation.step().time_error
        assert report
        if report.largest == 0.0:
            break
    else:
        pytest.fail("the error does not vanish")
    assert first[-1] and first[-1].largest > 1e-8
    simulation.reset()
    for _ in range(5):
        simulation.step()
    again = [simulation.step(joints).time_error for joints in way(simulation.command)]
    assert again == first


@pytest.mark.parametrize("scheme", sampled(["tr_bdf2", "bdf2", "implicit_euler"], "tr_bdf2"))
def test_a_step_that_changes_nothing_is_left_out_and_nothing_is_told_otherwise(
    monkeypatch: pytest.MonkeyPatch, scheme: str
) -> None:
    looked: list[int] = []
    momenta, carry = Modes.momenta, modal_error.carry

    def counted(*words: Any) -> Any:
        looked.append(1)
        return momenta(*words)

    def never_still(*words: Any) -> bool:
        carry(*words)
        return False

    def told() -> list[Any]:
        simulation = pressed("mesh_error.share=1e-9", "time_error={}", f"inertia.scheme={scheme}")
        looked.clear()
        for _ in range(20):
            simulation.step()
        reports = [simulation.step(joints) for joints in way(simulation.command)]
        return [
            (r.time_error.vector, r.mesh_error.effector) for r in reports if r.time_error and r.mesh_error
        ]

    monkeypatch.setattr(Modes, "momenta", counted)
    left_out, few = told(), len(looked)
    monkeypatch.setattr(ErrorTransport, "rests", lambda *_: False)
    monkeypatch.setattr(modal_error, "carry", never_still)
    np.testing.assert_array_equal(left_out, told())
    assert few < len(looked) - 10
    assert np.abs(left_out).max() > 1e-5


def test_whether_a_step_is_left_out_depends_on_the_state_alone() -> None:
    simulation = pressed("mesh_error.share=1e-9", "time_error={}")
    for joints in way(simulation.command)[:20]:
        simulation.step(joints)
    assert simulation.state.errors
    moving, none = simulation.state.errors.copy(), np.zeros_like(simulation.state.velocities)
    simulation.reset()
    for _ in range(5):
        simulation.step()
    errors, before = simulation._parts.errors, moving.error.copy()
    assert isinstance(errors, ErrorTransport) and simulation.state.errors.still
    assert not errors.rests(moving, none, none, simulation.scene.dt)
    h = simulation.scene.dt
    errors.carry(moving, simulation.scene.inertia.integrator.stages(h, h), none, none, none, h)
    assert np.abs(moving.error - before).max() > 0.0 and errors.report(moving, np.nan).largest > 1e-7


def test_only_what_no_force_pushes_is_still() -> None:
    one, z, rate, force = np.ones((1, 3), np.float32), np.zeros(1), np.zeros(1), np.zeros(1)
    slow, fast = np.zeros((1, 3)), np.full((1, 3), 1e-3)
    told = [
        modal_error.carry(
            np.zeros(1, np.int64), one, velocities, fast.copy(), 0.5, np.full((1, 1), 1e-9),
            propagator(np.ones(1), np.zeros(1), 0.5), force, z, rate, 1e-7,
        )
        for velocities in (slow, fast)
    ]  # fmt: skip
    assert told == [False, True] and not z.any() and not rate.any()


@pytest.mark.parametrize("damping", [(0.0, 0.0), (3.0, 5e-4), (2000.0, 0.1)])
def test_modes_are_carried_as_exactly_as_their_equation_can_be(damping: tuple[float, float]) -> None:
    squares, h = np.array([1.0, 4e4, 2e5]), 0.002
    found = propagator(squares, damping[0] + damping[1] * squares, h)
    for k, square in enumerate(squares.tolist()):
        expected = expm(np.array([[0.0, 1.0], [-square, -damping[0] - damping[1] * square]]) * h)
        np.testing.assert_allclose(found[:, :, k], expected, rtol=1e-9, atol=1e-12)
