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


def rolling_stiffness(corners: FloatArray, normal: FloatArray, radius: float, load: FloatArray) -> FloatArray:
    """Return the stiffness of the load of a ball that lies on one triangle, between the corners [N/m], shape (9, 9).

    The ball does not turn with the triangle: where that tilts by dn, the contact moves along it by -r dn, and the
    shares w_c of the corners, f_c = w_c F, change. With dn = -Σ ∇w_j (n . dx_j),

        K_cj = -df_c / dx_j = -r (∇w_c . ∇w_j) (F . n) n nᵀ,

    where of F only what is along n counts: a ball at rest leans hardly.

    Args:
        corners: [m], shape (3, 3).
        normal: n, from the triangle to the ball.
        radius: r [m].
        load: F on the triangle [N], shape (3,).
    """
    slopes = np.linalg.pinv(np.stack([corners[1] - corners[0], corners[2] - corners[0]], axis=1))
    slopes = np.stack([-slopes.sum(axis=0), *slopes])
    return -radius * float(load @ normal) * np.kron(slopes @ slopes.T, np.outer(normal, normal))
