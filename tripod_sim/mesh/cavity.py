"""Cavities of solids: closed surfaces among the faces of a mesh, found by number or within a set of nodes."""

from collections.abc import Sequence

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.errors import SceneError
from tripod_sim.mesh.closed_surface import ClosedSurface, open_edges
from tripod_sim.mesh.solid_mesh import Faces, SolidMesh
from tripod_sim.mesh.topology import parts

PLANAR = 0.1
"""Largest distance of a rim from its best plane, in parts of its largest extent, for which it gets a cap."""

FLAT = 1e-9
"""Smallest volume of a cavity, in parts of the cube of its largest extent."""

POCKET = 0.05
"""Smallest volume of a cavity, in mean elements; less is a pocket that a mesher left where surfaces nearly touch."""

SHOWN = 3
"""Open edges or cavities that a message lists."""


def closed_surfaces(mesh: SolidMesh) -> list[ClosedSurface]:
    """Return the closed surfaces of a mesh's boundary, in the order of their smallest node numbers.

    Surfaces that share a node count as one. Those of negative volume are the outsides of bodies.
    """
    label = parts([faces.nodes for faces in mesh.boundary], len(mesh.nodes))
    labels = np.unique(np.concatenate([label[faces.nodes[:, 0]] for faces in mesh.boundary]))
    return [ClosedSurface(_chosen(mesh.boundary, label, one)) for one in labels]


def cavities(mesh: SolidMesh) -> list[ClosedSurface]:
    """Return the cavities of a mesh, in the order of their smallest node numbers."""
    surfaces = closed_surfaces(mesh)
    volumes = [surface.volume(mesh.nodes) for surface in surfaces]
    least = POCKET * abs(sum(volumes)) / mesh.count
    return [surface for surface, volume in zip(surfaces, volumes, strict=True) if volume >= least]


def _chosen(boundary: Sequence[Faces], label: IndexArray, one: int) -> tuple[Faces, ...]:
    """Return the faces whose nodes have one label."""
    found = [faces._replace(nodes=faces.nodes[label[faces.nodes[:, 0]] == one]) for faces in boundary]
    return tuple(faces for faces in found if len(faces.nodes))


def cavity_faces(mesh: SolidMesh, number: int, field: str) -> ClosedSurface:
    """Return the surface of a cavity.

    Args:
        mesh: A mesh that `check_mesh` accepts.
        number: From 0, in the order of the smallest node number of each cavity.
        field: Where the number stands in the scene, for the message.

    Raises:
        SceneError: the mesh has no cavity, or none of that number.
    """
    found = cavities(mesh)
    if not found:
        count = sum(surface.volume(mesh.nodes) < 0 for surface in closed_surfaces(mesh))
        raise SceneError(
            f"{field} is {number}, but the mesh has no cavity: its boundary is {count} closed "
            f"surface{'s' if count > 1 else ''}, each the outside of a body; name the faces of the chamber by "
            "a set, and close an opening with cap = true"
        )
    if not 0 <= number < len(found):
        listed = "; ".join(_described(k, cavity, mesh.nodes) for k, cavity in enumerate(found[:SHOWN]))
        raise SceneError(
            f"{field} is {number}, but the mesh has {len(found)} "
            f"{'cavities' if len(found) > 1 else 'cavity'}; choose 0 to {len(found) - 1}: {listed}"
        )
    return found[number]


def _described(number: int, cavity: ClosedSurface, nodes: FloatArray) -> str:
    """Return number, volume and centre of a cavity in words."""
    return f"{number} of {cavity.volume(nodes):.3g} m³ about {_place(nodes[cavity.nodes].mean(axis=0))} m"


def faces_of_set(
    mesh: SolidMesh, nodes: IndexArray, field: str, name: str, *, cap: bool = False
) -> ClosedSurface:
    """Return the closed surface of the boundary faces within a set of nodes.

    Args:
        mesh: A mesh that `check_mesh` accepts.
        nodes: The set.
        field: Where the set is named in the scene, for messages.
        name: Of the set.
        cap: Whether openings with nearly planar rims are closed by caps (see `closed_surface`).

    Raises:
        SceneError: no face lies within the set; or the faces do not close, and `cap` is not set or a rim is no simple
            loop or not planar: the message names open edges by the positions of their ends; or they are flat or the
            outside of a body.
    """
    faces = mesh.faces_within(nodes)
    start = f"{field} is {name!r}: "
    if not faces:
        raise SceneError(
            f"{start}its {len(nodes)} nodes contain no whole face of the surface; enlarge the set"
        )
    edges = open_edges(faces)
    if len(edges) and not cap:
        raise SceneError(
            f"{start}its faces do not enclose a volume: {len(edges)} edges are open, "
            f"{_edge_places(edges, mesh.nodes)}; add the missing faces to the set, or close the opening with "
            "cap = true"
        )
    rims = _checked_rims(edges, mesh.nodes, start) if len(edges) else []
    surface = ClosedSurface(tuple(faces), tuple(rims))
    volume, extent = surface.volume(mesh.nodes), float(np.ptp(mesh.nodes[surface.nodes], axis=0).max())
    if not volume > FLAT * extent**3:
        raise SceneError(
            f"{start}its faces enclose {volume:.3g} m³, so they are no cavity: they are flat or the outside of a body; "
            "leave only the faces around the cavity in the set"
        )
    return surface


def _checked_rims(edges: IndexArray, nodes: FloatArray, start: str) -> list[IndexArray]:
    """Return open edges apart by the loops that they form; raise SceneError, its message begun by `start`."""
    label = parts([edges[:, :2]], int(edges[:, :2].max()) + 1)[edges[:, 0]]
    rims = [edges[label == one] for one in np.unique(label)]
    for rim in rims:
        if len(np.unique(rim[:, 0])) < len(rim) or len(np.unique(rim[:, 1])) < len(rim):
            raise SceneError(
                f"{start}a cap needs a rim that is a simple loop, but openings meet in a node, "
                f"{_edge_places(rim, nodes)}; add the faces between them to the set, or leave them all out"
            )
        places = nodes[np.unique(rim[rim >= 0])]
        extent = float(np.ptp(places, axis=0).max())
        centred = places - places.mean(axis=0)
        off = float(np.abs(centred @ np.linalg.svd(centred)[2][2]).max())
        if off > PLANAR * extent:
            raise SceneError(
                f"{start}a cap needs a nearly planar rim, but one of {extent:.3g} m, {_edge_places(rim, nodes)}, is "
                f"{off:.2g} m off its plane (at most {PLANAR * extent:.2g} m); add the missing faces to the set"
            )
    return rims


def _edge_places(edges: IndexArray, nodes: FloatArray) -> str:
    """Return the places of some edges in words."""
    shown = ", ".join(f"{_place(nodes[a])} to {_place(nodes[b])} m" for a, b in edges[:SHOWN, :2])
    return f"such as {shown}" if len(edges) > SHOWN else f"from {shown}"


def _place(point: FloatArray) -> str:
    """Return a position in words."""
    return "(" + ", ".join(f"{v:.4g}" for v in point) + ")"
