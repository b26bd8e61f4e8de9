"""Time that methods of single objects take, each without what the others below it take.

The methods are replaced on the objects themselves and put back afterwards: other simulations know nothing of it.
"""

from collections.abc import Callable
from time import perf_counter
from typing import Any

CALLS = 2000
"""Of the empty method that tells what timing itself costs."""


class Stopwatch:
    """Adds up exclusive times by stage; stage 0, the first one named, is what lies outside of all others.

    Attributes:
        stages: Their names.
        calls: Of each stage since `clear`.
    """

    def __init__(self, outside: str, clock: Callable[[], float] = perf_counter) -> None:
        self.stages, self._clock = [outside], clock
        self._raw, self.calls, self._made = [0.0], [0], [0]
        self._stack, self._mark = [0], 0.0
        self._wrapped: list[tuple[object, str]] = []
        self._within = self._around = 0.0

    def wrap(self, target: object, method: str, stage: str) -> None:
        """Count calls of `target.method` as `stage`; a method that is wrapped already stays as it is."""
        if method in getattr(target, "__dict__", {}):
            return
        number = self._number(stage)
        object.__setattr__(target, method, self._timed(getattr(target, method), number))
        self._wrapped.append((target, method))

    def unwrap(self) -> None:
        """Put every method back."""
        for target, method in self._wrapped:
            object.__delattr__(target, method)
        self._wrapped.clear()

    def measure_itself(self) -> None:
        """Find what the timing of a call costs, within the stage that is called and in the one that calls."""
        trial = Stopwatch("outside", self._clock)
        empty = _Empty()
        for _ in range(CALLS):
            empty.call()
        start = self._clock()
        for _ in range(CALLS):
            empty.call()
        bare = self._clock() - start
        trial.wrap(empty, "call", "inside")
        best = [float("inf"), float("inf")]
        for _ in range(5):
            trial.clear()
            start = self._clock()
            for _ in range(CALLS):
                empty.call()
            whole = self._clock() - start
            within = trial._raw[1]
            best = [min(best[0], within), min(best[1], whole - within - bare)]
        self._within, self._around = max(0.0, best[0] / CALLS), max(0.0, best[1] / CALLS)

    def clear(self) -> None:
        """Begin again."""
        n = len(self.stages)
        self._raw[:], self.calls[:], self._made[:] = [0.0] * n, [0] * n, [0] * n
        self._stack[:], self._mark = [0], self._clock()

    @property
    def times(self) -> list[float]:
        """Of each stage since `clear` [s], with what timing costs; of stage 0 that before the last timed call ended."""
        return list(self._raw)

    @property
    def costs(self) -> list[float]:
        """What timing cost in each stage since `clear` [s], as far as an empty method tells."""
        return [
            self._within * calls + self._around * made
            for calls, made in zip(self.calls, self._made, strict=True)
        ]

    def _number(self, stage: str) -> int:
        if stage not in self.stages:
            self.stages.append(stage)
            self._raw.append(0.0)
            self.calls.append(0)
            self._made.append(0)
        return self.stages.index(stage)

    def _timed(self, function: Callable[..., Any], stage: int) -> Callable[..., Any]:
        raw, calls, made, stack, clock = self._raw, self.calls, self._made, self._stack, self._clock

        def timed(*args: Any, **keywords: Any) -> Any:
            now = clock()
            outer = stack[-1]
            raw[outer] += now - self._mark
            made[outer] += 1
            calls[stage] += 1
            stack.append(stage)
            self._mark = now
            try:
                return function(*args, **keywords)
            finally:
                now = clock()
                raw[stage] += now - self._mark
                stack.pop()
                self._mark = now

        return timed


class _Empty:
    def call(self) -> None:
        """Do nothing."""
