"""Fills the solids of a STEP file with tetrahedra by gmsh, as a program: `gmsh_cad.py PARENT IN.npz OUT.npz`.

gmsh is under the GPL, so nothing else imports it. IN.npz has `path`, the file, and `size`, the length of an edge [m].
OUT.npz has, in metres, `points` (n, 3) and `cells` (m, 10), quadratic tetrahedra in VTK order, `triangles` (k, 6) and
`faces` (k,), the faces of the geometry on which they are, `volume`, that of the solids [m³], `distance`, the largest
one of a triangle's centre from the geometry, and `joined`, whether solids that touch or overlap were made one body:
then `faces` are not those of the file. For a size of 0 it has `extent`, the largest one, and `volume` alone. With exit
code 1 standard output holds the reason instead. The program ends with the process PARENT.
"""

import sys
from typing import Any

import numpy as np

from tripod_host.parent import helped

VTK_ORDER = (0, 1, 2, 3, 4, 5, 6, 7, 9, 8)
"""Of the nodes of a quadratic tetrahedron, as gmsh numbers them."""

FINER = 4
"""How many times smaller edges may be on curved faces."""

ROUND = 12
"""Edges along a full circle, as far as `FINER` allows them."""


def work(source: str, target: str) -> None:
    """Read, fill, write."""
    with np.load(source, allow_pickle=False) as given:
        found = filled(str(given["path"]), float(given["size"]))
    np.savez(target, allow_pickle=False, **found)


def filled(path: str, size: float) -> dict[str, Any]:
    """Return what OUT.npz has."""
    import gmsh  # noqa: PLC0415 - an optional package

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    options = {
        "General.Terminal": 0,
        "Mesh.MeshSizeMax": size,
        "Mesh.MeshSizeMin": size / FINER,
        "Mesh.MeshSizeFromCurvature": ROUND,
        "Mesh.ElementOrder": 2,
        "Mesh.OptimizeNetgen": 1,
    }
    for name, value in options.items():
        gmsh.option.setNumber(name, value)
    gmsh.option.setString("Geometry.OCCTargetUnit", "M")
    gmsh.open(path)
    solids = [tag for _, tag in gmsh.model.getEntities(3)]
    if not solids:
        surfaces = len(gmsh.model.getEntities(2))
        raise ValueError(f"it has no solid, but {surfaces} faces; export the part as a solid")
    joined = len(solids) > 1 and _joined(gmsh)
    volume = sum(gmsh.model.occ.getMass(*solid) for solid in gmsh.model.getEntities(3))
    if not size:
        low, high = np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3)
        return {"extent": float((high - low).max()), "volume": volume}
    gmsh.model.mesh.setSize(gmsh.model.getEntities(0), size)  # else it is at most a tenth of the diagonal
    gmsh.model.mesh.generate(3)
    tags, places, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    points = places.reshape(-1, 3)
    cells = _elements(gmsh, 3, -1, 11, number).reshape(-1, 10)[:, VTK_ORDER]
    triangles, faces, distance = [np.zeros((0, 6), np.int64)], [np.zeros(0, np.int64)], 0.0
    for _, face in gmsh.model.getEntities(2):
        own = _elements(gmsh, 2, face, 9, number).reshape(-1, 6)
        if not len(own) or len(gmsh.model.getAdjacencies(2, face)[0]) > 1:
            continue
        centres = points[own[:, 3:]].sum(axis=1) * (4 / 9) - points[own[:, :3]].sum(axis=1) / 9
        nearest = np.array(gmsh.model.getClosestPoint(2, face, centres.ravel())[0]).reshape(-1, 3)
        distance = max(distance, float(np.linalg.norm(nearest - centres, axis=1).max()))
        triangles.append(own)
        faces.append(np.full(len(own), face))
    return {
        "points": points,
        "cells": cells,
        "triangles": np.concatenate(triangles),
        "faces": np.concatenate(faces),
        "joined": joined,
        "volume": volume,
        "distance": distance,
    }


def _joined(gmsh: Any) -> bool:
    """Let solids share the faces where they touch; return whether any do."""
    before = gmsh.model.getEntities(2)
    first, *others = gmsh.model.getEntities(3)
    gmsh.model.occ.fragment([first], others)
    gmsh.model.occ.synchronize()
    return bool(gmsh.model.getEntities(2) != before)


def _elements(gmsh: Any, dimension: int, tag: int, kind: int, number: np.ndarray) -> np.ndarray:
    """Return the nodes of the elements of one of gmsh's kinds in an entity, or in all for -1, one after another."""
    kinds, _, nodes = gmsh.model.mesh.getElements(dimension, tag)
    found = [own for k, own in zip(kinds, nodes, strict=True) if k == kind]
    return number[np.concatenate(found).astype(np.int64)] if found else np.zeros(0, dtype=np.int64)


if __name__ == "__main__":
    sys.exit(helped(int(sys.argv[1]), lambda: work(*sys.argv[2:])))
