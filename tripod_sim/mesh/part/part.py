"""A mesh of tetrahedra of a part, from its surface (STL, OBJ) or its CAD file (STEP), with what is known of its errors.

A surface is closed and filled by fTetWild [HuEtAl2020], a CAD file by gmsh [GeuzaineRemacle2009]; each is a process of
its own. Quadratic elements take the middles of their edges from the surface, as far as they stay good.
"""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.elements.tetrahedron import T4
from tripod_sim.errors import SceneError
from tripod_sim.mesh.cavity import cavities
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.curved import curved
from tripod_sim.mesh.file_format import CAD, PARTS, SURFACES, checked_format
from tripod_sim.mesh.nearest import NearestSurface
from tripod_sim.mesh.part.mesher import Say, run_mesher
from tripod_sim.mesh.part.part_surface import PartSurface, closed, read_raw
from tripod_sim.mesh.part.step_file import face_names
from tripod_sim.mesh.solid_mesh import SolidMesh, check_mesh, element_quality, solid_volumes

UNITS: Mapping[str, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "um": 1e-6, "inch": 0.0254}
"""Length units of surface files [m]."""

SMALLEST, LARGEST = 1e-5, 100.0
"""Extents of a part [m]; beyond them its unit is taken to be wrong."""

SHARE = 8.5
"""Regular tetrahedra in the volume of a cube whose sides are as long as their edges."""

MOST_CELLS = 1_000_000
"""Of a mesh."""

CELL_BYTES, BASE_BYTES = 1.6e3, 4e8
"""Memory of meshing for each tetrahedron expected, and without any [B]: of the mesher's process and of the one that
waits for it and checks the mesh, together. Measured by benchmarks/mesher_memory.py: by gmsh 285 MB (bar, 4722 of them
expected), 385 MB (notched finger, 192,744), 541 MB (beam, 330,418); by fTetWild 371 MB (ball, 4424), 388 MB (box,
29,514), 400 MB (ball, 48,768). That grows by 0.8 kB for each; twice that is taken."""

LEAST_QUALITY = 0.01
"""Of an element, the smallest scaled Jacobian: flatter ones make steps fail."""

NEAR, NEAREST = 5e-3, 2e-4
"""How far the new surface may be from the old one, in parts of the diagonal: at most, and at least."""

OF_SIZE = 0.05
"""The same, in parts of the length of an edge, within these bounds."""

CLOSER = 0.2
"""Factor of that distance for another try where the volume is too wrong."""

NOTICED = 1e-9
"""Distance of a node from the surface that is rounding, in parts of the largest extent."""


@dataclass(frozen=True)
class PartSettings:
    """How a part is meshed.

    Attributes:
        size: Length of an edge [m].
        unit: Length unit of a surface file [m]; None: it is guessed from its extent. A STEP file names its own.
        element: `t10` or `t4`.
        volume_change: Largest change of the volume, in parts of it.
        time_limit: Longest time of the mesher [s].
    """

    size: float
    unit: float | None = None
    element: str = "t10"
    volume_change: float = 0.02
    time_limit: float = 300.0


@dataclass(frozen=True, eq=False)
class PartMesh:
    """The mesh of a part.

    Attributes:
        mesh: In metres; its groups are the nodes of named faces.
        faces: Triangles on each named face of the geometry, as nodes of `mesh`, shape (k, 3 or 6).
        tool: What made it.
        volume_before, volume: Of the closed surface or the geometry, and of the mesh [m³].
        distance: Largest distance between the surface and that of the mesh [m], of places on either; where the surface
            crosses itself, of places on that of the mesh.
        quality: Smallest scaled Jacobian of each element, shape (m,); 1 at a right angle.
        notes: What users should know, one sentence each.
    """

    mesh: SolidMesh
    faces: Mapping[str, IndexArray]
    tool: str
    volume_before: float
    volume: float
    distance: float
    quality: FloatArray
    notes: tuple[str, ...]

    @property
    def cavities(self) -> tuple[float, ...]:
        """Volumes of the cavities [m³], in the order of their numbers in `chamber.cavity`."""
        return tuple(surface.volume(self.mesh.nodes) for surface in cavities(self.mesh))


def mesh_part(path: Path, settings: PartSettings, field: str, say: Say = lambda _: None) -> PartMesh:
    """Return the mesh of a part.

    Args:
        path: An STL, OBJ or STEP file; the content tells which.
        settings: How.
        field: Where the file is named, for messages.
        say: Told what is being done.

    Raises:
        SceneError: the file cannot be read or encloses no volume; its unit, the size or the memory do not fit; the
            mesher is missing or failed; or the mesh differs too much, or has elements that are too flat.
    """
    name = f"{field}: {str(path)!r}"
    say("reading the part")
    file_format = checked_format(path, field)
    check_part(file_format, name)
    notes = list[str]()
    if file_format in SURFACES:
        surface, notes = read_part(path, file_format, settings, name)
        extent = float(np.ptp(surface.mesh.vertices, axis=0).max())
        check_size(settings.size, extent, surface.volume, name)
        found, faces, facts = _fill_surface(surface, settings, name, say)
    else:
        found, faces, facts = _fill_cad(path, settings, name, say)
    say("checking the mesh")
    mesh, less = found
    if less:
        notes.append(
            f"{less} nodes are not quite on the surface, because elements would bend too much there; a smaller size "
            "avoids it"
        )
    if facts.get("joined"):
        notes.append(
            "solids touch or overlap and became one body; its faces have numbers instead of their names"
        )
    check_mesh(mesh, name)
    quality = element_quality(mesh)
    if (worst := float(quality.min())) < LEAST_QUALITY:
        k = int(quality.argmin())
        place = ", ".join(f"{1e3 * c:.4g}" for c in mesh.nodes[mesh.elements[k]].mean(axis=0))
        raise SceneError(
            f"{name}: the worst element, {k} at ({place}) mm, has the quality {worst:.2g} (at least "
            f"{LEAST_QUALITY:g}), so steps would fail; give a smaller size, or remove the thin feature there"
        )
    volume, before = float(solid_volumes(mesh).sum()), float(facts["volume"])
    if abs(volume / before - 1) > settings.volume_change:
        raise SceneError(
            f"{name}: the volume changed from {1e9 * before:.4g} to {1e9 * volume:.4g} mm³, by "
            f"{100 * (volume / before - 1):+.2g} % (at most {100 * settings.volume_change:g} %); give a smaller size, "
            "correct the surface where it crosses itself, or allow it with --volume-change"
        )
    if file_format in SURFACES:
        say("comparing the surfaces")
        old = NearestSurface(surface.mesh.vertices, surface.mesh.triangles)
        new = NearestSurface(mesh.nodes, mesh.surface)
        # what crosses itself has places inside, which the mesh does not keep
        facts["distance"] = (
            old.farthest(new) if surface.crosses else max(old.farthest(new), new.farthest(old))
        )
    groups = {key: np.unique(rows) for key, rows in faces.items()}
    tool = "fTetWild" if file_format in SURFACES else "gmsh"
    return PartMesh(
        replace(mesh, groups=groups), faces, tool, before, volume, float(facts["distance"]), quality, tuple(notes)
    )  # fmt: skip


def mean_edge(mesh: SolidMesh) -> float:
    """Return the length of an edge [m] of a regular tetrahedron that is as large as those of a mesh on average.

    Where a part has small features, a mesh of it has shorter edges than the size that was asked for.
    """
    return float((SHARE * solid_volumes(mesh).sum() / mesh.count) ** (1 / 3))


def part_extent(path: Path, settings: PartSettings, field: str, say: Say = lambda _: None) -> float:
    """Return the largest extent of a part [m], before it is meshed. Raises SceneError as `mesh_part`."""
    name = f"{field}: {str(path)!r}"
    file_format = checked_format(path, field)
    if file_format in CAD:
        given = {"path": str(path.resolve()), "size": 0.0}
        return float(run_mesher("gmsh_cad", given, settings.time_limit, name, say)["extent"])
    check_part(file_format, name)
    surface, _ = read_part(path, file_format, settings, name)
    return float(np.ptp(surface.mesh.vertices, axis=0).max())


def check_part(file_format: str, name: str) -> None:
    """Raise SceneError, which begins with `name`, where a format is none of a part."""
    if file_format not in PARTS:
        raise SceneError(
            f"{name} is a file of {file_format or 'an unknown format'}; allowed: STL, OBJ and STEP"
        )


def check_extent(extent: float, name: str) -> None:
    """Raise SceneError, which begins with `name`, where a part is so long or short [m] that its unit is wrong."""
    if not SMALLEST <= extent <= LARGEST:
        raise SceneError(
            f"{name} would be {extent:.4g} m long (allowed: {SMALLEST:g} to {LARGEST:g} m), so its length unit is "
            "wrong; name it, such as --unit mm, or scale = 0.001 in a scene, or export it with the right one"
        )


def read_part(
    path: Path, file_format: str, settings: PartSettings, name: str
) -> tuple[PartSurface, list[str]]:
    """Return the surface of a part, closed, and notes on what was corrected. Raises SceneError."""
    vertices, triangles = read_raw(path, file_format, name)
    extent = float(np.ptp(vertices[triangles].reshape(-1, 3), axis=0).max())
    notes, unit = [], settings.unit
    if unit is None:
        unit = 1e-3 if extent > 1 else 1.0
        notes.append(
            f"the unit of {path.name} is taken to be {'mm' if extent > 1 else 'm'}: its largest extent is {extent:.4g}"
        )
    check_extent(extent * unit, name)
    surface = closed(vertices * unit, triangles, name)
    if surface.holes:
        notes.append(
            f"{surface.holes} hole{'s' if surface.holes > 1 else ''} closed, up to {1e3 * surface.widest:.3g} mm wide"
        )
    if surface.joined:
        notes.append(f"cracks closed: vertices up to {1e3 * surface.joined:.2g} mm apart were joined")
    if surface.crosses:
        notes.append("the surface crosses itself, or lies within itself; what it encloses twice counts once")
    if surface.turned:
        notes.append(f"{surface.turned} triangles turned over, so that all face outwards")
    if surface.removed:
        notes.append(f"{surface.removed} triangles removed: without area, or given twice")
    return surface, notes


def check_size(size: float, extent: float, volume: float, name: str, memory: float | None = None) -> None:
    """Refuse a size that does not fit.

    Args:
        size: Length of an edge [m].
        extent: Largest one of the part [m].
        volume: Of the part [m³].
        name: What messages call the part.
        memory: What may be used [B]; None: what is free.

    Raises:
        SceneError: it is larger than the part, or gives more elements than are allowed or than the memory holds.
    """
    if size > extent:
        raise SceneError(
            f"{name}: the size is {1e3 * size:.4g} mm, but the part is only {1e3 * extent:.4g} mm long; give a size of "
            f"at most {1e3 * extent / 5:.2g} mm"
        )
    cells = SHARE * volume / size**3
    room = free_memory() if memory is None else memory
    most = min(MOST_CELLS, max((room - BASE_BYTES) / CELL_BYTES, 1.0))
    if cells > most:
        fits = _rounded_up(1e3 * (SHARE * volume / most) ** (1 / 3))
        why = f"at most {MOST_CELLS} are allowed"
        if most < MOST_CELLS:
            need = (cells * CELL_BYTES + BASE_BYTES) / 1e9
            why = f"which need {need:.3g} GB of memory, and {room / 1e9:.3g} GB are free"
        raise SceneError(
            f"{name}: a size of {1e3 * size:.3g} mm gives about {cells:.2g} elements, {why}; give a size of at least "
            f"{fits:g} mm"
        )


def _rounded_up(value: float) -> float:
    """Return a positive number with two digits, no smaller than it is."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit) * unit:.2g}")


def free_memory() -> float:
    """Return the memory that new processes may use [B]."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return next(1024.0 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))


Filled = tuple[tuple[SolidMesh, int], dict[str, IndexArray], dict[str, Any]]
"""A mesh and how many of its nodes are not on the surface, faces by their name, and what is known of it."""


def _fill_surface(surface: PartSurface, settings: PartSettings, name: str, say: Say) -> Filled:
    """Return a mesh of the inside of a surface."""
    vertices, triangles = surface.mesh.vertices, surface.mesh.triangles
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    near = float(np.clip(OF_SIZE * settings.size, NEAREST * diagonal, NEAR * diagonal))
    given = {"points": vertices, "triangles": triangles, "size": settings.size}
    while True:
        made = run_mesher("tetwild", {**given, "distance": near}, settings.time_limit, name, say)
        mesh = tetrahedra(made["points"], made["cells"])
        change = abs(float(solid_volumes(mesh).sum()) / surface.volume - 1)
        if change <= settings.volume_change or near < NEAREST * diagonal:
            break
        near *= CLOSER  # thin walls vanish where the surface may move too far
    if not mesh.count:
        raise SceneError(
            f"{name} cannot be meshed: no inside was found; correct the surface in the CAD program"
        )
    say("moving nodes onto the surface")
    target = NearestSurface(vertices, triangles)
    mesh, less = _on_surface(mesh, target)
    if settings.element == "t10":
        mesh, less = _on_surface(convert(mesh, "t10"), target)
    return (mesh, less), {}, {"volume": surface.volume}


def _on_surface(mesh: SolidMesh, target: NearestSurface) -> tuple[SolidMesh, int]:
    """Return a mesh with the nodes of its boundary on a surface, and how many are not quite there."""
    places = np.array(mesh.nodes)
    own = np.unique(np.concatenate([faces.nodes.ravel() for faces in mesh.boundary]))
    places[own], distances = target.places(mesh.nodes[own])
    own = own[distances < NOTICED * np.ptp(mesh.nodes, axis=0).max()]
    places[own] = mesh.nodes[own]
    return curved(mesh, places)


def _fill_cad(path: Path, settings: PartSettings, name: str, say: Say) -> Filled:
    """Return a mesh of the solids of a CAD file, and the triangles on its faces."""
    if settings.unit is not None:
        raise SceneError(f"{name} names its own length unit; leave out --unit, and scale in a scene")
    given = {"path": str(path.resolve()), "size": 0.0}
    facts = run_mesher("gmsh_cad", given, settings.time_limit, name, say)
    check_extent(float(facts["extent"]), name)
    check_size(settings.size, float(facts["extent"]), float(facts["volume"]), name)
    made = run_mesher("gmsh_cad", {**given, "size": settings.size}, settings.time_limit, name, say)
    cells, points = made["cells"], made["points"]
    mesh = tetrahedra(points, cells[:, :4])
    number = np.full(len(points), -1)
    less = 0
    if settings.element == "t4":
        number[np.unique(cells[:, :4])] = np.arange(len(mesh.nodes))
    else:
        mesh = convert(mesh, "t10")
        number[cells] = mesh.elements
        places = np.array(mesh.nodes)
        places[mesh.elements] = points[cells]
        mesh, less = curved(mesh, places)
    corners = 3 if settings.element == "t4" else 6
    names = face_names(path)
    tags = np.unique(made["faces"])
    known = len(names) == int(tags.max()) and not made["joined"]
    faces: dict[str, IndexArray] = {}
    for tag in tags.tolist():
        rows = number[made["triangles"][made["faces"] == tag][:, :corners]]
        key = (names[tag - 1] if known else "") or f"face:{tag}"
        faces[key] = np.concatenate([faces[key], rows]) if key in faces else rows
    return (mesh, less), faces, {key: made[key] for key in ("volume", "distance", "joined")}


def tetrahedra(points: FloatArray, cells: IndexArray) -> SolidMesh:
    """Return a mesh of right-handed linear tetrahedra, without nodes that none has.

    Args:
        points: [m], shape (n, 3).
        cells: Either way round, shape (m, 4).
    """
    used, renumbered = np.unique(cells, return_inverse=True)
    cells, nodes = renumbered.reshape(-1, 4), points[used]
    a, b, c, d = np.moveaxis(nodes[cells], 1, 0)
    left = np.einsum("ei,ei->e", b - a, np.cross(c - a, d - a)) < 0
    cells[left] = cells[left][:, [0, 2, 1, 3]]
    return SolidMesh.of(nodes, cells, T4)
