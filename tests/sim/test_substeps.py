"""The loop that divides steps: what it restores, and what its control hears."""

import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_sim.errors import StepError
from tripod_sim.integrators.integrator import Integrator
from tripod_sim.integrators.newton import NewtonError, NewtonReport
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.step_control import HalveOnFailure, StepControl, Substep
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.state import State


class Drift(Integrator):
    """Moves each node by the time that passes, and its history counts; fails where a substep is in `fails`.

    Where `jumps` it asks for a substep with history to be made again without.
    """

    jumps = False

    def __init__(self, *fails: int) -> None:
        self.fails, self.tried, self.history, self.kept = fails, list[float](), 0, 0
        self.truncated, self._jumped = list[float](), False

    def forget(self) -> None:
        self.history = 0

    def drop_history(self) -> None:
        self.history = 0

    def keep_history(self) -> None:
        self.kept = self.history

    def recall_history(self) -> None:
        self.history = self.kept

    def restarts(self) -> bool:
        return self._jumped

    def advance_truncated(self, state: State, joints: np.ndarray, h: float) -> NewtonReport:
        self.truncated.append(h)
        return self.advance(state, joints, h)

    def advance(self, state: State, joints: np.ndarray, h: float) -> NewtonReport:
        self.tried.append(h)
        state.positions += h
        state.joints[:] = joints
        if len(self.tried) in self.fails:
            raise NewtonError("on purpose")
        self._jumped = self.jumps and self.history > 0
        self.history = 0 if self._jumped else self.history + 1
        return NewtonReport(iterations=2, residual=h)


class Quarters(StepControl):
    """Four equal substeps; those numbered in `rejected` are rejected once."""

    rejects = True

    def __init__(self, *rejected: int) -> None:
        self._left, self.replaced = set(rejected), list[float]()

    def begin(self, state: State, move: np.ndarray, dt: float) -> None:
        self._done, self._dt = 0, dt

    def propose(self) -> Substep | None:
        return None if self._done == 4 else Substep((self._done + 1) / 4, self._dt / 4, 0.25)

    def shorten(self, spent: int) -> bool:
        return False

    def accepts(self, state: State, work: object) -> bool:
        if self._done in self._left:
            return False
        self._done += 1
        return True

    def replace(self, state: State) -> None:
        self.replaced.append(float(state.positions[0, 0]))
        self._left.remove(self._done)


def start() -> State:
    state = State.of_nodes(np.zeros((2, 3)), np.zeros(1))
    state.time, state.step = 1.0, 7
    return state


def test_a_failed_substep_is_halved_and_later_ones_grow_again() -> None:
    drift, state = Drift(1, 2), start()
    report = Substeps(drift, HalveOnFailure(4, 100)).step(state, np.array([1.0]), 0.8)
    np.testing.assert_allclose(drift.tried, [0.8, 0.4, 0.2, 0.2, 0.4])
    assert (report.parts, report.halvings, report.iterations) == (3, 2, 6)
    np.testing.assert_allclose(state.positions, 0.8)
    assert (state.time, state.step, state.joints[0]) == (1.8, 8, 1.0)


@pytest.mark.parametrize("fails", [(1, 2, 3, 6), (2, 4)])
def test_substeps_nest_and_only_the_shortest_may_be_truncated(fails: tuple[int, ...]) -> None:
    drift, state = Drift(*fails), start()
    substeps = Substeps(drift, HalveOnFailure(3))
    for end in (0.8, 1.6):
        substeps.step(state, np.array([1.0]), 0.8)
        np.testing.assert_allclose(state.positions, end)
    made, done = [h for k, h in enumerate(drift.tried, 1) if k not in fails], 0.0
    for h in made:
        assert done / h == pytest.approx(round(done / h)), "begins at a multiple of its length"
        done += h
    assert drift.truncated == [h for h in drift.tried if h == pytest.approx(0.1)]
    assert bool(drift.truncated) == (len(fails) == 4)


def test_a_substep_in_which_velocities_jump_is_made_again_from_where_it_began() -> None:
    drift, state = Drift(), start()
    drift.jumps = True
    report = Substeps(drift, Quarters()).step(state, np.array([1.0]), 0.8)
    assert (report.parts, report.iterations, len(drift.tried)) == (4, 8, 7)
    np.testing.assert_allclose(state.positions, 0.8)


@pytest.mark.parametrize("fails", [1, 3])
def test_a_step_that_is_given_up_leaves_its_start(fails: int) -> None:
    """Also where earlier substeps were accepted."""
    drift, state = Drift(*range(fails, 20)), start()
    with raises_naming(StepError, "step 8", "1 s", "on purpose"):
        Substeps(drift, Quarters()).step(state, np.array([1.0]), 0.8)
    assert len(drift.tried) == fails
    assert not state.positions.any() and not state.joints.any()
    assert (state.time, state.step, drift.history) == (1.0, 7, 0)


def test_a_rejected_substep_leaves_neither_state_nor_history() -> None:
    drift, state, control = Drift(), start(), Quarters(0, 2)
    report = Substeps(drift, control).step(state, np.array([1.0]), 0.8)
    assert (report.parts, report.rejected, drift.history) == (4, 2, 4)
    np.testing.assert_allclose(control.replaced, [0.0, 0.4])
    np.testing.assert_allclose(state.positions, 0.8)


def test_the_report_adds_work_and_keeps_the_last_residual() -> None:
    report = StepReport()
    report.add(NewtonReport(iterations=3, residual=1.0))
    report.add(StepReport(iterations=4, residual=2.0, dt_limit=0.5, parts=9))
    assert (report.iterations, report.residual, report.dt_limit, report.parts) == (7, 2.0, 0.5, 10)
