"""The quickest way over the poses of an roadmap, several servos turning at once. Pure."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from tripod_host.arrays import FloatArray
from tripod_ik.model import MISSED, PART
from tripod_ik.snap_through import HURRY, LEAST_MARGIN, WITHIN
from tripod_ik.state import LinearState
from tripod_ik.tracker_settings import TrackerSettings

SPEED, TURN, LEAST = TrackerSettings.effector_speed, TrackerSettings.angle_speed, WITHIN * LEAST_MARGIN
"""Of the effector [m/s], of a servo [rad/s], and stability margin of which nothing may be left, where it is foretold
how long a way takes."""

DIGITS = 6
"""Of what is compared to choose one of several: what is equal but for rounding is so, and the first is taken."""

Numbers = NDArray[np.intp]


class Poses:
    """What is known of many poses, an array each.

    Attributes:
        angles: [rad], shape (N, s).
        places: Of the resting effector [m], shape (N, 3).
        stability_margin: ρ |ρ|, but no less than that of the softest pose, shape (N,).
        slopes: dρ²/dα [1/rad], shape (N, s).
    """

    def __init__(self, states: Sequence[LinearState]) -> None:
        self.angles = np.array([state.angles for state in states])
        self.places = np.array([state.equilibrium for state in states])
        rho = np.array([state.stability_margin for state in states])
        self.stability_margin = np.abs(rho) * rho
        self.slopes = 2 * np.abs(rho)[:, None] * np.array([state.stability_margin_slope for state in states])
        self.jacobians = np.array([state.jacobian[:3] for state in states])

    def misses(self, a: Numbers, b: Numbers) -> FloatArray:
        """Return how far moves of the effector are from what the Jacobians at both ends say [m], shape (k,)."""
        turns, moves = self.angles[b] - self.angles[a], self.places[b] - self.places[a]
        away = moves - 0.5 * np.einsum("kij,kj->ki", self.jacobians[a] + self.jacobians[b], turns)
        return np.asarray(np.linalg.norm(away, axis=1))

    def tolerated(self, a: Numbers, b: Numbers) -> FloatArray:
        """Return what may be missed in a smooth move [m], as `model.goes_on` has it, shape (k,)."""
        return np.asarray(MISSED + PART * np.linalg.norm(self.places[b] - self.places[a], axis=1))

    def durations(self, a: Numbers, b: Numbers) -> FloatArray:
        """Return about how long the straight ways from some poses to others take [s], shape (k,); `a` and `b`: (k,).

        No servo turns faster than `TURN`, the effector is not moved faster than `SPEED`, and what is left of ρ² is used
        up with the time constant `HURRY`; in between ρ² is least where its tangents at both ends meet.
        """
        turns = self.angles[b] - self.angles[a]
        first, last = self.stability_margin[a], self.stability_margin[b]
        fall, rise = (np.einsum("ki,ki->k", self.slopes[n], turns) for n in (a, b))
        least = np.minimum(first, last)
        part = (last - rise - first) / np.where(rise > fall, fall - rise, -1.0)
        dips = (fall < 0) & (rise > 0) & (part > 0) & (part < 1)
        least = np.where(dips, np.minimum(least, first + part * fall), least)
        first, least = (np.maximum(rho, LEAST_MARGIN**2) / LEAST**2 - 1.0 for rho in (first, least))
        move = np.linalg.norm(self.places[b] - self.places[a], axis=1) / SPEED
        longest: FloatArray = np.maximum.reduce([
            move, np.abs(turns).max(axis=1) / TURN, HURRY * np.log(first / least),
        ])  # fmt: skip
        return longest.round(DIGITS)


def time_of(states: Sequence[LinearState]) -> float:
    """Return about how long the way from the first to the last of some states takes [s]."""
    numbers = np.arange(len(states))
    return float(Poses(states).durations(numbers[:-1], numbers[1:]).sum())


def quickest(start: LinearState, end: LinearState) -> float:
    """Return the time [s] that any way from one state to another takes, at least."""
    move, turn = end.equilibrium - start.equilibrium, end.angles - start.angles
    return max(float(np.linalg.norm(move)) / SPEED, float(np.abs(turn).max()) / TURN)


class RoadmapPaths:
    """ShortestPaths between poses of a grid, by steps in which each servo turns by one cell or not at all.

    A step in which several turn is one where turning one after the other leads to the same pose in any order: there the
    sheet of equilibria has no end between them, as far as the grid tells.
    """

    def __init__(
        self,
        states: Sequence[LinearState],
        cells: Sequence[Sequence[int]],
        neighbours: Sequence[Collection[int]],
    ) -> None:
        """Make them.

        Args:
            states: The poses.
            cells: Their angles, in steps of the grid.
            neighbours: Poses that each one hangs together with by one step of one servo.
        """
        poses, places = Poses(states), np.array(cells)
        N, s = places.shape
        step = np.full((s, 3, N + 1), N)  # N: no pose
        for a, others in enumerate(neighbours):
            for b in others:
                move = places[b] - places[a]
                i = int(np.abs(move).argmax())
                step[i, move[i] + 1, a] = b
        ends: dict[tuple[int, ...], Numbers] = {(0,) * s: np.arange(N + 1)}
        for move in sorted(product((-1, 0, 1), repeat=s), key=lambda m: sum(map(abs, m)))[1:]:
            found = [step[i, move[i] + 1][ends[(*move[:i], 0, *move[i + 1 :])]] for i in range(s) if move[i]]
            ends[move] = np.where((np.array(found) == found[0]).all(axis=0), found[0], N)
        codes = [a * N + b for a, others in enumerate(neighbours) for b in others]
        for move, end in ends.items():
            if sum(map(abs, move)) > 1:
                there = np.flatnonzero(end[:N] < N)
                there = there[poses.misses(there, end[there]) <= poses.tolerated(there, end[there])]
                codes += (there * N + end[there]).tolist()
        rows, columns = np.divmod(np.unique(np.array(codes, dtype=np.intp)), N)
        times = poses.durations(rows, columns)
        self._times = csr_array((times, (rows, columns)), shape=(N, N))

    def steps(self) -> Numbers:
        """Return the poses that each step leads from and to, shape (k, 2)."""
        return np.transpose(self._times.nonzero())

    def ways(self, start: int, among: Collection[int]) -> "ShortestPaths":
        """Return the quickest ways from a pose to all of `among`, by these."""
        numbers = np.array(sorted(among))
        first = int(np.searchsorted(numbers, start))
        times, before = dijkstra(self._times[numbers][:, numbers], indices=first, return_predecessors=True)
        return ShortestPaths(numbers, times, before)


@dataclass(frozen=True, eq=False)
class ShortestPaths:
    """The quickest ways from a pose to others.

    Attributes:
        numbers: Of these poses, ascending, shape (N,).
        times: How long they take [s], infinite where there is none, shape (N,).
        before: Place in `numbers` of the pose before it on the way, shape (N,).
    """

    numbers: Numbers
    times: FloatArray
    before: NDArray[np.int32]

    def time(self, number: int) -> float:
        """Return how long the way to a pose takes [s]."""
        return float(self.times[np.searchsorted(self.numbers, number)])

    def to(self, number: int) -> list[int]:
        """Return the poses on the way to one that there is a way to, both ends included."""
        way = [int(np.searchsorted(self.numbers, number))]
        while self.before[way[-1]] >= 0:
            way.append(int(self.before[way[-1]]))
        return [int(self.numbers[n]) for n in reversed(way)]
