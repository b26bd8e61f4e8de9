"""Newton's method for one implicit stage of springs alone, compiled, and what the estimate of its error asks for.

A stage ends with x' = z + s v' and M (v' - u) / s = f(x', v') (see `integrators.stage`); its unknown here is v', so
that small steps lose no digits. It is the minimum of

    Phi(v') = E(x') + D(x') - F . x' + 1/2 |v' - u|²_M + a s / 2 |v'|²_M,

D the dampers' part, sum of c/(2 s) (l(x') - l_0)²: what the scheme does to positions it does to lengths, so that
dl/dt = (l - l_0) / s has the scheme's order, and a motion that changes no length is not damped.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put
from tripod_sim.springs import spring_kernels
from tripod_sim.springs.cg_kernels import Sweep, conjugate_gradients, prepare
from tripod_sim.springs.linear_kernels import Factor, assemble, factorise, solve_direct
from tripod_sim.springs.spring_kernels import Links, add_gradient, add_products, tangents

SOLVED, UNSOLVED, NO_DESCENT, SINGULAR, BROKEN, UNITERATED = 0, 1, 2, 3, 4, 5
"""How a solve ended: as it should; too many iterations; no lower state along the step; matrix not definite although
projected; a number not finite; conjugate gradients gave up."""

FEW = 4
"""A factorisation that needed at most so many linear solves serves the next stage of the same length too."""

SHORTEST = 1e-6
"""Smallest fraction of a step of Newton's method that is tried."""

MOST_REFINEMENTS, REFINED = 4, 0.02
"""Of a solution by a factorisation that may lag behind, and the share of its load at which they end."""


class Problem(NamedTuple):
    """A spring body and its load. mass: [kg], zero of fixed nodes; force: constant, [N], (n, 3); free: unknown nodes;
    number: place of a node in `free` or -1; drag: a [1/s]; rounding: [N], of the springs' forces; damped: whether a
    spring has a damper."""

    links: Links
    mass: Array
    force: Array
    free: Array
    number: Array
    drag: float
    rounding: float
    damped: bool


class Options(NamedTuple):
    """direct: L D L^T, else conjugate gradients to `linear_tolerance`; a stage is solved when its unbalanced force is
    below `tolerance` [N], or, in `one_solve` mode, by one Newton step with the tangent at its start, if that goes down
    the potential at its full length."""

    direct: bool
    one_solve: bool
    tolerance: float
    linear_tolerance: float
    max_iterations: int


class Work(NamedTuple):
    """Scratch: (n, 3) each, then blocks (m, 6), weight (n,), reference (m,).

    z, u, reference: of the stage, see above; guess: v' as it is expected, u + s rate; rate: (v' - u) / s of the last
    stage that was solved; kept: the s that the factorisation at hand belongs to [s], zero for none, (1,); sweep: of the
    conjugate gradients.
    """

    g: Array
    p: Array
    x: Array
    w: Array
    guess: Array
    rate: Array
    blocks: Array
    weight: Array
    kept: Array
    sweep: Sweep
    z: Array
    u: Array
    reference: Array


@njit(cache=True, error_model="numpy")
def _square(x: Array, body: Problem) -> float:
    """Return the square of the norm of what free nodes have of `x`, (n, 3)."""
    total = 0.0
    for k in range(body.free.shape[0]):
        n = body.free[k]
        total += x[n, 0] * x[n, 0] + x[n, 1] * x[n, 1] + x[n, 2] * x[n, 2]
    return total


@njit(cache=True, error_model="numpy")
def evaluate(x: Array, w: Array, s: float, body: Problem, work: Work) -> tuple[float, float]:
    """Write dPhi/dx' to `work.g` (of free nodes) at x' = `x`, v' = `w`; return Phi [J] and the norm of `g` [N]."""
    g, u = work.g, work.u
    phi = 0.0
    for k in range(body.free.shape[0]):
        n = body.free[k]
        m = body.mass[n]
        for i in range(3):
            difference, f = w[n, i] - u[n, i], body.force[n, i]
            g[n, i] = m * (difference / s + body.drag * w[n, i]) - f
            phi += m * (0.5 * difference * difference + 0.5 * body.drag * s * w[n, i] * w[n, i]) - f * x[n, i]
    rate = 1.0 / s if body.damped else 0.0
    phi += add_gradient(x, body.links, rate, work.reference, g)
    return phi, np.sqrt(_square(g, body))


@njit(cache=True, error_model="numpy")
def write_blocks(x: Array, s: float, project: bool, body: Problem, work: Work) -> None:
    """Write the springs' part of the Hessian at `x` to `work.blocks`, that of the nodes to `work.weight`."""
    blocks = work.blocks
    tangents(x, body.links, 1.0 / s if body.damped else 0.0, work.reference, project, blocks)
    for k in range(body.free.shape[0]):
        n = body.free[k]
        work.weight[n] = body.mass[n] * (1.0 / s + body.drag) / s


@njit(cache=True, error_model="numpy")
def renew(x: Array, s: float, project: bool, body: Problem, A: Factor, options: Options, work: Work) -> bool:
    """Prepare to solve with the Hessian at `x`; return whether it is positive definite, as far as can be told."""
    write_blocks(x, s, project, body, work)
    ends = body.links.ends
    if not options.direct:
        return prepare(ends, work.blocks, work.weight, body.free, body.number, work.sweep)
    assemble(ends, work.blocks, work.weight, body.free, body.number, A.slots)
    return factorise(A) == 0


@njit(cache=True, error_model="numpy")
def solve_as_prepared(load: Array, body: Problem, A: Factor, options: Options, work: Work, out: Array) -> int:
    """Write -H^-1 `load` of free nodes, (n, 3), H as `renew` prepared it last; conjugate gradients begin with `out`.

    Returns:
        Their iterations, 1 for a direct solve, -1 where it failed.
    """
    if options.direct:
        solve_direct(A, load, body.free, out)
        return 1
    limit = 1000 + 12 * body.free.shape[0]
    return conjugate_gradients(work.sweep, load, body.free, options.linear_tolerance, limit, out)


@njit(cache=True, error_model="numpy")
def walk(v: Array, scale: float, s: float, body: Problem, work: Work) -> None:
    """Write the state `scale` p away from `v`: velocities to `work.w`, positions to `work.x`."""
    for k in range(body.free.shape[0]):
        n = body.free[k]
        for i in range(3):
            work.w[n, i] = v[n, i] + scale / s * work.p[n, i]
            work.x[n, i] = work.z[n, i] + s * work.w[n, i]


@njit(cache=True, error_model="numpy")
def rounding(s: float, body: Problem, work: Work) -> float:
    """Return what of the unbalanced force rounding makes [N]."""
    total = 0.0
    for k in range(body.free.shape[0]):
        n = body.free[k]
        for i in range(3):
            size = body.mass[n] * abs(work.u[n, i]) / s + abs(body.force[n, i])
            total += size * size
    return 1e-14 * np.sqrt(total) + body.rounding


@njit(cache=True, error_model="numpy")
def solve_stage(
    x: Array,
    v: Array,
    s: float,
    predict: bool,
    body: Problem,
    A: Factor,
    options: Options,
    work: Work,
    counts: Array,
) -> int:
    """Solve one stage with `work.z`, `work.u` and `work.reference`, from the positions `x`; write x' and v'.

    predict: Whether a direct solver with a factorisation at hand begins where the guess leads; else where the body is.
    counts: linear solves, factorisations, conjugate gradients' iterations (each added to); residual [N] (written).
    """
    begin = predict and options.direct and work.kept[0] == s
    for k in range(body.free.shape[0]):
        n = body.free[k]
        for i in range(3):
            work.guess[n, i] = work.u[n, i] + s * work.rate[n, i]
            if begin:
                x[n, i] = work.z[n, i] + s * work.guess[n, i]
            v[n, i] = (x[n, i] - work.z[n, i]) / s
    put(work.x, x)  # fixed nodes
    put(work.w, v)
    phi, size = evaluate(x, v, s, body, work)
    if not np.isfinite(phi):
        return BROKEN
    enough = options.tolerance + rounding(s, body, work)
    iterations = 0
    chord = options.direct and not options.one_solve and work.kept[0] == s
    work.kept[0] = 0.0
    while not size <= enough:
        if iterations >= options.max_iterations:
            counts[3] = size
            return UNSOLVED
        if chord:
            solve_direct(A, work.g, body.free, work.p)
            iterations += 1
            walk(v, 1.0, s, body, work)
            lower, after = evaluate(work.x, work.w, s, body, work)
            if after < 0.5 * size and lower <= phi + 1e-12 * abs(phi):
                put(x, work.x)
                put(v, work.w)
                phi, size = lower, after
                continue
            phi, size = evaluate(x, v, s, body, work)
        taken = -1
        for attempt in range(2):
            counts[1] += 1.0
            if not renew(x, s, attempt == 1, body, A, options, work):
                continue
            for k in range(body.free.shape[0]):
                n = body.free[k]
                for i in range(3):  # the first solve of a stage begins with the guess
                    work.p[n, i] = s * (work.guess[n, i] - work.w[n, i]) if iterations == 0 else 0.0
            taken = solve_as_prepared(work.g, body, A, options, work, work.p)
            if taken >= 0:
                break
        if taken < 0:
            return SINGULAR if options.direct else UNITERATED
        counts[2] += taken
        iterations += 1
        chord = options.direct
        slope = 0.0
        for k in range(body.free.shape[0]):
            n = body.free[k]
            for i in range(3):
                slope += work.g[n, i] * work.p[n, i]
        scale, found = 1.0, False
        while scale >= SHORTEST and not found:
            walk(v, scale, s, body, work)
            lower, after = evaluate(work.x, work.w, s, body, work)
            found = lower <= phi + 1e-4 * scale * slope + 1e-12 * abs(phi) or after < 0.1 * size
            if not found:
                scale *= 0.5
        if not found:
            counts[3] = size
            return NO_DESCENT
        put(x, work.x)
        put(v, work.w)
        phi, size = lower, after
        if options.one_solve and iterations == 1 and scale == 1.0:
            break
    if chord and iterations <= FEW:
        work.kept[0] = s
    counts[0] += iterations
    counts[3] = size
    for k in range(body.free.shape[0]):
        n = body.free[k]
        for i in range(3):
            work.rate[n, i] = (v[n, i] - work.u[n, i]) / s
    return SOLVED


@njit(cache=True, error_model="numpy")
def add_rates(y: Array, s: float, body: Problem, work: Work, out: Array) -> None:
    """Add C y / s to `out` [N], C the dampers' matrix at the end of the stage just solved; y, out: (n, 3)."""
    spring_kernels.add_rates(work.x, body.links, 1.0 / s, work.reference, y, out)


@njit(cache=True, error_model="numpy")
def _answer(load: Array, body: Problem, A: Factor, options: Options, work: Work, out: Array) -> None:
    """Write -H^-1 `load` as `solve_as_prepared` does, from zero; NaN where conjugate gradients fail.

    At the end of a stage, where its potential is least, they do not: H is definite there.
    """
    out[:] = 0.0
    if solve_as_prepared(load, body, A, options, work, out) < 0:
        out[:] = np.nan


@njit(cache=True, error_model="numpy")
def solve_at_end(
    b: Array,
    s: float,
    fresh: bool,
    keep: bool,
    body: Problem,
    A: Factor,
    options: Options,
    work: Work,
    scratch: Array,
    out: Array,
) -> None:
    """Write H^-1 b to `out`, shape (3 f,) both, H the Hessian at the end of the stage just solved.

    Args:
        b, out: [N] and [m].
        s: Of the stage [s].
        fresh: Whether this is the first solve since.
        keep: Whether a factorisation made here may serve the next stage; if not, this leaves no trace in the motion.
        body, A, options, work: As of the stage.
        scratch: (5, n, 3).

    With H = W + K, W the weights, that is y - H^-1 K y, y = W^-1 b: what the factorisation leaves over is a share of
    the small part alone that the springs have in it.
    """
    if fresh:
        if work.kept[0] != s:
            for attempt in range(2):
                if renew(work.x, s, attempt == 1, body, A, options, work):
                    break
            work.kept[0] = s if keep and options.direct else 0.0
        write_blocks(work.x, s, body.links.slack, body, work)
    y, load, move, residual, part = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4]
    load[:] = 0.0
    for k in range(body.free.shape[0]):
        n = body.free[k]
        for i in range(3):
            y[n, i] = b[3 * k + i] / work.weight[n]
    add_products(body.links.ends, work.blocks, y, 1.0, load)
    _answer(load, body, A, options, work, move)
    before, enough = np.inf, REFINED**2 * _square(load, body)
    for _ in range(MOST_REFINEMENTS):
        for n in range(load.shape[0]):
            for i in range(3):
                residual[n, i] = load[n, i] + work.weight[n] * move[n, i]
        add_products(body.links.ends, work.blocks, move, 1.0, residual)
        square = _square(residual, body)
        if not enough < square < before:
            break
        before = square
        _answer(residual, body, A, options, work, part)
        for k in range(body.free.shape[0]):
            n = body.free[k]
            for i in range(3):
                move[n, i] += part[n, i]
    for k in range(body.free.shape[0]):
        n = body.free[k]
        for i in range(3):
            out[3 * k + i] = y[n, i] + move[n, i]
