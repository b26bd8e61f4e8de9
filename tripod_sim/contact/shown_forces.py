"""The forces of contacts as points and vectors, for people to see."""

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.contact.contact_solver import ContactSolver


def contact_forces(
    world: ContactSolver, moving: int
) -> tuple[FloatArray, FloatArray, FloatArray, IndexArray]:
    """Return points [m], normal forces and friction [N] of the contacts of the last step, each of shape (k, 3), and
    sides, shape (k, 2): numbers of the surface on which each acts, and of that by which.

    A contact acts on each of its sides that can move, where that is touched: between two bodies that move there are two
    forces, opposite to each other. Impacts (`contact.restitution`) are no forces and are left out.

    Args:
        world: The bodies, at the end of a step.
        moving: How many of the surfaces, the first ones, are of soft and rigid bodies.
    """
    c, count = world.contacts.arrays, world.contacts.count
    pressed = np.flatnonzero(c.pressure[:count] > 0.0)
    vertex, weight, normal = c.vertex[pressed], c.weight[pressed], c.normal[pressed]
    normals, friction = c.pressure[pressed, None] * normal, c.friction[pressed]
    points, forces, slips, sides = [], [], [], []
    rows = np.arange(len(pressed))
    both = [world.surfaces.body[vertex[rows, (s * weight).argmax(axis=1)]] for s in (1.0, -1.0)]
    for sign in (1.0, -1.0):
        own = sign * weight > 0.0
        share = np.where(own, np.abs(weight), 0.0)
        radius = np.where(own, world.surfaces.radius[vertex], 0.0).max(axis=1, initial=0.0)
        place = np.einsum("ck,cki->ci", share, world.positions[vertex]) - sign * radius[:, None] * normal
        acts = (own & (world.surfaces.body[vertex] < moving)).any(axis=1)
        points.append(place[acts])
        forces.append(sign * normals[acts])
        slips.append(sign * friction[acts])
        sides.append(np.stack(both if sign > 0.0 else both[::-1], axis=1)[acts])
    return np.concatenate(points), np.concatenate(forces), np.concatenate(slips), np.concatenate(sides)
