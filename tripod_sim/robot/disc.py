"""The effector: a rigid disc in the centre of the piece."""

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.errors import SceneError
from tripod_sim.tables.robot import Effector

FEWEST = 3
"""Nodes of a disc: fewer do not say how it is turned."""

THIN = 1e-6
"""Width of a disc over its length from which on its nodes lie on a line, about which it could turn freely."""

LARGE = 2.0
"""Length of a body that is more likely in mm than in m [m]."""


def effector_disc(nodes: FloatArray, effector: Effector, field: str = "effector") -> IndexArray:
    """Return the nodes within the effector's radius of the Z axis.

    Raises SceneError if there are fewer than three, or all lie on a line.

    Args:
        nodes: Undeformed positions in the frame of the body [m], shape (n, 3).
        effector: The disc.
        field: How messages name it.
    """
    radius = np.hypot(nodes[:, 0], nodes[:, 1])
    held = np.flatnonzero(radius <= effector.radius + 1e-9)
    if not held.size:
        raise SceneError(
            f"{field}.radius is {effector.radius} m: no node is so near the Z axis; the nearest is "
            f"{radius.min():.4g} m away: set a larger radius{_unit_hint(nodes)}"
        )
    if held.size < FEWEST:
        raise SceneError(
            f"{field}.radius is {effector.radius} m: {held.size} nodes are within it, but a disc needs "
            f"{FEWEST}; there are so many within {np.sort(radius)[FEWEST - 1]:.4g} m of the Z axis: set a "
            f"larger radius{_unit_hint(nodes)}"
        )
    arms = nodes[held] - nodes[held].mean(axis=0)
    length, width, _ = np.linalg.svd(arms, compute_uv=False)
    if width <= THIN * length:
        raise SceneError(
            f"{field}.radius is {effector.radius} m: its {held.size} nodes lie on a line, about which the "
            f"disc could turn freely; enlarge the radius{_unit_hint(nodes)}"
        )
    return held


def _unit_hint(nodes: FloatArray) -> str:
    """Return what to check where a body is so large that its file is in mm, probably; else nothing."""
    size = float(np.ptp(nodes, axis=0).max())
    return (
        f". The body is {size:.4g} m long: if its file is in mm, set mesh.scale = 0.001"
        if size > LARGE
        else ""
    )
