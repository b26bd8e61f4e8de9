"""Compiled forces on the nodes of a solid in motion, its incompatible modes in equilibrium."""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from tripod_sim.forces.rate_kernels import add_solid_rates
from tripod_sim.forces.solid_arrays import SolidArrays
from tripod_sim.forces.solid_kernels import add_element_products, solid_gradient, update_modes

Array = Any

BALANCED = 1e-6
"""Unbalanced force of incompatible modes, as a share of the nodes', at which they are in equilibrium: the condensed
force is then wrong by that times the share by which the condensation lags behind."""

MOST_CORRECTIONS = 30
"""Of the modes, for one evaluation of forces."""


class Load(NamedTuple):
    """What acts on the nodes besides the solid.

    constant (n, 3): minus weight and dead loads [N]; mass (n,) [kg]; inverse (n,): 1 / m of free nodes, zero of others
    [1/kg]; drag: a of -a M v [1/s]; rayleigh: b of -b K v [s]; lag: whether K is the last assembled, else that of the
    moment; matrices, elements, which: of a foundation, empty without one; floor: square of a force below which all is
    rounding [N²].
    """

    constant: Array
    mass: Array
    inverse: Array
    drag: float
    rayleigh: float
    lag: bool
    matrices: Array
    elements: Array
    which: Array
    floor: float


class ForceScratch(NamedTuple):
    """Of one solid with n nodes, m elements of k modes.

    gradient (n, 3): minus the forces of the last `evaluate` [N]; damping, still, move (n, 3): `still` stays zero;
    last_x, last_v (n, 3): of the nodes at that evaluation; rates (m, k, 3), rate_y (m, 3 k): of the modes; corrections
    (1,): most that an evaluation has taken since `begin`.
    """

    gradient: Array
    damping: Array
    still: Array
    move: Array
    last_x: Array
    last_v: Array
    rates: Array
    rate_y: Array
    corrections: Array


@njit(cache=True, error_model="numpy")
def begin(x: Array, solid: SolidArrays, scratch: ForceScratch) -> None:
    """Prepare evaluations from nodes at `x` (n, 3), where the modes are in equilibrium and X and K_aa^-1 are exact."""
    solid.y[:] = 0.0
    scratch.last_x[:] = x
    scratch.last_v[:] = 0.0
    scratch.rates[:] = 0.0
    scratch.rate_y[:] = 0.0
    scratch.corrections[0] = 0.0


@njit(cache=True, error_model="numpy")
def evaluate(
    x: Array, v: Array, modes: Array, solid: SolidArrays, load: Load, scratch: ForceScratch
) -> float:
    """Write minus the forces on the nodes [N] to `scratch.gradient` and return the strain energy [J].

    The modes follow the nodes from the evaluation before, to first order, and are then corrected until they are in
    equilibrium; so are their rates, where the damping needs them. The energy is infinite where there is no force.
    """
    g, move = scratch.gradient, scratch.move
    energy = _evaluate_elastic(x, modes, solid, load, scratch)
    if not np.isfinite(energy):
        return np.inf
    if load.which.shape[0]:
        energy += add_element_products(load.matrices, load.elements, load.which, x, 1.0, g)
    if load.rayleigh > 0.0:
        if load.lag:
            which = solid.every
            add_element_products(solid.matrices, solid.elements, which, v, load.rayleigh, g)
        else:
            _add_rates(x, v, modes, solid, load, scratch, move)
    if load.drag > 0.0:
        for n in range(x.shape[0]):
            for i in range(3):
                g[n, i] += load.drag * load.mass[n] * v[n, i]
    return energy


@njit(cache=True, error_model="numpy")
def _evaluate_elastic(x: Array, modes: Array, solid: SolidArrays, load: Load, scratch: ForceScratch) -> float:
    """Write minus weight, dead loads and elastic forces to `scratch.gradient`; move the modes to equilibrium."""
    g, move = scratch.gradient, scratch.move
    has_modes = modes.shape[1] > 0
    if has_modes:
        for n in range(x.shape[0]):
            for i in range(3):
                move[n, i] = x[n, i] - scratch.last_x[n, i]
        update_modes(modes, solid.elements, solid.X, solid.y, move, 1.0, modes)
        scratch.last_x[:] = x
    energy = np.inf
    for correction in range(MOST_CORRECTIONS):
        scratch.corrections[0] = max(scratch.corrections[0], correction)
        g[:] = load.constant
        energy, unbalanced = solid_gradient(
            x, modes, solid.elements, solid.G, solid.weight, solid.law, solid.lam, solid.mu, solid.mean, solid.X,
            solid.inverse, solid.y, g, solid.work,
        )  # fmt: skip
        if not has_modes or not np.isfinite(energy) or _balanced(unbalanced, g, load.floor):
            break
        update_modes(modes, solid.elements, solid.X, solid.y, scratch.still, 1.0, modes)
    return energy


@njit(cache=True, error_model="numpy")
def _add_rates(
    x: Array, v: Array, modes: Array, solid: SolidArrays, load: Load, scratch: ForceScratch, move: Array
) -> None:
    """Add b times the rate of the elastic forces to `scratch.gradient`, the modes' rates in equilibrium."""
    d, rates, y = scratch.damping, scratch.rates, scratch.rate_y
    has_modes = modes.shape[1] > 0
    if has_modes:
        for n in range(x.shape[0]):
            for i in range(3):
                move[n, i] = v[n, i] - scratch.last_v[n, i]
        update_modes(rates, solid.elements, solid.X, y, move, 1.0, rates)
        scratch.last_v[:] = v
    for correction in range(MOST_CORRECTIONS):
        scratch.corrections[0] = max(scratch.corrections[0], correction)
        d[:] = 0.0
        unbalanced = add_solid_rates(
            x, v, modes, rates, solid.elements, solid.G, solid.weight, solid.law, solid.lam, solid.mu, solid.mean,
            load.rayleigh, solid.X, solid.inverse, y, d,
        )  # fmt: skip
        if not has_modes or _balanced(load.rayleigh**2 * unbalanced, scratch.gradient, load.floor):
            break
        update_modes(rates, solid.elements, solid.X, y, scratch.still, 1.0, rates)
    for n in range(x.shape[0]):
        for i in range(3):
            scratch.gradient[n, i] += d[n, i]


@njit(cache=True, error_model="numpy")
def _balanced(unbalanced: float, g: Array, floor: float) -> bool:
    square = floor
    for n in range(g.shape[0]):
        square += g[n, 0] * g[n, 0] + g[n, 1] * g[n, 1] + g[n, 2] * g[n, 2]
    return unbalanced <= BALANCED * BALANCED * square or not np.isfinite(unbalanced)


@njit(cache=True, error_model="numpy")
def power(g: Array, v: Array, nodes: Array) -> float:
    """Return what holds `nodes` against the forces -g does to the body [W]."""
    total = 0.0
    for n in nodes:
        total += g[n, 0] * v[n, 0] + g[n, 1] * v[n, 1] + g[n, 2] * v[n, 2]
    return total
