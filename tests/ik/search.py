"""The closest pose within limits, found by looking everywhere: an independent answer to compare with.

A grid over all angles allowed, each pose from its neighbour, then SciPy's SLSQP from the best of them.
Unlike `tripod_ik` it has no linear program with slacks, no branch and no step of its own: it asks the model for poses.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from tripod_ik.arrays import FloatArray
from tripod_ik.model import Saved, StaticModel
from tripod_ik.state import LinearState

FEASIBLE = 1e-6
"""A constraint may be passed by so much of its size: SLSQP's own accuracy."""


@dataclass(frozen=True, eq=False)
class Limits:
    """Largest torque [N m], and smallest and largest corner of where the effector may be [m]."""

    torque: float = np.inf
    low: FloatArray | float = -np.inf
    high: FloatArray | float = np.inf

    def room(self, state: LinearState) -> tuple[FloatArray, FloatArray]:
        """Return what is left to each finite limit, positive inside, as a part of 0.1 N m or 10 mm; and d/dα of it."""
        n, p = len(state.angles), state.equilibrium
        low, high = np.broadcast_to(self.low, 3), np.broadcast_to(self.high, 3)
        most = np.full(n, self.torque)
        torque, place = [most - state.torques, most + state.torques], [p - low, high - p]
        left = np.concatenate([*(row / 0.1 for row in torque), *(row / 0.01 for row in place)])
        K, J = state.stiffness / 0.1, state.jacobian[:3] / 0.01
        rows, finite = np.concatenate([-K, K, J, -J]), np.isfinite(left)
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
        low, high = self.bounds

        def at(angles: FloatArray) -> LinearState:
            return self.model.move(np.clip(angles, low, high))

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
