"""How right the note is that warns of cells too coarse to bend (`tripod_sim.bodies.suited`), on 50 meshes.

    python benchmarks/coarse_meshes.py

Bodies of random shape, element and Poisson's ratio from 0.3 to 0.49 are clamped at one end and hang under their own
weight, with small strains. The true error is that of the deflection of the other end, against `h20` on cells half as
long. The note is right if it is within a factor of 1.3 of the true error, or says "at least" and is below it. Where
there is no note, the error has to be below 1.3 times the smallest that is told.

Results go to a file line by line; meshes that are there are not computed again.
"""

import argparse
import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from benchmarks.blocks import elastic
from benchmarks.doc_parts import table_lines, write_part
from benchmarks.stored_rows import store, stored
from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.bodies.suited import TOLD, suited
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.element import node_volumes
from tripod_sim.elements.hexahedron import CORNERS
from tripod_sim.elements.tetrahedron import right_handed
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.refine import refine
from tripod_sim.mesh.solid_mesh import SolidMesh, check_mesh

FACTOR = 1.3
"""Within which a note is right."""

MOST_CELLS = 150
"""Of a mesh, so that the reference takes seconds."""

Shape = Callable[[np.random.Generator, FloatArray], FloatArray]
"""Moves the nodes of a straight bar."""


def straight(rng: np.random.Generator, x: FloatArray) -> FloatArray:
    """A bar or a plate."""
    return x


def jittered(rng: np.random.Generator, x: FloatArray) -> FloatArray:
    """Inner nodes moved by up to a fifth of a cell along the bar."""
    step = np.diff(np.unique(x[:, 0])).min()
    inner = (x[:, 0] > 1e-9) & (x[:, 0] < x[:, 0].max() - 1e-9)
    return x + np.outer(inner * rng.uniform(-0.2, 0.2, len(x)) * step, [1.0, 0.0, 0.0])


def leaning(rng: np.random.Generator, x: FloatArray) -> FloatArray:
    """Inner faces lean over, one to the right and the next to the left."""
    column = np.unique(np.round(x[:, 0], 9), return_inverse=True)[1]
    inner = (column > 0) & (column < column.max())
    room = 0.6 * np.diff(np.unique(np.round(x[:, 0], 9))).min() / np.ptp(x[:, 2])
    slope = rng.uniform(0.3, 1.0) * min(room, 0.6)
    return x + np.outer(inner * np.where(column % 2, slope, -slope) * x[:, 2], [1.0, 0.0, 0.0])


def tapered(rng: np.random.Generator, x: FloatArray) -> FloatArray:
    """Thinner and narrower towards the free end."""
    scale = 1 - rng.uniform(0.2, 0.6) * x[:, 0] / x[:, 0].max()
    return x * np.stack([np.ones(len(x)), scale, scale], axis=1)


def arched(rng: np.random.Generator, x: FloatArray) -> FloatArray:
    """Curved in the plane of its weight, by up to a quarter of a circle."""
    angle = rng.uniform(0.3, math.pi / 2) * x[:, 0] / x[:, 0].max()
    radius = x[:, 0].max() / angle.max() + x[:, 2]
    return np.stack(
        [radius * np.sin(angle), x[:, 1], radius * np.cos(angle) - x[:, 0].max() / angle.max()], axis=1
    )


def curved(rng: np.random.Generator, x: FloatArray) -> FloatArray:
    """Curved across its weight, so that it twists, too."""
    return arched(rng, x[:, [0, 2, 1]])[:, [0, 2, 1]]


def whole(cells: tuple[int, int, int], rng: np.random.Generator) -> np.ndarray:
    """All cells."""
    return np.ones(cells, dtype=bool)


def tube(cells: tuple[int, int, int], rng: np.random.Generator) -> np.ndarray:
    """Walls about a hollow that is open at the free end."""
    kept = np.ones(cells, dtype=bool)
    kept[1:, 1:-1, 1:-1] = False
    return kept


def chambers(cells: tuple[int, int, int], rng: np.random.Generator) -> np.ndarray:
    """A strip with ribs upon it, as a bending actuator has them."""
    kept = np.ones(cells, dtype=bool)
    kept[1::2, :, cells[2] // 2 :] = False
    return kept


def elbow(cells: tuple[int, int, int], rng: np.random.Generator) -> np.ndarray:
    """A strip with a hook at its free end."""
    kept = np.ones(cells, dtype=bool)
    kept[: cells[0] * 2 // 3, cells[1] // 2 :] = False
    return kept


SHAPES = (straight, straight, jittered, leaning, tapered, arched, curved)
SOLIDS = (whole, whole, whole, tube, chambers, elbow)
KINDS = ("t4", "t4", "t4 alternating", "h8", "h8_mean", "h8_modes")


def alternating(mesh: SolidMesh, places: IndexArray) -> SolidMesh:
    """Return five tetrahedra in each cell, mirrored from cell to cell; `places`: of the cells in the grid, (m, 3)."""
    corner = {tuple(c): i for i, c in enumerate(((CORNERS + 1) // 2).astype(int).tolist())}
    found = []
    for odd in (0, 1):
        name = lambda a, b, c, odd=odd: corner[(a ^ odd, b, c)]  # noqa: E731
        middle = [name(0, 0, 0), name(1, 1, 0), name(1, 0, 1), name(0, 1, 1)]
        cut = [
            [name(1, 0, 0), name(0, 0, 0), name(1, 1, 0), name(1, 0, 1)],
            [name(0, 1, 0), name(0, 0, 0), name(1, 1, 0), name(0, 1, 1)],
            [name(0, 0, 1), name(0, 0, 0), name(1, 0, 1), name(0, 1, 1)],
            [name(1, 1, 1), name(1, 1, 0), name(1, 0, 1), name(0, 1, 1)],
        ]
        found.append([right_handed(t, CORNERS.astype(float)) for t in (middle, *cut)])
    parity = places.sum(axis=1) % 2
    elements = np.concatenate([mesh.elements[parity == odd][:, np.array(found[odd])] for odd in (0, 1)])
    return SolidMesh.of(mesh.nodes, elements.reshape(-1, 4), ELEMENTS["t4"])


class Case(NamedTuple):
    """One of the meshes.

    Attributes:
        words: What it is.
        mesh: Itself.
        exact: That of the reference.
        poisson: nu.
        end: Nodes of its free end [m], shape (k, 3); the other end is in x = 0.
    """

    words: str
    mesh: SolidMesh
    exact: SolidMesh
    poisson: float
    end: FloatArray


def made(seed: int) -> Case:
    """Return mesh `seed`."""
    rng = np.random.default_rng(20261128 + seed)
    shape, solid = SHAPES[rng.integers(len(SHAPES))], SOLIDS[rng.integers(len(SOLIDS))]
    kind, poisson = KINDS[seed % len(KINDS)], round(float(rng.uniform(0.3, 0.49)), 3)
    length, thick = 0.1, 0.1 / rng.uniform(6, 20)
    wide = thick * rng.uniform(1, 4)
    while True:
        cells = (int(rng.integers(6, 31)), int(rng.integers(1, 5)), int(rng.integers(1, 5)))
        if solid is not whole:
            cells = (cells[0], max(cells[1], 3), max(cells[2], 3 if solid is tube else 2))
        if np.prod(cells) <= MOST_CELLS:
            break
    kept = solid(cells, rng)
    lines = [np.linspace(0, length, cells[0] + 1)]
    lines += [np.linspace(-w / 2, w / 2, n + 1) for w, n in ((wide, cells[1]), (thick, cells[2]))]
    x = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 3)
    numbers = np.arange(len(x)).reshape([n + 1 for n in cells])
    places = np.argwhere(kept)
    corners = ((CORNERS + 1) // 2).astype(int)
    elements = np.stack([numbers[tuple((places + c).T)] for c in corners], axis=1)
    used, elements = np.unique(elements, return_inverse=True)
    x = shape(rng, x)
    plain = SolidMesh.of(x[used], elements.reshape(-1, 8), ELEMENTS["h8"])
    check_mesh(plain, f"mesh {seed}")
    mesh = convert(plain, "t4" if kind.startswith("t4") else kind)
    if kind == "t4 alternating":
        mesh = alternating(plain, places)
    words = f"{kind}, {solid.__name__}, {shape.__name__}, {cells[0]} x {cells[1]} x {cells[2]}"
    return Case(words, mesh, convert(refine(plain), "h20"), poisson, x[numbers[-1].ravel()])


def deflection(mesh: SolidMesh, poisson: float, end: FloatArray) -> FloatArray:
    """Return how far the `end` of a body moves under its weight along -z, E = density = g = 1."""
    solid, x = elastic(mesh, 1.0, poisson), np.array(mesh.nodes)
    solid.stiffness(x, solid.rest_modes(), project=False)
    dofs = (3 * mesh.elements[:, :, None] + np.arange(3)).reshape(len(mesh.elements), -1)
    rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    K = sparse.csc_matrix((solid.matrices.ravel(), (rows.ravel(), columns.ravel())), (x.size,) * 2)
    weight, load = np.zeros(len(x)), np.zeros_like(x)
    np.add.at(weight, mesh.elements, node_volumes(mesh.kind, x[mesh.elements])[0])
    load[:, 2] = -weight
    free = np.flatnonzero(np.repeat(x[:, 0] > 1e-9, 3))
    u = np.zeros(x.size)
    u[free] = splu(K[free][:, free]).solve(load.ravel()[free])
    centre = end.mean(axis=0)
    normal, reach = np.linalg.svd(end - centre)[2][-1], np.linalg.norm(end - centre, axis=1).max()
    looked_at = (np.abs((x - centre) @ normal) < 1e-7) & (np.linalg.norm(x - centre, axis=1) < 1.01 * reach)
    return np.asarray(u.reshape(-1, 3)[looked_at].mean(axis=0))


def measured(seed: int) -> dict[str, Any]:
    """Return mesh `seed`, the error that its note states, and its true error, as values for JSON."""
    case = made(seed)
    found, right = (deflection(m, case.poisson, case.end) for m in (case.mesh, case.exact))
    drifts = [move[1] / move[2] for move in (found, right)]
    return {
        "seed": seed,
        "mesh": case.words,
        "poisson": case.poisson,
        "true": float(1 - found[2] / right[2]),
        "sideways": float(abs(drifts[0] - drifts[1])),
        "note": " ".join(suited(case.mesh, case.poisson)[1]),
    }


def told(note: str) -> tuple[str, float]:
    """Return what a note says of the deflection: `about`, `at least` or nothing, and the error; negative: too large."""
    if found := re.search(r"deflections (about|at least) (\d+) % too (small|large)", note):
        return found[1], float(found[2]) / 100 * (1 if found[3] == "small" else -1)
    return ("at least", 0.0) if "deflections from" in note else ("", 0.0)


def verdict(row: dict[str, Any]) -> str:
    """Return whether a note is `within` the factor, says `at least` and is below the truth, or is `wrong`."""
    (kind, error), true = told(row["note"]), row["true"]
    if not kind:
        return "within" if abs(true) < FACTOR * TOLD else "wrong"
    if error * true > 0 and 1 / FACTOR <= error / true <= FACTOR:
        return "within"
    return "at least" if kind == "at least" and (error == 0 or 0 < error / true <= 1) else "wrong"


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the table of the page."""
    heads = ("mesh", "nu", "true error [%]", "note", "sideways, true [%]", "note [%]", "verdict")
    lines = []
    for row in rows:
        kind, error = told(row["note"])
        sideways = re.search(r"up to about (\d+) %", row["note"])
        note = f"{kind} {100 * error:.0f}" if kind else "nothing"
        aside = (f"{100 * row['sideways']:.0f}", sideways[1] if sideways else "")
        lines.append((row["mesh"], row["poisson"], f"{100 * row['true']:.0f}", note, *aside, verdict(row)))
    verdicts = Counter(map(verdict, rows))
    return [
        *table_lines(heads, lines),
        "",
        f"Of {len(rows)} meshes: " + ", ".join(f"{n} {v}" for v, n in sorted(verdicts.items())) + ".",
    ]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--meshes", type=int, default=50, help="(default 50)")
    parser.add_argument("--seed", type=int, default=0, help="of the first; the others follow (default 0)")
    parser.add_argument("--results", type=Path, default=Path("build/coarse_meshes.jsonl"))
    parser.add_argument("--write", action="store_true", help="write the table to docs/verification.md, too")
    options = parser.parse_args()
    known = {row["seed"]: row for row in stored(options.results)}
    wanted = range(options.seed, options.seed + options.meshes)
    for seed in wanted:
        if seed not in known:
            known[seed] = measured(seed)
            store(options.results, known[seed])
    found = table([known[seed] for seed in wanted])
    print("\n".join(found))
    if options.write:
        write_part("verification.md", "coarse meshes", found)


if __name__ == "__main__":
    main()
