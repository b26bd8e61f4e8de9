"""Whether an element suits the cells of a mesh: where it would err without a word, another is taken, or it is told."""

from dataclasses import replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.bodies.bending import bending
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.errors import Doubt
from tripod_sim.mesh.hourglass import unseen_motions
from tripod_sim.mesh.solid_mesh import SolidMesh, solid_volumes
from tripod_sim.tables.bodies import DENSITY, Material
from tripod_sim.tables.fields import out_of_usual

TOLD, TOLD_ELSEWHERE = 0.15, 0.3
"""Errors of deflections, relative, above which they are told: in the softest direction, and in others."""

TOLD_SIDEWAYS = 0.05
"""Drift sideways, relative to the deflection, above which it is told."""

WIDE = 2.0
"""Width of a body from which on it is asked whether it is described in other units [m]."""


def width_note(source: str, nodes: FloatArray) -> tuple[Doubt, ...]:
    """Return what users should know of the width of what `source` describes; `nodes` [m], shape (n, 3)."""
    width = float(np.ptp(nodes, axis=0).max())
    if width < WIDE:
        return ()
    text = (
        f"mesh.source {source!r} is {width:.4g} m wide; if its coordinates are in millimetres, set "
        "mesh.scale = 0.001"
    )
    return (Doubt(text),)


def mass_note(material: Material, mesh: SolidMesh, field: str = "") -> tuple[Doubt, ...]:
    """Return what users should know of the density that follows from `material.mass`; `field`: before `material`."""
    if material.density is not None:
        return ()
    volume = float(solid_volumes(mesh).sum())
    said = out_of_usual(material.mass / volume, "kg/m³", DENSITY)
    if not said:
        return ()
    grams = (
        ""
        if out_of_usual(1e-3 * material.mass / volume, "kg/m³", DENSITY)
        else "; if you meant grams, divide material.mass by 1000"
    )
    text = f"the density of {field}material.mass, {material.mass:g} kg in {volume:.4g} m³, {said}{grams}"
    return (Doubt(text),)


def suited(mesh: SolidMesh, poisson: float) -> tuple[SolidMesh, tuple[str, ...]]:
    """Return a mesh with an element that it can be computed with, and notes for users, one sentence each.

    `h20` becomes `h20_full` where its 2x2x2 points leave motions without energy (`hourglass`). Linear elements stay; a
    note gives the error to expect where they bend too stiffly, or lean to one side (`bending`).

    Args:
        mesh: As it is described.
        poisson: nu of its material.
    """
    if count := unseen_motions(mesh):
        note = (
            f"mesh.element {mesh.kind.name!r} is integrated with full quadrature here, as {mesh.kind.full!r}: its "
            f"reduced quadrature would leave {count} motions without stiffness, as the body is one element "
            "thick and wide somewhere; mesh.refine = 1 avoids this"
        )
        return replace(mesh, blocks=(mesh.blocks[0]._replace(kind=ELEMENTS[mesh.kind.full]),)), (note,)
    note = bending_note(mesh, poisson) if any(not block.kind.centres for block in mesh.blocks) else ""
    return mesh, (note,) if note else ()


def bending_note(mesh: SolidMesh, poisson: float) -> str:
    """Return a note on the bending error of linear elements; empty if the error is too small to report."""
    found, errors = bending(mesh, poisson), []
    bending_well = all(block.kind.modes or block.kind.centres for block in mesh.blocks)
    if not found and bending_well:
        return ""
    if len(mesh.blocks) > 1 or not mesh.kind.quadratic:
        stiff = ", ".join(repr(b.kind.name) for b in mesh.blocks if not (b.kind.modes or b.kind.centres))
        return (
            f"elements {stiff} bend too stiffly where few cells lie across the body, and lock where the material is "
            f"nearly incompressible. By how much is not estimated for meshes of {mesh.kinds}: compare with a finer mesh"
        )
    cell = mesh.kind.plain.cell
    rich = [
        e.name for e in ELEMENTS.values() if e.centres and (e.plain.cell == cell or cell in e.plain.divisions)
    ]
    *names, last = (repr(name) for name in rich if not any(e.full == name for e in ELEMENTS.values()))
    others = f"{', '.join(names)} and {last} have" if names else f"{last} has"
    if not found:
        return (
            f"mesh.element {mesh.kind.name!r} bends too stiffly where few cells lie across the body. By "
            f"how much is not estimated for this mesh of {len(mesh.elements)} elements, which is too "
            f"large; {others} no such error"
        )
    softest, low, high = (100 * error for error in (found.softest, found.low, found.high))
    if mesh.kind.modes:  # it may be softer than the quadratic elements, which does not make it wrong
        softest, low = max(softest, 0.0), max(low, 0.0)
    if abs(softest) > 100 * TOLD or max(-low, high) > 100 * TOLD_ELSEWHERE:
        if found.sure:
            errors.append(f"deflections about {abs(softest):.0f} % too {'small' if softest > 0 else 'large'}")
        elif low < 0 < high:
            errors.append(
                f"deflections from {-low:.0f} % too large to {high:.0f} % too small, by their direction"
            )
        else:
            least, most = sorted((abs(low), abs(high)))
            size = "small" if high > 0 else "large"
            errors.append(
                f"deflections at least {least:.0f} % too {size}, and {most:.0f} % in some directions"
            )
    if found.sideways > TOLD_SIDEWAYS:
        errors.append(f"a sideways deflection of up to about {100 * found.sideways:.0f} % of them")
    if not errors:
        return ""
    return (
        f"mesh.element {mesh.kind.name!r} is too coarse here for bending, at material.poisson = "
        f"{poisson:g}: expect {' and '.join(errors)}; {others} no such error"
    )
