"""The mesh of a solid as a scene describes it."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.element import Element
from tripod_sim.elements.hexahedron import H8
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import SolidMesh, check_mesh
from tripod_sim.tables.bodies import AUTO, Mesh

MOST_CELLS = 1_000_000
"""Of a mesh: what goes beyond fills the memory of most machines."""


def described_mesh(description: Mesh) -> SolidMesh:
    """Return the mesh that a scene describes. Raises SceneError."""
    kind: Element | None
    notes = tuple[str, ...]()
    if description.source == "y_piece":
        from tripod_sim.mesh.y_piece import LEVELS, YShape, divided, y_piece  # noqa: PLC0415 - only where it is described

        kind = ELEMENTS[description.element]
        level = divided(LEVELS[description.level], 2**description.refine)
        shape = YShape(legs=description.legs)
        mesh = y_piece(level, shape, kind) if kind.plain is H8 else y_piece(level, shape)
    elif description.source == "block":
        from tripod_sim.mesh.block import block  # noqa: PLC0415 - only where it is described

        _check_count(math.prod(description.cells), description)
        kind = ELEMENTS[description.element]
        mesh = block(description.scale * np.array(description.corners), description.cells)
    elif "." in description.source:
        mesh = _from_file(Path(description.source), description)
        kind, notes = None, mesh.notes
    else:
        raise SceneError(
            f"mesh.source is {description.source!r}; allowed: y_piece, block, or the path of a mesh file"
        )
    if kind and mesh.kind is not kind:
        from tripod_sim.mesh.convert import convert  # noqa: PLC0415 - only where it is described

        mesh = convert(mesh, kind.name)
    if description.source != "y_piece":
        _check_count(mesh.count, description)
    for _ in range(0 if description.source == "y_piece" else description.refine):
        from tripod_sim.mesh.refine import refine  # noqa: PLC0415 - only where it is described

        mesh = refine(mesh)
    check_mesh(mesh, f"mesh.source {description.source!r}")
    return replace(mesh, notes=notes)


def _from_file(path: Path, description: Mesh) -> SolidMesh:
    """Return the mesh in a file, or that of a part, which is made where there is none yet. Raises SceneError."""
    from tripod_sim.mesh.file_format import PARTS, checked_format  # noqa: PLC0415 - only where it is described
    from tripod_sim.mesh.read import read_solid  # noqa: PLC0415

    if (file_format := checked_format(path, "mesh.source")) not in PARTS:
        return read_solid(path, description.scale, description.element)
    from tripod_sim.mesh.part.kept import as_element, kept_mesh  # noqa: PLC0415

    kept, notes = kept_mesh(path, file_format, description.scale, description.size)
    return replace(as_element(read_solid(kept, 1.0, AUTO), description.element), notes=notes)


def element_of(description: Mesh) -> str:
    """Return the name of the element of a mesh; where none is given for a file, its cells decide.

    Raises SceneError where the file cannot be read.
    """
    if description.element != AUTO:
        return description.element
    return described_mesh(description).blocks[0].kind.name


def _check_count(cells: int, description: Mesh) -> None:
    """Raise SceneError if a mesh has too many cells once it is refined."""
    if (count := cells * 8**description.refine) > MOST_CELLS:
        raise SceneError(
            f"mesh.source {description.source!r} has {count} cells at mesh.refine = {description.refine}; "
            f"allowed: at most {MOST_CELLS}; set a smaller mesh.refine"
        )
