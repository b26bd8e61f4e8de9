"""The damper of a solid at a point: a viscous stress in proportion to the rate of Green's strain.

With E = (F^T F - 1) / 2, of which rigid motions change nothing, and A = dE/dt, the second Piola-Kirchhoff stress is
S = b C_0 : A, C_0 the law's tangent undeformed (Kelvin and Voigt's solid),

    S = (l tr A + kappa v) 1 + 2 mu A,   P = F S,

times b; v is the mean of tr A over the element where it has mean dilatation, and l = lambda - kappa; else kappa is
zero. In an implicit stage A = (E - E_q) / s, E_q made of earlier E as the scheme makes its known values of earlier
ones, and P is the gradient of s/2 A : S. Its tangent has a part F C_0 F, and one of S alone, which is not positive
where S is not.

An element that is inside out at a point has no damper in the stage: E is that of its mirror image, too, so that a
damper would hold it there. It is noticed where the stiffness is written, and D, which is never negative, falls by it.

Strains are stored as xx, yy, zz, xy, yz, zx.
"""

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.materials.spectral import keep_positive


@njit(cache=True, error_model="numpy", inline="always")
def switch_off(before: Array) -> None:
    """Let an element have no damper until its next stage; before: its E_q, shape (q, 6)."""
    before[0, 0] = np.nan


@njit(cache=True, error_model="numpy", inline="always")
def damps(before: Array) -> bool:
    """Return whether an element has a damper in this stage."""
    return not np.isnan(before[0, 0])


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def strain_rate(F: Array, rate: float, before: Array, strain: Array, A: Array) -> None:
    """Write E to `strain` (6,), and A = rate (E - E_q), E_q = `before`; rate: 1 / s [1/s]."""
    strain[0] = 0.5 * (F[0, 0] * F[0, 0] + F[1, 0] * F[1, 0] + F[2, 0] * F[2, 0] - 1.0)
    strain[1] = 0.5 * (F[0, 1] * F[0, 1] + F[1, 1] * F[1, 1] + F[2, 1] * F[2, 1] - 1.0)
    strain[2] = 0.5 * (F[0, 2] * F[0, 2] + F[1, 2] * F[1, 2] + F[2, 2] * F[2, 2] - 1.0)
    strain[3] = 0.5 * (F[0, 0] * F[0, 1] + F[1, 0] * F[1, 1] + F[2, 0] * F[2, 1])
    strain[4] = 0.5 * (F[0, 1] * F[0, 2] + F[1, 1] * F[1, 2] + F[2, 1] * F[2, 2])
    strain[5] = 0.5 * (F[0, 2] * F[0, 0] + F[1, 2] * F[1, 0] + F[2, 2] * F[2, 0])
    A[0, 0], A[1, 1], A[2, 2] = (
        rate * (strain[0] - before[0]),
        rate * (strain[1] - before[1]),
        rate * (strain[2] - before[2]),
    )
    A[0, 1] = A[1, 0] = rate * (strain[3] - before[3])
    A[1, 2] = A[2, 1] = rate * (strain[4] - before[4])
    A[0, 2] = A[2, 0] = rate * (strain[5] - before[5])


@njit(cache=True, error_model="numpy", inline="always")
def volume_rate(F: Array, rate: float, before: Array) -> float:
    """Return tr A as `strain_rate` writes A."""
    total = -3.0
    for i in range(3):
        for j in range(3):
            total += F[i, j] * F[i, j]
    return rate * (0.5 * total - before[0] - before[1] - before[2])


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def damper_stress(F: Array, A: Array, viscosity: Array, swelling: float, P: Array) -> float:
    """Write P [Pa] and return A : S [W/m³]; viscosity: b (l, mu, kappa) [Pa s]; swelling: b kappa v [Pa]."""
    two, pressure = 2.0 * viscosity[1], viscosity[0] * (A[0, 0] + A[1, 1] + A[2, 2]) + swelling
    power = 0.0
    for j in range(3):
        s0, s1, s2 = two * A[0, j], two * A[1, j], two * A[2, j]
        if j == 0:
            s0 += pressure
        elif j == 1:
            s1 += pressure
        else:
            s2 += pressure
        power += s0 * A[0, j] + s1 * A[1, j] + s2 * A[2, j]
        for i in range(3):
            P[i, j] = F[i, 0] * s0 + F[i, 1] * s1 + F[i, 2] * s2
    return power


@njit(cache=True, error_model="numpy")
def add_damper_tangent(
    F: Array, rate: float, before: Array, viscosity: Array, swelling: float, project: bool, S: Array, C: Array
) -> None:
    """Add dP/dF at a constant v to C (9, 9), index 3 i + J, with `project` positive semi-definite; S is scratch."""
    lam, mu = rate * viscosity[0], rate * viscosity[1]
    strain = np.empty(6)
    strain_rate(F, rate, before, strain, S)
    pressure = viscosity[0] * (S[0, 0] + S[1, 1] + S[2, 2]) + swelling
    for i in range(3):
        for j in range(3):
            S[i, j] *= 2.0 * viscosity[1]
        S[i, i] += pressure
    if project:
        keep_positive(S)
        lam = max(lam, -2.0 / 3.0 * mu)
    for i in range(3):
        for k in range(3):
            product = mu * (F[i, 0] * F[k, 0] + F[i, 1] * F[k, 1] + F[i, 2] * F[k, 2])
            for j in range(3):
                for m in range(3):
                    entry = lam * F[i, j] * F[k, m] + mu * F[i, m] * F[k, j]
                    if j == m:
                        entry += product
                    if i == k:
                        entry += S[j, m]
                    C[3 * i + j, 3 * k + m] += entry


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"}, inline="always")
def add_swelling(w: float, F: Array, Ge: Array, out: Array) -> None:
    """Add w d(tr E)/dx of a point to `out`, shape (3, c)."""
    for i in range(3):
        for a in range(out.shape[1]):
            out[i, a] += w * (F[i, 0] * Ge[0, a] + F[i, 1] * Ge[1, a] + F[i, 2] * Ge[2, a])
