"""Compiled repetitions of the kernels of springs: what one of them takes, without the call from Python."""

from typing import Any

from numba import njit

from tripod_host.arrays import Array
from tripod_sim.springs import cg_kernels, explicit_kernels, implicit_kernels, linear_kernels, spring_kernels


@njit(cache=True, error_model="numpy")
def evaluate(count: int, x: Array, v: Array, s: float, body: Any, work: Any) -> float:
    """Repeat `implicit_kernels.evaluate`."""
    total = 0.0
    for _ in range(count):
        phi, size = implicit_kernels.evaluate(x, v, s, body, work)
        total += phi + size
    return total


@njit(cache=True, error_model="numpy")
def tangents(count: int, x: Array, links: Any, rate: float, reference: Array, out: Array) -> None:
    """Repeat `spring_kernels.tangents` without projection."""
    for _ in range(count):
        spring_kernels.tangents(x, links, rate, reference, False, out)


@njit(cache=True, error_model="numpy")
def assemble(
    count: int, ends: Array, blocks: Array, weight: Array, free: Array, number: Array, A: Any
) -> None:
    """Repeat `linear_kernels.assemble`."""
    for _ in range(count):
        linear_kernels.assemble(ends, blocks, weight, free, number, A)


@njit(cache=True, error_model="numpy")
def factorise(count: int, A: Any) -> int:
    """Repeat `linear_kernels.factorise`."""
    total = 0
    for _ in range(count):
        total += linear_kernels.factorise(A)
    return total


@njit(cache=True, error_model="numpy")
def solve(count: int, A: Any, g: Array, free: Array, p: Array) -> None:
    """Repeat `linear_kernels.solve_direct`."""
    for _ in range(count):
        linear_kernels.solve_direct(A, g, free, p)


@njit(cache=True, error_model="numpy")
def prepare(count: int, ends: Array, blocks: Array, weight: Array, free: Array, number: Array, A: Any) -> int:
    """Repeat `cg_kernels.prepare`."""
    total = 0
    for _ in range(count):
        total += cg_kernels.prepare(ends, blocks, weight, free, number, A)
    return total


@njit(cache=True, error_model="numpy")
def iterate(count: int, A: Any, g: Array, free: Array, tolerance: float, limit: int, p: Array) -> int:
    """Repeat `cg_kernels.conjugate_gradients` from zero; return the iterations of all."""
    total = 0
    for _ in range(count):
        p[:] = 0.0
        total += cg_kernels.conjugate_gradients(A, g, free, tolerance, limit, p)
    return total


@njit(cache=True, error_model="numpy")
def walk(count: int, v: Array, scale: float, s: float, body: Any, work: Any) -> None:
    """Repeat `implicit_kernels.walk`."""
    for _ in range(count):
        implicit_kernels.walk(v, scale, s, body, work)


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
