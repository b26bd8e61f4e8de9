"""The time in which motions are meant: as /clock passes where it is used, never back, never held up for ever."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from tripod_graph import motion_clock
from tripod_graph.motion_clock import JUMP, STALL, MotionClock


@dataclass
class Machine:
    """Both clocks of a node [s]."""

    steady: float = 100.0
    told: float = 0.0
    simulated: bool = True
    clock: MotionClock = field(init=False)

    def __post_init__(self) -> None:
        self.clock = MotionClock(self)

    def get_clock(self) -> "Machine":
        return self

    def now(self) -> SimpleNamespace:
        return SimpleNamespace(nanoseconds=round(1e9 * self.told))

    @property
    def ros_time_is_active(self) -> bool:
        return self.simulated

    def pass_by(self, steady: float, told: float) -> float:
        """Let time pass on both [s]; return how much that is for motions."""
        before = self.clock.at(self.steady)
        self.steady, self.told = self.steady + steady, self.told + told
        return self.clock.at(self.steady) - before


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    monkeypatch.setattr(motion_clock.time, "monotonic", lambda: 100.0)
    return Machine()


def test_without_a_simulated_clock_it_is_the_steady_one(machine: Machine) -> None:
    machine.simulated = False
    assert machine.clock.at(100.0) == 100.0
    assert machine.pass_by(0.25, 9.0) == pytest.approx(0.25)
    assert machine.clock.at(50.0) == machine.clock.at(100.0)  # steady, whatever the caller says
    assert not machine.clock.stalled


@pytest.mark.parametrize("factor", [0.1, 1.0, 8.0])
def test_it_passes_as_the_simulated_clock_does(machine: Machine, factor: float) -> None:
    assert sum(machine.pass_by(0.1, 0.1 * factor) for _ in range(20)) == pytest.approx(2.0 * factor)
    assert not machine.clock.stalled


def test_a_simulated_clock_that_is_set_moves_nothing(machine: Machine) -> None:
    machine.pass_by(0.1, 5.0 * JUMP)
    for jump in (1000.0, -1000.0):
        assert machine.pass_by(0.1, jump) == 0.0
        assert machine.pass_by(0.1, 0.1) == pytest.approx(0.1)


def test_a_clock_that_stands_still_is_told_and_time_goes_on_all_the_same(machine: Machine) -> None:
    machine.pass_by(0.1, 0.1)
    assert machine.pass_by(0.9 * STALL, 0.0) == 0.0
    assert not machine.clock.stalled
    machine.pass_by(0.2 * STALL, 0.0)
    assert machine.clock.stalled
    assert machine.pass_by(3.0, 0.0) == pytest.approx(3.0)
    assert machine.pass_by(0.1, 0.01) == pytest.approx(0.01)
    assert not machine.clock.stalled
