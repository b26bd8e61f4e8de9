"""What the effector should do: each task gives its error, its Jacobian and its weights."""

from dataclasses import dataclass, field

import numpy as np

from tripod_ik.arrays import FloatArray, frozen
from tripod_ik.errors import IkError
from tripod_ik.state import LinearState


@dataclass(frozen=True, eq=False)
class PositionTask:
    """Bring the effector to `target`: three rows, error e = target - equilibrium position.

    Attributes:
        target: Position wanted [m], shape (3,), in the frame `world`.
        weights: S, how much each axis counts, shape (3,), not negative; an axis of weight 0 is free.
        curvature: How fast the Jacobian turns, |d²p/dα²| [m/rad²]. It damps the step by curvature · |S² e|,
            see `problem.build_ik`. Half of the true value still converges; less lets the command jump from
            side to side of an unreachable target, more slows the approach from afar. The simulated Tripod has
            0.014 in its working pose.
    """

    target: FloatArray
    weights: FloatArray = field(default_factory=lambda: np.ones(3))
    curvature: float = 0.03

    def __post_init__(self) -> None:
        object.__setattr__(self, "target", frozen("target", self.target, (3,)))
        object.__setattr__(self, "weights", frozen("weights", self.weights, (3,)))
        if self.weights.min() < 0 or self.weights.max() == 0:
            raise IkError(f"weights {self.weights.tolist()}: not negative, at least one positive")
        if not 0 <= self.curvature < np.inf:
            raise IkError(f"curvature is {self.curvature} m/rad²; it must be finite and not negative")

    def error(self, state: LinearState) -> FloatArray:
        """Return e = target - equilibrium position [m], shape (3,)."""
        return self.target - state.equilibrium

    def jacobian(self, state: LinearState) -> FloatArray:
        """Return J, the motion of the equilibrium with the angles [m/rad], shape (3, n)."""
        return state.jacobian[:3]

    def distance(self, error: FloatArray) -> float:
        """Return the length of `error`, shape (3,), over the axes that count [m]."""
        return float(np.linalg.norm(error[self.weights > 0]))
