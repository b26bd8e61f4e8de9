"""Dead loads on sets of nodes: forces, pressures on the undeformed surface, masses.

A force F over an area A gives the node a the force F int N_a dA / A, a pressure p the force -p int N_a n dA with n the
outer normal of the undeformed surface: constant, so they have a potential. A mass is spread in the same way; as inertia
by int N_a² dA, which is nowhere negative (as `element.node_volumes`).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError
from tripod_sim.mesh.node_sets import NodeSets
from tripod_sim.mesh.solid_mesh import Faces, SolidMesh
from tripod_sim.tables.sets import Load


class SetLoads(NamedTuple):
    """What loads do to n nodes: forces [N], shape (n, 3); masses that weigh and that resist [kg], shape (n,)."""

    force: FloatArray
    weighing: FloatArray
    inert: FloatArray


def set_load(table: Load, field: str, sets: NodeSets, solids: Sequence[SolidMesh], size: int) -> SetLoads:
    """Return what a load does to `size` nodes, of which those of `solids`, in one numbering, come first.

    Raises:
        SceneError: there is no such set, or it holds no face of the surface where an area is needed; `field` names it.
    """
    nodes, force = sets.nodes(table.set, f"{field}.set"), np.zeros((size, 3))
    share, lumped = np.zeros(size), np.zeros(size)
    if table.share == "even" and table.pressure is None:
        share[nodes] = 1.0 / len(nodes)
        lumped = share
    else:
        found = [(solid, faces) for solid in solids for faces in solid.faces_within(nodes)]
        if not found:
            why = (
                "a pressure needs at least one: enlarge the set"
                if table.pressure is not None
                else "enlarge the set, or set share = 'even', which needs none"
            )
            raise SceneError(
                f"{field}.set is {table.set!r}: its {len(nodes)} nodes contain no whole face of the surface; "
                f"{why}"
            )
        for solid, faces in found:
            areas, squares, normals = face_integrals(faces, solid.nodes)
            if table.pressure is not None:
                np.add.at(force, faces.nodes, -table.pressure * normals)
            np.add.at(share, faces.nodes, areas)
            np.add.at(lumped, faces.nodes, squares)
        share, lumped = share / share.sum(), lumped / lumped.sum()
    if table.force is not None:
        force += np.outer(share, table.force)
    mass = table.mass or 0.0
    return SetLoads(force, mass * share, mass * lumped)


def face_integrals(faces: Faces, places: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return int N_a dA, int N_a² dA [m²], both (k, f), and int N_a n dA [m²], (k, f, 3), of `faces`.

    `places`: of the mesh's nodes, shape (n, 3) [m].
    """
    values, first, second = faces.functions()
    ds, dt = (np.einsum("qa,fai->fqi", slopes, places[faces.nodes]) for slopes in (first, second))
    normal = np.cross(ds, dt) * faces.shape.weights[:, None]
    area = np.sqrt((normal**2).sum(axis=2))
    return area @ values, area @ values**2, np.einsum("fqi,qa->fai", normal, values)
