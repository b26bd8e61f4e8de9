"""Shape: a triangulated surface from an OBJ or STL file; a rigid body is the inside of a closed one."""

from pathlib import Path

import numpy as np

from tripod_sim.errors import SceneError
from tripod_sim.mesh.read_surface import read_surface
from tripod_sim.mesh.surface_mesh import SurfaceMesh
from tripod_sim.mesh.surfaces import Part
from tripod_sim.shapes import Shape
from tripod_sim.tables.bodies import Obstacle, Rigid

FIELDS = ("source", "scale")


def make(table: Rigid | Obstacle, field: str, obstacle: bool) -> Shape:
    """Return the surface of a file about the file's origin as an obstacle, else what it encloses about its centre.

    Raises:
        SceneError: naming file and line; or a rigid body's surface is open or faces inward.
    """
    surface = read_surface(Path(table.source), table.scale, f"{field}.source")
    if not obstacle:
        return solid_of(surface, f"{field}.source {table.source!r}")
    part = Part(surface.vertices, surface.triangles)
    return Shape(part, surface.vertices, surface.triangles, np.zeros((3, 3)), 0.0)


def solid_of(surface: SurfaceMesh, field: str) -> Shape:
    """Return the body that a closed surface encloses, of even density, moved so that its centre is the origin.

    With V, V c and C = integrals of 1, x and (x - c) (x - c)^T over the tetrahedra between origin and triangles,
    I = (tr C 1 - C) / V.

    Raises:
        SceneError: the surface is open or faces inward; `field` names it.
    """
    if not surface.watertight:
        raise SceneError(
            f"{field}: the surface is open; a rigid body needs a closed one: close its holes, or make it "
            "one of the [[obstacles]], which may be open"
        )
    middle = surface.vertices.mean(axis=0)
    a, b, c = np.moveaxis((surface.vertices - middle)[surface.triangles], 1, 0)
    volumes = np.einsum("ti,ti->t", a, np.cross(b, c)) / 6
    volume, total = float(volumes.sum()), a + b + c
    if not volume > 0:
        raise SceneError(
            f"{field}: the surface encloses {volume:.3g} m³, so its triangles face inward; reverse their "
            "node order (flip the normals)"
        )
    centre = np.asarray((volumes[:, None] * total).sum(axis=0) / (4 * volume))
    moment = np.einsum("t,ti,tj->ij", volumes, total, total)
    for x in (a, b, c):
        moment += np.einsum("t,ti,tj->ij", volumes, x, x)
    spread = moment / (20 * volume) - np.outer(centre, centre)
    vertices = surface.vertices - middle - centre
    part = Part(vertices, surface.triangles, rigid=True)
    return Shape(part, vertices, surface.triangles, np.trace(spread) * np.eye(3) - spread, volume)
