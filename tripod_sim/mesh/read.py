"""Meshes from files, through meshio (gmsh, VTK, Abaqus, and what else it reads)."""

import importlib.util
import io
import subprocess
import sys
from pathlib import Path

import numpy as np

from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import FloatArray, IndexArray, SolidMesh, names_of

MAX_BYTES = 200_000_000
"""A mesh file larger than this is refused unread."""

PATIENCE = 20.0
"""Longest time to read a file [s], besides one second per megabyte."""


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
    points, elements, kinds = _read(path)
    if not len(elements):
        raise SceneError(f"mesh.source: {str(path)!r} has no hexahedra (cells: {', '.join(kinds) or 'none'})")
    if points.ndim != 2 or points.shape[1] != 3:
        raise SceneError(
            f"mesh.source: {str(path)!r} has points of shape {points.shape}; three coordinates are needed"
        )
    if (bad := np.flatnonzero(((elements < 0) | (elements >= len(points))).any(axis=1))).size:
        raise SceneError(
            f"mesh.source: {str(path)!r}: elements {names_of(bad)} name nodes outside 0..{len(points) - 1}"
        )
    used, renumbered = np.unique(elements, return_inverse=True)
    return SolidMesh(points[used] * scale, renumbered.reshape(elements.shape))


def _read(path: Path) -> tuple[FloatArray, IndexArray, list[str]]:
    """Return points [file's unit], hexahedra and the names of all cell types. Raises SceneError."""
    if importlib.util.find_spec("meshio") is None:
        raise SceneError(
            "mesh.source: reading mesh files needs the package meshio (pip install 'tripod[mesh]')"
        )
    program = [sys.executable, "-P", str(Path(__file__).with_name("foreign.py")), str(path.absolute())]
    patience = PATIENCE + path.stat().st_size / 1e6
    try:
        run = subprocess.run(
            program, stdin=subprocess.DEVNULL, capture_output=True, timeout=patience, check=False
        )
    except subprocess.TimeoutExpired:
        raise SceneError(
            f"mesh.source: {str(path)!r} is not read after {patience:.0f} s; is the file cut short?"
        ) from None
    if run.returncode != 0:
        why = (
            " ".join(run.stdout.decode(errors="replace").split()) or f"the reader ended with {run.returncode}"
        )
        raise SceneError(f"mesh.source: {str(path)!r} cannot be read as a mesh: {why[:200]}")
    with np.load(io.BytesIO(run.stdout), allow_pickle=False) as found:
        return found["points"], found["hexahedra"], found["kinds"].tolist()
