"""How long the substeps of a step are: what the loop of `substeps` asks.

A control proposes substeps one after the other until the step is done, hears of each whether it was solved, and may
reject one that was. Lengths are shares of the step; the loop alone saves and restores states.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

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
        last: Whether no shorter one will be tried: the integrator may then truncate it.
    """

    end: float
    length: float
    share: float
    last: bool = False


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


class Increments(NamedTuple):
    """How a move of the joints is divided in statics.

    Attributes:
        turns: Returns how far actuators go, as turns [rad], where `State.joints` change by its argument.
        max_turn: Largest servo move of an increment [rad].
        reach: Of an arm [m], sets the same for the slide.
    """

    turns: Callable[[FloatArray], FloatArray]
    max_turn: float
    reach: float

    def count(self, move: FloatArray) -> int:
        """Return the increments in which no servo moves farther than it may, for joints that move by `move`."""
        turns = self.turns(move)
        turn = max(float(turns.max(initial=0.0)), abs(float(move[len(turns)])) / self.reach)
        return max(1, int(np.ceil(turn / self.max_turn)))


class HalveOnFailure(StepControl):
    """Substeps are as long as they may be; one that fails is replaced by two of half the length, and so on.

    So substeps nest: their lengths recur, and factorisations serve many of them.
    """

    def __init__(self, max_halvings: int, max_iterations: int = 1) -> None:
        """`max_halvings`: the smallest substep is 2^-max_halvings of the largest; `max_iterations`: of one solve."""
        self._max_halvings, self._most_failed = max_halvings, MOST_FAILED * max_iterations

    def fewest(self, move: FloatArray) -> int:
        """Return how many substeps a step has at least, for joints that move by `move`, shape (s + 1,)."""
        return 1

    def halvings(self, move: FloatArray) -> int:
        """Return how often the largest of these may be halved."""
        return self._max_halvings

    def begin(self, state: State, move: FloatArray, dt: float) -> None:
        """Begin with the largest substep."""
        self._largest = self._size = 2 ** self.halvings(move)  # in units of the smallest
        self._units, self._dt = self.fewest(move) * self._largest, dt
        self._done, self._failed = 0, 0

    def propose(self) -> Substep | None:
        """Return the next substep."""
        done, units = self._done, self._units
        if done >= units:
            return None
        if done % self._largest:  # the other half of one that failed
            self._size = min(self._size, done & -done)
        share = self._size / units
        return Substep((done + self._size) / units, self._dt * share, share, self._size == 1)

    def shorten(self, spent: int) -> bool:
        """Halve, unless substeps are too short, or too much has been spent on those that failed."""
        self._failed += spent
        if self._size == 1 or self._failed >= self._most_failed:
            return False
        self._size //= 2
        return True

    def accepts(self, state: State, work: Work) -> bool:
        """Accept; the next substep is the other half of one that failed, or as long as it may be."""
        self._done, self._size = self._done + self._size, self._largest
        return True
