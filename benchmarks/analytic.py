"""Cases with a known solution, for any element: what the element finds, over what is right.

A bar of square section with nu = 0 is bent, shaken, buckled and twisted; small strains, so that beam theory holds. A
block of distorted elements is strained evenly and moved rigidly, and a bar flies freely.
"""

import math
from collections.abc import Callable

import numpy as np
from scipy import linalg, optimize

from benchmarks.blocks import beside, block, brick, elastic, lumped
from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.forces.solid import Solid
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import SolidMesh

LENGTH, HEIGHT, YOUNG, DENSITY = 10.0, 0.5, 1000.0, 1.0
"""Of the bar [m, m, Pa, kg/m³]."""
AREA, INERTIA, SHEAR = HEIGHT**2, HEIGHT**4 / 12, 5 / 6 * HEIGHT**2 * YOUNG / 2
"""Of its section: area [m²], second moment [m⁴], shear stiffness 5/6 G A [N]."""


def bar(element: str, cells: int, thick: int = 1) -> SolidMesh:
    """Return the mesh of the bar, its axis along x from the origin; `thick`: elements along a side of the section."""
    across = np.linspace(-HEIGHT / 2, HEIGHT / 2, thick + 1)
    return brick(element, (np.linspace(0, LENGTH, cells + 1), across, across))


def tangent(solid: Solid, mesh: SolidMesh, x: FloatArray) -> FloatArray:
    """Return the stiffness of all nodes at positions `x` [m], incompatible modes condensed [N/m], shape (3n, 3n)."""
    solid.stiffness(x, solid.rest_modes(), project=False)
    out = np.zeros((x.size, x.size))
    for nodes, k in zip(mesh.elements, solid.matrices, strict=True):
        dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
        out[np.ix_(dofs, dofs)] += k
    return out


def _free(mesh: SolidMesh) -> IndexArray:
    """Return the degrees of freedom of nodes that are not at x = 0."""
    return np.flatnonzero(np.repeat(mesh.nodes[:, 0] > 1e-9, 3))


def deflection(element: str, cells: int = 10) -> float:
    """Return the deflection of a cantilever under a force at its tip over Timoshenko's F L (L²/3EI + 1/kGA)."""
    mesh = bar(element, cells)
    K, free = tangent(elastic(mesh, YOUNG, 0.0), mesh, np.array(mesh.nodes)), _free(mesh)
    tip = np.flatnonzero(mesh.nodes[:, 0] > LENGTH - 1e-9)
    load, u = np.zeros(len(K)), np.zeros(len(K))
    load[3 * tip + 2] = 1.0 / len(tip)
    u[free] = np.linalg.solve(K[np.ix_(free, free)], load[free])
    return float(u[3 * tip + 2].mean() / (LENGTH**3 / (3 * YOUNG * INERTIA) + LENGTH / SHEAR))


def beam_frequency() -> float:
    """Return the first angular frequency of Timoshenko's cantilever [rad/s].

    With w' = psi + V/kGA, psi' = M/EI, M' = -V - rho I om² psi, V' = -rho A om² w, clamped at 0 and free at L, it is
    the smallest om at which the block of the transfer matrix from (M, V) to (M, V) is singular.
    """
    euler = 1.8751040687**2 * math.sqrt(YOUNG * INERTIA / (DENSITY * AREA)) / LENGTH**2

    def singular(om: float) -> float:
        a = np.zeros((4, 4))
        a[0, 1], a[0, 3], a[1, 2], a[2, 3] = 1.0, 1 / SHEAR, 1 / (YOUNG * INERTIA), -1.0
        a[2, 1], a[3, 0] = -DENSITY * INERTIA * om**2, -DENSITY * AREA * om**2
        return float(np.linalg.det(linalg.expm(LENGTH * a)[2:, 2:]))

    return float(optimize.brentq(singular, 0.8 * euler, 1.1 * euler))


def frequency(element: str, cells: int = 10) -> float:
    """Return the first eigenfrequency of a cantilever, with the masses of implicit schemes, over Timoshenko's.

    The bar is two elements thick: in a chain one element thick the points of `h20` leave motions without energy.
    """
    mesh = bar(element, cells, thick=2)
    K, free = tangent(elastic(mesh, YOUNG, 0.0), mesh, np.array(mesh.nodes)), _free(mesh)
    mass = DENSITY * AREA * LENGTH
    M = np.diag(lumped(mesh, mass)[1])
    for elements, couplings in beside(mesh, mass):
        np.add.at(M, (elements[:, :, None], elements[:, None, :]), couplings)
    M = np.kron(M, np.eye(3))
    squares = linalg.eigh(
        K[np.ix_(free, free)], M[np.ix_(free, free)], eigvals_only=True, subset_by_index=(0, 0)
    )
    return float(math.sqrt(squares[0]) / beam_frequency())


def buckling(element: str, cells: int = 10) -> float:
    """Return the dead load at which a straight cantilever's tangent turns singular, over Euler's.

    Euler's pi² EI / 4 L² with Engesser's correction for shear: P = P_E / (1 + P_E / kGA). Two elements thick.
    """
    mesh = bar(element, cells, thick=2)
    solid, free, x = elastic(mesh, YOUNG, 0.0), _free(mesh), np.array(mesh.nodes)
    end = np.flatnonzero(mesh.nodes[:, 0] < 1e-9)

    def shortened(strain: float) -> FloatArray:
        return x * [1 - strain, 1, 1]

    def smallest(strain: float) -> float:
        K = tangent(solid, mesh, shortened(strain))[np.ix_(free, free)]
        return float(linalg.eigvalsh(K, subset_by_index=(0, 0))[0])

    euler = math.pi**2 * YOUNG * INERTIA / (4 * LENGTH**2)
    strain = optimize.brentq(smallest, 0.0, 20 * euler / (YOUNG * AREA), xtol=1e-9)
    force, y = np.zeros_like(x), shortened(strain)
    tangent(solid, mesh, y)
    solid.add_gradient(y, solid.rest_modes(), force)
    return float(abs(force[end, 0].sum()) / (euler / (1 + euler / SHEAR)))


def torsion(element: str, cells: int = 4) -> float:
    """Return the torsional stiffness of a square bar over Saint-Venant's G J / L.

    J = a⁴ (1/3 - 64/pi⁵ sum over odd n of tanh(n pi/2) / n⁵). Both ends turn in their plane and are free to warp: his
    solution then holds all along the bar. `cells`: elements along a side of the section.
    """
    side, length = np.linspace(-0.5, 0.5, cells + 1), 1.0
    mesh = brick(element, (np.linspace(0, length, 3), side, side))
    x, K = np.array(mesh.nodes), tangent(elastic(mesh, YOUNG, 0.0), mesh, np.array(mesh.nodes))
    ends = np.flatnonzero((x[:, 0] < 1e-9) | (x[:, 0] > length - 1e-9))
    held = np.concatenate([3 * ends + 1, 3 * ends + 2, [3 * int(np.argmin(np.linalg.norm(x, axis=1)))]])
    free, u = np.setdiff1d(np.arange(x.size), held), np.zeros(x.size)
    angle = x[:, 0] / length
    u[1::3], u[2::3] = -angle * x[:, 2], angle * x[:, 1]
    u[0::3] = 0.0
    u[free] = 0.0
    u[free] = -np.linalg.solve(K[np.ix_(free, free)], K[free] @ u)
    series = sum(math.tanh(n * math.pi / 2) / n**5 for n in range(1, 40, 2))
    exact = YOUNG / 2 * (1 / 3 - 64 / math.pi**5 * series) / length
    return float(u @ K @ u / exact)


def distorted(element: str) -> SolidMesh:
    """Return a block of 3x3x3 cells whose inner and outer corners are moved by up to 12 % of an edge."""
    straight = brick("h8_modes", (np.arange(4.0),) * 3)
    noise = np.random.default_rng(5).uniform(-0.12, 0.12, straight.nodes.shape)
    mesh = SolidMesh.of(straight.nodes + noise, straight.elements)
    return mesh if element == "h8_modes" else convert(mesh, element)


STRAIN = np.array([[1.3, 0.2, 0.0], [0.1, 0.9, 0.1], [0.0, 0.2, 1.1]])
"""F of the patch test."""


def patch(element: str) -> float:
    """Return the largest force on an inner node of an evenly strained block, over the largest on an outer one."""
    mesh = distorted(element)
    solid, x, g = elastic(mesh, YOUNG, 0.45), mesh.nodes @ STRAIN.T, np.zeros(mesh.nodes.shape)
    tangent(solid, mesh, x)
    solid.add_gradient(x, solid.rest_modes(), g)
    outer = np.unique(mesh.surface)
    inner = np.setdiff1d(np.arange(len(x)), outer)
    return float(np.abs(g[inner]).max() / np.abs(g[outer]).max())


def rigid(element: str) -> float:
    """Return the largest force on a node of a block turned by 2 rad and shifted, over the patch test's largest."""
    mesh = distorted(element)
    solid, nodes = elastic(mesh, YOUNG, 0.45), np.array(mesh.nodes)
    turn = linalg.expm(np.cross(np.eye(3), 2 * np.array([2, -1, 2]) / 3))
    found = []
    for x in (nodes @ turn.T + [5.0, -3.0, 2.0], nodes @ STRAIN.T):
        g = np.zeros_like(nodes)
        tangent(solid, mesh, x)
        solid.add_gradient(x, solid.rest_modes(), g)
        found.append(float(np.abs(g).max()))
    return found[0] / found[1]


def flight(element: str, steps: int = 250, scheme: str = "tr_bdf2") -> tuple[float, float, float]:
    """Return what a free, spinning, vibrating bar keeps of linear momentum, angular momentum and energy in 0.5 s.

    One turn a second, stretched by 2 % at the start; its first axial vibration has 0.25 s. Steps of 2 ms.
    """
    mesh = brick(element, (np.linspace(-1, 1, 9), np.linspace(-0.25, 0.25, 2), np.linspace(-0.25, 0.25, 2)))
    body = block(
        mesh, young=256.0, poisson=0.3, mass=0.5, held=np.zeros(0, int), dt=0.5 / steps, scheme=scheme,
        acceleration=(0.0, 0.0, 0.0), tolerance=1e-7,
    )  # fmt: skip
    state = body.state
    state.positions[:, 0] *= 1.02
    state.velocities[:] = np.array([1.0, 0.5, -0.2]) + np.cross([0.0, 0.0, 2 * math.pi], state.positions)
    (p0, h0), (_, e0) = body.momenta(), body.energies()
    for _ in range(steps):
        body.step()
    (p, h), (_, e) = body.momenta(), body.energies()
    linear = float(np.linalg.norm(p - p0) / np.linalg.norm(p0))
    return 1 + linear, 1 + float(np.linalg.norm(h - h0) / np.linalg.norm(h0)), e / e0


RATIOS: dict[str, Callable[[str], float]] = {
    "patch test: force on inner nodes": lambda e: 1 + patch(e),
    "rigid motion: force": lambda e: 1 + rigid(e),
    "cantilever, deflection": deflection,
    "the same, 20 elements": lambda e: deflection(e, 20),
    "cantilever, first frequency": frequency,
    "Euler's buckling load": buckling,
    "torsion of a bar": torsion,
}
"""Cases by name: what is found over what is right."""
