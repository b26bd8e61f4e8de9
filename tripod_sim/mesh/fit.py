"""From the cells of a file to a mesh of the element that a scene asks for."""

from dataclasses import replace

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.element import Element, node_volumes
from tripod_sim.errors import SceneError
from tripod_sim.mesh.cells import Cells
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import SolidMesh, names_of
from tripod_sim.tables.bodies import AUTO

BEST = {
    "hexahedron": "h8_modes",
    "tetra": "t10",
    "tetra10": "t10",
    "hexahedron20": "h20",
    "hexahedron27": "h27",
}
"""The element of each kind of cells where a scene names none."""

LINEAR = {"hexahedron": "h8", "tetra": "t4"}
"""Cells that can be made into others, and their plainest element."""

SAMPLE = 512
"""Elements by which the order of mid-edge and face nodes is told."""


def fit_element(cells: Cells, element: str, scale: float, name: str) -> SolidMesh:
    """Return the mesh of the cells of a file; nodes that no element has are left out.

    Linear hexahedra become any element, linear tetrahedra T4 or T10; quadratic cells only the elements of their kind.
    Cells that are all inside out are turned over.

    Args:
        cells: Of one file.
        element: Name of the element, as in `elements.catalogue`, or `auto`: that of `BEST`.
        scale: Length unit of the file [m].
        name: What messages call the file.

    Raises:
        SceneError: no volume cells, several kinds of them, none that the element can be made of; cells that name points
            which the file does not have; points without three coordinates.
    """
    volumes = {k: v for k, v in cells.volumes.items() if len(v)}
    if not volumes:
        kinds = ", ".join([*cells.volumes, *cells.others]) or "none"
        raise SceneError(f"mesh.source: {name} has no tetrahedra or hexahedra (cells: {kinds})")
    if cells.solid:
        raise SceneError(
            f"mesh.source: {name} has cells that cannot be used: {', '.join(cells.solid)}; write the mesh "
            "with tetrahedra or hexahedra"
        )
    if len(volumes) > 1:
        raise SceneError(
            f"mesh.source: {name} has several kinds of volume cells ({', '.join(sorted(volumes))}); write "
            "the mesh with one kind"
        )
    ((cell, elements),) = volumes.items()
    notes = list[str]()
    if cells.skipped:
        counts = ", ".join(f"{count} {kind}" for kind, count in cells.skipped.items())
        notes.append(f"{name} has cells that are not read, none of them with a volume: {counts}")
    if element == AUTO:
        element = BEST[cell]
        if cell == "tetra":
            notes.append(
                f"mesh.element is not given: the tetrahedra of {name} become {element!r}, with a node in the "
                "middle of each edge. Element 't4' has fewer unknowns, but bends too stiffly"
            )
    points = _checked(cells.points, elements, name)
    fitting = [e.name for e in ELEMENTS.values() if e.cell == cell]
    makeable = [e.name for e in ELEMENTS.values() if _makeable(e, cell)]
    if element not in makeable:
        raise SceneError(
            f"mesh.element is {element!r}; the {cell} cells of {name} allow {', '.join(makeable)}"
        )
    used, renumbered = np.unique(elements, return_inverse=True)
    with np.errstate(over="ignore"):  # positions that overflow are named by check_mesh
        nodes = points[used] * scale
    kind = ELEMENTS[element if element in fitting else LINEAR[cell]]
    groups = {group: np.flatnonzero(np.isin(used, members)) for group, members in cells.groups.items()}
    ordered = in_order(nodes, renumbered.reshape(elements.shape), kind)
    if inside_out(nodes, ordered, kind):
        ordered = ordered[:, mirrored(kind)]
        notes.append(
            f"all {len(ordered)} cells of {name} had their nodes in reverse order; this was corrected"
        )
    mesh = SolidMesh(nodes, ordered, kind, groups, cells.cell_groups)
    mesh = mesh if element in fitting else convert(mesh, element)
    return replace(mesh, notes=tuple(notes))


def _makeable(kind: Element, cell: str) -> bool:
    return cell in (kind.cell, "hexahedron") or (cell == "tetra" and kind.corners == 4)


def _checked(points: FloatArray, elements: IndexArray, name: str) -> FloatArray:
    if points.ndim != 2 or points.shape[1] != 3:
        raise SceneError(
            f"mesh.source: {name} has points of shape {points.shape}; each needs three coordinates"
        )
    if (bad := np.flatnonzero(((elements < 0) | (elements >= len(points))).any(axis=1))).size:
        raise SceneError(
            f"mesh.source: {name}: elements {names_of(bad)} name nodes outside 0..{len(points) - 1}"
        )
    return points


def inside_out(nodes: FloatArray, elements: IndexArray, kind: Element) -> bool:
    """Return whether all elements (m, k) have a negative volume."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool((node_volumes(kind, nodes[elements])[0].sum(axis=1) < 0).all())


def mirrored(kind: Element) -> list[int]:
    """Return the nodes of an element in the order that turns it over: seen in a mirror, its cell is the same."""
    x = kind.reference
    seen = x[:, [1, 0, 2]] if kind.corners == 4 else x * [1, 1, -1]
    return [int(np.argmin(np.linalg.norm(x - place, axis=1))) for place in seen]


def in_order(nodes: FloatArray, elements: IndexArray, kind: Element) -> IndexArray:
    """Return quadratic elements with their mid-edge, face and centre nodes in VTK order, corners as they are.

    Formats number these nodes differently, and writers of one format do too; but each lies near the middle of its
    corners. The one order for all elements is read off the mean square distances in a sample of them. If that gives no
    one-to-one order, the elements are returned as they are, for `check_mesh` to refuse.
    """
    c = kind.corners
    if kind.size == c:
        return elements
    plain = ELEMENTS["t4" if c == 4 else "h8"]
    sample = elements[:: max(1, len(elements) // SAMPLE)]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        x = nodes[sample]
        x = (x - x[:, :1]) / np.ptp(x, axis=1).max(axis=1)[:, None, None]
        middles = np.einsum("ka,eai->eki", plain.functions(kind.reference[c:]), x[:, :c])
        square = ((x[:, c:, None] - middles[:, None]) ** 2).sum(axis=3).mean(axis=0)
    order = square.argmin(axis=0)
    if not np.isfinite(square).all() or len(set(order.tolist())) < len(order):
        return elements
    return np.hstack([elements[:, :c], elements[:, c:][:, order]])
