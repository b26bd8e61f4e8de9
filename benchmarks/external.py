"""Problems that others have set, with their references: what the simulator finds over what is right, in percent.

    python benchmarks/external.py              # all tables of docs/verification.md, some minutes
    python benchmarks/external.py --only schemes --write

Solids, for every element: Cook's membrane, compressible and nearly not; NAFEMS LE1 and LE10, whose targets are
stresses; a cantilever bent by its tip load to large deflections (the elastica). Schemes: the period of a pendulum that
swings by 120 degrees. Nets and contact: a catenary, the friction at which a block begins to stick, a ball that slides
until it rolls, Hertz's ball on an elastic half-space, a pile of 666 balls.
"""

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import meshio
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve
from scipy.special import ellipk

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

import tripod_sim
from benchmarks.blocks import brick, elastic
from benchmarks.doc_parts import write_part
from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim import Simulation, StepError, load_scene
from tripod_sim.forces.set_loads import face_integrals
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.scene.file import scene_from_toml

ELEMENTS = ("h8_modes", "t10", "h20", "h20_full", "h27", "h8", "h8_mean", "t4")
SCHEMES = ("semi_implicit_euler", "explicit_euler", "rk4", "implicit_euler", "bdf2", "tr_bdf2")
ROUNDS = 3
"""How often CPU times of elements are taken; the first time also compiles."""

G = 9.81
PLATE = Path(tripod_sim.__file__).parent / "scenes" / "plate.obj"

# solids ---------------------------------------------------------------------------------------------------------------


def cook(element: str) -> float:
    """Return the rise of Cook's membrane over 23.96 F / E t, of the shipped scene with 16 x 16 x 1 cells."""
    simulation = Simulation(load_scene("cook", [f"mesh.element={element}"]))
    simulation.step()
    return (simulation.markers[0][1] - 0.052) / 2.396e-6


def cook_incompressible(element: str) -> float:
    """Return the rise of its upper corner in plane strain over 7.769: nu = 0.4999, E = 250, sheared by 6.25."""
    grid = brick(element, [np.linspace(0, 1, n + 1) for n in (48, 48, 1)])
    s, t, z = grid.nodes.T
    low, high = 44 * s, 44 + 16 * s
    mesh = SolidMesh.of(np.stack([48 * s, low + t * (high - low), z], axis=1), grid.elements, grid.kind)
    held = np.stack([s < 1e-9, s < 1e-9, np.ones(len(s), bool)], axis=1)
    right = np.flatnonzero(s > 1 - 1e-9)
    force = np.zeros((len(s), 3))
    force[:, 1] = -pushed(mesh, right, 6.25)[:, 0]  # as large, but along the side
    corner = int(np.argmin(np.linalg.norm(mesh.nodes - [48, 60, 0], axis=1)))
    return float(displaced(mesh, held, force, 250.0, 0.4999)[corner, 1]) / 7.769


def ring(element: str, cells: tuple[int, int, int], height: float) -> SolidMesh:
    """Return a quarter of an elliptic ring: inner half axes 2 and 1 m, outer ones 3.25 and 2.75 m.

    Cells are smaller near the end of the inner half axis along x, where stresses are asked for.
    """
    grid = brick(
        element, [np.linspace(0, 1, n + 1) ** power for n, power in zip(cells, (1.5, 1.5, 1.0), strict=True)]
    )
    s, t, z = grid.nodes.T
    angle = t * np.pi / 2
    nodes = np.stack([(2 + 1.25 * s) * np.cos(angle), (1 + 1.75 * s) * np.sin(angle), height * z], axis=1)
    return SolidMesh.of(nodes, grid.elements, grid.kind)


def displaced(
    mesh: SolidMesh, held: NDArray[np.bool_], force: FloatArray, young: float = 210e9, poisson: float = 0.3
) -> FloatArray:
    """Return the displacements of linear elasticity [m], shape (n, 3).

    Args:
        mesh: The body.
        held: Of nodes along the axes, shape (n, 3).
        force: [N], shape (n, 3).
        young, poisson: [Pa]; nu.
    """
    solid = elastic(mesh, young, poisson)
    x = np.array(mesh.nodes)
    solid.stiffness(x, solid.rest_modes(), project=False)
    dofs = (3 * mesh.elements[:, :, None] + np.arange(3)).reshape(len(mesh.elements), -1)
    n = dofs.shape[1]
    K = sparse.csc_array((
        np.asarray(solid.matrices).ravel(), (np.repeat(dofs, n, axis=1).ravel(), np.tile(dofs, (1, n)).ravel())
    ))  # fmt: skip
    free = np.flatnonzero(~held.ravel())
    u = np.zeros(x.size)
    u[free] = spsolve(K[free][:, free], force.ravel()[free])
    return u.reshape(-1, 3)


def stress_yy(mesh: SolidMesh, u: FloatArray, place: FloatArray) -> float:
    """Return the stress along y at a node [Pa], the mean of its elements."""
    node = int(np.argmin(np.linalg.norm(mesh.nodes - place, axis=1)))
    found = []
    for nodes in mesh.elements[(mesh.elements == node).any(axis=1)]:
        xi = mesh.kind.reference[nodes == node]
        J = mesh.kind.jacobians(mesh.nodes[nodes][None], xi)[0, 0]
        gradient = u[nodes].T @ mesh.kind.gradients(xi)[0] @ np.linalg.inv(J)
        strain = (gradient + gradient.T) / 2
        lam, mu = 210e9 * 0.3 / (1.3 * 0.4), 210e9 / 2.6
        found.append(lam * np.trace(strain) + 2 * mu * strain[1, 1])
    return float(np.mean(found))


def pushed(mesh: SolidMesh, nodes: IndexArray, pressure: float) -> FloatArray:
    """Return the forces of a pressure [Pa] on the faces whose nodes are all among `nodes` [N], shape (n, 3)."""
    force = np.zeros((len(mesh.nodes), 3))
    for faces in mesh.faces_within(nodes):
        np.add.at(force, faces.nodes, -pressure * face_integrals(faces, mesh.nodes)[2])
    return force


def le1(element: str) -> float:
    """Return the stress along y at the end of the inner half axis over NAFEMS' 92.7 MPa: membrane, 10 MPa outwards."""
    mesh = ring(element, (18, 27, 1), 0.1)
    x, y, z = mesh.nodes.T
    held = np.stack([x < 1e-9, y < 1e-9, z < 1e-9], axis=1)
    outer = np.flatnonzero((x / 3.25) ** 2 + (y / 2.75) ** 2 > 1 - 1e-6)
    u = displaced(mesh, held, pushed(mesh, outer, -10e6))
    return stress_yy(mesh, u, np.array([2.0, 0.0, 0.0])) / 92.7e6


def le10(element: str) -> float:
    """Return the stress along y over there, on top of a thick plate, over NAFEMS' -5.38 MPa: 1 MPa on its top."""
    mesh = ring(element, (12, 18, 6), 0.6)
    x, y, z = mesh.nodes.T
    outer = (x / 3.25) ** 2 + (y / 2.75) ** 2 > 1 - 1e-6
    held = np.stack([(x < 1e-9) | outer, (y < 1e-9) | outer, outer & (np.abs(z - 0.3) < 1e-9)], axis=1)
    u = displaced(mesh, held, pushed(mesh, np.flatnonzero(z > 0.6 - 1e-9), 1e6))
    return stress_yy(mesh, u, np.array([2.0, 0.0, 0.6])) / -5.38e6


ALPHA = 5.0
"""Load of the elastica, P L² / E I."""

BAR = """
name = "bar"
dt = 1.0
[mesh]
source = "block"
corners = [[0, -0.01, -0.01], [1, -0.01, -0.01], [1, 0.01, -0.01], [0, 0.01, -0.01],
           [0, -0.01, 0.01], [1, -0.01, 0.01], [1, 0.01, 0.01], [0, 0.01, 0.01]]
cells = [50, 1, 1]
element = "ELEMENT"
[material]
law = "st_venant_kirchhoff"
young = 1e7
poisson = 0.0
[solver]
mode = "newton"
tolerance = 1e-9
[[set]]
name = "tip"
along = [1, 0, 0]
at = 1.0
[[marker]]
set = "tip"
[[load]]
set = "tip"
force = [0, 0, FORCE]
[[fixed]]
low = [0, -1, -1]
high = [0, 1, 1]
"""


@cache
def elastica(alpha: float = ALPHA) -> tuple[float, float]:
    """Return deflection and shortening of the tip over the length: theta'' = -alpha cos theta, by shooting.

    The elliptic integrals of [BisshoppDrucker1945] have the same: 0.714 and 0.388 for alpha = 5.
    """

    def end(curvature: float) -> FloatArray:
        def rates(_: float, y: FloatArray) -> list[float]:
            return [y[1], -alpha * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

        return np.asarray(solve_ivp(rates, (0, 1), [0, curvature, 0, 0], rtol=1e-11, atol=1e-13).y[:, -1])

    best = brentq(lambda k: end(k)[1], 0.3 * alpha, alpha)
    return float(end(best)[3]), float(1 - end(best)[2])


def cantilever(element: str) -> float:
    """Return the deflection of a cantilever 50 times as long as high over the elastica's."""
    force = ALPHA * 1e7 * 0.02**4 / 12
    simulation = Simulation(scene_from_toml(BAR.replace("ELEMENT", element).replace("FORCE", f"{force!r}")))
    simulation.step()
    return float(simulation.markers[0][2]) / elastica()[0]


COLUMN, TURN = 0.02, 0.01
"""Edge of the column's square [m] and the turn of its head [rad]."""

TORSION = 0.140577
"""Of a square's torque, TORSION G a⁴ dturn/dL [TimoshenkoGoodier1970, section 109]."""


def column(element: str) -> float:
    """Return the torque of the shipped column by that of Saint-Venant, whose ends are free to warp.

    Of two lengths, so that the ends, which may not warp here, cancel: dturn/dL is that of turn / T over the length.
    """
    yielding, lengths = [], (0.08, 0.12)
    for length in lengths:
        square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * COLUMN / 2
        corners = [[*xy, z] for z in (0.0, length) for xy in square.tolist()]
        words = [
            f"mesh.corners={corners}", f"mesh.cells=[6, 6, {round(100 * length)}]", f"mesh.element={element}",
            f"set.1.at={length}", f'prescribed.0.turn="0: 0,0,0; 1: 0,0,{TURN}"', "inertia=off", "damping=off",
            "dt=1.0", "solver.tolerance=1e-9",
        ]  # fmt: skip
        simulation = Simulation(load_scene("column", words))
        simulation.step()
        yielding.append(TURN / simulation.reactions(0)[1][2])
    material = simulation.scene.material
    assert material
    shear = material.young / (2 * (1 + material.poisson))
    return float((lengths[1] - lengths[0]) / (yielding[1] - yielding[0]) / (TORSION * shear * COLUMN**4))


SOLIDS: dict[str, Callable[[str], float]] = {
    "Cook's membrane, nu 1/3": cook,
    "Cook's membrane, nu 0.4999": cook_incompressible,
    "NAFEMS LE1, stress": le1,
    "NAFEMS LE10, stress": le10,
    "elastica, P L² / E I = 5": cantilever,
    "column, torque of a little twist": column,
}

# schemes --------------------------------------------------------------------------------------------------------------

SWING = """
name = "swing"
dt = DT
[springs]
source = "chain"
nodes = 2
size = 1.0
node_mass = 1.0
stiffness = 1e6
fixed_corners = [0]
[gravity]
acceleration = [-4.905, 0.0, -8.495709211125343]
[inertia]
scheme = "SCHEME"
[solver]
tolerance = 1e-10
"""


def period(scheme: str, dt: float) -> tuple[float, float]:
    """Return the period of a pendulum let go at 120 degrees over 4 sqrt(L/g) K(sin 60°), and CPU time a step [s]."""
    exact = 4 * np.sqrt(1.0 / G) * ellipk(np.sin(np.pi / 3) ** 2)
    simulation = Simulation(scene_from_toml(SWING.replace("DT", repr(dt)).replace("SCHEME", scheme)))
    down, angles, count = np.array([-0.5, -np.sqrt(0.75)]), [], round(1.5 * exact / dt)
    simulation.step()
    begin = time.process_time()
    simulation.reset()
    for _ in range(count):
        simulation.step()
        x, z = simulation.positions[1, [0, 2]]
        angles.append(np.arctan2(down[0] * z - down[1] * x, down[0] * x + down[1] * z))
    cpu = (time.process_time() - begin) / count
    roots = CubicSpline(dt * np.arange(1, count + 1), angles).roots(extrapolate=False)
    roots = roots[np.concatenate([[True], np.diff(roots) > 0.1 * exact])]
    return float((roots[2] - roots[0]) / exact) if len(roots) > 2 else np.nan, cpu


# nets and contact -----------------------------------------------------------------------------------------------------

ROPE = """
name = "rope"
dt = 0.05
[springs]
source = "chain"
nodes = 101
size = 1.0
rest = 1.2
node_mass = 0.01
stiffness = 1e7
fixed_corners = [0, 1]
[gravity]
[inertia]
scheme = "implicit_euler"
[damping]
mass = 2.0
[solver]
mode = "newton"
tolerance = 1e-8
"""


def catenary() -> float:
    """Return the sag of a rope of 1.2 m between supports 1 m apart over a (cosh 1/2a - 1), 2 a sinh 1/2a = 1.2."""
    simulation = Simulation(scene_from_toml(ROPE))
    for _ in range(600):
        simulation.step()
    a = brentq(lambda a: 2 * a * np.sinh(0.5 / a) - 1.2, 0.05, 10)
    return float(-simulation.positions[:, 2].min() / (a * (np.cosh(0.5 / a) - 1)))


def slides(friction: float) -> bool:
    """Return whether the block of the shipped incline, of 20 degrees, slides by more than 0.5 mm in a second."""
    simulation = Simulation(load_scene("incline", [f"contact.friction={friction!r}"]))
    for _ in range(40):  # comes to rest on its contacts
        simulation.step()
    start = simulation.rigid[0].position.copy()
    for _ in range(200):
        simulation.step()
    return bool(np.linalg.norm(simulation.rigid[0].position - start) > 5e-4)


def threshold() -> float:
    """Return the friction at which the block begins to stick over tan 20 degrees."""
    low, high = 0.3, 0.45
    while high - low > 2e-4:
        middle = (low + high) / 2
        low, high = (middle, high) if slides(middle) else (low, middle)
    return (low + high) / 2 / np.tan(np.radians(20))


ROLLING = """
name = "rolling"
dt = 0.002
[gravity]
[inertia]
scheme = "implicit_euler"
[contact]
contact_distance = 1e-4
alarm_distance = 5e-4
friction = 0.3
tolerance = 1e-5
[[obstacles]]
source = "plate.obj"
[[rigid]]
shape = "ball"
radius = 0.05
mass = 0.2
position = [-0.2, 0.0, 0.0501]
velocity = [1.0, 0.0, 0.0]
"""


def rolling() -> float:
    """Return the speed with which a ball that was pushed at 1 m/s rolls, over 5/7 m/s."""
    simulation = Simulation(scene_from_toml(ROLLING.replace("plate.obj", str(PLATE))))
    places = []
    for _ in range(150):
        simulation.step()
        places.append(float(simulation.rigid[0].position[0]))
    return (places[-1] - places[-51]) / 0.1 / (5 / 7)


PRESSED = """
name = "pressed"
dt = 1.0
[mesh]
source = "block.vtk"
[material]
law = "corotational"
young = YOUNG
poisson = POISSON
[solver]
mode = "newton"
tolerance = 1e-8
[contact]
contact_distance = THIN
alarm_distance = NEAR
friction = 0.0
[[obstacles]]
source = "cap.obj"
position = [0, 0, APART]
[[set]]
name = "bottom"
along = [0, 0, 1]
at = BOTTOM
[[set]]
name = "inside"
centre = [0, 0, INSIDE]
radius = 1e-9
[[fixed]]
low = [0, -1, -1]
high = [0, 1, 1]
axes = "x"
[[fixed]]
low = [-1, 0, -1]
high = [1, 0, 1]
axes = "y"
[[prescribed]]
set = "bottom"
axes = "z"
move = "0: 0,0,0; 1: 0,0,LIFT"
[[marker]]
set = "bottom"
[[marker]]
set = "inside"
"""


def hertz(cells: int = 6, growth: float = 1.5, size: float = 20.0) -> float:
    """Return the force of a ball on an elastic half-space over Hertz's, 4/3 E' sqrt(R) d^1.5, E' = E / (1 - nu²).

    A quarter of a block, `size` contact radii a wide and high, is pressed on the cap of a fixed ball, R = 100 a,
    without friction. There are `cells` along a, farther away each `growth` times as long as the one before. Told is how
    far a point 10 a below the contact has come: d less what the force moves it by in a half-space,
    (1 + nu) (3 - 2 nu) F / (2 pi E z) [Johnson1985, chapters 3 and 4].
    """
    young, poisson, radius, a = 1e6, 0.3, 0.05, 5e-4
    depth, effective = a**2 / radius, young / (1 - poisson**2)

    def lines(fine: float) -> FloatArray:
        x, h = [0.0], a / cells
        while x[-1] < size * a:
            h *= growth if x[-1] >= fine * a else 1.0
            x.append(x[-1] + h)
        return np.array(x)

    wide, deep = lines(1.2), lines(0.3)
    inside = deep[np.argmin(np.abs(deep - 10 * a))]
    grid = brick("h8", (wide, wide, -deep[::-1]))
    n = np.arange(-cells, 4 * cells + 1)
    x, y = (c.ravel() for c in np.meshgrid(0.5 * a / cells * n, 0.5 * a / cells * n, indexing="ij"))
    number = np.arange(len(n) ** 2).reshape(len(n), len(n))
    p, q, r, s = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack([p, r, q], -1).reshape(-1, 3), np.stack([p, s, r], -1).reshape(-1, 3)])
    thin = 0.02 * depth
    words = {
        "YOUNG": young, "POISSON": poisson, "THIN": thin, "NEAR": 3 * depth, "APART": 2 * thin, "BOTTOM": -deep[-1],
        "INSIDE": -inside, "LIFT": depth + thin,
    }  # fmt: skip
    text = PRESSED
    for word, value in words.items():
        text = text.replace(word, repr(float(value)))
    with TemporaryDirectory() as folder:
        meshio.write(Path(folder) / "block.vtk", meshio.Mesh(grid.nodes, [("hexahedron", grid.elements)]))
        cap = np.stack([x, y, radius - np.sqrt(radius**2 - x**2 - y**2)], axis=1)
        meshio.write(Path(folder) / "cap.obj", meshio.Mesh(cap, [("triangle", faces)]))
        scene = Path(folder) / "pressed.toml"
        scene.write_text(text)
        simulation = Simulation(load_scene(str(scene)))
    simulation.step()
    came = float(simulation.markers[1][2]) + inside - thin
    yields = (1 + poisson) * (3 - 2 * poisson) / (2 * np.pi * young * inside)

    def missing(force: float) -> float:
        return (0.75 * force / (effective * np.sqrt(radius))) ** (2 / 3) - yields * force - came

    exact = brentq(missing, 0.0, 4 * effective * np.sqrt(radius) * depth**1.5)
    return float(4 * simulation.reactions(0)[0][2]) / exact


@dataclass(frozen=True)
class Pile:
    """What a pile of balls did.

    Attributes:
        gap: The smallest one [radii].
        rise: Largest rise of the energy in a step, as a share of what is lost.
        cpu: Time a step [s].
    """

    gap: float
    rise: float
    cpu: float


def pile(count: int = 666, seconds: float = 0.6, dt: float = 0.005) -> Pile:
    """Let balls, a little beside each other at random, fall in a heap: SimBenchmark's 666 [HwangboEtAl2018]."""
    radius, rng, edge = 0.02, np.random.default_rng(666), int(np.ceil(count ** (1 / 3)))
    places = (
        2.2 * radius * (np.indices((edge,) * 3).reshape(3, -1).T - [(edge - 1) / 2, (edge - 1) / 2, -0.55])
    )
    places = places[np.sort(np.argsort(places[:, 2], kind="stable")[:count])]  # the lowest
    places[:, :2] += radius * rng.uniform(-0.1, 0.1, (count, 2))
    head = ROLLING.replace("plate.obj", str(PLATE)).replace("dt = 0.002", f"dt = {dt}").split("[[rigid]]")[0]
    balls = [
        f"[[rigid]]\nshape = 'ball'\nradius = {radius}\nmass = 0.1\nposition = {p.tolist()}" for p in places
    ]
    simulation = Simulation(scene_from_toml("\n".join([head, *balls])))
    gaps, energies, begin = [], [], time.process_time()
    for _ in range(round(seconds / dt)):
        simulation.step()
        x = np.array([ball.position for ball in simulation.rigid])
        apart = np.linalg.norm(x[:, None] - x[None], axis=2)[np.triu_indices(len(x), 1)]
        gaps.append(min(apart.min() - 2 * radius, x[:, 2].min() - radius) / radius)
        energies.append(sum(vars(simulation.energies()).values()))
    cpu = (time.process_time() - begin) / len(gaps)
    rise = float(np.diff(energies).max())
    return Pile(min(gaps), max(rise, 0.0) / (energies[0] - energies[-1]), cpu)


BESIDE: dict[str, Callable[[], float]] = {
    "catenary, sag": catenary,
    "incline, friction at which a block sticks": threshold,
    "ball that slides until it rolls, speed": rolling,
    "Hertz, force of a ball on a half-space": hertz,
}

# tables ---------------------------------------------------------------------------------------------------------------


def solids_table(names: Sequence[str], rounds: int = ROUNDS) -> list[str]:
    """Return the errors of every element, in percent, and CPU times, mesh and all, over those of the first.

    Elements take turns, `rounds` times, so that what slows the machine slows all; the least time of each counts.
    """
    lines = ["| problem | " + " | ".join(ELEMENTS) + " |", "|---|" + "---|" * len(ELEMENTS)]
    for name in names:
        found, least = dict[str, float](), dict.fromkeys(ELEMENTS, np.inf)
        for _ in range(rounds):
            for element in ELEMENTS:
                begin = time.process_time()
                found[element] = SOLIDS[name](element)
                least[element] = min(least[element], time.process_time() - begin)
        first = least[ELEMENTS[0]]
        cells = [f"{100 * (found[e] - 1):+.2f}, {least[e] / first:.2g} x" for e in ELEMENTS]
        lines.append(f"| {name} | {' | '.join(cells)} |")
        print(f"{name}: {ELEMENTS[0]} {first:.3f} s", file=sys.stderr, flush=True)
    return lines


def schemes_table(steps: Sequence[float] = (1e-3, 2.5e-4)) -> list[str]:
    """Return the errors of the period, in percent, and CPU times of a step."""
    lines = ["| scheme | " + " | ".join(f"error at {1e3 * dt:g} ms, CPU a step" for dt in steps) + " |"]
    lines.append("|---|" + "---|" * len(steps))
    for scheme in SCHEMES:
        cells = []
        for dt in steps:
            try:
                found, cpu = period(scheme, dt)
                cells.append(f"{100 * (found - 1):+.4f} %, {1e6 * cpu:.0f} us")
            except StepError:
                cells.append("unstable, and says so")
        lines.append(f"| {scheme} | " + " | ".join(cells) + " |")
    return lines


def contact_table() -> list[str]:
    """Return the errors of nets and contact, in percent, and what the pile did."""
    lines = ["| problem | error |", "|---|---|"]
    lines += [f"| {name} | {100 * (found() - 1):+.3f} % |" for name, found in BESIDE.items()]
    heap = pile()
    lines.append(
        f"| pile of 666 balls, 0.6 s | nothing passes through anything: gaps from {heap.gap:.4f} radii on; "
        f"no step gains more than {100 * heap.rise:.2g} % of the energy lost; {1e3 * heap.cpu:.0f} ms of CPU a step |"
    )
    return lines


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--only", nargs="+", choices=("solids", "schemes", "contact"), help="some of the tables"
    )
    parser.add_argument("--write", action="store_true", help="into docs/verification.md")
    options = parser.parse_args()
    tables = {
        "solids": lambda: solids_table(list(SOLIDS)),
        "schemes": schemes_table,
        "contact": contact_table,
    }
    for name in options.only or tables:
        lines = tables[name]()
        print("\n".join(lines), "\n", flush=True)
        if options.write:
            write_part("verification.md", f"external {name}", lines)


if __name__ == "__main__":
    main()
