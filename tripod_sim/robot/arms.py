"""Servo arms as driven frames: evenly about Z, or as their tables say.

Evenly about Z servo i of n stands at azimuth phi = 2 pi i / n. Its axis is horizontal and perpendicular to the strip,
a = (sin phi, -cos phi, 0), so that a negative angle tips the arm outward and down.
"""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.constraints.groups import DrivenFrame
from tripod_sim.errors import SceneError
from tripod_sim.node_sets import NodeSets
from tripod_sim.tables.robot import Servos
from tripod_sim.tables.sets import Servo

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


def servo_arms(nodes: FloatArray, servos: Servos) -> tuple[DrivenFrame, ...]:
    """Return the driven frames that hold the nodes beyond `servos.clamp_radius` along each strip.

    Args:
        nodes: Undeformed positions [m], shape (n, 3).
        servos: Geometry.

    Raises:
        SceneError: no node lies beyond the clamp radius.
    """
    frames = []
    for i in range(servos.count):
        phi = 2 * np.pi * i / servos.count
        outward = np.array([np.cos(phi), np.sin(phi), 0.0])
        held = np.flatnonzero(nodes @ outward >= servos.clamp_radius - 1e-9)
        if not held.size:
            raise SceneError(
                f"servos.clamp_radius is {servos.clamp_radius} m: servo {i} holds no node; strip {i} of the mesh "
                f"reaches {float((nodes @ outward).max()):.4g} m"
            )
        axis = np.array([np.sin(phi), -np.cos(phi), 0.0])
        frames.append(
            DrivenFrame(
                held, axis, servos.axis_radius * outward - np.array([0, 0, servos.axis_depth]), -outward
            )
        )
    return tuple(frames)


def placed_arms(tables: tuple[Servo, ...], sets: NodeSets) -> tuple[DrivenFrame, ...]:
    """Return the driven frames that hold the sets of `tables`. Raises SceneError where there is no such set."""
    frames = []
    for i, table in enumerate(tables):
        axis, inward = np.array(table.axis), np.array(table.inward or (0.0, 0.0, 0.0))
        length = np.linalg.norm(inward)
        frames.append(
            DrivenFrame(
                sets.nodes(table.set, f"servo.{i}.set"),
                axis / np.linalg.norm(axis),
                np.array(table.hub),
                inward / length if length > 0 else inward,
            )
        )
    return tuple(frames)
