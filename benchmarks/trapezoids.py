"""How much too little a bar of trapezoids bends, and what `tripod run` says of it beforehand.

    python benchmarks/trapezoids.py [--write]    # into docs/verification.md

A bar with a force at its tip, nu = 0; the inner faces across it lean over by the tilt, one to the right and the next to
the left. Cells along it and through its thickness; deflections over Timoshenko's; `told`: by
`tripod_sim.bodies.bending`.
"""

import argparse
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

import numpy as np

from benchmarks.analytic import HEIGHT, INERTIA, LENGTH, SHEAR, YOUNG, bar, tangent
from benchmarks.blocks import elastic
from benchmarks.doc_parts import write_part
from tripod_sim.bodies.bending import bending
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import SolidMesh

TILTS = (0, 5, 10, 20, 31, 40)
"""[degrees]."""

BARS = ((5, 1), (10, 1), (20, 1), (20, 2), (20, 3))
"""Cells along and through the thickness."""

OTHERS = ("h8", "h20_full", "t10", "h27")


def leaning(element: str, cells: int, tilt: float, thick: int = 1) -> SolidMesh:
    """Return the mesh of the bar with its inner faces tilted by `tilt` [rad] one way and the other."""
    mesh = bar("h8", cells, thick)
    x = np.array(mesh.nodes)
    column = np.rint(x[:, 0] / LENGTH * cells).astype(int)
    inner = (column > 0) & (column < cells)
    x[:, 0] += inner * np.where(column % 2, 1, -1) * x[:, 2] * math.tan(tilt)
    if ELEMENTS[element].size == mesh.kind.size:
        return SolidMesh.of(x, mesh.elements, ELEMENTS[element])
    return convert(SolidMesh.of(x, mesh.elements, mesh.kind), element)


def deflection(mesh: SolidMesh) -> float:
    """Return the deflection of the bar's tip over F L (L²/3EI + 1/kGA)."""
    K = tangent(elastic(mesh, YOUNG, 0.0), mesh, np.array(mesh.nodes))
    free = np.flatnonzero(np.repeat(mesh.nodes[:, 0] > 1e-9, 3))
    tip = np.flatnonzero(mesh.nodes[:, 0] > LENGTH - 1e-9)
    load, u = np.zeros(len(K)), np.zeros(len(K))
    load[3 * tip + 2] = 1.0 / len(tip)
    u[free] = np.linalg.solve(K[np.ix_(free, free)], load[free])
    return float(u[3 * tip + 2].mean() / (LENGTH**3 / (3 * YOUNG * INERTIA) + LENGTH / SHEAR))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write docs/verification.md, too")
    options = parser.parse_args()
    lines = [f"| cells | length / height | tilt [degrees] | h8_modes | note | {' | '.join(OTHERS)} |"]
    lines.append("|" + "---|" * (5 + len(OTHERS)))
    for cells, thick in BARS:
        ratio = LENGTH / cells / (HEIGHT / thick)
        for tilt in TILTS:
            if HEIGHT * math.tan(math.radians(tilt)) > 0.9 * LENGTH / cells:
                continue  # the short side of a cell is nearly gone
            mesh = leaning("h8_modes", cells, math.radians(tilt), thick)
            others = (deflection(leaning(e, cells, math.radians(tilt), thick)) for e in OTHERS)
            told = bending(mesh, 0.0)
            assert told, "small enough"
            right, *others = (f"{100 * (share - 1):+.0f} %" for share in (deflection(mesh), *others))
            columns = " | ".join((right, f"{-100 * told.low:+.0f} to {-100 * told.high:+.0f} %", *others))
            lines.append(f"| {cells} x {thick} | {ratio:.2g} | {tilt} | {columns} |")
    print("\n".join(lines))
    if options.write:
        write_part("verification.md", "trapezoids", lines)


if __name__ == "__main__":
    main()
