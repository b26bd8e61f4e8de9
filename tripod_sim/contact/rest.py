"""What holds a solid at rest in contact: forces, and the rows of its contacts with obstacles and rigid bodies.

To first order a contact that presses keeps its gap, and one that sticks its place: with n . sum_k w_k x_k the gap of
contact c, its row is the gradient of that in the moves of its four points. A spring of penalty of stiffness rho yields
by 1 / rho. A rigid body goes along as its contacts and its weight let it.

The pressure p turns and shifts with the surfaces: the stiffness -p d²g/dx² of the gap g. With t where on the two sides
the nearest points are, d = g n between them, e_t = dd/dt and v_kt = dw_k/dt, that g is a minimum over t gives

    d²g/dx_k dx_j = [w_k w_j (I - n nᵀ) - sum_ts m_kt (e_t . e_s)^-1 m_jsᵀ] / g,   m_kt = v_kt d + w_k e_t.
"""

from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import BoolArray, FloatArray, IndexArray
from tripod_sim.constraints.groups import Kind
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.rest_bodies import Touching, loose
from tripod_sim.contact.rest_rows import Points, Rest
from tripod_sim.contact.stepper import ContactStepper
from tripod_sim.integrators.stepper import integrator_of
from tripod_sim.state import State
from tripod_sim.system import System

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.contact.rigid_set import RigidSet

PRESSES = 1e-3
"""Share of the largest pressure from which on a contact holds: those below may open at the next moment."""

STICKS = 0.999
"""Share of Coulomb's limit up to which friction holds: a contact at its limit slides, its friction a dead force."""

PARALLEL = 1e-3
"""Square of the sine between two edges below which it is not clear where they touch, nor how that moves."""


def rest_of(
    stepper: object, system: System, state: State, rigid: "RigidSet | None" = None
) -> tuple[Rest | None, tuple[int, ...]]:
    """Return what presses the solid that `stepper` advances, None if nothing does, and the rigid bodies on it that are
    left out of that, since nothing keeps them where they are.

    Args:
        stepper: Of a simulation, with contact or without.
        system: The static one of its solid; its levers are written.
        state: At the end of the last step.
        rigid: The rigid bodies of the scene.
    """
    stepper = integrator_of(stepper)
    if not isinstance(stepper, ContactStepper) or not stepper.world.nodes:
        return None, ()
    world, nodes = stepper.world, stepper.world.nodes.nodes
    giving = (system.reduction.kind[nodes] == Kind.FIXED) & ~stepper.world.nodes.held.all(axis=1)
    touching = Touching(world, len(nodes), rigid)
    linked = touching.linked()
    carried = linked.copy()
    system.update_levers(state)
    while True:
        found = _rest(world, nodes, giving, len(system.rest), touching, carried)
        falls = loose(found.holding(system)) if found and carried.any() else carried[:0]
        if not falls.any():
            return found, tuple(np.flatnonzero(linked & ~carried).tolist())
        carried[np.flatnonzero(carried)[falls]] = False


def _rest(
    world: ContactSolver,
    nodes: IndexArray,
    giving: BoolArray,
    count: int,
    touching: Touching,
    carried: BoolArray,
) -> Rest | None:
    """Return what presses the solid; None if nothing does.

    Args:
        world: Of a simulation with a solid.
        nodes: Of the mesh, for the first vertices of the world, shape (k,).
        giving: Which of them are of soft bodies that nothing holds at rest: they press, and yield to any move.
        count: Of nodes of the mesh.
        touching: What presses.
        carried: Which rigid bodies count, shape (b,); contacts with others are left out.
    """
    of = touching.among(carried)
    if not of.any():
        return None
    c, pressing, soft = world.contacts.arrays, touching.contacts[of], touching.soft[of]
    vertex, weight, normal = c.vertex[pressing], c.weight[pressing], c.normal[pressing]
    pressure, friction = c.pressure[pressing], c.friction[pressing]
    bodies = np.append(np.cumsum(carried) - 1, -1)[touching.bodies[of]]
    moves = soft | (bodies >= 0)
    weights = np.where(moves, weight, 0.0)
    forces = weights[:, :, None] * (pressure[:, None] * normal + friction)[:, None]
    own = nodes[np.where(soft, vertex, 0)]
    force = np.zeros((count, 3))
    np.add.at(force, own[soft], forces[soft])
    arms = touching.arms[of]
    levers = arms - (np.sign(weights) * touching.radius[of])[:, :, None] * normal[:, None]

    yields = (soft & giving[np.where(soft, vertex, 0)]).any(axis=1)
    holds = (pressure > PRESSES * pressure.max()) & ~yields
    sticks = holds & (np.linalg.norm(friction, axis=1) < STICKS * world.law.friction * pressure)
    one, two = _across(normal[sticks])
    rows = np.concatenate([np.flatnonzero(holds), np.flatnonzero(sticks), np.flatnonzero(sticks)])
    directions = np.concatenate([normal[holds], one, two])
    sides = arms + _to_touch(world, vertex, weight, normal, bodies)
    touched = np.concatenate([levers[holds], sides[sticks], sides[sticks]])
    give = np.zeros(len(rows))
    if world.law.response == "penalty":
        stiffness = c.stiffness[pressing]
        give = 1.0 / np.concatenate([stiffness[holds, 0], stiffness[sticks, 1], stiffness[sticks, 1]])
    second = curvature(world.positions[vertex], weight, normal)
    both = np.repeat(moves & holds[:, None], 3, axis=1)
    second *= -pressure[:, None, None] * (both[:, :, None] & both[:, None])
    return Rest(
        force, Points(own, bodies, arms, moves & holds[:, None]), second, rows,
        weights[rows][:, :, None] * directions[:, None], touched, give,
        touching.carried(bodies, carried, arms, levers, forces),
    )  # fmt: skip


def _to_touch(
    world: ContactSolver, vertex: IndexArray, weight: FloatArray, normal: FloatArray, bodies: IndexArray
) -> FloatArray:
    """Return the way from the nearest point of each vertex's side to where that is touched [m], shape (c, 4, 3).

    Where it sticks that is the point of the other side, so that a body that turns along with the solid does not slip;
    between two bodies the middle.
    """
    x, first = world.positions[vertex], weight > 0.0
    one, other = (np.einsum("ck,cki->ci", np.where(side, np.abs(weight), 0.0), x) for side in (first, ~first))
    radius = [
        np.where(side & (weight != 0.0), world.surfaces.radius[vertex], 0.0).max(axis=1)
        for side in (first, ~first)
    ]
    touch, touched = one - radius[0][:, None] * normal, other + radius[1][:, None] * normal
    both = ((bodies >= 0) & first).any(axis=1) & ((bodies >= 0) & ~first).any(axis=1)
    middle = 0.5 * (touch + touched)
    touch[both], touched[both] = middle[both], middle[both]
    return np.where(first[:, :, None], (touched - one)[:, None], (touch - other)[:, None])


def curvature(corners: FloatArray, weights: FloatArray, normals: FloatArray) -> FloatArray:
    """Return d²g/dx² of contacts, shape (c, 12, 12); zero where it is not clear.

    Args:
        corners: x [m], shape (c, 4, 3).
        weights: w, positive on the one side, negative on the other, zero where a vertex does not count, shape (c, 4).
        normals: n, from the other side to the one, shape (c, 3).
    """
    c, side = len(weights), np.sign(weights)
    first = np.where(side > 0, (side > 0).argmax(axis=1)[:, None], (side < 0).argmax(axis=1)[:, None])
    slides = (side != 0) & (
        first != np.arange(4)
    )  # the nearest point may move from the first vertex to each other
    i, k = slides.nonzero()
    shift = np.zeros((c, 4, 4))  # v, t numbered as these vertices
    shift[i, k, k], shift[i, first[i, k], k] = side[i, k], -side[i, k]
    gap = np.einsum("ci,ck,cki->c", normals, weights, corners)
    along = corners.transpose(0, 2, 1) @ shift  # e
    scale = np.linalg.norm(along, axis=1)
    scale[scale == 0.0] = 1.0
    along, shift = along / scale[:, None], shift / scale[:, None]
    square = along.transpose(0, 2, 1) @ along + np.eye(4) * ~slides[:, None]
    clear = (gap > 0.0) & (np.linalg.det(square) > PARALLEL)
    square[~clear], gap[~clear] = np.eye(4), np.inf
    m = gap[:, None, None, None] * shift[:, :, None] * normals[:, None, :, None]
    m = (m + weights[:, :, None, None] * along[:, None]).reshape(c, 12, 4)
    across = np.eye(3) - normals[:, :, None] * normals[:, None]
    second = (weights[:, :, None] * weights[:, None])[:, :, None, :, None] * across[:, None, :, None]
    second = second.reshape(c, 12, 12) - m @ np.linalg.solve(square, m.transpose(0, 2, 1))
    return np.where(clear[:, None, None], second / gap[:, None, None], 0.0)


def _across(normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors at right angles to each of `normals` and to each other, each of shape (m, 3)."""
    if not len(normals):
        return normals, normals
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    one = np.cross(normals, axis)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    return one, np.cross(normals, one)
