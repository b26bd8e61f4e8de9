"""The error that the mesh makes of the effector's position, estimated while a scene runs.

A richer mesh of the same piece, with the same clamps, material and weight, is kept at rest beside the body in motion.
Its driven frames stand where those of the body stand, and it carries as a dead load what the body's own mesh lacks for
balance,

    r = dE/dx (x),      dE+/dx (x+) = P^T r,      error = H x+ - H x,

E and E+ the energies of the body alone, in its weight, on the two meshes, P what interpolates in the elements of the
richer one at the places of the body's nodes, H the mean of the disc's nodes. So r are the forces by which all else
acts: inertia, damping, contact, ball, maze, ties, other bodies. By P^T they do the same work in each move of the richer
mesh; were that the body's own, there would be no error. Of the disc's nodes only force and moment count, since what
keeps it rigid is among their r.

Where both are linear that is the dual-weighted residual [BeckerRannacher2001] with the dual solution of the richer
mesh, error = -z+ . R+(x), A+ z+ = H^T: a step with the kept tangent A+ costs the one back-substitution that the dual
would, gives all three components, and what the linearisation misses is seen and corrected by the next. The forces are
taken as known, so the error follows at once; that it has inertia and vibrates, of a body that is alone, is in
`modal_error`.
"""

import time
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from tripod_host.arrays import FloatArray
from tripod_host.rotations import rotation_vector
from tripod_sim.build import build_model
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.quadratic_hexahedron import H20
from tripod_sim.errors import SceneError, StepError
from tripod_sim.forces.loads import NodalLoads
from tripod_sim.integrators.newton import NewtonError
from tripod_sim.integrators.quasi_static import quasi_static_steps
from tripod_sim.integrators.report import MeshErrorReport
from tripod_sim.integrators.turning import Rotations, TurningSolver
from tripod_sim.mesh.described import element_of
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.mesh_error.chord import ChordNewton
from tripod_sim.mesh_error.external_loads import ExternalLoads, alone, interpolate, interpolation
from tripod_sim.mesh_error.modal_error import ModalError
from tripod_sim.model import Model
from tripod_sim.state import State
from tripod_sim.steps.parts import Parts
from tripod_sim.tables.bodies import GENERATED, Mesh

GRADED = 8
"""The coarsest mesh level of the Y whose cells are graded for quadratic elements; see `mesh.y_piece.LEVELS`."""


def richer(model: Model) -> Model:
    """Return the model at rest of the first body alone, on the mesh that tells the error of its own."""
    _, body = model.bodies[0]
    assert body.mesh
    return alone(model, finer(body.mesh))


def finer(mesh: Mesh) -> Mesh:
    """Return the mesh that tells the error of `mesh`.

    Quadratic elements on the same cells tell the error of linear ones, half the edges that of quadratic ones:
    hexahedra, also for the tetrahedra into which a generator divides its cells. Cells of a file stay of their kind. The
    Y's levels below `GRADED` are too coarse at disc and clamp for that: they are held against quadratic hexahedra of
    that level.
    """
    generated, element = mesh.source in GENERATED, element_of(mesh)
    if mesh.source == "y_piece" and mesh.level < GRADED:
        return replace(mesh, element="h20", level=GRADED)
    kind, hexahedral = ELEMENTS[element], H20.name
    if kind.centres:
        return replace(mesh, element=hexahedral if generated else element, refine=mesh.refine + 1)
    if not (generated or kind.quadratic):
        raise SceneError(
            f"mesh_error cannot tell the error of mesh.element {element!r}: there is no quadratic element on the same "
            "cells to compare with; leave out [mesh_error], and compare with a finer mesh"
        )
    return replace(mesh, element=hexahedral if generated else kind.quadratic)


class MeshError:
    """Keeps the richer mesh beside a simulation."""

    def __init__(self, model: Model, mesh: SolidMesh, simulated: Parts, share: float = np.inf) -> None:
        """Build the richer mesh.

        Args:
            model: Of the simulation.
            mesh: Of its first body, whose nodes come first in its states.
            simulated: Its parts.
            share: Of the CPU time of the steps, what estimates may take.

        Raises:
            SceneError: it cannot be built.
        """
        if len(mesh.blocks) > 1:
            raise SceneError(
                f"mesh_error cannot tell the error of a mesh of several kinds of elements ({mesh.kinds}): there is no "
                "quadratic mesh on the same cells to compare with; leave out [mesh_error], and compare with a finer one"
            )
        parts, solver = build_model(richer(model)), simulated.solver
        assert isinstance(parts.mesh, SolidMesh)
        self._outside = ExternalLoads(model, mesh, parts, simulated)
        system = self._system = self._outside.supported(parts.system, model)
        system.linear = self._turning = TurningSolver(system.linear, system.unknowns)
        self._newton = ChordNewton(system, solver.tolerance, solver.max_iterations)
        self._careful = quasi_static_steps(self._newton, solver.max_halvings, solver.max_turn, model.reach)
        self._moves = bool(model.scheme)
        self._share = share
        self._nodes, self._weights = interpolation(mesh, parts.mesh.nodes)
        around = self._nodes[system.reduction.free]
        self._rotations = Rotations(mesh.nodes, [(mesh.elements, mesh.kind)], around, system)
        self._rest, self._simulated = mesh.nodes, simulated
        self._modal_error = self._error_in_motion(model, parts)
        self._own: State | None = None
        self._astray = False
        self._dx, self._move = np.zeros_like(system.rest), np.zeros(system.unknowns)
        self._loads = NodalLoads(system.rest)
        system.take(self._loads)

    def start(self, state: State) -> MeshErrorReport:
        """Begin again with `state`: bring the richer mesh to its rest there; return the error there.

        It goes there from where it is undeformed along with the body: whatever equilibrium that is in, it comes to the
        one beside.
        """
        self._astray = False
        own = self._own = self._system.start_state(np.zeros_like(self._joints(state)))
        self._seen = state.copy()
        self._seen.errors = None
        self._seen.positions[: len(self._rest)] = self._rest
        self._seen.centres[0], self._seen.rotations[0] = own.centres[0], own.rotations[0]
        self._trial = own.copy()
        self._newton.forget()
        self._newton.amiss = None
        self._credit = 0.0
        self._error_at_rest(state)  # goes there
        self._error_at_rest(state)  # is factored there; the next one takes as long as those to come
        begin = time.thread_time()
        self._at_rest = self._error_at_rest(state)
        self._cost = time.thread_time() - begin
        if self._modal_error:
            self._modal_error.start(state, own)
        self._last = self._report(state.time)
        return self._last

    def carry_steps(self) -> bool:
        """Carry the error of the time steps in the modes in which that of the mesh swings, and say so, if that can be.

        It then costs no linear solve, as little as that of the mesh. It begins again.
        """
        errors, modal = self._simulated.errors, self._modal_error
        if not (errors and modal and len(modal.modes.squares)):
            return False
        from tripod_sim.integrators.time_error import ErrorTransport  # noqa: PLC0415 - an effect that is absent
        from tripod_sim.mesh_error.modal_integration import ModalIntegration  # noqa: PLC0415

        if not isinstance(errors, ErrorTransport) or not errors.carried:
            return False
        errors.carry_in(ModalIntegration(modal.modes, errors.system, errors.inertia, modal.damping))
        return True

    def _error_in_motion(self, model: Model, richer: Parts) -> ModalError | None:
        """Return what adds the inertia of the error; None where nothing moves, or more than the body alone."""
        system = self._simulated.system
        if not model.scheme or model.contact or len(model.bodies) > 1:
            return None
        (count, k), (own_plate, plate) = self._nodes.shape, self._outside.plates
        rows = np.append(np.repeat(np.arange(count), k), plate)
        weights = np.append(self._weights, np.ones(len(plate)))
        shape = (len(richer.mass), len(self._outside.system.rest))
        prolong = csr_matrix((weights, (rows, np.append(self._nodes, own_plate))), shape)
        return ModalError(self._outside, self._system, prolong, richer.mass, model.drag, system.elastic)

    def follow(self, state: State, begin: float) -> MeshErrorReport:
        """Take notice of a step to `state` that began at `begin` of the thread's clock [s].

        Returns:
            The error at its end: at rest by an estimate where one is due, else by the last one.
        """
        if self._astray:
            return self.start(state)
        end = time.thread_time()
        self._credit += self._share * (end - begin)
        due = self._credit >= self._cost
        swings = self._modal_error is not None and self._modal_error.follow(state)
        if due:
            self._last = self.estimate(state, exactly=not self._moves)
        elif swings:
            self._last = self._report(self._last.time)
        self._credit -= time.thread_time() - end
        return self._last

    def unknown(self, state: State) -> MeshErrorReport:
        """Return that the error at `state` is not known, as under forces that the richer mesh does not bear."""
        self._astray = True
        return MeshErrorReport((np.nan, np.nan, np.nan), state.time)

    def estimate(self, state: State, *, exactly: bool = True) -> MeshErrorReport:
        """Return the error at `state`; if not `exactly`, as far as its size asks for."""
        self._newton.amiss = None if exactly else state.centres[0]
        self._at_rest = self._error_at_rest(state)
        if self._modal_error:
            self._modal_error.see()
        return self._report(state.time)

    def field(self) -> FloatArray:
        """Return how far the nodes of the body's mesh are from the richer one at rest [m], shape (n,).

        That is the last estimate: nothing is solved here. It is NaN where the error is not known.
        """
        if self._astray or not np.isfinite(self._at_rest).all():
            return np.full(len(self._rest), np.nan)
        assert self._own
        place, seen = self._own.positions, self._seen.positions[: len(self._rest)]
        return np.asarray(np.linalg.norm(self._outside.places(place) - seen, axis=1))

    def _report(self, at: float) -> MeshErrorReport:
        """Return the last error at rest, of the time `at` [s], as it swings now."""
        (x, y, z), (dx, dy, dz) = (
            self._at_rest.tolist(),
            self._modal_error.beyond() if self._modal_error else (0.0,) * 3,
        )
        return MeshErrorReport((x + dx, y + dy, z + dz), at)

    def _error_at_rest(self, state: State) -> FloatArray:
        """Return the error at rest under the forces of `state` [m], shape (3,); NaN where there is no rest."""
        own = self._own
        assert own
        self._outside.load(state, own, self._loads.force)
        self._outside.hold(state, self._seen, own)
        try:
            self._settle(own, state)
        except StepError:
            return np.full(3, np.nan)
        state.copy_to(self._seen)
        return own.centres[0] - state.centres[0]

    def _joints(self, state: State) -> FloatArray:
        """Return the joints of the first body, which has all servos, and perhaps not the motions of others."""
        return state.joints[: self._system.groups.joints]

    def _settle(self, own: State, state: State) -> None:
        """Bring the richer mesh to rest where `state` has moved since it was last seen.

        It goes along with that at first; where no rest is near there, it goes its own way, by increments.

        Raises:
            StepError: there is no rest; it stays where it was.
        """
        trial, joints = self._trial, self._joints(state)
        own.copy_to(trial)
        self._carry(own, state, trial)
        self._turning.turn(self._rotations.at(state))
        try:
            self._newton.solve(trial, joints, keep=1.0 + self._outside.changes)
            trial.copy_to(own)
        except NewtonError:
            self._newton.amiss = None
            self._careful.step(own, joints, 0.0)

    def _carry(self, own: State, state: State, out: State) -> None:
        """Write to `out` where `own` is moved by what `state` has moved since it was last seen."""
        system, seen, dx, move = self._system, self._seen, self._dx, self._move
        first = 3 * system.reduction.free_count
        interpolate(self._nodes, self._weights, state.positions, seen.positions, 1.0, dx)
        move[first : first + 3] = state.centres[0] - seen.centres[0]
        move[first + 3 : first + 6] = rotation_vector(state.rotations[0] @ seen.rotations[0].T)
        system.drive(out, self._joints(state))
        system.move(own, move, dx, 1.0, out)
