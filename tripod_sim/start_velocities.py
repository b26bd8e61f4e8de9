"""Velocities that a scene gives to nodes at the start."""

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_sim.node_sets import NodeSets
from tripod_sim.tables.sets import InitialVelocity


def start_velocities(
    tables: tuple[InitialVelocity, ...], sets: NodeSets, rest: FloatArray, held: NDArray[np.bool_]
) -> FloatArray:
    """Return v + spin x (x - centre) of the nodes of each set, later tables over earlier ones [m/s], shape (n, 3).

    Args:
        tables: Of the scene.
        sets: Of the body.
        rest: Undeformed positions [m], shape (n, 3).
        held: Which nodes are held along which axes, shape (n, 3): they have no velocity there.

    Raises:
        SceneError: there is no such set.
    """
    velocities = np.zeros_like(rest)
    for i, table in enumerate(tables):
        nodes = sets.nodes(table.set, f"initial_velocity.{i}.set")
        arm = rest[nodes] - np.array(table.centre)
        velocities[nodes] = np.array(table.velocity) + np.cross(table.spin, arm)
    velocities[held] = 0.0
    return velocities
