"""Factorisations of several lengths of a step at a time, for steps whose length changes up and down a ladder."""

from collections import OrderedDict

from tripod_sim.linear.solver import LinearSolver
from tripod_sim.system import System

MOST = 12
"""Factorisations kept; the one that was asked for longest ago makes room."""


class FactorStore:
    """Lets a system solve with the factorisation that belongs to a length, each in a linear solver of its own."""

    def __init__(self, system: System) -> None:
        """Begin with the system's own linear solver, which has factored nothing yet."""
        self._system = system
        self._solvers: OrderedDict[float, LinearSolver] = OrderedDict()
        self._good: set[float] = set()
        self._idle = [system.linear]

    def use(self, length: float) -> bool:
        """Let the system solve with what belongs to `length` [s]; return whether that is factored and was good.

        It counts as bad until `keep` says otherwise.
        """
        solver = self._solvers.pop(length, None)
        if solver is None:
            solver = self._idle.pop() if self._idle else self._spare()
        self._solvers[length] = self._system.linear = solver
        good = length in self._good
        self._good.discard(length)
        return good

    def keep(self, length: float) -> None:
        """Note that the factorisation of `length` [s] is good."""
        self._good.add(length)

    def forget(self) -> None:
        """Drop all factorisations."""
        self._good.clear()
        self._idle += self._solvers.values()
        self._solvers.clear()

    def _spare(self) -> LinearSolver:
        if len(self._solvers) < MOST:
            return self._system.another_linear()
        oldest, solver = self._solvers.popitem(last=False)
        self._good.discard(oldest)
        return solver
