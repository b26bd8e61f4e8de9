"""The potential of one step in the coordinates of a reduced model.

It is the potential of `system.System` with the rows of the model in the place of nodes; what differs is how positions
follow from the unknowns. Solid, damping and inertia are the same terms on fewer elements and nodes.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tripod_sim.constraints.reduction import move_bodies
from tripod_sim.forces.solid import Solid
from tripod_sim.forces.solid_kernels import add_element_products
from tripod_sim.reduced.basis import Basis
from tripod_sim.reduced.coordinates import Coordinates
from tripod_sim.reduced.product_kernels import multiply
from tripod_sim.reduced.projection import Projection
from tripod_sim.reduced.rows import make_rows
from tripod_sim.reduced.state import ReducedState
from tripod_sim.reduced.terms import Bedding, Weight
from tripod_sim.state import State
from tripod_sim.system import System
from tripod_sim.system_kernels import inner

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.forces.anchor import Anchor
    from tripod_sim.forces.rayleigh import StiffnessDamping

FloatArray = NDArray[np.float64]


class ReducedSystem(System):
    """Evaluates Phi, its gradient and Hessian, and moves a reduced state along a step of the unknowns.

    Unknowns: centre and rotation of each body, then the amplitudes q. What takes a state takes that of the whole body,
    too, and looks at its `reduced`.

    Attributes:
        rows: Of the model.
        columns: B of all nodes, shape (3 n, size).
    """

    def __init__(self, full: System, mass: FloatArray, basis: Basis) -> None:
        """Reduce a system without inertia and damping, which `add_motion` adds.

        Args:
            full: The system of all nodes; it is not changed.
            mass: Of nodes [kg], shape (n,).
            basis: Made for this system.
        """
        groups = self.groups = full.groups
        self.inertia = self.damping = self.foundation = self.gravity = self.loads = None
        self.columns = basis.columns(full.rest, groups)
        which = np.flatnonzero(basis.weights > 0)
        nodes, numbers = np.unique(full.solid.elements[which], return_inverse=True)
        elements = numbers.reshape(len(which), -1)
        self.rows = make_rows(full.rest, self.columns, nodes, mass, _bedding(full, self.columns))
        self.solid: Solid = full.solid.part(which, basis.weights[which], elements)
        self._nodes = full.rest
        self.rest = self.rows.rest
        centres = np.array([full.rest[b].mean(axis=0) for b in groups.rigid]).reshape(-1, 3)
        self._rest_centres = centres
        self.coordinates = Coordinates(centres, len(groups.driven), basis.shapes.shape[1])
        projection = Projection(self.coordinates, self.rows, elements)
        self.reduction = projection  # type: ignore[assignment]
        self.linear = projection.linear
        if full.foundation:
            self.foundation = Bedding(self.rows)  # type: ignore[assignment]
        if full.gravity:
            self.gravity = Weight(full.gravity.force, self.columns, self.rows)  # type: ignore[assignment]
        n, s = len(self.rest), len(groups.driven)
        self.gradient, self.lever, self.axes = np.zeros((n, 3)), np.zeros((0, 3)), np.zeros((0, 3))
        self.residual, self.torques = np.zeros(projection.unknowns), np.zeros(s)
        self._no_weight, self._change = np.zeros(n), np.zeros((n, 3))
        self.strain_energy = self.gravity_energy = 0.0
        self.driven, self._beside = np.arange(n), np.arange(len(which))
        self.factored = False
        self._reduced, self._unused = np.zeros_like(self.residual), np.zeros(s)
        self._elastic, self._elastic_energy = np.zeros((n, 3)), 0.0
        self._last, self._known = (self.rest.copy(), self.solid.rest_modes()), False
        self._z = np.empty(self.coordinates.size)
        self._scale = self._unknown_scale(full, basis)

    def _unknown_scale(self, full: System, basis: Basis) -> FloatArray:
        """Return the factors that make forces of the residual [1, 1/m, kg^1/2 ...]."""
        first = 6 * len(self.groups.rigid)
        scale = np.ones(self.reduction.unknowns)
        for b, nodes in enumerate(self.groups.rigid):
            arm = full.rest[nodes] - self._rest_centres[b]
            scale[6 * b + 3 : 6 * b + 6] = 1 / np.sqrt((arm**2).sum(axis=1).mean())
        scale[first:] = 1 / np.linalg.norm(basis.shapes, axis=0)
        return scale

    def add_motion(self, inertia: "Anchor | None", damping: "StiffnessDamping | None") -> None:
        """Add inertia and stiffness damping, both made for the rows."""
        self.inertia, self.damping = inertia, damping

    # the state -----------------------------------------------------------------------------------------------

    def start_state(self, joints: FloatArray) -> State:
        """Return the undeformed state of all nodes at the joint values `joints`, shape (s + 1,), with `reduced`."""
        k, n, bodies = len(self.rest), len(self._nodes), len(self.groups.rigid)
        centres, rotations = self._rest_centres, np.tile(np.eye(3), (bodies, 1, 1))
        reduced = ReducedState(
            self.rest.copy(), np.zeros((k, 3)), self.solid.rest_modes(), centres.copy(), rotations.copy(),
            joints.copy(), q=np.zeros(self.coordinates.size - self.coordinates.boundary),
        )  # fmt: skip
        modes = np.zeros((0, 0, 3))
        return State(
            self._nodes.copy(), np.zeros((n, 3)), modes, centres.copy(), rotations, joints.copy(), reduced=reduced
        )  # fmt: skip

    def expand(self, state: State) -> None:
        """Write positions, velocities, bodies and joints of the whole body from its `reduced`."""
        reduced = _inner(state)
        z = self.coordinates.values(reduced)
        if self.inertia:
            rates = self.rows.back @ reduced.velocities[self.rows.inert].reshape(-1)
            multiply(self.columns, rates, state.velocities.reshape(-1))
        multiply(self.columns, z, state.positions.reshape(-1))
        state.positions += self._nodes
        for name in ("centres", "rotations", "joints"):
            getattr(state, name)[:] = getattr(reduced, name)

    def _place(self, state: ReducedState) -> None:
        """Put the rows where the coordinates say."""
        multiply(self.rows.columns, self.coordinates.values(state), state.positions.reshape(-1))
        state.positions += self.rest

    def drive(self, state: State, joints: FloatArray) -> None:
        """Put the driven frames at `joints`, shape (s + 1,); rows move along with them."""
        reduced = _inner(state)
        reduced.joints[:] = joints
        self._place(reduced)

    def move(self, start: State, solution: FloatArray, dx: FloatArray, scale: float, out: State) -> None:
        """Write to `out` the state after `scale` times a step, as `System.move`; `dx` is not looked at."""
        assert isinstance(start, ReducedState)
        assert isinstance(out, ReducedState)
        first = 6 * self.coordinates.bodies
        move_bodies(start.centres, start.rotations, scale, solution, 0, out.centres, out.rotations)
        np.multiply(solution[first:], scale, out=out.q)
        out.q += start.q
        self._place(out)
        moved = out.positions - start.positions
        moved /= scale
        self.solid.advance_modes(start.modes, moved, scale, out.modes)

    # the potential --------------------------------------------------------------------------------------------

    def potentials(self, state: State) -> tuple[float, float]:
        """Return strain energy, the foundation's included, and potential of gravity [J]."""
        return super().potentials(_inner(state))

    def evaluate(self, state: State) -> float:
        """As `System.evaluate`."""
        return super().evaluate(_inner(state))

    def assemble(self, state: State, *, project: bool) -> int:
        """As `System.assemble`."""
        return super().assemble(_inner(state), project=project)

    def update_levers(self, state: State) -> None:
        """Linearise the coordinates about `state`."""
        self.coordinates.update(state.rotations, state.joints)

    def settle(self, state: State, solution: FloatArray, dx: FloatArray) -> None:
        """As `System.settle`; all elastic forces become those of the linear response, which takes no longer here."""
        elastic, work = self._elastic, inner(self._elastic, dx)
        add_element_products(self.solid.matrices, self.solid.elements, self._beside, dx, 1.0, elastic)
        self.residual[:] = 0.0
        self.torques += solution @ self.reduction.drive
        self._elastic_energy += 0.5 * (work + inner(elastic, dx))
        self._claim(_inner(state))

    def add_driven(self, dx: FloatArray) -> None:
        """Add to `residual` the first-order change of the gradient when rows move by `dx` [m], shape (rows, 3)."""
        super().add_driven(dx)
        if self.inertia:
            np.multiply(dx, self.inertia.weight[:, None], out=self._change)
            self.reduction.gradient(self._change, self.lever, self.axes, self._reduced, self._unused)
            self.residual += self._reduced


def _inner(state: State) -> ReducedState:
    """Return a reduced state: `state` itself, or that of the whole body's."""
    found = state if isinstance(state, ReducedState) else state.reduced
    assert isinstance(found, ReducedState)
    return found


def _bedding(full: System, columns: FloatArray) -> FloatArray | None:
    """Return B^T K B of the foundation, shape (size, size)."""
    if not full.foundation:
        return None
    size = columns.shape[1]
    elements = full.foundation.elements
    local = columns.reshape(-1, 3, size)[elements].reshape(len(elements), -1, size)
    products = np.matmul(full.foundation.matrices, local)
    found = local.reshape(-1, size).T @ products.reshape(-1, size)
    return np.asarray(0.5 * (found + found.T))
