"""What a ball at rest presses with, and how that load goes along with what the ball lies on."""

import numpy as np

from tripod_host.arrays import FloatArray


def carried(arms: FloatArray, place: FloatArray, force: FloatArray) -> FloatArray:
    """Return forces on the points of a rigid body that stand for one `force` at `place`, fastened to the body.

    With a_i the points, r the place and F the force,

        f_i = α_i F,   α_i = 1/n + (a_i - ā) . M⁻¹ (r - ā),   M = Σ (a_i - ā)(a_i - ā)ᵀ,

    so that Σ α_i = 1 and Σ α_i a_i = r: however the body turns, the potential -Σ f_i . x_i of these dead loads is that
    of F at the point that r has gone to. Force, moment r x F and the change of that moment, the load's part of the
    stiffness, so are right together; a split that only has the right moment would not do.

    Args:
        arms: a_i from the body's centre [m], shape (n, 3), not all in one plane.
        place: r from the same centre [m], shape (3,).
        force: F [N], shape (3,).

    Returns:
        f_i [N], shape (n, 3).
    """
    middle = arms.mean(axis=0)
    out = arms - middle
    share = 1.0 / len(arms) + out @ np.linalg.solve(out.T @ out, place - middle)
    return np.asarray(share[:, None] * force)
