"""On which branch a pose is.

Two poses that meet the same tasks and cannot be reached from one another while these change smoothly have a fold
between them, where det(J) = 0; on either side of it det(J) has another sign.
"""

from collections.abc import Sequence

import numpy as np

from tripod_ik.state import LinearState
from tripod_ik.tasks import Task


def branch(state: LinearState, tasks: Sequence[Task]) -> float:
    """Return the sign of det(J) of the rows that count, if they are as many as servos; else 0: any branch is right."""
    found = [rows for task in tasks if task.distances((rows := task.rows(state)).error)]
    if not found:
        return 0.0
    J = np.concatenate([rows.jacobian[rows.weights > 0] for rows in found])
    return float(np.sign(np.linalg.det(J))) if J.shape[0] == J.shape[1] else 0.0
