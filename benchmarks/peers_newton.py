"""Newton (on Warp) on the CPU in the cases of `peers.py`: solver VBD, linear tetrahedra, springs.

VBD is the solver of its soft-body examples, which give each substep of 1.7 ms ten iterations; 10 and 50 stand here. It
is made for GPUs: on a CPU Warp runs on one thread, which is what this comparison asks of all. Contacts are off.
Vertices carry the lumped masses of the finite elements. On the way to rest the velocities are reduced after each step
by exp(-a dt): damping in proportion to mass.
"""

from importlib import metadata

import newton
import numpy as np
import warp as wp

from benchmarks import peers_cases as cases
from benchmarks.blocks import lumped
from benchmarks.peers_cases import Prepared, Setting, height
from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.mesh.solid_mesh import SolidMesh

NAME, MODULE = "Newton", "newton"

STIFFER = 100.0
"""Of the disc's tetrahedra over the others."""


def version() -> str:
    """Return the versions of Newton and Warp."""
    return f"{metadata.version('newton')}, Warp {metadata.version('warp-lang')}"


def _set(name: str, dt: float, iterations: int, *, quick: bool = False, **options) -> Setting:
    return Setting(
        f"VBD, {iterations} iterations, dt {1e3 * dt:g} ms, {name}",
        {"dt": dt, "iterations": iterations, **options},
        quick,
    )


def _bars(*rows: tuple[tuple[int, int, int], float, int, bool]) -> list[Setting]:
    return [
        _set(f"T4, {c[0]} x {c[1]} x {c[2]} cells", dt, n, quick=quick, cells=c) for c, dt, n, quick in rows
    ]


SETTINGS = {
    "cantilever rest": _bars(
        ((10, 2, 2), 2e-3, 10, True), ((10, 2, 2), 2e-3, 50, False), ((10, 2, 2), 5e-4, 10, False)
    ),
    "cantilever swing": _bars(
        ((10, 2, 2), 2e-3, 10, True), ((10, 2, 2), 2e-3, 50, False), ((10, 2, 2), 5e-4, 10, False),
        ((10, 2, 2), 1e-4, 10, False),
    ),
    "y L1": [_set("T4, mesh level 5", 2e-3, 10, level=5, quick=True), _set("T4, mesh level 5", 2e-3, 50, level=5)],
    "y L2": [_set("T4, mesh level 5", 2e-3, 10, level=5, quick=True), _set("T4, mesh level 5", 2e-3, 50, level=5)],
    "cloth": [
        _set("springs", 2e-3, 10, quick=True), _set("springs", 2e-3, 50), _set("springs", 1e-3, 10),
        _set("springs", 5e-4, 10),
    ],
}  # fmt: skip


class Body:
    """A model, its two states and its solver."""

    def __init__(self, builder: newton.ModelBuilder, iterations: int, dt: float) -> None:
        builder.color()
        self.model = builder.finalize(device="cpu")
        self.solver_of = lambda: newton.solvers.SolverVBD(
            model=self.model,
            iterations=iterations,
            particle_enable_self_contact=False,
            particle_enable_tile_solve=False,
        )
        self.control, self.dt = self.model.control(), dt
        self.start()
        self.step()
        self.start()

    def start(self) -> None:
        """Go to the start; the solver keeps nothing of an earlier run."""
        self.solver, self.now, self.then = self.solver_of(), self.model.state(), self.model.state()

    def step(self, drag: float = 0.0) -> None:
        """Advance by dt."""
        self.now.clear_forces()
        self.solver.step(self.now, self.then, self.control, None, self.dt)
        self.now, self.then = self.then, self.now
        if drag:
            speeds = self.now.particle_qd.numpy()  # a view: arrays live on the CPU
            speeds *= np.exp(-drag * self.dt)

    @property
    def positions(self) -> FloatArray:
        """Positions [m], shape (n, 3), a view."""
        return self.now.particle_q.numpy()


def _builder(nodes: FloatArray, mass: FloatArray, held: IndexArray) -> newton.ModelBuilder:
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, -cases.GRAVITY))
    kept = np.array(mass)
    kept[held] = 0.0
    for position, m in zip(nodes, kept, strict=True):
        builder.add_particle(wp.vec3(*position), wp.vec3(0, 0, 0), float(m))
    return builder


def _solid(
    mesh: SolidMesh,
    held: IndexArray,
    young: float,
    poisson: float,
    mass: float,
    stiff: IndexArray | None = None,
) -> newton.ModelBuilder:
    builder = _builder(mesh.nodes, lumped(mesh, mass)[1], held)
    lam, mu = cases.lame(young, poisson)
    for tet in mesh.elements:
        factor = STIFFER if stiff is not None and np.isin(tet, stiff).all() else 1.0
        builder.add_tetrahedron(*(int(i) for i in tet), k_mu=factor * mu, k_lambda=factor * lam, k_damp=0.0)
    return builder


def prepare(case: str, options: dict) -> Prepared:
    """Return the model of a case, its kernels compiled."""
    if case == "cloth":
        return _cloth(**options)
    return _y(case, **options) if case.startswith("y") else _bar(case, **options)


def _bar(case: str, cells: tuple[int, int, int], dt: float, iterations: int) -> Prepared:
    mesh = cases.bar("t4", tuple(cells))
    held, tip = cases.bar_ends(mesh.nodes)
    body = Body(_solid(mesh, held, cases.YOUNG, cases.POISSON, cases.MASS), iterations, dt)
    every = round(cases.SAMPLE.get(case, cases.REST) / dt)
    drag = cases.BAR_DRAG if case == "cantilever rest" else 0.0

    def run() -> FloatArray:
        body.start()
        found = []
        for _ in range(round(cases.SIMULATED[case] / dt / every)):
            for _ in range(every):
                body.step(drag)
            found.append((body.positions[tip, 2] - mesh.nodes[tip, 2]).mean())
        return height(np.array(found))

    return Prepared(run, 3 * (len(mesh.nodes) - len(held)), cases.SIMULATED[case])


def _y(case: str, level: int, dt: float, iterations: int) -> Prepared:
    y = cases.y_mesh(level)
    held = np.concatenate([nodes for nodes, _, _ in y.arms])
    body = Body(_solid(y.mesh, held, *cases.SILICONE, stiff=y.disc), iterations, dt)
    steps = round(cases.REST / dt)

    def run() -> FloatArray:
        body.start()
        for k in range(steps):
            if case == "y L2":
                body.positions[held] = np.concatenate(y.turned(cases.TURN * min(1.0, 2 * (k + 1) / steps)))
            body.step(cases.Y_DRAG)
        return height(body.positions[y.disc, 2].mean())

    return Prepared(run, 3 * (len(y.mesh.nodes) - len(held)), cases.REST)


def _cloth(dt: float, iterations: int) -> Prepared:
    sheet = cases.cloth()
    builder = _builder(sheet.nodes, sheet.mass, sheet.fixed)
    for (i, j), k, c in zip(sheet.ends, sheet.stiffness, sheet.damping, strict=True):
        builder.add_spring(int(i), int(j), float(k), float(c), 0.0)
    body = Body(builder, iterations, dt)
    every = round(cases.SAMPLE["cloth"] / dt)

    def run() -> FloatArray:
        body.start()
        found = []
        for _ in cases.CLOTH_TIMES:
            for _ in range(every):
                body.step()
            found.append(cases.cloth_read(body.positions))
        return np.array(found)

    return Prepared(run, 3 * (len(sheet.nodes) - len(sheet.fixed)), cases.SIMULATED["cloth"])
