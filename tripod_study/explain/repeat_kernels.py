"""Compiled repetitions of the kernels of springs: what one of them takes, without the call from Python."""

from typing import Any

from numba import njit

from tripod_host.arrays import Array
from tripod_sim.forces import spring_kernels
from tripod_sim.springs import explicit_kernels


@njit(cache=True, error_model="numpy")
def accelerations(count: int, x: Array, v: Array, links: Any, load: Any, a: Array) -> float:
    """Repeat `explicit_kernels.accelerations`."""
    total = 0.0
    for _ in range(count):
        total += explicit_kernels.accelerations(x, v, links, load, a)
    return total


@njit(cache=True, error_model="numpy")
def watch(count: int, x: Array, v: Array, origin: Array, links: Any, load: Any, a: Array) -> float:
    """Repeat what tells the energy after a step of an explicit scheme."""
    total = 0.0
    for _ in range(count):
        total += spring_kernels.elastic_energy(x, links)
        kinetic, weight = explicit_kernels.mechanical(x, v, origin, load)
        total += kinetic + weight
    return total
