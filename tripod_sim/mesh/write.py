"""Writes meshes of tetrahedra as VTK's .vtu or gmsh's .msh, the named faces with them."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tripod_host.arrays import IndexArray
from tripod_host.writing import replaced, scratch_folder
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import SolidMesh

FORMATS = {".vtu": "vtu", ".msh": "gmsh22"}
"""meshio's names of the formats by the ending of a file."""


def check_writable(path: Path, field: str) -> None:
    """Raise SceneError, which begins with `field`, unless a mesh can be written to a file of that name."""
    if path.suffix.lower() not in FORMATS:
        raise SceneError(f"{field} is {str(path)!r}; it must end in {' or '.join(FORMATS)}")
    try:
        import meshio  # noqa: F401, PLC0415 - an optional package
    except ImportError:
        raise SceneError(f"{field}: mesh files need the package meshio (pip install 'tripod[cad]')") from None


def write_mesh(path: Path, mesh: SolidMesh, faces: Mapping[str, IndexArray]) -> None:
    """Write a mesh of one kind of element, whole or not at all.

    As sets of a scene the faces have their names in a .msh file; in a .vtu file they are `face:1`, `face:2` and so on,
    in the order of `faces`.

    Args:
        path: With an ending of `FORMATS`.
        mesh: In metres.
        faces: Triangles of nodes, shape (k, 3 or 6), by name.

    Raises:
        OSError: it cannot be written.
    """
    import meshio  # noqa: PLC0415 - an optional package

    triangle = "triangle" if mesh.kind.corners == mesh.kind.size else "triangle6"
    blocks = [(mesh.kind.cell, mesh.elements)]
    numbers = [np.zeros(len(mesh.elements), dtype=np.int32)]
    if faces:
        rows = list(faces.values())
        blocks.append((triangle, np.concatenate(rows)))
        numbers.append(np.repeat(np.arange(1, len(rows) + 1, dtype=np.int32), [len(r) for r in rows]))
    file_format = FORMATS[path.suffix.lower()]
    if file_format == "vtu":
        found = meshio.Mesh(mesh.nodes, blocks, cell_data={"face": numbers} if faces else {})
    else:
        named = {re.sub(r'[\s"]', "_", name): np.array([k, 2]) for k, name in enumerate(faces, 1)}
        data = {"gmsh:physical": numbers, "gmsh:geometrical": numbers}
        found = meshio.Mesh(mesh.nodes, blocks, cell_data=data, field_data=named)
    with scratch_folder() as folder, replaced(path) as file:
        made = folder / f"mesh{path.suffix.lower()}"
        meshio.write(made, found, file_format)
        file.write(made.read_bytes())
