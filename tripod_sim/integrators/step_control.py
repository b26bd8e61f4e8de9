"""How long the substeps of a step are: what the loop of `substeps` asks.

A control proposes substeps one after the other until the step is done, hears of each whether it was solved, and may
reject one that was. Lengths are shares of the step; the loop alone saves and restores states.
"""

import math
from abc import ABC, abstractmethod
from typing import NamedTuple, Protocol

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.report import StepReport
from tripod_sim.state import State

MOST_FAILED = 8
"""Substeps that fail may take together so many times the linear solves after which one is given up: substeps that can
be saved fail at once, where an element turns inside out, and others go on failing however short they are."""


class Substep(NamedTuple):
    """One of the parts into which a step is divided.

    Attributes:
        end: Share of the step at its end; 1 is the end of the step.
        length: [s].
        share: Of the step.
    """

    end: float
    length: float
    share: float


class Work(Protocol):
    """What advancing over one substep took: a `NewtonReport` or a `StepReport`."""

    iterations: int
    residual: float
    parts: int


class StepControl(ABC):
    """Chooses the substeps of one step after the other.

    Attributes:
        rejects: Whether a substep that was solved may be rejected: the scheme's history is saved only then.
        added: Largest error that a substep of this step added to the position of a node [m]; NaN where none is known.
    """

    rejects = False
    added = math.nan

    @abstractmethod
    def begin(self, state: State, move: FloatArray, dt: float) -> None:
        """Begin a step of `dt` [s] from `state`, in which the joints move by `move`, shape (s + 1,)."""

    @abstractmethod
    def propose(self) -> Substep | None:
        """Return the next substep; None once the step is done."""

    def prepare(self, state: State) -> None:  # noqa: B027 - few need it
        """Prepare the proposed substep, which begins at `state`."""

    @abstractmethod
    def shorten(self, spent: int) -> bool:
        """Choose shorter substeps after one failed, having spent so many linear solves; return False to give up."""

    @abstractmethod
    def accepts(self, state: State, work: Work) -> bool:
        """Return whether the substep that led to `state` is good enough; choose what follows it, or replaces it."""

    def replace(self, state: State) -> None:  # noqa: B027 - who accepts all replaces none
        """Choose what replaces a rejected substep; `state` is restored to where it began."""

    def finish(self, state: State, report: StepReport) -> None:  # noqa: B027 - few have something to add
        """Complete the report of a step that is done."""


class HalveOnFailure(StepControl):
    """Substeps are as long as they may be at first; one that fails is halved, and the next ones grow again."""

    def __init__(self, max_halvings: int, max_iterations: int = 1) -> None:
        """`max_halvings`: the smallest substep is 2^-max_halvings of the largest; `max_iterations`: of one solve."""
        self._max_halvings, self._most_failed = max_halvings, MOST_FAILED * max_iterations

    def largest(self, move: FloatArray) -> float:
        """Return the largest share of a step to try, for joints that move by `move`, shape (s + 1,)."""
        return 1.0

    def smallest(self, move: FloatArray) -> float:
        """Return the smallest share of a step to try."""
        return self.largest(move) * 0.5**self._max_halvings

    def begin(self, state: State, move: FloatArray, dt: float) -> None:
        """Begin with the largest substep."""
        self._first = self._size = self.largest(move)
        self._least, self._dt = self.smallest(move), dt
        self._done, self._end, self._failed, self._halved = 0.0, 0.0, 0, False

    def propose(self) -> Substep | None:
        """Return the next substep."""
        done = self._done
        if done >= 1.0:
            return None
        self._end = end = 1.0 if done + self._size > 1.0 - 1e-9 else done + self._size
        return Substep(end, self._dt if end - done == 1.0 else self._dt * (end - done), self._size)

    def shorten(self, spent: int) -> bool:
        """Halve, unless substeps are too short, or too much has been spent on those that failed."""
        self._failed += spent
        if self._size < 2 * self._least * 0.999 or self._failed >= self._most_failed:
            return False
        self._size *= 0.5
        self._halved = True
        return True

    def accepts(self, state: State, work: Work) -> bool:
        """Accept, and let substeps that were halved grow."""
        self._done = self._end
        self._size = min(self._first, self._size * 2 if self._halved else self._size)
        return True
