"""The laws by name, and their compiled functions behind one call each.

A law is three functions of F: `energy`, `stress` (which also returns the energy) and `tangent`; see any of them. What
projects a tangent is common to all: `dilatation.spectral_tangent`.
"""

from typing import Final

from numba import njit

from tripod_host.arrays import Array
from tripod_sim.materials import corotational, dilatation, neo_hooke, st_venant_kirchhoff, stable_neo_hooke

LAWS: Final = {"neo_hooke": 0, "corotational": 1, "stable_neo_hooke": 2, "st_venant_kirchhoff": 3}
"""Number of each law in the compiled functions below."""

_e0, _e1, _e2, _e3 = (
    neo_hooke.energy,
    corotational.energy,
    stable_neo_hooke.energy,
    st_venant_kirchhoff.energy,
)
_s0, _s1, _s2, _s3 = (
    neo_hooke.stress,
    corotational.stress,
    stable_neo_hooke.stress,
    st_venant_kirchhoff.stress,
)
_t0, _t1, _t2, _t3 = (
    neo_hooke.tangent,
    corotational.tangent,
    stable_neo_hooke.tangent,
    st_venant_kirchhoff.tangent,
)
_spectral = dilatation.spectral_tangent


@njit(cache=True, error_model="numpy")
def energy(law: int, F: Array, lam: float, mu: float) -> float:
    """Return psi [J/m³]."""
    if law == 0:
        return _e0(F, lam, mu)
    if law == 1:
        return _e1(F, lam, mu)
    return _e2(F, lam, mu) if law == 2 else _e3(F, lam, mu)


@njit(cache=True, error_model="numpy")
def stress(law: int, F: Array, lam: float, mu: float, P: Array) -> float:
    """Write P [Pa] and return psi [J/m³]."""
    if law == 0:
        return _s0(F, lam, mu, P)
    if law == 1:
        return _s1(F, lam, mu, P)
    return _s2(F, lam, mu, P) if law == 2 else _s3(F, lam, mu, P)


@njit(cache=True, error_model="numpy")
def tangent(law: int, F: Array, lam: float, mu: float, project: bool, C: Array) -> None:
    """Write d²psi/dF², shape (9, 9), index 3 i + J; `project` lifts its negative eigenvalues to 1e-6 mu."""
    if law == 1:
        if not _t1(F, lam, mu, project, C):
            _spectral(law, F, lam, mu, project, C)
    elif project:
        _spectral(law, F, lam, mu, project, C)
    elif law == 0:
        _t0(F, lam, mu, C)
    elif law == 2:
        _t2(F, lam, mu, C)
    else:
        _t3(F, lam, mu, C)
