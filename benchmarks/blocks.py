"""Bars and blocks for benchmarks: bodies that no scene describes, made of the simulator's own parts."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.constraints.groups import Groups
from tripod_sim.elements.element import node_volumes, row_sums
from tripod_sim.elements.hexahedron import CORNERS
from tripod_sim.forces.anchor import Anchor
from tripod_sim.forces.element_inertia import ElementInertia, ElementMasses, lacking
from tripod_sim.forces.gravity import GravityForce
from tripod_sim.forces.solid import Solid
from tripod_sim.integrators.implicit import ImplicitSteps
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.schemes import SCHEMES
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.substeps import Substeps, halving
from tripod_sim.materials.lame import lame_constants
from tripod_sim.materials.law import vector
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import SolidMesh, check_mesh
from tripod_sim.state import State
from tripod_sim.system import System


def brick(element: str, lines: Sequence[NDArray[Any]]) -> SolidMesh:
    """Return the mesh of a brick whose cells lie between the given coordinates of each of the three axes [m]."""
    nodes = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 3)
    a, b, c = (len(line) for line in lines)
    n = np.arange(len(nodes)).reshape(a, b, c)
    corners = ((CORNERS + 1) // 2).astype(int)
    cells = [n[p : a - 1 + p, q : b - 1 + q, r : c - 1 + r].ravel() for p, q, r in corners]
    mesh = SolidMesh.of(nodes, np.stack(cells, axis=1))
    if element != mesh.kind.name:
        mesh = convert(mesh, element)
    check_mesh(mesh, "brick")
    return mesh


def lumped(mesh: SolidMesh, mass: float) -> tuple[FloatArray, FloatArray]:
    """Return what nodes weigh and what inertia they have [kg], each of shape (n,) and of sum `mass`."""
    found = []
    for volumes in node_volumes(mesh.kind, mesh.nodes[mesh.elements]):
        node = np.zeros(len(mesh.nodes))
        np.add.at(node, mesh.elements, volumes)
        found.append(node * (mass / node.sum()))
    return found[0], found[1]


def beside(mesh: SolidMesh, mass: float) -> list[ElementMasses]:
    """Return what those of `lumped` lack of the inertia of quadratic elements, in all of `mass` [kg]."""
    if mesh.kind.lumping is row_sums:
        return []
    nodes = mesh.nodes[mesh.elements]
    density = mass / node_volumes(mesh.kind, nodes)[0].sum()
    return [lacking(mesh.kind, nodes, mesh.elements, np.full(len(mesh.elements), density))]


def elastic(
    mesh: SolidMesh, young: float, poisson: float, law: str = "neo_hooke", damping: float = 0.0
) -> Solid:
    """Return the elastic solid on a mesh; `young` in Pa, `damping` by stiffness in s."""
    nodes, elements, parameters = (
        np.array(mesh.nodes),
        np.array(mesh.elements),
        vector(law, *lame_constants(young, poisson)),
    )
    return Solid(nodes, elements, mesh.kind, law, parameters, damping=damping)


@dataclass(eq=False)
class Block:
    """A body of one mesh, free or held at some nodes, stepped in time.

    Attributes:
        mesh: Its mesh.
        solid: Its elasticity.
        mass: Inertia of nodes [kg], shape (n,).
        masses: What that lacks of the inertia of elements.
        gravity: Its weight.
        state: Where it is.
        stepper: The time integrator.
        dt: Time step [s].
    """

    mesh: SolidMesh
    solid: Solid
    mass: FloatArray
    masses: list[ElementMasses]
    gravity: GravityForce
    state: State
    stepper: Substeps
    dt: float

    def step(self) -> StepReport:
        """Advance by dt."""
        return self.stepper.step(self.state, self.state.joints.copy(), self.dt)

    def warm_up(self) -> None:
        """Load every kernel by one step, and undo it."""
        start = self.state.copy()
        self.step()
        start.copy_to(self.state)
        self.stepper.forget()

    @property
    def momentum(self) -> FloatArray:
        """M v [kg m/s], shape (n, 3)."""
        found = self.mass[:, None] * self.state.velocities
        for masses in self.masses:
            masses.add(self.state.velocities, found)
        return found

    @property
    def modes(self) -> FloatArray:
        """The modes of its elements [m], which may have none."""
        return self.state.modes if self.solid.has_modes else self.solid.rest_modes()

    def energies(self) -> tuple[float, float]:
        """Return kinetic energy, and the sum of kinetic, strain and gravity [J]."""
        s = self.state
        kinetic = 0.5 * float(np.vdot(s.velocities, self.momentum))
        return kinetic, kinetic + self.solid.energy(s.positions, self.modes) + self.gravity.energies(
            s.positions
        )[1]

    def momenta(self) -> tuple[FloatArray, FloatArray]:
        """Return linear [kg m/s] and angular momentum about the origin [kg m²/s]."""
        s = self.state
        return self.momentum.sum(axis=0), np.cross(s.positions, self.momentum).sum(axis=0)


def block(
    mesh: SolidMesh,
    *,
    young: float,
    poisson: float,
    mass: float,
    held: IndexArray,
    dt: float,
    scheme: str,
    law: str = "neo_hooke",
    acceleration: tuple[float, float, float] = (0.0, 0.0, -9.81),
    damping: tuple[float, float] = (0.0, 0.0),
    tolerance: float = 1e-4,
) -> Block:
    """Return a block at rest.

    Args:
        mesh: Its mesh.
        young, poisson, mass, law: E [Pa], nu, total mass [kg] and elastic law.
        held: Nodes that never move; may be none.
        dt: Time step [s].
        scheme: Time integrator.
        acceleration: Of gravity [m/s²].
        damping: By mass, a [1/s], and by stiffness, b [s].
        tolerance: Unbalanced force at which a step counts as solved [N].
    """
    solid, (load, inert) = elastic(mesh, young, poisson, law, damping[1]), lumped(mesh, mass)
    nodes = np.array(mesh.nodes)
    gravity, inertia = GravityForce(load, acceleration, nodes), Anchor(len(nodes))
    groups, masses = Groups(len(nodes), fixed=np.array(held, dtype=np.int64)), beside(mesh, mass)
    terms = [gravity, inertia, *(ElementInertia(m, inertia) for m in masses)]
    system = System(nodes, [solid], groups, terms, damped=True)
    stage = ImplicitStage(Newton(system, tolerance, 100), inertia, inert, damping[0])
    stepper = halving(ImplicitSteps(SCHEMES[scheme], stage), 8)
    return Block(mesh, solid, inert, masses, gravity, system.start_state(np.zeros(1)), stepper, dt)
