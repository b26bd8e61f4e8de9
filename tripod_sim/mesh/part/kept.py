"""The mesh of a part that a scene names: made once, and kept beside the part under a name with its content's hash."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

from tripod_host.reading import read_file
from tripod_sim.elements.tetrahedron import T4, T10
from tripod_sim.errors import SceneError, shown
from tripod_sim.mesh.convert import linear
from tripod_sim.mesh.file_format import CAD
from tripod_sim.mesh.lines import MAX_BYTES
from tripod_sim.mesh.part.part import PartSettings, mesh_part
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.mesh.write import check_writable, write_mesh
from tripod_sim.tables.bodies import AUTO

VERSION = 2
"""Of what makes meshes of parts; another one makes them again, under other names."""

FIELD = "mesh.source"


def kept_mesh(path: Path, file_format: str, scale: float, size: float | None) -> tuple[Path, tuple[str, ...]]:
    """Return the file with the quadratic mesh of a part, and notes where it was made just now.

    Args:
        path: The part, a file that can be read.
        file_format: Of `file_format.PARTS`.
        scale: Length unit of the file [m]; 1 for a CAD file, which names its own.
        size: Length of an edge [m].

    Raises:
        SceneError: there is no size; the part cannot be meshed, or the mesh cannot be kept.
    """
    if size is None:
        raise SceneError(
            f"{FIELD}: {str(path)!r} has no cells with a volume. To fill it, give mesh.size, the length of an edge, "
            "which tripod mesh finds for an accuracy. obstacles.source, rigid.source and springs.source take surfaces"
        )
    cad = file_format in CAD
    if cad and scale != 1.0:
        raise SceneError(
            f"mesh.scale is {scale:g}, but {str(path)!r} names its own length unit; leave it out"
        )
    settings = PartSettings(size, None if cad else scale)
    what = json.dumps([VERSION, asdict(settings)], sort_keys=True).encode()
    digest = hashlib.sha256(what + read_file(path, MAX_BYTES)).hexdigest()[:12]
    kept = path.with_name(f"{path.stem}-{digest}.msh")
    if kept.is_file():
        return kept, ()
    before = sorted(p.name for p in path.parent.glob(f"{path.stem}-{12 * '[0-9a-f]'}.msh"))
    check_writable(kept, FIELD)
    made = mesh_part(path, settings, FIELD)
    try:
        write_mesh(kept, made.mesh, made.faces)
    except OSError as error:
        raise SceneError(
            f"{FIELD}: the mesh of {str(path)!r} cannot be kept as {kept.name}: {error.strerror or error}; make the "
            "folder writable, or make the mesh elsewhere with tripod mesh"
        ) from None
    changed = f"; the part or its settings changed since {', '.join(before)} was made" if before else ""
    return kept, (
        f"{path.name} was filled with {made.mesh.count} elements of {1e3 * size:.3g} mm, kept as {kept.name}{changed}",
        *made.notes,
    )


def as_element(mesh: SolidMesh, element: str) -> SolidMesh:
    """Return the mesh of a part with the element that a scene names: its own, or linear ones on the same corners.

    Raises SceneError where it is another one.
    """
    if element in (AUTO, T10.name):
        return mesh
    if element != T4.name:
        raise SceneError(f"mesh.element is {shown(element)}; a part is meshed with {T10.name} or {T4.name}")
    return linear(mesh)
