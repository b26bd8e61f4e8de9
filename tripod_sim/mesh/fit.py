"""From the cells of a file to a mesh of the elements that a scene asks for."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.elements.catalogue import CHOSEN, ELEMENTS, LINEAR, SIZES
from tripod_sim.elements.element import Element, node_volumes
from tripod_sim.errors import SceneError
from tripod_sim.mesh.cells import Cells
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import Block, SolidMesh, names_of
from tripod_sim.tables.bodies import AUTO

SAMPLE = 512
"""Elements by which the order of mid-edge and face nodes is told."""


def fit_element(cells: Cells, element: str, scale: float, name: str) -> SolidMesh:
    """Return the mesh of the cells of a file; nodes that no element has are left out.

    Of a file with one kind of cells, linear hexahedra become any element of hexahedra or tetrahedra, linear tetrahedra
    T4 or T10, others an element with their nodes. Of a file with several kinds each becomes an element with its nodes.
    Cells of a kind that are all inside out are turned over.

    Args:
        cells: Of one file.
        element: Name of the element, as in `elements.catalogue`, or `auto`: that of `elements.catalogue.CHOSEN`.
        scale: Length unit of the file [m].
        name: What messages call the file.

    Raises:
        SceneError: no volume cells, none that the element can be made of; cells that name points which the file does
            not have; points without three coordinates.
    """
    volumes = {k: v for k, v in cells.volumes.items() if len(v)}
    if not volumes:
        kinds = ", ".join([*(f"{kind} (0)" for kind in cells.volumes), *cells.others]) or "none"
        raise SceneError(
            f"mesh.source: {name} has no volume cells (its cells: {kinds}); export a volume mesh with cells of the "
            f"kinds {', '.join(SIZES)}"
        )
    if cells.solid:
        raise SceneError(
            f"mesh.source: {name} has cells that cannot be used: {', '.join(cells.solid)}; write the mesh "
            f"with cells of the kinds {', '.join(SIZES)}"
        )
    notes = list[str]()
    if cells.skipped:
        counts = ", ".join(f"{count} {kind}" for kind, count in cells.skipped.items())
        notes.append(f"{name} has cells that are not read, none of them with a volume: {counts}")
    points = _checked(cells.points, volumes, name)
    kinds_of, said = _kinds(volumes, element, name)
    notes += said
    used, renumbered = np.unique(np.concatenate([v.ravel() for v in volumes.values()]), return_inverse=True)
    with np.errstate(over="ignore"):  # positions that overflow are named by check_mesh
        nodes = points[used] * scale
    groups = {group: np.flatnonzero(np.isin(used, members)) for group, members in cells.groups.items()}
    blocks, start, renumbered = [], 0, renumbered.ravel()
    for cell, elements in volumes.items():
        own = renumbered[start : start + elements.size].reshape(elements.shape)
        start += elements.size
        kind = kinds_of[cell] if kinds_of[cell].cell == cell else LINEAR[cell]
        own = in_order(nodes, own, kind)
        if inside_out(nodes, own, kind):
            own = own[:, kind.mirrored]
            which = "" if len(volumes) == 1 else f"{cell} "
            notes.append(
                f"all {len(own)} {which}cells of {name} had their nodes in reverse order; this was corrected"
            )
        blocks.append(Block(kind, own))
    mesh = SolidMesh(nodes, tuple(blocks), groups, cells.cell_groups)
    wanted = [*kinds_of.values()]
    if len(wanted) == 1 and mesh.kind is not wanted[0]:
        mesh = convert(mesh, wanted[0].name)
    return replace(mesh, notes=tuple(notes))


def _kinds(
    volumes: Mapping[str, IndexArray], element: str, name: str
) -> tuple[dict[str, Element], list[str]]:
    """Return the element that each kind of cells becomes, and notes. Raises SceneError if `element` is none of them."""
    several, notes = len(volumes) > 1, list[str]()
    found = {cell: _chosen(cell, several=several) for cell in volumes}
    if element != AUTO:
        able = {
            cell: [e for e in ELEMENTS.values() if (e.cell == cell if several else _makeable(e, cell))]
            for cell in volumes
        }
        if not any(element in {e.name for e in of} for of in able.values()):
            allowed = "; ".join(
                f"the {cell} cells of {name} allow {', '.join(e.name for e in of)}"
                for cell, of in able.items()
            )
            raise SceneError(f"mesh.element is {element!r}; {allowed}")
        for cell, of in able.items():
            if element in {e.name for e in of}:
                found[cell] = ELEMENTS[element]
    elif not several and (cell := next(iter(volumes))) != (kind := found[cell]).cell:
        notes.append(
            f"mesh.element is not given: the {cell} cells of {name} become {kind.name!r}, with a node in the "
            f"middle of each edge. Element {LINEAR[cell].name!r} has fewer unknowns, but bends too stiffly"
        )
    if several:
        pairs = ", ".join(f"{len(volumes[cell])} {cell} as {kind.name!r}" for cell, kind in found.items())
        notes.append(
            f"{name} has several kinds of cells: {pairs}. Each keeps its nodes, so that neighbours fit together"
        )
    return found, notes


def _chosen(cell: str, *, several: bool) -> Element:
    """Return the element of a kind of cells where a scene names none; beside others it has no further nodes."""
    kind = ELEMENTS[CHOSEN.get(cell) or next(e.name for e in ELEMENTS.values() if e.cell == cell)]
    return LINEAR[cell] if several and kind.cell != cell else kind


def _makeable(kind: Element, cell: str) -> bool:
    """Return whether cells of one kind can become elements of `kind`: as they are, with more nodes, or divided."""
    return cell in (kind.cell, kind.plain.cell, *kind.plain.divisions)


def _checked(points: FloatArray, volumes: Mapping[str, IndexArray], name: str) -> FloatArray:
    if points.ndim != 2 or points.shape[1] != 3:
        raise SceneError(
            f"mesh.source: {name} has points of shape {points.shape}; each needs three coordinates"
        )
    outside = np.concatenate([((v < 0) | (v >= len(points))).any(axis=1) for v in volumes.values()])
    if (bad := np.flatnonzero(outside)).size:
        raise SceneError(
            f"mesh.source: {name}: elements {names_of(bad)} name nodes outside 0..{len(points) - 1}"
        )
    return points


def inside_out(nodes: FloatArray, elements: IndexArray, kind: Element) -> bool:
    """Return whether all elements (m, k) have a negative volume."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool((node_volumes(kind, nodes[elements])[0].sum(axis=1) < 0).all())


def in_order(nodes: FloatArray, elements: IndexArray, kind: Element) -> IndexArray:
    """Return quadratic elements with their mid-edge, face and centre nodes in VTK order, corners as they are.

    Formats number these nodes differently, and writers of one format do too; but each lies near the middle of its
    corners. The one order for all elements is read off the mean square distances in a sample of them. If that gives no
    one-to-one order, the elements are returned as they are, for `check_mesh` to refuse.
    """
    c = kind.corners
    if kind.size == c:
        return elements
    sample = elements[:: max(1, len(elements) // SAMPLE)]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        x = nodes[sample]
        x = (x - x[:, :1]) / np.ptp(x, axis=1).max(axis=1)[:, None, None]
        middles = np.einsum("ka,eai->eki", kind.plain.functions(kind.reference[c:]), x[:, :c])
        square = ((x[:, c:, None] - middles[:, None]) ** 2).sum(axis=3).mean(axis=0)
    order = square.argmin(axis=0)
    if not np.isfinite(square).all() or len(set(order.tolist())) < len(order):
        return elements
    return np.hstack([elements[:, :c], elements[:, c:][:, order]])
