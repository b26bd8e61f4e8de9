"""Surfaces from files: OBJ and STL."""

import math
from array import array
from pathlib import Path

import numpy as np

from tripod_sim.errors import SceneError
from tripod_sim.mesh.obj import read_obj
from tripod_sim.mesh.read import check_file
from tripod_sim.mesh.stl import read_stl
from tripod_sim.mesh.surface_mesh import SurfaceMesh, check_surface

READERS = {".obj": read_obj, ".stl": read_stl}
"""By the ending of the file's name."""


def read_surface(path: Path, scale: float, field: str, owner: "array[int] | None" = None) -> SurfaceMesh:
    """Return the surface in a file, checked; vertices that no triangle has are left out.

    Args:
        path: A file that ends in `.obj` or `.stl`.
        scale: Length unit of the file [m]; neither format names one.
        field: Name of the scene's field that asks for it, for messages.
        owner: Takes the number of the polygon that each triangle is part of; stays empty for a file of triangles.

    Raises:
        SceneError: no such file, too large, not readable, or not a surface that `check_surface` accepts.
    """
    if not (math.isfinite(scale) and scale > 0):
        raise SceneError(f"{field}: scale is {scale} m; it must be a finite number above 0 m")
    check_file(path, field)
    read = READERS.get(path.suffix.lower())
    if read is None:
        raise SceneError(f"{field}: {str(path)!r} ends in {path.suffix!r}; allowed: {', '.join(READERS)}")
    name = f"{field}: {str(path)!r}"
    vertices, triangles = read_obj(path, name, owner) if read is read_obj else read(path, name)
    used, renumbered = np.unique(triangles, return_inverse=True)
    with np.errstate(over="ignore"):  # positions that overflow are named by the check
        mesh = SurfaceMesh(vertices[used] * scale, renumbered.reshape(-1, 3))
    check_surface(mesh, f"{field} {str(path)!r}")
    return mesh
