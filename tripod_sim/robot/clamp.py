"""The compliant clamp: strips bedded on their arms instead of tied to them."""

from dataclasses import replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.groups import DrivenFrame
from tripod_sim.errors import SceneError
from tripod_sim.forces.foundation import Foundation
from tripod_sim.mesh.solid_mesh import SolidMesh


def bed_clamps(
    mesh: SolidMesh, frames: tuple[DrivenFrame, ...], stiffness: float
) -> tuple[FloatArray, tuple[DrivenFrame, ...], list[Foundation]]:
    """Return the ghosts, the frames that drive them, and the foundations between the clamped elements and them.

    Args:
        mesh: The solid's mesh.
        frames: The ideal clamps: all their nodes become free, and a ghost of each is driven in its place.
        stiffness: kappa of the foundation [N/m⁴].

    Returns:
        Undeformed positions of mesh nodes and ghosts [m], shape (nodes + ghosts, 3); frames; a foundation for each
        kind of clamped elements.

    Raises:
        SceneError: a clamp holds no whole element.
    """
    nodes, count = mesh.nodes, len(mesh.nodes)
    ghost_of = np.full(count, -1, dtype=np.int64)
    driven = []
    clamped = [np.zeros((0, kind.size), dtype=np.int64) for kind, _ in mesh.blocks]
    for i, frame in enumerate(frames):
        first = count + sum(len(f.nodes) for f in frames[:i])
        ghost_of[frame.nodes] = first + np.arange(len(frame.nodes))
        driven.append(replace(frame, nodes=ghost_of[frame.nodes]))
        held = [elements[np.isin(elements, frame.nodes).all(axis=1)] for _, elements in mesh.blocks]
        if not any(map(len, held)):
            raise SceneError(
                f"clamp: servo_{i} holds no whole element of the mesh; refine the mesh or move the clamp "
                "inward"
            )
        clamped = [np.concatenate(both) for both in zip(clamped, held, strict=True)]
    rest = np.concatenate([nodes, *(nodes[f.nodes] for f in frames)])
    beds = [
        Foundation(kind, rest, elements, ghost_of[elements], stiffness)
        for (kind, _), elements in zip(mesh.blocks, clamped, strict=True)
        if len(elements)
    ]
    return rest, tuple(driven), beds
