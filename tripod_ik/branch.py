"""On which branch a pose is, and how far from its end.

Two poses that meet the same tasks and cannot be reached from one another while these change smoothly have a fold
between them, where det(J) = 0; on either side of it det(J) has another sign. In the fold itself there is a direction in
which nothing moves the effector: who stands there exactly does not find out again.
"""

from collections.abc import Sequence
from math import sqrt

import numpy as np

from tripod_ik.state import LinearState
from tripod_ik.tasks import Task

FOLD = 1e-3
"""Poses whose `branch` is below this in size are too near to a fold to go to."""


def branch(state: LinearState, tasks: Sequence[Task]) -> float:
    """Return det(J) / (|J| / √n)ⁿ of the rows that count, -1 to 1, if they are n, as many as servos; else 0.

    |J| is the Frobenius norm, rows have their weights. Zero means that any branch is right.
    """
    found = [rows for task in tasks if task.distances((rows := task.rows(state)).error)]
    if not found or state.held:  # a cable that goes slack changes the sign, and is no fold
        return 0.0
    J = np.concatenate([(rows.weights[:, None] * rows.jacobian)[rows.weights > 0] for rows in found])
    n = J.shape[1]
    size = sqrt(float(np.vdot(J, J)) / n)
    return float(np.linalg.det(J / size)) if len(J) == n and size > 0 else 0.0


def is_beyond(now: float, start: float) -> bool:
    """Return whether a pose of `branch` value `now` has left the branch of one of value `start`, or nearly so."""
    side = float(np.sign(start))
    return now * side < min(FOLD, start * side)
