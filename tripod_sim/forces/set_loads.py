"""Dead loads on sets of nodes: forces, pressures on the undeformed surface, masses.

A force F over an area A gives the node a the force F int N_a dA / A, a pressure p the force -p int N_a n dA with n the
outer normal of the undeformed surface: constant, so they have a potential. A mass is spread in the same way; as inertia
by int N_a² dA, which is nowhere negative (as `element.node_volumes`).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.effects.load import Load
from tripod_sim.elements.element import Element
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.node_sets import NodeSets


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
        found = [(solid, faces_within(solid, nodes)) for solid in solids]
        if not any(len(faces) for _, faces in found):
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
            areas, squares, normals = _integrals(solid.kind, solid.nodes[faces])
            if table.pressure is not None:
                np.add.at(force, faces, -table.pressure * normals)
            np.add.at(share, faces, areas)
            np.add.at(lumped, faces, squares)
        share, lumped = share / share.sum(), lumped / lumped.sum()
    if table.force is not None:
        force += np.outer(share, table.force)
    mass = table.mass or 0.0
    return SetLoads(force, mass * share, mass * lumped)


def faces_within(solid: SolidMesh, nodes: IndexArray) -> IndexArray:
    """Return the faces of the surface whose nodes are all among `nodes`, shape (k, nodes of a face)."""
    return solid.boundary[np.isin(solid.boundary, nodes).all(axis=1)]


def _integrals(kind: Element, nodes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return int N_a dA, int N_a² dA [m²], both (k, f), and int N_a n dA [m²], (k, f, 3), of faces with `nodes`.

    Args:
        kind: Element whose faces they are.
        nodes: Of each face as in `kind.faces`, shape (k, f, 3) [m].
    """
    loop = list(kind.faces[0])  # all faces number their nodes alike
    corners = kind.reference[loop[: kind.face_corners]]
    if kind.face_corners == 3:  # six points, degree 4 [Dunavant1985]
        a, b = 0.445948490915965, 0.091576213509771
        share = np.array([[1 - 2 * c if i == j else c for j in range(3)] for c in (a, b) for i in range(3)])
        weights = np.repeat([0.223381589678011, 0.109951743655322], 3) / 2
        first, second = np.tile(corners[1] - corners[0], (6, 1)), np.tile(corners[2] - corners[0], (6, 1))
        points = share @ corners
    else:
        x, w = np.polynomial.legendre.leggauss(3)
        s, t = (c.ravel() for c in np.meshgrid(x, x, indexing="ij"))
        weights = np.outer(w, w).ravel()
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        along, across = 1 + np.outer(s, signs[:, 0]), 1 + np.outer(t, signs[:, 1])
        points = along * across / 4 @ corners
        first, second = across * signs[:, 0] / 4 @ corners, along * signs[:, 1] / 4 @ corners
    values, slopes = kind.functions(points)[:, loop], kind.gradients(points)[:, loop]
    ds, dt = (np.einsum("qaj,qj,fai->fqi", slopes, way, nodes) for way in (first, second))
    normal = np.cross(ds, dt) * weights[:, None]
    area = np.sqrt((normal**2).sum(axis=2))
    return area @ values, area @ values**2, np.einsum("fqi,qa->fai", normal, values)
