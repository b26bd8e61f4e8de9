"""Effect: velocities of sets at the start."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tripod_host.arrays import BoolArray, FloatArray
from tripod_sim.effect import Effect, Need
from tripod_sim.errors import SceneError
from tripod_sim.tables.fields import number
from tripod_sim.tables.sets import Vector


@dataclass(frozen=True)
class InitialVelocity:
    """Velocity of a set at the start: v + spin x (x - centre). Needs inertia.

    Attributes:
        set: Name of the set.
        velocity: v [m/s].
        spin: [rad/s].
        centre: Of the spin [m].
    """

    set: str = "all"
    velocity: Vector = number((0.0, 0.0, 0.0), unit="m/s", low=-1e4, high=1e4)
    spin: Vector = number((0.0, 0.0, 0.0), unit="rad/s", low=-1e5, high=1e5)
    centre: Vector = number((0.0, 0.0, 0.0), unit="m")


def start(tables: tuple[InitialVelocity, ...], sets: Any, rest: FloatArray, held: BoolArray) -> FloatArray:
    """Return v + spin x (x - centre) of the nodes of each set, later tables over earlier ones [m/s], shape (n, 3).

    Args:
        tables: Of the scene.
        sets: Of the bodies (`mesh.node_sets.NodeSets`).
        rest: Undeformed positions [m], shape (n, 3).
        held: Which nodes are held along which axes, shape (n, 3): they have no velocity there.

    Raises:
        SceneError: there is no such set, or all of it is held.
    """
    velocities = np.zeros_like(rest)
    for i, table in enumerate(tables):
        nodes = sets.nodes(table.set, f"initial_velocity.{i}.set")
        arm = rest[nodes] - np.array(table.centre)
        velocities[nodes] = np.array(table.velocity) + np.cross(table.spin, arm)
        moved = velocities[nodes] != 0
        if moved.any() and held[nodes][moved].all():
            raise SceneError(
                f"initial_velocity.{i}.set is {table.set!r}: all its nodes are fixed or prescribed, so they "
                "cannot move by themselves; name another set"
            )
    velocities[held] = 0.0
    return velocities


EFFECT = Effect(
    InitialVelocity,
    rank=70,
    several=True,
    rest=False,
    needs=(Need("inertia", "a scene at rest has no velocity; add [inertia]"),),
    words=("initial_velocity=[{velocity=[0.01, 0.0, 0.0]}]",),
    start=start,
)
