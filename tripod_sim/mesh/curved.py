"""Meshes whose nodes are moved onto a curved surface, as far as the elements stay good."""

from dataclasses import replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.mesh.solid_mesh import SolidMesh, element_quality

KEPT = 0.5
"""Least quality of an element afterwards, in parts of that before."""

HALVINGS = 4
"""How often the way of the nodes of a bad element is halved before they stay where they were."""


def curved(mesh: SolidMesh, places: FloatArray) -> tuple[SolidMesh, int]:
    """Return a mesh with its nodes moved to `places`, and how many nodes were moved less.

    Where an element would lose more than half its quality (the smallest scaled Jacobian), its nodes go half of the
    way, a quarter, and so on; in the end they stay.

    Args:
        mesh: Of one kind of element; each has a positive quality.
        places: Of each node [m], shape (n, 3).
    """
    straight = element_quality(mesh)
    share = np.ones(len(mesh.nodes))
    moved = replace(mesh, nodes=places)
    while (bad := element_quality(moved) < KEPT * straight).any():
        nodes = np.unique(mesh.elements[bad])
        share[nodes] = np.where(share[nodes] > 0.5**HALVINGS, 0.5 * share[nodes], 0.0)
        moved = replace(mesh, nodes=mesh.nodes + share[:, None] * (places - mesh.nodes))
    away = np.linalg.norm(places - mesh.nodes, axis=1) > 0
    return moved, int(((share < 1) & away).sum())
