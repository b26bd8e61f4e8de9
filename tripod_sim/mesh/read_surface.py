"""Surfaces from files: OBJ and STL."""

import math
from array import array
from pathlib import Path

import numpy as np

from tripod_sim.errors import SceneError
from tripod_sim.mesh.file_format import SURFACES, checked_format
from tripod_sim.mesh.lines import MOST_TRIANGLES
from tripod_sim.mesh.obj import read_obj
from tripod_sim.mesh.stl import read_stl
from tripod_sim.mesh.surface_mesh import SurfaceMesh, check_surface


def read_surface(
    path: Path, scale: float, field: str, owner: "array[int] | None" = None, most: int = MOST_TRIANGLES
) -> SurfaceMesh:
    """Return the surface in a file, checked; vertices that no triangle has are left out.

    Args:
        path: An OBJ or STL file; `format_of` tells which.
        scale: Length unit of the file [m]; neither format names one.
        field: Name of the scene's field that asks for it, for messages.
        owner: Takes the number of the polygon that each triangle is part of; stays empty for a file of triangles.
        most: Triangles; a file of more is refused as soon as that is known.

    Raises:
        SceneError: no such file, too large, not readable, or not a surface that `check_surface` accepts.
    """
    if not (math.isfinite(scale) and scale > 0):
        raise SceneError(f"{field}: scale is {scale} m; it must be a finite number above 0 m")
    file_format = checked_format(path, field)
    name = f"{field}: {str(path)!r}"
    if file_format not in SURFACES:
        raise SceneError(f"{name} is a file of {file_format or 'an unknown format'}; allowed: OBJ and STL")
    if file_format == "obj":
        vertices, triangles = read_obj(path, name, owner, most)
    else:
        vertices, triangles = read_stl(path, name, most)
    used, renumbered = np.unique(triangles, return_inverse=True)
    with np.errstate(over="ignore"):  # positions that overflow are named by the check
        mesh = SurfaceMesh(vertices[used] * scale, renumbered.reshape(-1, 3))
    check_surface(mesh, f"{field} {str(path)!r}")
    return mesh
