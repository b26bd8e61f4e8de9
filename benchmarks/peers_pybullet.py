"""PyBullet in the cases of `peers.py`: its deformable world, linear neo-Hookean tetrahedra and mass-spring cloth.

Elastic forces are explicit and damping forces implicit, so steps are short. A soft body's mass is spread evenly over
its nodes: nothing in the Python interface gives nodes their own. Held nodes are anchors to the world. Contacts do not
occur.
"""

import tempfile
from importlib import metadata
from pathlib import Path

import numpy as np
import pybullet as bullet

from benchmarks import peers_cases as cases
from benchmarks.peers_cases import Prepared, Setting, height
from tripod_host.arrays import FloatArray, IndexArray

NAME, MODULE = "PyBullet", "pybullet"


def version() -> str:
    """Return PyBullet's version."""
    return metadata.version("pybullet")


def _bars(viscosity: float, *rows: tuple[tuple[int, int, int], float, bool]) -> list[Setting]:
    viscous = f", NeoHookeanDamping {viscosity:g}" if viscosity else ""
    return [
        Setting(
            f"T4, {c[0]} x {c[1]} x {c[2]} cells, dt {1e3 * dt:g} ms{viscous}",
            {"cells": c, "dt": dt, "viscosity": viscosity},
            quick,
        )
        for c, dt, quick in rows
    ]


SETTINGS = {
    "cantilever rest": _bars(5e-3, ((10, 2, 2), 5e-4, True), ((10, 2, 2), 2e-4, False)),
    "cantilever swing": _bars(
        0.0, ((10, 2, 2), 2e-4, True), ((10, 2, 2), 1e-4, False), ((20, 4, 4), 1e-4, False)
    ),
    "cloth": [
        Setting(f"springs, dt {1e3 * dt:g} ms", {"dt": dt}, quick)
        for dt, quick in ((5e-4, True), (2e-4, False))
    ],
}


def prepare(case: str, options: dict) -> Prepared:
    """Return the model of a case, loaded."""
    return _cloth(**options) if case == "cloth" else _bar(case, **options)


def _world(dt: float) -> None:
    if bullet.isConnected():
        bullet.disconnect()
    bullet.connect(bullet.DIRECT)
    bullet.resetSimulation(bullet.RESET_USE_DEFORMABLE_WORLD)
    bullet.setGravity(0, 0, -cases.GRAVITY)
    bullet.setTimeStep(dt)


def _positions(body: int) -> FloatArray:
    return np.array(bullet.getMeshData(body, -1, flags=bullet.MESH_DATA_SIMULATION_MESH)[1])


def _load(text: str, suffix: str, nodes: FloatArray, held: IndexArray, **options) -> int:
    """Return a soft body that a file of `text` describes. Raises RuntimeError if its nodes are not `nodes`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"body{suffix}"
        path.write_text(text)
        body = bullet.loadSoftBody(
            str(path), collisionMargin=1e-4, useSelfCollision=0, useFaceContact=0, **options
        )
    found = _positions(body)
    if found.shape != nodes.shape or np.abs(found - nodes).max() > 1e-6:
        raise RuntimeError("PyBullet changed the order or number of nodes")
    for i in held:
        bullet.createSoftBodyAnchor(body, int(i), -1, -1)
    return body


def _vtk(nodes: FloatArray, tets: IndexArray) -> str:
    lines = ["# vtk DataFile Version 2.0", "body", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines += [f"POINTS {len(nodes)} double", *(f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in nodes)]
    lines += [f"CELLS {len(tets)} {5 * len(tets)}", *("4 " + " ".join(map(str, t)) for t in tets.tolist())]
    lines += [f"CELL_TYPES {len(tets)}", *["10"] * len(tets)]
    return "\n".join(lines) + "\n"


def _bar(case: str, cells: tuple[int, int, int], dt: float, viscosity: float) -> Prepared:
    mesh = cases.bar("t4", tuple(cells))
    nodes, text = np.array(mesh.nodes), _vtk(mesh.nodes, np.asarray(mesh.elements))
    held, tip = cases.bar_ends(nodes)
    lam, mu = cases.lame(cases.YOUNG, cases.POISSON)
    every = round(cases.SAMPLE.get(case, cases.REST) / dt)

    def load() -> int:
        _world(dt)
        return _load(
            text, ".vtk", nodes, held, mass=cases.MASS, useNeoHookean=1, NeoHookeanMu=mu, NeoHookeanLambda=lam,
            NeoHookeanDamping=viscosity,
        )  # fmt: skip

    def run() -> FloatArray:
        body, found = load(), []
        for _ in range(round(cases.SIMULATED[case] / dt / every)):
            for _ in range(every):
                bullet.stepSimulation()
            found.append((_positions(body)[tip, 2] - nodes[tip, 2]).mean())
        return height(np.array(found))

    return Prepared(run, 3 * (len(nodes) - len(held)), cases.SIMULATED[case])


def _cloth(dt: float) -> Prepared:
    """Every cell gets the four triangles of both diagonals, whose edges are the scene's springs."""
    sheet = cases.cloth()
    nodes = np.array(sheet.nodes)
    n = round(len(nodes) ** 0.5)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = (x.ravel() for x in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    faces = np.stack([(a, b, c), (a, c, d), (a, b, d), (b, c, d)]).transpose(0, 2, 1).reshape(-1, 3) + 1
    text = "".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in nodes)
    text += "".join("f " + " ".join(map(str, f)) + "\n" for f in faces.tolist())
    every = round(cases.SAMPLE["cloth"] / dt)

    def run() -> FloatArray:
        _world(dt)
        body = _load(
            text, ".obj", nodes, sheet.fixed, mass=float(sheet.mass.sum()), useMassSpring=1,
            useBendingSprings=0, springElasticStiffness=float(sheet.stiffness[0]),
            springDampingStiffness=float(sheet.damping[0]), springDampingAllDirections=0,
        )  # fmt: skip
        found = []
        for _ in cases.CLOTH_TIMES:
            for _ in range(every):
                bullet.stepSimulation()
            found.append(cases.cloth_read(_positions(body)))
        return np.array(found)

    return Prepared(run, 3 * (len(nodes) - len(sheet.fixed)), cases.SIMULATED["cloth"])
