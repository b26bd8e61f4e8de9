"""Compiled forces on the nodes of solids and springs in motion, incompatible modes in equilibrium."""

from typing import NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put
from tripod_sim.forces.rate_kernels import add_solid_rates
from tripod_sim.forces.solid_arrays import SolidArrays
from tripod_sim.forces.solid_kernels import ELASTIC, solid_gradient, update_modes
from tripod_sim.forces.spring_kernels import Links, add_forces
from tripod_sim.forces.term_kernels import add_couplings

BALANCED = 1e-6
"""Unbalanced force of incompatible modes, as a share of the nodes', at which they are in equilibrium: the condensed
force is then wrong by that times the share by which the condensation lags behind."""

MOST_CORRECTIONS = 30
"""Of the modes, for one evaluation of forces."""


class Load(NamedTuple):
    """What acts on the nodes besides solids and springs.

    constant (n, 3): minus weight and dead loads [N]; mass (n,) [kg]; inverse (n,): 1 / m of free nodes, zero of others
    [1/kg]; drag: a of -a M v [1/s]; couplings, elements: of what ties nodes to others (`forces.term.LinearTerm`), empty
    without it; floor: square of a force below which all is rounding [N²].
    """

    constant: Array
    mass: Array
    inverse: Array
    drag: float
    couplings: Array
    elements: Array
    floor: float


class MovingSolid(NamedTuple):
    """A solid with its modes (m, k, 3) [m], in place, and whether it has a damper."""

    arrays: SolidArrays
    modes: Array
    damped: bool


Solids = tuple[MovingSolid, ...]
Nets = tuple[Links, Links]
"""Springs that push as well as pull, those that only pull."""


class ForceScratch(NamedTuple):
    """Of n nodes.

    gradient (n, 3): minus the forces of the last `evaluate` [N]; pull, still, move (n, 3): `still` stays zero; last_x
    (n, 3): of the nodes at that evaluation; corrections (1,): most that an evaluation has taken since `begin`.
    """

    gradient: Array
    pull: Array
    still: Array
    move: Array
    last_x: Array
    corrections: Array


@njit(cache=True, error_model="numpy")
def begin(x: Array, solids: Solids, scratch: ForceScratch) -> None:
    """Prepare evaluations from nodes at `x` (n, 3), where the modes are in equilibrium and X and K_aa^-1 are exact."""
    for solid in solids:
        solid.arrays.y[:] = 0.0
    put(scratch.last_x, x)
    scratch.corrections[0] = 0.0


@njit(cache=True, error_model="numpy")
def evaluate(x: Array, v: Array, solids: Solids, nets: Nets, load: Load, scratch: ForceScratch) -> float:
    """Write minus the forces on the nodes [N] to `scratch.gradient` and return the strain energy [J].

    The modes follow the nodes from the evaluation before, to first order, and are then corrected until they are in
    equilibrium. The energy is infinite where there is no force.
    """
    g = scratch.gradient
    energy = _evaluate_solids(x, solids, load, scratch)
    if not np.isfinite(energy):
        return np.inf
    for net in nets:
        if net.ends.shape[0]:
            energy += _add_springs(x, v, net, scratch.pull, g)
    if load.elements.shape[0]:
        energy += add_couplings(load.couplings, load.elements, x, g)
    for solid in solids:
        if solid.damped:
            add_solid_rates(x, v, solid.modes, solid.arrays, 1.0, g)
    if load.drag > 0.0:
        for n in range(x.shape[0]):
            for i in range(3):
                g[n, i] += load.drag * load.mass[n] * v[n, i]
    return energy


@njit(cache=True, error_model="numpy", inline="always")
def _add_springs(x: Array, v: Array, net: Links, force: Array, g: Array) -> float:
    """Take the forces of springs and of their dampers from `g`; return their energy [J]. `force` is scratch."""
    force[:] = 0.0
    energy = add_forces(x, v, net, force)
    for n in range(x.shape[0]):
        for i in range(3):
            g[n, i] -= force[n, i]
    return energy


@njit(cache=True, error_model="numpy")
def _has_modes(solids: Solids) -> bool:
    found = False
    for solid in solids:
        found = found or solid.modes.shape[1] > 0
    return found


@njit(cache=True, error_model="numpy", inline="always")
def _evaluate_solids(x: Array, solids: Solids, load: Load, scratch: ForceScratch) -> float:
    """Write minus weight, dead loads and the solids' forces to `scratch.gradient`; move the modes to equilibrium."""
    g, move, has_modes = scratch.gradient, scratch.move, _has_modes(solids)
    if has_modes:
        for n in range(x.shape[0]):
            for i in range(3):
                move[n, i] = x[n, i] - scratch.last_x[n, i]
        _follow_nodes(solids, move)
        put(scratch.last_x, x)
    energy = np.inf
    for correction in range(MOST_CORRECTIONS):
        scratch.corrections[0] = max(scratch.corrections[0], correction)
        put(g, load.constant)
        energy = unbalanced = 0.0
        for solid in solids:
            own, _, left = solid_gradient(x, solid.modes, solid.arrays, ELASTIC, g, g)
            energy += own
            unbalanced += left
        if not has_modes or not np.isfinite(energy) or _balanced(unbalanced, g, load.floor):
            break
        _follow_nodes(solids, scratch.still)
    return energy


@njit(cache=True, error_model="numpy")
def _follow_nodes(solids: Solids, move: Array) -> None:
    """Move the modes as a Newton step does in which the nodes move by `move` [m], shape (n, 3)."""
    for solid in solids:
        s = solid.arrays
        update_modes(solid.modes, s.elements, s.X, s.y, move, 1.0, solid.modes)


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
