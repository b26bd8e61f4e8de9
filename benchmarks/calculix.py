"""The Tripod's load cases solved by CalculiX, an independent finite-element code (Debian package calculix-ccx).

Both codes get the same mesh, law, weight and motion of the clamps; elements, Newton's method and equation solver are
CalculiX's own. Its law C10 (I1 J^-2/3 - 3) + (J - 1)^2 / D1 is ours with C10 = mu / 2 and D1 = 2 / K. The disc is given
the motion that the simulator found, and CalculiX's own reactions tell whether that motion is right: at the equilibrium
nothing holds the disc, so their resultant is zero. What is left of it, times the compliance of the disc, is how far
CalculiX's disc would stand from ours. (Its *RIGID BODY leaves the rotation of the loads out of its tangent and stops
converging at some 20 degrees of the servos.) CalculiX reads N, mm, tonne and MPa.

The compliant clamp is k int |x - p|^2 / 2 dV over the clamped elements, p where the arm has a point. With the integrals
M_ab of the shape functions' products that is, for CalculiX, springs along each axis: of k M_ab from node a to the arm's
place of b, and of -k M_ab from a to b.
"""

import math
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.scenes import SHARP
from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim import Simulation, load_scene
from tripod_sim.elements.element import node_volumes
from tripod_sim.materials.lame import lame_constants
from tripod_sim.robot.disc import effector_disc
from tripod_sim.scene import Scene
from tripod_sim.tables.materials import initial_young

ELEMENTS = {"t4": "C3D4", "t10": "C3D10", "h20": "C3D20R", "h20_full": "C3D20"}
"""Elements of the simulator that CalculiX has with the same shape functions and the same quadrature points."""

CASES = {
    "L1": ((0.0, 0.0, 0.0, 0.0), 0),
    "L2": ((-math.pi / 4,) * 3 + (0.0,), 20),
    "L3": ((-math.pi / 4, 0.0, 0.0, 0.0), 20),
    "L4": ((-1.4965,) * 3 + (0.035,), 40),
    "L5": ((-1.1965, -1.4965, -1.4965, 0.035), 40),
}
"""Joints [rad, rad, rad, m] at the end, and the straight increments in which both codes go there."""

STIFFNESS = {"L5": 1.4e10}
"""Of the compliant clamp [N/m^4]; the other cases have the ideal one."""

PACKAGE = "CalculiX is missing; to install: sudo apt-get install calculix-ccx"

MM = 1e3


class CalculixError(RuntimeError):
    """CalculiX did not reach the end of a load case."""


def installed() -> bool:
    """Return whether the program `ccx` is there."""
    return shutil.which("ccx") is not None


def scene(element: str, level: int, stiffness: float = 0.0) -> Scene:
    """Return the Tripod in statics with the solver's tolerance far below the differences that are compared.

    `stiffness` is that of a compliant clamp [N/m^4]; 0 is the ideal one.
    """
    clamp = [f"clamp={{stiffness={stiffness!r}}}"] if stiffness else []
    overrides = ["inertia=off", "damping=off", f"mesh.element={element}", f"mesh.level={level}"]
    return load_scene(SHARP, [*overrides, *clamp, "solver.tolerance=1e-7"])


def path(case: str) -> FloatArray:
    """Return the joints after each increment of a load case, shape (increments, 4)."""
    joints, increments = CASES[case]
    return np.linspace(0, 1, increments + 1)[1:, None] * np.array(joints)


@dataclass(frozen=True, eq=False)
class Solution:
    """A load case, increment by increment.

    Attributes:
        displacements: Of nodes [m], shape (increments, n, 3).
        forces: Reaction plus weight of each node [N], shape (increments, n, 3).
    """

    displacements: FloatArray
    forces: FloatArray


@dataclass(frozen=True)
class Agreement:
    """How well the codes agree at the last increment that CalculiX reaches.

    Attributes:
        reached: Share of the load case, 1 for all of it.
        size: Largest displacement [m].
        nodes: Largest difference of a node's displacement, over `size`.
        disc: How far the disc would move until CalculiX's forces on it balance, over `size`.
    """

    reached: float
    size: float
    nodes: float
    disc: float


def disc_nodes(simulation: Simulation) -> IndexArray:
    """Return the nodes of the rigid disc."""
    assert simulation.scene.effector
    return effector_disc(simulation.mesh.nodes, simulation.scene.effector)


def weights(simulation: Simulation) -> FloatArray:
    """Return the weight of each node [N], shape (n, 3), as its elements' shape functions share it out."""
    mesh, s = simulation.mesh, simulation.scene
    assert s.gravity
    volumes = node_volumes(mesh.kind, mesh.nodes[mesh.elements])[0]
    share = np.zeros(len(mesh.nodes))
    np.add.at(share, mesh.elements, volumes / volumes.sum())
    return np.outer(s.material.mass * share, s.gravity.acceleration)


def ours(case: str, element: str, level: int) -> tuple[Simulation, FloatArray, list[FloatArray]]:
    """Return the simulation at the end of a load case, the displacements of its nodes at the start and after each
    increment [m], shape (increments + 1, n, 3), and the compliance of the disc with locked servos at the same moments.
    """
    simulation = Simulation(scene(element, level, STIFFNESS.get(case, 0.0)))
    found, soft = [], []
    for joints in [np.zeros(4), *path(case)]:
        simulation.step(joints)
        found.append(simulation.positions - simulation.mesh.nodes)
        w = simulation.compliance().w
        soft.append(w[:6, :6] - w[:6, 6:] @ np.linalg.solve(w[6:, 6:], w[6:, :6]))
    return simulation, np.array(found), soft


def clamped(simulation: Simulation, joints: FloatArray) -> tuple[IndexArray, FloatArray]:
    """Return the nodes of the arms and their displacements [m] at `joints`, from the rotation about each axis."""
    nodes, moves = [], []
    mesh = simulation.scene.mesh
    assert mesh
    frames = Simulation(
        scene(mesh.element, mesh.level)
    ).driven_frames  # with a compliant clamp they drive no node
    for frame, angle in zip(frames, joints[:-1], strict=True):
        arm = simulation.mesh.nodes[frame.nodes] - frame.point
        along = np.outer(arm @ frame.axis, frame.axis)
        turned = along + math.cos(angle) * (arm - along) + math.sin(angle) * np.cross(frame.axis, arm)
        nodes.append(frame.nodes)
        moves.append(turned - arm + joints[-1] * frame.inward)
    return np.concatenate(nodes), np.concatenate(moves)


def bedding(simulation: Simulation, nodes: IndexArray) -> FloatArray:
    """Return the stiffness of the compliant clamp between the clamped nodes [N/m], shape (k, k), along each axis."""
    mesh, clamp = simulation.mesh, simulation.scene.clamp
    assert clamp
    held = mesh.elements[np.isin(mesh.elements, nodes).all(axis=1)]
    points, weights = mesh.kind.products
    volumes = np.abs(np.linalg.det(mesh.kind.jacobians(mesh.nodes[held], points))) * weights
    values = mesh.kind.functions(points)
    place = np.full(len(mesh.nodes), -1)
    place[nodes] = np.arange(len(nodes))
    found, rows = np.zeros((len(nodes), len(nodes))), place[held]
    shares = clamp.stiffness * np.einsum("eq,qa,qb->eab", volumes, values, values)
    np.add.at(found, (rows[:, :, None], rows[:, None, :]), shares)
    return found


def springs(nodes: IndexArray, places: IndexArray, stiffness: FloatArray, first: int) -> list[str]:
    """Return the springs between nodes and `places` of the arms, numbered from `first` on, as CalculiX reads them."""
    k, lines = stiffness / MM, list[str]()
    rows = [(nodes[a] + 1, places[b], k[a, b]) for a, b in zip(*np.nonzero(k), strict=True)]
    rows += [(nodes[a] + 1, nodes[b] + 1, -k[a, b]) for a, b in zip(*np.nonzero(np.triu(k, 1)), strict=True)]
    for i, (one, other, value) in enumerate(rows):
        for axis in (1, 2, 3):
            name = f"S{i}A{axis}"
            lines += [f"*ELEMENT, TYPE=SPRING2, ELSET={name}", f"{first}, {one}, {other}"]
            lines += [f"*SPRING, ELSET={name}", f"{axis}, {axis}", f"{value:.12e}"]
            first += 1
    return lines


def write_input(simulation: Simulation, case: str, discs: FloatArray, file: Path) -> None:
    """Write the CalculiX input of a load case: gravity first, then one step for each increment of the clamps.

    Args:
        simulation: Of the scene.
        case: Name of the load case.
        discs: Displacements of the disc's nodes in each step [m], shape (increments + 1, d, 3).
        file: To write.
    """
    s, mesh = simulation.scene, simulation.mesh
    assert s.gravity
    lam, mu = lame_constants(initial_young(s.material), s.material.poisson)
    volume = node_volumes(mesh.kind, mesh.nodes[mesh.elements])[0].sum()
    g = np.array(s.gravity.acceleration)
    size, disc = float(np.linalg.norm(g)), disc_nodes(simulation)
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i}, {x:.12e}, {y:.12e}, {z:.12e}" for i, (x, y, z) in enumerate(MM * mesh.nodes, 1)]
    lines.append(f"*ELEMENT, TYPE={ELEMENTS[mesh.kind.name]}, ELSET=BODY")
    for i, nodes in enumerate(mesh.elements + 1, 1):
        words = [str(i), *map(str, nodes.tolist())]
        lines += [", ".join(words[:12]) + ("," if len(words) > 12 else "")]
        lines += [", ".join(words[12:])] if len(words) > 12 else []
    lines += ["*MATERIAL, NAME=SILICONE", "*HYPERELASTIC, NEO HOOKE"]
    lines.append(f"{mu / 2 / 1e6:.12e}, {2 / (lam + 2 * mu / 3) * 1e6:.12e}")
    lines += ["*DENSITY", f"{s.material.mass / volume * 1e-12:.12e}"]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=SILICONE"]
    if s.clamp:
        soft = clamped(simulation, np.zeros(4))[0]
        places = len(mesh.nodes) + 1 + np.arange(len(soft))
        lines.append("*NODE")
        lines += [
            f"{i}, " + ", ".join(f"{c:.12e}" for c in MM * mesh.nodes[n])
            for i, n in zip(places, soft, strict=True)
        ]
        lines += springs(soft, places, bedding(simulation, soft), len(mesh.elements) + 1)
    for k, joints in enumerate([np.zeros(4), *path(case)]):
        lines += ["*STEP, NLGEOM, INC=100", "*STATIC", "1., 1."]
        if k == 0:
            lines += ["*CONTROLS, PARAMETERS=FIELD", "1e-7, 1e-6, , , 1e-7"]
            lines += ["*DLOAD", f"BODY, GRAV, {MM * size:.12e}, " + ", ".join(f"{c:.12e}" for c in g / size)]
        nodes, moves = clamped(simulation, joints)
        if s.clamp:
            nodes = places - 1
        lines.append("*BOUNDARY")
        held, moves = np.concatenate([nodes, disc]), np.concatenate([moves, discs[k]])
        for n, move in zip(held + 1, MM * moves, strict=True):
            lines += [f"{n}, {i}, {i}, {value:.12e}" for i, value in enumerate(move, 1)]
        lines += ["*NODE PRINT, NSET=ALL, FREQUENCY=100", "U, RF", "*END STEP"]
    file.write_text("\n".join(lines) + "\n")


def read_results(file: Path, count: int) -> Solution:
    """Return what a .dat file holds of `count` nodes: one block of displacements and one of forces for each step."""
    found: dict[str, list[FloatArray]] = {"displacements": [], "forces": []}
    for line in file.read_text().splitlines():
        words = line.split()
        if words[:1] and words[0] in found:
            found[words[0]].append(np.zeros((count, 3)))
            rows = found[words[0]][-1]
        elif len(words) == 4:
            rows[int(words[0]) - 1] = [float(v) for v in words[1:]]
    steps = len(found["forces"])  # written after the displacements
    return Solution(np.array(found["displacements"])[:steps] / MM, np.array(found["forces"]))


def theirs(simulation: Simulation, case: str, discs: FloatArray, folder: Path) -> Solution:
    """Return CalculiX's solution of a load case, as far as it gets.

    Raises:
        CalculixError: the package is missing, or CalculiX does not solve the first step.
    """
    if not installed():
        raise CalculixError(PACKAGE)
    write_input(simulation, case, discs, folder / "tripod.inp")
    done = subprocess.run(
        ["ccx", "-i", "tripod"], cwd=folder, capture_output=True, text=True, timeout=300, check=False,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    found = read_results(folder / "tripod.dat", len(simulation.mesh.nodes))
    if not len(found.forces):
        raise CalculixError(f"CalculiX solves nothing: {done.stdout.strip()[-300:]}")
    return found


def agreement(case: str, element: str, level: int, folder: Path) -> Agreement:
    """Return how well CalculiX agrees with the simulator, at the last increment that CalculiX reaches.

    Args:
        case: Name of the load case.
        element: Name of the element.
        level: Of the mesh.
        folder: For CalculiX's files.
    """
    simulation, u, soft = ours(case, element, level)
    disc = disc_nodes(simulation)
    found = theirs(simulation, case, u[:, disc], folder)
    last = len(found.forces) - 1
    size = float(np.linalg.norm(u[last], axis=1).max())
    apart = float(np.linalg.norm(u[last] - found.displacements[last], axis=1).max())
    force = found.forces[last, disc] - weights(simulation)[disc]
    position = (simulation.mesh.nodes + u[last])[disc]
    wrench = np.concatenate(
        [force.sum(axis=0), np.cross(position - position.mean(axis=0), force).sum(axis=0)]
    )
    disc_move = float(np.linalg.norm((soft[last] @ wrench)[:3]))
    return Agreement(last / (len(u) - 1) if len(u) > 1 else 1.0, size, apart / size, disc_move / size)
