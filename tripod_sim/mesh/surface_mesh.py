"""A surface of triangles, for obstacles, mazes and cloth, and the checks that name what is wrong with one."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray, freeze
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import SAME, names_of
from tripod_sim.mesh.topology import coincident, directed_edges, edge_uses

FLAT = 1e-9
"""A triangle lower than this fraction of its longest side has no area."""


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """Triangles in space.

    Attributes:
        vertices: Positions [m], shape (n, 3).
        triangles: Vertex indices, shape (m, 3), counter-clockwise seen from the side to which the surface faces.
    """

    vertices: FloatArray
    triangles: IndexArray

    def __post_init__(self) -> None:
        freeze(self, vertices=np.float64, triangles=np.int64)

    @cached_property
    def watertight(self) -> bool:
        """Whether each edge belongs to exactly two triangles: there is an inside."""
        return bool(len(self.triangles) and (edge_uses([self.triangles])[1] == 2).all())

    @property
    def volume(self) -> float:
        """What a watertight surface encloses [m³], 1/6 sum of a . (b x c); negative if it faces inward."""
        a, b, c = np.moveaxis(self.vertices[self.triangles] - self.vertices[:1], 1, 0)
        return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6)


def check_surface(mesh: SurfaceMesh, source: str) -> None:
    """Refuse a surface with which no contact can work, and name the offenders. An open boundary is none of them.

    Args:
        mesh: The surface.
        source: Where it comes from, for the message.

    Raises:
        SceneError: no triangles; positions not finite; vertex numbers out of range; unreferenced vertices; coincident
            vertices; triangles without area; edges of more than two triangles; neighbours that face opposite sides.
    """
    n = len(mesh.vertices)
    if not len(mesh.triangles):
        raise SceneError(f"{source}: the surface has no triangles; save it with faces")
    if (bad := np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))).size:
        raise SceneError(f"{source}: positions of vertices {names_of(bad)} are not finite")
    if (bad := np.flatnonzero(((mesh.triangles < 0) | (mesh.triangles >= n)).any(axis=1))).size:
        raise SceneError(f"{source}: triangles {names_of(bad)} name vertices outside 0..{n - 1}")
    if (bad := np.setdiff1d(np.arange(n), mesh.triangles)).size:
        raise SceneError(f"{source}: vertices {names_of(bad)} belong to no triangle; remove them")
    with np.errstate(over="ignore", invalid="ignore"):
        shared = coincident(mesh.vertices, SAME * np.ptp(mesh.vertices, axis=0).max())
        bad = np.flatnonzero(~(_heights(mesh) > FLAT))
    if shared.size:
        raise SceneError(
            f"{source}: vertices {names_of(shared)} have the same position as another vertex; merge them"
        )
    if bad.size:
        raise SceneError(f"{source}: triangles {names_of(bad)} have no area; remove them")
    edges, uses = edge_uses([mesh.triangles])
    if (crowded := edges[uses > 2]).size:
        raise SceneError(
            f"{source}: edges at vertices {names_of(np.unique(crowded))} belong to more than two "
            "triangles; correct the surface"
        )
    directed = directed_edges(mesh.triangles)
    _, inverse, count = np.unique(
        directed[:, 0] * n + directed[:, 1], return_inverse=True, return_counts=True
    )
    if (turned := np.unique(np.flatnonzero(count[inverse.ravel()] > 1) // 3)).size:
        raise SceneError(
            f"{source}: triangles {names_of(turned)} have the opposite orientation of a neighbour; make "
            "the orientation (normals) of the surface consistent"
        )


def _heights(mesh: SurfaceMesh) -> FloatArray:
    """Return the height of each triangle over its longest side, as a fraction of that side, shape (m,)."""
    x = mesh.vertices[mesh.triangles]
    sides = np.roll(x, -1, axis=1) - x
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    unit = np.divide(
        sides, longest[:, None, None], out=np.zeros_like(sides), where=longest[:, None, None] > 0
    )
    return np.asarray(np.linalg.norm(np.cross(unit[:, 0], unit[:, 1]), axis=1))
