"""Whether an element suits the cells of a mesh: where it would err without a word, another is taken, or it is told."""

from dataclasses import replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.elements.element import node_volumes
from tripod_sim.elements.hexahedron import H8, H8_MODES
from tripod_sim.elements.quadratic_hexahedron import H20, H20_FULL
from tripod_sim.elements.tetrahedron import T4
from tripod_sim.errors import Doubt
from tripod_sim.mesh.bending import deflection_share, tetrahedra_share
from tripod_sim.mesh.hourglass import unseen_motions
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.tables.bodies import DENSITY, Material
from tripod_sim.tables.fields import out_of_usual

TOLD = 0.1
"""Error of deflections, relative, from which on it is told. On the Tripod's meshes it is 0.053 for `h8_modes`, of what
docs/convergence.md measures there."""

WIDE = 2.0
"""Width of a body from which on it is asked whether it is described in other units [m]."""


def width_note(source: str, nodes: FloatArray) -> tuple[Doubt, ...]:
    """Return what users should know of the width of what `source` describes; `nodes` [m], shape (n, 3)."""
    width = float(np.ptp(nodes, axis=0).max())
    if width < WIDE:
        return ()
    text = f"mesh.source {source!r} is {width:.4g} m wide; if it is described in millimetres, set mesh.scale = 0.001"
    return (Doubt(text),)


def mass_note(material: Material, mesh: SolidMesh, field: str = "") -> tuple[Doubt, ...]:
    """Return what users should know of the density that follows from `material.mass`; `field`: before `material`."""
    if material.density is not None:
        return ()
    volume = float(node_volumes(mesh.kind, mesh.nodes[mesh.elements])[0].sum())
    said = out_of_usual(material.mass / volume, "kg/m³", DENSITY)
    if not said:
        return ()
    grams = "" if out_of_usual(1e-3 * material.mass / volume, "kg/m³", DENSITY) else "; or grams?"
    text = f"the density of {field}material.mass, {material.mass:g} kg in {volume:.4g} m³, {said}{grams}"
    return (Doubt(text),)


def suited(mesh: SolidMesh) -> tuple[SolidMesh, tuple[str, ...]]:
    """Return a mesh with an element that it can be computed with, and what users should know, one sentence each.

    `h20` becomes `h20_full` where its 2x2x2 points leave motions without energy (`hourglass`). Eight-node hexahedra on
    cells on which they bend too stiffly (`bending`) stay, and the expected error is told; so do four-node tetrahedra.
    """
    if mesh.kind is H20 and (count := unseen_motions(mesh)):
        note = (
            f"mesh.element 'h20' integrates this mesh as 'h20_full' does: its 2x2x2 points would leave {count} motions "
            "without energy, as the body is one element thick and wide somewhere; mesh.refine = 1 gives it more"
        )
        return replace(mesh, kind=H20_FULL), (note,)
    if mesh.kind is T4 and (error := 1 - tetrahedra_share(mesh)) > TOLD:
        note = (
            "mesh.element 't4' bends too stiffly here, as its cells are few across the body: expect it to bend about "
            f"{100 * error:.0f} % too little; 't10' has no such error"
        )
        return mesh, (note,)
    if mesh.kind in (H8, H8_MODES) and (error := 1 - deflection_share(mesh)) > TOLD:
        name = mesh.kind.name
        why = "are no parallelepipeds" if mesh.kind is H8_MODES else "are few across the body"
        note = (
            f"mesh.element {name!r} bends too stiffly here, as its cells {why}: expect deflections about "
            f"{100 * error:.0f} % too small; 'h27' and 't10' have no such error"
        )
        return mesh, (note,)
    return mesh, ()
