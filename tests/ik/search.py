"""The closest pose within limits, found by looking everywhere: an independent answer to compare with.

A grid over all angles allowed, each pose from its neighbour, then SciPy's SLSQP from the best of them. `Flood` has only
poses that the body comes to without a snap from where the model stands, and stays firm in.
Unlike `tripod_ik` it has no linear program with slacks, no branch and no step of its own: it asks the model for poses.
"""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from tripod_host.arrays import FloatArray
from tripod_ik.model import Saved, StaticModel
from tripod_ik.state import LinearState
from tripod_sim.errors import StepError
from tripod_sim.scene import Scene

FEASIBLE = 1e-6
"""A constraint may be passed by so much of its size: SLSQP's own accuracy."""

MET = 1e-6
"""Nothing closer to a target than this [m] is looked for."""


@dataclass(frozen=True, eq=False)
class Limits:
    """Largest torque [N m], smallest and largest corner of where the effector may be [m], least stability margin."""

    torque: float = np.inf
    low: FloatArray | float = -np.inf
    high: FloatArray | float = np.inf
    stability_margin: float = -np.inf

    def room(self, state: LinearState) -> tuple[FloatArray, FloatArray]:
        """Return what is left to each finite limit, positive inside, as a part of 0.1 N m or 10 mm, of stability
        margin as it is; and d/dα of it."""
        n, p = len(state.angles), state.equilibrium
        low, high = np.broadcast_to(self.low, 3), np.broadcast_to(self.high, 3)
        most = np.full(n, self.torque)
        torque, place = [most - state.efforts, most + state.efforts], [p - low, high - p]
        firm = [state.stability_margin - self.stability_margin]
        left = np.concatenate([*(row / 0.1 for row in torque), *(row / 0.01 for row in place), firm])
        K, J = state.stiffness / 0.1, state.jacobian[:3] / 0.01
        rows, finite = (
            np.concatenate([-K, K, J, -J, state.stability_margin_slope[None, :]]),
            np.isfinite(left),
        )
        return left[finite], rows[finite]


class Search:
    """All poses of a model with angles within [low, high] [rad], `count` of them an axis."""

    def __init__(self, model: StaticModel, low: float, high: float, count: int) -> None:
        self.model, self.bounds = model, (low, high)
        self.poses: list[tuple[LinearState, Saved]] = []
        axis = np.linspace(low, high, count)
        for i, a in enumerate(axis):
            for j, b in enumerate(axis[:: 1 if i % 2 == 0 else -1]):
                for c in axis[:: 1 if (i * count + j) % 2 == 0 else -1]:
                    self.poses.append((model.move(np.array([a, b, c])), model.save()))

    def closest(self, target: FloatArray, limits: Limits, starts: int = 3) -> tuple[float, FloatArray]:
        """Return the least distance [m] of the effector from `target` among poses within the limits, and its angles.

        Infinite if no pose is found within them.
        """
        missing = [np.minimum(limits.room(state)[0], 0.0).sum() for state, _ in self.poses]
        far = np.array([np.linalg.norm(state.equilibrium - target) for state, _ in self.poses])
        found = [
            (d, state.angles) for d, m, (state, _) in zip(far, missing, self.poses, strict=True) if m >= 0
        ]
        for i in np.argsort(far - 0.05 * np.array(missing))[: 4 * starts : 4]:
            self.model.restore(self.poses[i][1])
            distance = self.descend(target, limits)
            found.append((distance, self.model.angles))
        distance, angles = min(found, key=lambda pair: pair[0])
        return float(distance), angles

    def descend(self, target: FloatArray, limits: Limits) -> float:
        """Return the least distance [m] near the pose where the model stands; infinite if that is out of the limits."""
        state = self.model.state()
        at = self._at

        def distance(angles: FloatArray) -> tuple[float, FloatArray]:
            e = 1e3 * (at(angles).equilibrium - target)
            return 0.5 * float(e @ e), 1e3 * at(angles).jacobian[:3].T @ e

        found = minimize(
            distance,
            state.angles,
            jac=True,
            method="SLSQP",
            bounds=[self.bounds] * len(state.angles),
            constraints=[{
                "type": "ineq",
                "fun": lambda a: limits.room(at(a))[0],
                "jac": lambda a: limits.room(at(a))[1],
            }] if limits.room(state)[0].size else (),
            options={"ftol": 1e-14, "maxiter": 100},
        )  # fmt: skip
        end = at(found.x)
        if limits.room(end)[0].min(initial=0.0) < -FEASIBLE:
            return np.inf
        return float(np.linalg.norm(end.equilibrium - target))

    def _at(self, angles: FloatArray) -> LinearState:
        return self.model.move(np.clip(angles, *self.bounds))


class Flood(Search):
    """All poses within `limits` that hang together with the one where the model stands, on a grid about it.

    `within`: poses whose effector is farther from that one [m] are left out.
    """

    @staticmethod
    def model(scene: Scene, slide: float, angles: FloatArray) -> StaticModel:
        """Return a model that gives up early: what takes many iterations is no small step."""
        solver = replace(scene.solver, max_iterations=25, max_halvings=0)
        return StaticModel(replace(scene, solver=solver), slide, angles)

    def __init__(
        self,
        model: StaticModel,
        low: float,
        high: float,
        limits: Limits,
        *,
        spacing: float = 0.12,
        within: float = 0.018,
    ) -> None:
        centre = model.state().equilibrium
        self.model, self.bounds = model, (low, high)
        self.poses, origin = [(model.state(), model.save())], model.angles
        cells: dict[tuple[int, ...], list[LinearState]] = {(0, 0, 0): [model.state()]}
        todo = deque([((0, 0, 0), self.poses[0])])
        while todo:
            cell, (state, saved) = todo.popleft()
            for move in (*np.eye(3, dtype=int), *-np.eye(3, dtype=int)):
                there = tuple(int(i) for i in np.array(cell) + move)
                angles, known = origin + spacing * np.array(there), cells.setdefault(there, [])
                if angles.min() < low or angles.max() > high or any(_linked(state, other) for other in known):
                    continue
                model.restore(saved)
                try:
                    found = model.follow(angles, shortest=spacing / 8)
                except StepError:
                    continue
                new = all(np.abs(found.equilibrium - other.equilibrium).max() > 1e-4 for other in known)
                near = np.linalg.norm(found.equilibrium - centre) <= within
                if new and near and limits.room(found)[0].min() >= 0:
                    known.append(found)
                    self.poses.append((found, model.save()))
                    todo.append((there, self.poses[-1]))

    def closest(self, target: FloatArray, limits: Limits, starts: int = 6) -> tuple[float, FloatArray]:
        """Return the least distance [m] among these poses and those that SLSQP goes to from there, and its angles."""
        far = np.array([np.linalg.norm(state.equilibrium - target) for state, _ in self.poses])
        order = np.argsort(far)
        best, chosen = (float(far[order[0]]), self.poses[order[0]][0].angles), []
        for i in order:
            state, saved = self.poses[i]
            if len(chosen) == starts or best[0] < MET:
                break
            if any(
                np.abs(state.angles - other.angles).max() < 0.15
                and np.abs(state.equilibrium - other.equilibrium).max() < 0.005
                for other in chosen
            ):
                continue
            chosen.append(state)
            self.model.restore(saved)
            best = min(best, (self.descend(target, limits), self.model.angles), key=lambda pair: pair[0])
        return best

    def _at(self, angles: FloatArray) -> LinearState:
        """Return the state at `angles`; beyond a snap what the last one foretells, but far too soft."""
        wanted, before = np.clip(angles, *self.bounds), self.model.state()
        try:
            return self.model.follow(wanted)
        except StepError:
            offset = before.equilibrium_offset.copy()
            offset[:3] += before.jacobian[:3] @ (wanted - before.angles)
            return replace(before, angles=wanted, equilibrium_offset=offset, stability_margin=-1.0)


def _linked(state: LinearState, other: LinearState) -> bool:
    turn = other.angles - state.angles
    foretold = 0.5 * (state.jacobian[:3] + other.jacobian[:3]) @ turn
    return bool(np.linalg.norm(other.equilibrium - state.equilibrium - foretold) < 3e-4)
