"""Meshes from files, through meshio (gmsh, VTK, Abaqus, and what else it reads)."""

import io
import warnings
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import SolidMesh

MAX_BYTES = 200_000_000
"""A mesh file larger than this is refused unread."""


def read_hexahedra(path: Path, scale: float) -> SolidMesh:
    """Return the hexahedra of a mesh file.

    Args:
        path: A file with eight-node hexahedra; other cells are left out, and nodes that only they use.
        scale: Length unit of the file [m].

    Raises:
        SceneError: no such file, not readable as a mesh, too large, or without hexahedra.
    """
    if not path.is_file():
        raise SceneError(f"mesh.source: file {str(path)!r} does not exist")
    if path.stat().st_size > MAX_BYTES:
        raise SceneError(f"mesh.source: file {str(path)!r} is larger than {MAX_BYTES} bytes")
    mesh = _read(path)
    blocks = [block.data for block in mesh.cells if block.type == "hexahedron"]
    if not blocks:
        kinds = ", ".join(sorted({block.type for block in mesh.cells})) or "none"
        raise SceneError(f"mesh.source: {str(path)!r} has no hexahedra (cells: {kinds})")
    elements = np.concatenate(blocks).astype(np.int64)
    points = np.asarray(mesh.points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise SceneError(
            f"mesh.source: {str(path)!r} has points of shape {points.shape}; three coordinates are needed"
        )
    if ((elements < 0) | (elements >= len(points))).any():
        raise SceneError(f"mesh.source: {str(path)!r} names nodes outside 0..{len(points) - 1}")
    used, renumbered = np.unique(elements, return_inverse=True)
    return SolidMesh(points[used] * scale, renumbered.reshape(elements.shape))


def _read(path: Path) -> Any:
    """Return what meshio makes of a file, silently. Raises SceneError."""
    try:
        import meshio  # noqa: PLC0415 - only scenes with a mesh file need it
    except ImportError:
        raise SceneError(
            "mesh.source: reading mesh files needs the package meshio (pip install 'tripod[mesh]')"
        ) from None
    printed = io.StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return meshio.read(path)
    except SystemExit:  # meshio prints its reason and exits
        why = printed.getvalue() or "not in the format that its name says"
    except Exception as error:  # noqa: BLE001 - whatever a parser meets in a file that is not what it says
        why = f"{type(error).__name__}: {error}"
    raise SceneError(f"mesh.source: {str(path)!r} cannot be read as a mesh: {' '.join(why.split())[:200]}")
