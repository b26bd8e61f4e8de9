"""Volume meshes from files: GiD's text, and through meshio gmsh, VTK, Abaqus and what else it reads."""

import importlib.util
import io
import math
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from tripod_host.reading import open_file
from tripod_sim.elements.catalogue import SIZES
from tripod_sim.errors import SceneError
from tripod_sim.mesh.cells import Cells
from tripod_sim.mesh.file_format import format_of
from tripod_sim.mesh.fit import fit_element
from tripod_sim.mesh.gid import read_gid
from tripod_sim.mesh.lines import MAX_BYTES
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.tables.bodies import AUTO

PARTS = ("stl", "obj", "step")
"""Formats of surfaces and of CAD files, which have no cells."""

PATIENCE = 20.0
"""Longest processor time to read a file [s], besides one second per megabyte."""


def read_solid(path: Path, scale: float, element: str, size: float | None = None) -> SolidMesh:
    """Return the volume mesh of a file.

    Cells without volume are left out, and nodes that only they use. Which elements the cells of a file allow is in
    `fit.fit_element`.

    Args:
        path: GiD text, or what meshio reads; `format_of` tells which.
        scale: Length unit of the file [m].
        element: Name of the element, or `auto`.
        size: Length of an edge [m], of a part (STL, OBJ, STEP), which is filled with tetrahedra.

    Raises:
        SceneError: no such file, not readable as a mesh, too large, or without cells of which the element is made.
    """
    name = repr(str(path))
    check_file(path, "mesh.source")
    try:
        file_format = format_of(path)
    except OSError as error:
        raise SceneError(f"mesh.source: {name} cannot be read: {error.strerror}") from None
    if file_format in PARTS:
        from tripod_sim.mesh.part.kept import as_element, kept_mesh  # noqa: PLC0415 - a mesh file needs no mesher

        kept, notes = kept_mesh(path, file_format, scale, size)
        mesh = as_element(read_solid(kept, 1.0, AUTO), element)
        return replace(mesh, notes=notes)
    cells = read_gid(path, f"mesh.source: {name}") if file_format == "gid" else _read(path, file_format)
    return fit_element(cells, element, scale, name)


def check_file(path: Path, field: str) -> None:
    """Refuse what is no file, or too large. Raises SceneError that begins with the name of the scene's `field`."""
    try:
        open_file(path, MAX_BYTES).close()
    except FileNotFoundError:
        raise SceneError(
            f"{field}: file {str(path)!r} does not exist; paths count from the folder of the scene file"
        ) from None
    except OSError as error:
        raise SceneError(f"{field}: file {str(path)!r} cannot be read: {error.strerror}") from None


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
