"""Volume meshes from files: GiD's text, and through meshio gmsh, VTK, Abaqus and what else it reads."""

import importlib.util
import io
import math
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np

from tripod_sim.elements.catalogue import SIZES
from tripod_sim.errors import SceneError
from tripod_sim.mesh.cells import Cells
from tripod_sim.mesh.file_format import PARTS, checked_format
from tripod_sim.mesh.fit import fit_element
from tripod_sim.mesh.gid import read_gid
from tripod_sim.mesh.solid_mesh import SolidMesh

PATIENCE = 20.0
"""Longest processor time to read a file [s], besides one second per megabyte."""


def read_solid(path: Path, scale: float, element: str) -> SolidMesh:
    """Return the volume mesh of a file.

    Cells without volume are left out, and nodes that only they use. Which elements the cells of a file allow is in
    `fit.fit_element`.

    Args:
        path: GiD text, or what meshio reads; `format_of` tells which.
        scale: Length unit of the file [m].
        element: Name of the element, or `auto`.

    Raises:
        SceneError: no such file, not readable as a mesh, too large, or without cells of which the element is made.
    """
    name = repr(str(path))
    file_format = checked_format(path, "mesh.source")
    if file_format in PARTS:
        raise SceneError(f"mesh.source: {name} has no cells with a volume; fill it with cells by tripod mesh")
    cells = read_gid(path, f"mesh.source: {name}") if file_format == "gid" else _read(path, file_format)
    return fit_element(cells, element, scale, name)


def _read(path: Path, file_format: str) -> Cells:
    """Return what meshio reads; the format is by its names, or empty. Raises SceneError."""
    if importlib.util.find_spec("meshio") is None:
        raise SceneError(
            "mesh.source: reading mesh files needs the package meshio (pip install 'tripod[mesh]')"
        )
    patience = math.ceil(PATIENCE + path.stat().st_size / 1e6)
    program = [sys.executable, "-P", str(Path(__file__).with_name("foreign.py")), str(path.absolute())]
    program += [file_format, str(patience), *(f"{kind}={size}" for kind, size in SIZES.items())]
    run = subprocess.run(
        program,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # threads reserve memory, which is bounded there
    )
    if run.returncode == -signal.SIGXCPU:
        raise SceneError(
            f"mesh.source: reading {str(path)!r} took more than {patience} s of processor time and was "
            "stopped; is the file cut short?"
        )
    if run.returncode != 0:
        why = (
            " ".join(run.stdout.decode(errors="replace").split()) or f"the reader ended with {run.returncode}"
        )
        raise SceneError(f"mesh.source: {str(path)!r} cannot be read as a mesh: {why[:300]}")
    with np.load(io.BytesIO(run.stdout), allow_pickle=False) as found:
        volumes = {kind: found[kind] for kind in SIZES if kind in found}
        groups = {name: found[f"group {i}"] for i, name in enumerate(found["groups"].tolist())}
        cell_groups = {name: found[f"cells {i}"] for i, name in enumerate(groups)}
        others, skipped = tuple(found["others"].tolist()), found["skipped"].tolist()
        return Cells(
            found["points"],
            volumes,
            others,
            tuple(kind for kind, solid in zip(others, found["solid"].tolist(), strict=True) if solid),
            {kind: count for kind, count in zip(others, skipped, strict=True) if count},
            groups,
            {name: cells for name, cells in cell_groups.items() if len(cells)},
        )
