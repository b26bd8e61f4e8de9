"""Compiled parts of an explicit step: forces, driven frames, rigid bodies, the schemes.

The unknowns are the free nodes and the bodies (mass centre, rotation, momentum, angular momentum); the nodes of driven
frames are where the joints put them at each instant and move with their velocity.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from tripod_host.arrays import Array
from tripod_sim.array_kernels import put
from tripod_sim.constraints.rigid_kernels import Bodies, add_up, carry, drift, read_bodies
from tripod_sim.integrators.force_kernels import ForceScratch, Load, Nets, Solids, begin, evaluate, power
from tripod_sim.integrators.scheme import Tableau
from tripod_sim.rotation_kernels import carried, rotation_rate, turned

FEW = 3
"""Corrections of the modes, for one evaluation, with which a condensation serves on."""


class Frames(NamedTuple):
    """Driven frames: x = centre + cos(angle) cosine + sin(angle) sine + slide inward; and nodes held along axes.

    nodes (k,): driven nodes; frame (k,): whose; centre, cosine, sine, inward (k, 3) [m]; joints (s + 1,): angles [rad]
    and slide [m] at the start of the step; rates (s + 1,): theirs over the step [rad/s, m/s]; held (h, 2): node
    and axis; begin, speed (h,): where it stands at the start of the step [m] and how fast it moves over it [m/s].
    """

    nodes: Array
    frame: Array
    centre: Array
    cosine: Array
    sine: Array
    inward: Array
    joints: Array
    rates: Array
    held: Array
    begin: Array
    speed: Array


class Start(NamedTuple):
    """Of schemes of several stages: nodes and bodies at the start of a part, and sums of rates over its stages.

    x, v, sum_x, sum_v (n, 3); centre (b, 3), turn (b, 3, 3), velocity, angular (b, 3); way (b, 3): rotation since the
    start; sums (4, b, 3): of the rates of centre, velocity, angular momentum and `way`.
    """

    x: Array
    v: Array
    sum_x: Array
    sum_v: Array
    centre: Array
    turn: Array
    velocity: Array
    angular: Array
    way: Array
    sums: Array


@njit(cache=True, error_model="numpy")
def drive(frames: Frames, time: float, x: Array, v: Array) -> None:
    """Write positions and velocities (n, 3) of driven and held nodes `time` [s] after the start of the step."""
    slide, slide_rate = frames.joints[-1] + time * frames.rates[-1], frames.rates[-1]
    for k in range(frames.nodes.shape[0]):
        n, s = frames.nodes[k], frames.frame[k]
        angle, rate = frames.joints[s] + time * frames.rates[s], frames.rates[s]
        c, d = np.cos(angle), np.sin(angle)
        for i in range(3):
            u, w, inward = frames.cosine[k, i], frames.sine[k, i], frames.inward[k, i]
            x[n, i] = frames.centre[k, i] + c * u + d * w + slide * inward
            v[n, i] = rate * (c * w - d * u) + slide_rate * inward
    for k in range(frames.held.shape[0]):
        n, i = frames.held[k]
        x[n, i], v[n, i] = frames.begin[k] + time * frames.speed[k], frames.speed[k]


@njit(cache=True, error_model="numpy")
def _given(g: Array, v: Array, frames: Frames) -> float:
    """Return what drives and holds the nodes against the forces -g does to the body [W]."""
    total = power(g, v, frames.nodes)
    for k in range(frames.held.shape[0]):
        n, i = frames.held[k]
        total += g[n, i] * v[n, i]
    return total


@njit(cache=True, error_model="numpy")
def _euler(
    semi_implicit: bool,
    h: float,
    time: float,
    x: Array,
    v: Array,
    load: Load,
    frames: Frames,
    bodies: Bodies,
    g: Array,
) -> None:
    """Make one part from forces -g; `time` [s] is its end."""
    add_up(g, x, bodies)
    for n in range(x.shape[0]):
        inverse = load.inverse[n]
        if inverse > 0.0:
            for i in range(3):
                old = v[n, i]
                v[n, i] = old - h * inverse * g[n, i]
                x[n, i] += h * (v[n, i] if semi_implicit else old)
    if not semi_implicit:
        _follow(bodies, h)
    for b in range(bodies.mass.shape[0]):
        for i in range(3):
            bodies.velocity[b, i] += h / bodies.mass[b] * bodies.force[b, i]
            bodies.angular[b, i] += h * bodies.moment[b, i]
    if semi_implicit:
        drift(bodies, h)
    else:
        for b in range(bodies.mass.shape[0]):
            carried(bodies.turn[b], bodies.inverse[b], bodies.angular[b], bodies.spin[b])
    drive(frames, time, x, v)
    carry(bodies, x, v)


@njit(cache=True, error_model="numpy")
def _follow(bodies: Bodies, h: float) -> None:
    """Move the bodies with the velocity and spin that they have: C' = C + h V, R' = exp(h w) R."""
    after = np.empty((3, 3))
    for b in range(bodies.mass.shape[0]):
        for i in range(3):
            bodies.centre[b, i] += h * bodies.velocity[b, i]
        turned(h * bodies.spin[b], bodies.turn[b], after)
        put(bodies.turn[b], after)


@njit(cache=True, error_model="numpy")
def _begin_part(x: Array, v: Array, bodies: Bodies, s: Start) -> None:
    """Remember where nodes and bodies are at the start of a part of several stages."""
    put(s.x, x)
    put(s.v, v)
    put(s.centre, bodies.centre)
    put(s.turn, bodies.turn)
    put(s.velocity, bodies.velocity)
    put(s.angular, bodies.angular)
    s.sum_x[:], s.sum_v[:], s.sums[:], s.way[:] = 0.0, 0.0, 0.0, 0.0


@njit(cache=True, error_model="numpy")
def _runge_kutta(
    scheme: Tableau, stage: int, h: float, time: float, x: Array, v: Array, load: Load, frames: Frames,
    bodies: Bodies, g: Array, s: Start,
) -> None:  # fmt: skip
    """Continue after a stage with its forces -g; stage = their number: end the part, which began at `time` [s].

    Bodies turn by R = exp([p]x) R_0, and p is integrated as x is [HairerLubichWanner2006, chapter IV.8].
    """
    rate, step = np.empty(3), np.empty(4)
    stages = scheme.weights.shape[0]
    inside, share = stage < stages, h / scheme.total
    weight, reach = (scheme.weights[stage], scheme.reach[stage] * h) if inside else (0.0, h)
    if inside:
        add_up(g, x, bodies)
    for n in range(x.shape[0]):
        inverse = load.inverse[n]
        if inverse > 0.0:
            for i in range(3):
                if inside:
                    dx, dv = v[n, i], -inverse * g[n, i]
                    s.sum_x[n, i] += weight * dx
                    s.sum_v[n, i] += weight * dv
                    x[n, i], v[n, i] = s.x[n, i] + reach * dx, s.v[n, i] + reach * dv
                else:
                    x[n, i] = s.x[n, i] + share * s.sum_x[n, i]
                    v[n, i] = s.v[n, i] + share * s.sum_v[n, i]
    for b in range(bodies.mass.shape[0]):
        far = reach if inside else share
        if inside:
            rotation_rate(s.way[b], bodies.spin[b], rate)
        for i in range(3):
            if inside:
                step[0], step[1] = bodies.velocity[b, i], bodies.force[b, i] / bodies.mass[b]
                step[2], step[3] = bodies.moment[b, i], rate[i]
                for k in range(4):
                    s.sums[k, b, i] += weight * step[k]
            else:
                for k in range(4):
                    step[k] = s.sums[k, b, i]
            bodies.centre[b, i] = s.centre[b, i] + far * step[0]
            bodies.velocity[b, i] = s.velocity[b, i] + far * step[1]
            bodies.angular[b, i] = s.angular[b, i] + far * step[2]
            s.way[b, i] = far * step[3]
        turned(s.way[b], s.turn[b], bodies.turn[b])
        carried(bodies.turn[b], bodies.inverse[b], bodies.angular[b], bodies.spin[b])
    if stage != stages - 1:
        drive(frames, time + reach, x, v)
        carry(bodies, x, v)


@njit(cache=True, error_model="numpy")
def start_step(x: Array, v: Array, load: Load, frames: Frames, bodies: Bodies) -> None:
    """Give the nodes of frames and bodies the velocities with which the step begins, in place."""
    read_bodies(x, v, load.mass, bodies)
    drive(frames, 0.0, x, v)
    carry(bodies, x, v)


@njit(cache=True, error_model="numpy")
def explicit_parts(
    scheme: Tableau, parts: int, h: float, h_before: float, time: float, x: Array, v: Array, solids: Solids,
    nets: Nets, load: Load, frames: Frames, bodies: Bodies, scratch: ForceScratch, start: Start,
) -> tuple[int, float]:  # fmt: skip
    """Advance bodies by up to `parts` parts of `h` [s] from `time` [s] of the step, in place, the condensation fresh.

    Ends early once a correction of the modes took more than `FEW` evaluations: the condensation is to be renewed.

    Returns:
        Parts made; work of the frames on them [J], not finite where a force or a number ceased to exist. Of a
        scheme of one stage it is that of the trapezoidal rule, without its last half: `h_before` [s] is the length of
        the part before, zero at the start of the step.
    """
    begin(x, solids, scratch)
    g, work = scratch.gradient, 0.0
    stages = scheme.weights.shape[0]
    for part in range(parts):
        own = 0.0
        if stages > 1:
            _begin_part(x, v, bodies, start)
        for stage in range(stages):  # forces are evaluated here alone: who else calls that compiles it again
            if not np.isfinite(evaluate(x, v, solids, nets, load, scratch)):
                return part + 1, np.inf
            given = _given(g, v, frames)
            if stages > 1:
                own += h / scheme.total * scheme.weights[stage] * given
                _runge_kutta(scheme, stage, h, time + part * h, x, v, load, frames, bodies, g, start)
            else:
                own = 0.5 * ((h if part else h_before) + h) * given
                _euler(scheme.swaps, h, time + (part + 1) * h, x, v, load, frames, bodies, g)
        if stages > 1:
            _runge_kutta(scheme, stages, h, time + part * h, x, v, load, frames, bodies, g, start)
        work += own
        if not np.isfinite(work) or scratch.corrections[0] > FEW:
            return part + 1, work
    return parts, work


def finish_step(
    scheme: Tableau, h: float, x: Array, v: Array, solids: Solids, nets: Nets, load: Load, frames: Frames,
    scratch: ForceScratch,
) -> tuple[float, float]:  # fmt: skip
    """Evaluate the forces at the end of a step, minus them in `scratch.gradient`.

    Returns:
        Strain energy [J], infinite where there is none; the half of the work that `explicit_parts` left out [J].
    """
    strain = evaluate(x, v, solids, nets, load, scratch)
    return strain, 0.0 if len(scheme.weights) > 1 else 0.5 * h * _given(scratch.gradient, v, frames)
