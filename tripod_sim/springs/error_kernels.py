"""Estimate of the error of time steps of springs, and steps as long as it allows, compiled.

The error itself is carried along by the factorisation at hand, as for solids (see `integrators.time_error`). With C the
dampers' and Rayleigh's damping matrix a stage's error is e_x' = e* + d, e_v' = (e_x' - y) / s, where

    y = e_z + tau_x,   w = e_u + tau_v,   e* = y + s w,
    A d = -r - a M w - (K + C / s) e* + C y / s,   A = M / s² + a M / s + C / s + K.

The products on the right are those of the present state, so that a factorisation of an earlier one does little harm:
what it leaves over is small against the inertia, which is in e*. What a step adds by itself needs no such care: the
same with K taken out,

    A e_x' = (M / s² + a M / s + C / s) tau_x + M tau_v / s,

is one solve, without tangents where nothing damps.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from tripod_sim.integrators.time_error_kernels import differences, furthest, rates
from tripod_sim.springs.cg_kernels import conjugate_gradients
from tripod_sim.springs.implicit_kernels import (
    BDF2,
    IMPLICIT_EULER,
    SOLVED,
    TR_BDF2,
    G,
    Options,
    P,
    Problem,
    Q,
    Work,
    implicit_steps,
    renew,
)
from tripod_sim.springs.linear_kernels import Factor, solve_direct
from tripod_sim.springs.spring_kernels import add_products, direction, tangents

Array = Any

KNOWN, LENGTH, MISSING, PROPOSED, LAST = 0, 1, 2, 3, 4
"""Places in `Errors.numbers`, named as in `integrators.time_error.ErrorState`."""

REFINED = 0.02
"""Share of a load that a solve may leave over, where the factorisation at hand belongs to an earlier state."""

MOST_REFINEMENTS = 4

SAME = 0.8
"""Share of the length that the tolerance allows down to which the length of the part before is kept."""

SAFETY, SHRINK, GROW, LEAST = 0.9, 0.1, 4.0, 1e-4
"""Of the controller, as in `integrators.auto_steps`."""


class Errors(NamedTuple):
    """What the estimate remembers: the arrays of an `ErrorState`, and its numbers (5,)."""

    error: Array
    before: Array
    velocities: Array
    accelerations: Array
    numbers: Array


class ErrorWork(NamedTuple):
    """Scratch: known, middle (2, n, 3); alone, y, far, force, move, left, residual, part (n, 3); derivatives (3, n, 3);
    damping (m, 6): blocks of C; moving (n,): whether a node is free."""

    known: Array
    middle: Array
    alone: Array
    y: Array
    far: Array
    force: Array
    move: Array
    left: Array
    residual: Array
    part: Array
    derivatives: Array
    damping: Array
    moving: Array


class Motion(NamedTuple):
    """What a step changes besides the errors, as `implicit_steps` takes it."""

    x: Array
    v: Array
    history: Array
    past: Array
    clock: Array


@njit(cache=True, error_model="numpy")
def _tangent_blocks(x: Array, s: float, body: Problem, work: Work) -> None:
    """Write the blocks of a stage's Hessian at `x` to `work.blocks`, as `renew` does, but not projected."""
    tangents(x, body.links, 1.0 / s if body.damped else 0.0, work.reference, body.links.slack, work.blocks)
    if body.rayleigh > 0.0:
        for m in range(work.blocks.shape[0]):
            for c in range(6):
                work.blocks[m, c] += body.rayleigh / s * work.lagged[m, c]


@njit(cache=True, error_model="numpy")
def _damping_blocks(x: Array, body: Problem, work: Work, out: Array) -> None:
    """Write the blocks of C = sum of c n n^T + b K_n, as `tangents` does, shape (m, 6) [N s/m]."""
    links = body.links
    for m in range(out.shape[0]):
        _, n0, n1, n2 = direction(x, links.ends[m, 0], links.ends[m, 1])
        c = links.damping[m]
        out[m, 0], out[m, 1], out[m, 2] = c * n0 * n0, c * n0 * n1, c * n0 * n2
        out[m, 3], out[m, 4], out[m, 5] = c * n1 * n1, c * n1 * n2, c * n2 * n2
        if body.rayleigh > 0.0:
            for i in range(6):
                out[m, i] += body.rayleigh * work.lagged[m, i]


@njit(cache=True, error_model="numpy")
def _solve_as_prepared(
    load: Array, body: Problem, A: Factor, options: Options, work: Work, out: Array
) -> None:
    """Write -H^-1 `load` of free nodes, H as `renew` prepared it last; NaN where conjugate gradients fail.

    At the end of a stage, where its potential is least, they do not: H is definite there.
    """
    if options.direct:
        solve_direct(A, load, body.free, out)
        return
    out[:] = 0.0
    limit = 1000 + 12 * body.free.shape[0]
    if conjugate_gradients(work.sweep, load, body.free, options.linear_tolerance, limit, out) < 0:
        out[:] = np.nan


@njit(cache=True, error_model="numpy")
def _solve(most: int, body: Problem, A: Factor, options: Options, work: Work, scratch: ErrorWork) -> None:
    """Write -H^-1 `scratch.force` to `scratch.move`, H with `work.blocks`, by what is prepared, which may lag behind.

    most: Refinements.
    """
    load, residual, move, part = scratch.force, scratch.residual, scratch.move, scratch.part
    _solve_as_prepared(load, body, A, options, work, move)
    before, enough = np.inf, REFINED**2 * _square(load, body)
    for _ in range(most):
        for n in range(load.shape[0]):
            for i in range(3):
                residual[n, i] = load[n, i] + work.weight[n] * move[n, i]
        add_products(body.links.ends, work.blocks, move, 1.0, residual)
        square = _square(residual, body)
        if not enough < square < before:
            break
        before = square
        _solve_as_prepared(residual, body, A, options, work, part)
        for k in range(body.free.shape[0]):
            n = body.free[k]
            for i in range(3):
                move[n, i] += part[n, i]


@njit(cache=True, error_model="numpy")
def _square(x: Array, body: Problem) -> float:
    total = 0.0
    for k in range(body.free.shape[0]):
        n = body.free[k]
        total += x[n, 0] * x[n, 0] + x[n, 1] * x[n, 1] + x[n, 2] * x[n, 2]
    return total


@njit(cache=True, error_model="numpy")
def _stage(
    first: Array,
    c1: float,
    second: Array,
    c2: float,
    derivative: int,
    factor: float,
    s: float,
    left: bool,
    most: int,
    body: Problem,
    A: Factor,
    options: Options,
    work: Work,
    scratch: ErrorWork,
    out: Array,
) -> None:
    """Write the errors at the end of a stage that starts from c1 `first` + c2 `second` to `out`.

    Its defects are `factor` times the derivatives of the acceleration from number `derivative` on; `left`: whether the
    solver's unbalanced force counts; `most`: refinements of the solution.
    """
    p, q = scratch.derivatives[derivative], scratch.derivatives[derivative + 1]
    known, y, force, far = scratch.known, scratch.y, scratch.force, scratch.far
    for n in range(y.shape[0]):
        drag = body.drag * body.mass[n]
        for i in range(3):
            known[0, n, i] = c1 * first[0, n, i] + c2 * second[0, n, i]
            known[1, n, i] = c1 * first[1, n, i] + c2 * second[1, n, i]
            y[n, i] = known[0, n, i] + factor * p[n, i]
            rate = known[1, n, i] + factor * q[n, i]
            far[n, i] = y[n, i] + s * rate
            force[n, i] = drag * rate + (scratch.left[n, i] if left else 0.0)
    ends = body.links.ends
    add_products(ends, work.blocks, far, 1.0, force)
    if body.damped or body.rayleigh > 0.0:
        add_products(ends, scratch.damping, y, -1.0 / s, force)
    _solve(most, body, A, options, work, scratch)
    for n in range(y.shape[0]):
        for i in range(3):
            out[0, n, i] = far[n, i] + scratch.move[n, i]
            out[1, n, i] = (out[0, n, i] - y[n, i]) / s


@njit(cache=True, error_model="numpy")
def _carry(
    scheme: int,
    euler: bool,
    h: float,
    ratio: float,
    lead: float,
    s: float,
    body: Problem,
    A: Factor,
    options: Options,
    work: Work,
    errors: Errors,
    scratch: ErrorWork,
) -> None:
    """Carry `errors` over a step of `h` [s] whose derivatives are known; `euler`, `ratio`, `lead`, `s`: its stages'."""
    d, number, e, most = scratch.derivatives, errors.numbers, errors.error, MOST_REFINEMENTS
    if number[MISSING] > 0.0 and number[KNOWN] > 0.0:
        for n in range(e.shape[1]):
            for i in range(3):
                e[1, n, i] -= 0.5 * number[MISSING] ** 2 * d[1, n, i]
        number[MISSING] = 0.0
    if euler:
        if number[KNOWN] == 0.0:
            number[MISSING] = h
        factor = -0.5 * h * h
        errors.before[:] = e
        _stage(e, 1.0, e, 0.0, 0, factor, s, True, most, body, A, options, work, scratch, e)
        if scheme == TR_BDF2:
            rates(e, scratch.known, d[0], d[1], factor, s, errors.before)
    elif scheme == BDF2:
        factor = -(h**3) * (1.0 + ratio) / (6.0 * lead * ratio)
        scratch.middle[:] = e
        b, c = (1.0 + ratio) / lead, ratio * ratio / (1.0 + ratio) / lead
        _stage(e, b, errors.before, -c, 1, factor, s, True, most, body, A, options, work, scratch, e)
        errors.before[:] = scratch.middle
    else:
        first, second = -((G * h) ** 3) / 12.0, -((1.0 - G) ** 2) / (6.0 * (2.0 - G)) * h**3
        middle = scratch.middle
        _stage(e, 1.0, errors.before, s, 1, first, s, False, most, body, A, options, work, scratch, middle)
        _stage(middle, P, e, -Q, 1, second, s, True, most, body, A, options, work, scratch, e)
        rates(e, scratch.known, d[1], d[2], second, s, errors.before)


@njit(cache=True, error_model="numpy")
def _added(
    derivative: int, factor: float, s: float, body: Problem, A: Factor, options: Options, work: Work, scratch: ErrorWork
) -> float:  # fmt: skip
    """Return the largest distance of a node that a step with these defects (see `_stage`) adds [m], by one solve."""
    p, q = scratch.derivatives[derivative], scratch.derivatives[derivative + 1]
    y, force = scratch.y, scratch.force
    for n in range(y.shape[0]):
        mass = body.mass[n] / s
        weight = mass * (1.0 / s + body.drag)
        for i in range(3):
            y[n, i] = factor * p[n, i]
            force[n, i] = weight * y[n, i] + mass * factor * q[n, i]
    if body.damped or body.rayleigh > 0.0:
        add_products(body.links.ends, scratch.damping, y, 1.0 / s, force)
    scratch.alone[:] = 0.0
    _solve_as_prepared(force, body, A, options, work, scratch.alone)
    most, _ = furthest(scratch.alone)
    return most


@njit(cache=True, error_model="numpy")
def carry_errors(
    scheme: int,
    h: float,
    h_before: float,
    local: bool,
    carried: bool,
    motion: Motion,
    body: Problem,
    A: Factor,
    options: Options,
    work: Work,
    errors: Errors,
    scratch: ErrorWork,
) -> tuple[int, float]:
    """Carry `errors` over the step of `h` [s] just made; return its order and the largest distance that it added [m].

    Args:
        scheme: One of the numbers of `implicit_kernels`.
        h, h_before: Lengths of this step and of the one before, zero at a start [s].
        local: Whether to find what the step added, else zero is returned.
        carried: Whether the errors themselves are carried along, else they stay as they are.
        motion, body, A, options, work: As the step left them.
        errors, scratch: See there.
    """
    number = errors.numbers
    euler = scheme == IMPLICIT_EULER or h_before == 0.0
    ratio = 1.0 if euler else h / h_before
    lead = (1.0 + 2.0 * ratio) / (1.0 + ratio)
    s = h if euler else (h / lead if scheme == BDF2 else 0.5 * G * h)
    scratch.left[:] = work.g
    for n in range(body.mass.shape[0]):
        for i in range(3):
            if motion.history[1, n, i] != errors.velocities[n, i]:  # somebody has changed them
                number[KNOWN] = number[MISSING] = 0.0
    if work.kept[0] != s:
        for attempt in range(2):
            if renew(motion.x, s, attempt == 1, body, A, options, work):
                break
        keep = local and options.direct  # where steps have a fixed length the estimate leaves no trace
        work.kept[0] = s if keep else 0.0
    if body.damped or body.rayleigh > 0.0:
        _damping_blocks(motion.x, body, work, scratch.damping)
    differences(
        motion.v, work.u, s, h, errors.accelerations, number[LENGTH], int(number[KNOWN]), scratch.moving,
        scratch.derivatives, errors.velocities,
    )  # fmt: skip
    if carried:
        _tangent_blocks(motion.x, s, body, work)
        _carry(scheme, euler, h, ratio, lead, s, body, A, options, work, errors, scratch)
    number[LENGTH], number[KNOWN] = h, min(number[KNOWN] + 1.0, 2.0)
    added = 0.0
    if local:
        derivative, factor = 1, (-3.0 * G**2 + 4.0 * G - 2.0) / (12.0 * (2.0 - G)) * h**3
        if euler:
            derivative, factor = 0, -0.5 * h * h
        elif scheme == BDF2:
            factor = -(h**3) * (1.0 + ratio) / (6.0 * lead * ratio)
        added = _added(derivative, factor, s, body, A, options, work, scratch)
    return 1 if euler else 2, added


@njit(cache=True, error_model="numpy")
def _copy(motion: Motion, errors: Errors, carried: bool, to: Motion, errors_to: Errors) -> None:
    to.x[:], to.v[:], to.history[:] = motion.x, motion.v, motion.history
    to.past[:], to.clock[:] = motion.past, motion.clock
    if carried:
        errors_to.error[:], errors_to.before[:] = errors.error, errors.before
    errors_to.velocities[:], errors_to.accelerations[:] = errors.velocities, errors.accelerations
    errors_to.numbers[:] = errors.numbers


@njit(cache=True, error_model="numpy")
def estimated_interval(
    scheme: int,
    dt: float,
    auto: bool,
    carried: bool,
    tolerance: float,
    shortest: float,
    smallest: float,
    motion: Motion,
    errors: Errors,
    kept: Motion,
    kept_errors: Errors,
    body: Problem,
    A: Factor,
    options: Options,
    work: Work,
    scratch: ErrorWork,
    counts: Array,
) -> tuple[int, int, int, int, float]:
    """Advance by an interval `dt` [s] and estimate the errors, in parts where needed or chosen.

    Args:
        scheme: One of the numbers of `implicit_kernels`.
        dt: [s].
        auto: Whether the parts are as long as `tolerance` allows, else one where possible.
        carried: Whether the errors are carried along, else `errors` serves to find what a part adds alone.
        tolerance: Distance that a part may add [m].
        shortest: Length of a part that is accepted whatever it adds [s].
        smallest: That is tried where Newton's method fails [s].
        motion, errors: In place.
        kept, kept_errors: Scratch of their shapes.
        body, A, options, work, scratch, counts: As for `carry_errors` and `implicit_steps`.

    Returns:
        How the last solve ended; parts made, taken back, and failed; the largest distance that a part added [m].
    """
    number = errors.numbers
    length = number[PROPOSED] if auto and number[PROPOSED] > 0.0 else dt
    done, worst, parts, rejected, failed, again = 0.0, 0.0, 0, 0, 0, False
    while done < dt:
        left = dt - done
        pieces = max(1.0, np.ceil(left / length - 1e-9))
        h = left / pieces
        same = max(1.0, np.rint(left / max(number[LENGTH], SAME * length)))
        if SAME * length <= number[LENGTH] <= length and abs(left - same * number[LENGTH]) < 1e-9 * left:
            h, pieces = number[LENGTH], same  # to the bit: its factorisation serves again
        _copy(motion, errors, carried, kept, kept_errors)
        before = motion.clock[0]
        outcome, _ = implicit_steps(
            scheme, 1, h, motion.x, motion.v, motion.history, motion.past, motion.clock, body, A, options, work, counts,
            auto,
        )  # fmt: skip
        if outcome != SOLVED:
            failed += 1
            length, again = 0.5 * h, True
            if length < smallest:
                return outcome, parts, rejected, failed, worst
            continue
        order, added = carry_errors(
            scheme, h, before, auto, carried, motion, body, A, options, work, errors, scratch
        )
        ratio, k = added / tolerance, order + 1.0
        if auto and not ratio <= 1.0 and h > shortest * (1.0 + 1e-9):  # so that NaN counts as too much
            _copy(kept, kept_errors, carried, motion, errors)
            rejected += 1
            shrink = max(SAFETY * ratio ** (-1.0 / k), SHRINK) if np.isfinite(ratio) else 0.5
            length, again = max(h * shrink, shortest), True
            continue
        if auto:
            meant = max(ratio * (length / h) ** k, LEAST) if np.isfinite(ratio) else 1.0
            last = number[LAST] if number[LAST] > 0.0 else 1.0
            change = SAFETY * meant ** (-0.7 / k) * last ** (0.4 / k)
            length *= min(max(change, SHRINK), 1.0 if again else GROW)
            length = min(max(length, shortest), dt)
            number[LAST], number[PROPOSED] = meant, length
        parts, again, worst = parts + 1, False, max(worst, added)
        done = dt if pieces == 1.0 else done + h
    return SOLVED, parts, rejected, failed, worst
