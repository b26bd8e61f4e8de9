"""Compiled time loops of the implicit schemes for springs: many steps in one call, the same bits as one by one.

A stage ends with x' = z + s v' and M (v' - u) / s = f(x', v') (see `integrators.stage`); its unknown here is v', so
that small steps lose no digits. It is the minimum of

    Phi(v') = E(x') + D(x') - F . x' + 1/2 |v' - u|²_M + a s / 2 |v'|²_M + b s / 2 (v')^T K_n v',

K_n the springs' projected tangents at the start of the step; D is the dampers' part, sum of c/(2 s) (l(x') - l_0)²:
what the scheme does to positions it does to lengths, so that dl/dt = (l - l_0) / s has the scheme's order.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from tripod_sim.springs.cg_kernels import Sweep, conjugate_gradients, prepare
from tripod_sim.springs.linear_kernels import Factor, assemble, factorise, solve_direct
from tripod_sim.springs.spring_kernels import (
    Links,
    add_gradient,
    add_products,
    length_rates,
    lengths,
    tangents,
)

Array = Any

IMPLICIT_EULER, BDF2, TR_BDF2 = 0, 1, 2

SOLVED, UNSOLVED, NO_DESCENT, SINGULAR, BROKEN, UNITERATED = 0, 1, 2, 3, 4, 5
"""How a solve ended: as it should; too many iterations; no lower state along the step; matrix not definite although
projected; a number not finite; conjugate gradients gave up."""

G = 2.0 - np.sqrt(2.0)
P = 1.0 / (G * (2.0 - G))
Q = (1.0 - G) ** 2 * P

FEW = 4
"""A factorisation that needed at most so many linear solves serves the next stage of the same length too."""

SHORTEST = 1e-6
"""Smallest fraction of a step of Newton's method that is tried."""


class Problem(NamedTuple):
    """A spring body and its load. mass: [kg], zero of fixed nodes; force: constant, [N], (n, 3); free: unknown nodes;
    number: place of a node in `free` or -1; drag: a [1/s]; rayleigh: b [s]; rounding: [N], of the springs' forces;
    damped: whether a spring has a damper."""

    links: Links
    mass: Array
    force: Array
    free: Array
    number: Array
    drag: float
    rayleigh: float
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
    """Scratch: (n, 3) each, then blocks and lagged (m, 6), weight (n,), reference (m,).

    guess: v' as the conjugate gradients expect it; kept: the s that the factorisation at hand belongs to [s], zero for
    none, (1,); sweep: of the conjugate gradients.
    """

    g: Array
    p: Array
    x: Array
    w: Array
    z: Array
    u: Array
    guess: Array
    blocks: Array
    lagged: Array
    weight: Array
    reference: Array
    kept: Array
    sweep: Sweep


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
    if body.rayleigh > 0.0:
        phi += s * add_products(body.links.ends, work.lagged, w, body.rayleigh, g)
    square = 0.0
    for k in range(body.free.shape[0]):
        n = body.free[k]
        square += g[n, 0] * g[n, 0] + g[n, 1] * g[n, 1] + g[n, 2] * g[n, 2]
    return phi, np.sqrt(square)


@njit(cache=True, error_model="numpy")
def renew(x: Array, s: float, project: bool, body: Problem, A: Factor, options: Options, work: Work) -> bool:
    """Prepare to solve with the Hessian at `x`; return whether it is positive definite, as far as can be told."""
    links, blocks = body.links, work.blocks
    tangents(x, links, 1.0 / s if body.damped else 0.0, work.reference, project, blocks)
    if body.rayleigh > 0.0:
        factor = body.rayleigh / s
        for m in range(blocks.shape[0]):
            for c in range(6):
                blocks[m, c] += factor * work.lagged[m, c]
    for k in range(body.free.shape[0]):
        n = body.free[k]
        work.weight[n] = body.mass[n] * (1.0 / s + body.drag) / s
    if not options.direct:
        return prepare(links.ends, blocks, work.weight, body.free, body.number, work.sweep)
    assemble(links.ends, blocks, work.weight, body.free, body.number, A)
    return factorise(A) == 0


@njit(cache=True, error_model="numpy")
def solve_step(s: float, first: bool, body: Problem, A: Factor, options: Options, work: Work) -> int:
    """Write p = -H^-1 g; return the conjugate gradients' iterations, 1 for a direct solve, -1 where it failed.

    The `first` solve of a stage begins with the guess.
    """
    if options.direct:
        solve_direct(A, work.g, body.free, work.p)
        return 1
    for k in range(body.free.shape[0]):
        n = body.free[k]
        for i in range(3):
            work.p[n, i] = s * (work.guess[n, i] - work.w[n, i]) if first else 0.0
    limit = 1000 + 12 * body.free.shape[0]
    return conjugate_gradients(work.sweep, work.g, body.free, options.linear_tolerance, limit, work.p)


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
    x: Array, v: Array, s: float, body: Problem, A: Factor, options: Options, work: Work, counts: Array
) -> int:
    """Solve one stage with `work.z`, `work.u` and `work.reference`, from the positions `x`; write x' and v'.

    counts: linear solves, factorisations, conjugate gradients' iterations (each added to); residual [N] (written).
    """
    for k in range(body.free.shape[0]):
        n = body.free[k]
        for i in range(3):
            v[n, i] = (x[n, i] - work.z[n, i]) / s
    work.x[:] = x  # fixed nodes
    work.w[:] = v
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
                x[:], v[:] = work.x, work.w
                phi, size = lower, after
                continue
            phi, size = evaluate(x, v, s, body, work)
        taken = -1
        for attempt in range(2):
            counts[1] += 1.0
            if not renew(x, s, attempt == 1, body, A, options, work):
                continue
            taken = solve_step(s, iterations == 0, body, A, options, work)
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
        x[:], v[:] = work.x, work.w
        phi, size = lower, after
        if options.one_solve and iterations == 1 and scale == 1.0:
            break
    if chord and iterations <= FEW:
        work.kept[0] = s
    counts[0] += iterations
    counts[3] = size
    return SOLVED


@njit(cache=True, error_model="numpy")
def implicit_steps(
    scheme: int,
    count: int,
    h: float,
    x: Array,
    v: Array,
    history: Array,
    past: Array,
    clock: Array,
    body: Problem,
    A: Factor,
    options: Options,
    work: Work,
    counts: Array,
    predict: bool,
) -> tuple[int, int]:
    """Advance `x` and `v` by `count` steps of `h` [s]; return how the last solve ended and the steps made.

    A step that fails leaves the state before it.

    Args:
        scheme: One of the numbers above.
        count, h: Steps and their length.
        x, v: State, (n, 3), in place.
        history: Scratch and memory, (5, n, 3): state before the step at hand (0, 1), before that (2, 3),
            acceleration with which the last step ended (4).
        past: Lengths of springs before the last step, then two of scratch, (3, m).
        clock: Length of the last step [s], zero for none.
        body, A, options, work, counts: As for `solve_stage`.
        predict: Whether a direct solver begins the stages of TR-BDF2 where the last accelerations lead, if the stage
            before was solved in few iterations; else where the body is.
    """
    x_now, v_now, x_old, v_old, a = history[0], history[1], history[2], history[3], history[4]
    links, z, u = body.links, work.z, work.u
    for done in range(count):
        work.guess[:] = v
        if not options.direct and clock[0] > 0.0 and scheme != TR_BDF2:
            for n in range(x.shape[0]):
                for i in range(3):
                    work.guess[n, i] += v[n, i] - v_now[n, i]  # as it changed in the last step
        x_now[:], v_now[:] = x, v
        if body.damped:
            lengths(x, links, past[1])
        if body.rayleigh > 0.0:
            tangents(x, links, 0.0, past[1], True, work.lagged)
        if clock[0] == 0.0 or scheme == IMPLICIT_EULER:
            s = h
            z[:], u[:] = x, v
            work.reference[:] = past[1]
        elif scheme == BDF2:
            r = h / clock[0]
            lead, b, c = (1.0 + 2.0 * r) / (1.0 + r), 1.0 + r, r * r / (1.0 + r)
            b, c, s = b / lead, c / lead, h / lead
            for n in range(x.shape[0]):
                for i in range(3):
                    z[n, i] = b * x[n, i] - c * x_old[n, i]
                    u[n, i] = b * v[n, i] - c * v_old[n, i]
            if body.damped:
                for m in range(past.shape[1]):
                    work.reference[m] = b * past[1, m] - c * past[0, m]
        else:
            s = 0.5 * G * h
            for n in range(x.shape[0]):
                for i in range(3):
                    z[n, i] = x[n, i] + s * v[n, i]
                    u[n, i] = v[n, i] + s * a[n, i]
            if body.damped:
                length_rates(x, v, links, past[2])
                for m in range(past.shape[1]):
                    work.reference[m] = past[1, m] + s * past[2, m]
            if predict and work.kept[0] == s:
                for k in range(body.free.shape[0]):
                    n = body.free[k]
                    for i in range(3):
                        x[n, i] = z[n, i] + s * (u[n, i] + s * a[n, i])
            state = solve_stage(x, v, s, body, A, options, work, counts)
            if state != SOLVED:
                x[:], v[:] = x_now, v_now
                return state, done
            if predict:
                for k in range(body.free.shape[0]):
                    n = body.free[k]
                    for i in range(3):
                        middle = (v[n, i] - u[n, i]) / s
                        work.guess[n, i] = middle + (middle - a[n, i]) * (1.0 - G) / G
            for n in range(x.shape[0]):
                for i in range(3):
                    z[n, i] = P * x[n, i] - Q * x_now[n, i]
                    u[n, i] = P * v[n, i] - Q * v_now[n, i]
            if body.damped:
                lengths(x, links, past[2])
                for m in range(past.shape[1]):
                    work.reference[m] = P * past[2, m] - Q * past[1, m]
            if predict and work.kept[0] == s:
                for k in range(body.free.shape[0]):
                    n = body.free[k]
                    for i in range(3):
                        x[n, i] = z[n, i] + s * (u[n, i] + s * work.guess[n, i])
        state = solve_stage(x, v, s, body, A, options, work, counts)
        if state != SOLVED:
            x[:], v[:] = x_now, v_now
            return state, done
        if scheme == TR_BDF2:
            for k in range(body.free.shape[0]):
                n = body.free[k]
                for i in range(3):
                    a[n, i] = (v[n, i] - u[n, i]) / s
        elif scheme == BDF2:
            x_old[:], v_old[:] = x_now, v_now
            past[0] = past[1]
        clock[0] = h
    return SOLVED, count
