"""The potential that one step minimises, in nodes and in the unknowns that constraints leave.

    Phi(x, modes) = E(x, modes) + D(x, modes) + sum of V(x)

strain energy, that of dampers in a stage (see `aim`), and whatever terms there are: gravity, inertia, clamps, loads ...
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.constraints.groups import Groups
from tripod_sim.constraints.reduction import Reduction, move_bodies, move_nodes, swing_nodes, write_levers
from tripod_sim.forces.actuator import ActuatorTerm
from tripod_sim.forces.elastic import Elastic, ElasticTerm
from tripod_sim.forces.term import BlockTerm, StageTerm, Term
from tripod_sim.linear.choice import LinearFactory, linear_factory
from tripod_sim.linear.solver import LinearSolver
from tripod_sim.state import State
from tripod_sim.system_kernels import same, scaled_norm_squared

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.mesh.embedding import Embedding

T = TypeVar("T", bound=Term)

ROUNDING = 1e-15
"""Relative error of positions and of the points that inertia pulls to: a few roundings."""

DEFAULT_LINEAR = linear_factory("auto", 1e-8)


class System:
    """Evaluates Phi, its gradient and Hessian, and moves a state along a step of the unknowns.

    Attributes:
        elastic: The strain energy: a sum of terms.
        terms: All others, those with blocks first.
        remembers: How many numbers a stage remembers of the dampers of `elastic`; 0 where none counts.
        gradient: dPhi/dx of the last `evaluate` [N], shape (n, 3).
        residual: Reduced gradient of the last `evaluate` [N, N m], shape (unknowns,).
        actuators: Number of actuators: s driven frames, then the terms that are actuators.
        efforts: dPhi/dq of each at the last `evaluate`, shape (actuators,): the torque that a servo exerts on the body
            [N m]; of others see `forces.actuator`.
        torques: Those of the driven frames, a view, shape (s,).
        lever: r_i of nodes of bodies and frames [m], shape (n, 3).
        driven: Nodes of all driven frames, and those of prescribed motions.
        factored: Whether `linear` can solve after the last `factor`, be the matrix definite or not.
        assembly: Bends bodies that do not fit together undeformed; None where all do.
    """

    def __init__(
        self,
        rest: FloatArray,
        elastic: Sequence[ElasticTerm],
        groups: Groups,
        terms: Iterable[Term] = (),
        *,
        damped: bool = False,
        joined: Sequence[IndexArray] = (),
        linear: LinearFactory = DEFAULT_LINEAR,
    ) -> None:
        """Add up terms.

        Args:
            rest: Undeformed positions [m], shape (n, 3).
            elastic: Terms of the strain energy.
            groups: What holds nodes.
            terms: All others.
            damped: Whether the dampers of `elastic` count.
            joined: Nodes that have entries with each other in the Hessian besides those of elements, shapes (m, k).
            linear: Makes the solver.
        """
        self.rest, self.groups = rest, groups
        self.assembly: Callable[[System], State] | None = None
        given = list(terms)
        self._blocks = [t for t in given if isinstance(t, BlockTerm)]
        self.terms = [*self._blocks, *(t for t in given if not isinstance(t, BlockTerm))]
        frames = groups.driven
        self._arms = np.concatenate([f.nodes for f in frames] or [np.zeros(0, dtype=np.int64)])
        self._prescribed = groups.prescribed
        others = [self._prescribed.nodes] if self._prescribed else []
        self.driven = np.concatenate([self._arms, *others])
        self.elastic = Elastic(elastic, self.driven, damped=damped)
        self.remembers = self.elastic.remembers
        blocks = [*(t.elements for t in elastic), *(t.elements for t in self._blocks)]
        self._actuated = [t for t in self.terms if isinstance(t, ActuatorTerm)]
        self.actuators = groups.commanded
        self.reduction = Reduction([*blocks, *joined], groups)
        free, bodies = self.reduction.free_count, self.reduction.bodies
        diagonal_blocks = np.append(3 * np.arange(free), 3 * free + 6 * np.arange(bodies + 1))
        self._new_linear = lambda: linear(self.reduction.pattern, diagonal_blocks)
        self._linear: LinearSolver | None = None
        n, s = len(rest), len(groups.driven)
        self.gradient, self.lever, self.axes = np.zeros((n, 3)), self.reduction.lever, self.reduction.axes
        self.residual, self.efforts = np.zeros(self.reduction.unknowns), np.zeros(self.actuators)
        self.torques = self.efforts[:s]
        self._no_weight = np.zeros(n)
        placed = groups.placed(rest)
        self._rest_centres = np.array([placed[b].mean(axis=0) for b in groups.rigid]).reshape(-1, 3)
        self._frame_of = np.repeat(np.arange(s), [len(f.nodes) for f in frames])
        swings = [(*f.swing(rest[f.nodes]), np.tile(f.inward, (len(f.nodes), 1))) for f in frames]
        self._swing = [np.concatenate([t[k] for t in swings] or [np.zeros((0, 3))]) for k in range(4)]
        self._hubs = np.array([f.point for f in frames]).reshape(s, 3)
        self._inward = np.array([f.inward for f in frames]).reshape(s, 3)
        self.factored, self._turns = False, bool(groups.rigid or frames)
        self._change, self._reduced, self._unused = (
            np.zeros((n, 3)),
            np.zeros_like(self.residual),
            np.zeros(s),
        )
        self._forces, self._elastic_energy = np.zeros((n, 3)), 0.0
        self._damper_forces, self._damper_energy = np.zeros((n, 3) if self.remembers else (0, 3)), 0.0
        self._last, self._known = (rest.copy(), self.elastic.rest_modes()), False
        self._rate, self._assembled = 0.0, (rest.copy(), self.elastic.rest_modes(), self._rest_centres.copy())
        self._aimed = False  # whether the forces of dampers at hand are those of the stage
        self._strains, self._strained = (
            np.zeros(self.remembers),
            False,
        )  # what is remembered of `_last`, if it is known
        self._unmoved = False  # whether dampers have no rate where the stage starts, at `_last`
        self._arm = placed.copy()  # of nodes of bodies, from the centre, undeformed [m]
        for centre, nodes in zip(self._rest_centres, groups.rigid, strict=True):
            self._arm[nodes] -= centre
        self._scale = np.ones(self.reduction.unknowns)
        for b, nodes in enumerate(groups.rigid):
            radius = np.sqrt(((placed[nodes] - self._rest_centres[b]) ** 2).sum(axis=1).mean())
            first = 3 * self.reduction.free_count + 6 * b
            self._scale[first + 3 : first + 6] = 1 / radius

    def radius(self, body: int) -> float:
        """Return the radius of gyration of a rigid body's nodes [m]."""
        return 1.0 / float(self._scale[3 * self.reduction.free_count + 6 * body + 3])

    @property
    def linear(self) -> LinearSolver:
        """Solves with the Hessian of the last `factor`; made when it is first needed: explicit schemes need none."""
        if self._linear is None:
            self._linear = self._new_linear()
        return self._linear

    @linear.setter
    def linear(self, solver: LinearSolver) -> None:
        self._linear = solver

    def another_linear(self) -> LinearSolver:
        """Return one more linear solver for the Hessian, which has factored nothing yet."""
        sibling = getattr(self.linear, "sibling", None)
        return sibling() if sibling else self._new_linear()

    def take(self, term: Term) -> None:
        """Add a term that has no Hessian."""
        self.terms.append(term)

    def term(self, kind: type[T]) -> T | None:
        """Return the first term of a kind, None if there is none."""
        return next((t for t in self.terms if isinstance(t, kind)), None)

    @property
    def damped(self) -> bool:
        """Whether dampers count."""
        return self.remembers > 0

    @property
    def unknowns(self) -> int:
        """Number of unknowns, after elimination of constraints and incompatible modes."""
        return self.reduction.unknowns

    @property
    def step_unknowns(self) -> int:
        """Number of unknowns of a step: `unknowns`, and six of each free rigid body."""
        return self.unknowns + 6 * self.groups.free

    def potentials(self, state: State) -> tuple[float, float]:
        """Return strain energy, that of compliant clamps included, and potential in gravity [J]."""
        strain, gravity = self.elastic.energy(state.positions, state.modes), 0.0
        for term in self.terms:
            stored, raised = term.energies(state.positions)
            strain, gravity = strain + stored, gravity + raised
        return strain, gravity

    def start_state(self, joints: FloatArray) -> State:
        """Return the state that a simulation begins from, with the joint values `joints`, as `State.joints`.

        It is undeformed, or where bodies have to be bent to fit together that of rest with all joints at 0; no node is
        moved to `joints`. Raises SceneError where they do not fit.
        """
        if not self.assembly:
            return self.undeformed(joints)
        found = self.assembly(self)
        found.joints = joints.copy()
        return found

    def undeformed(self, joints: FloatArray) -> State:
        """Return the undeformed state at the joint values `joints`, as `State.joints`; no node is moved.

        Free rigid bodies stand at the origin, at rest.
        """
        free, centres = self.groups.free, self._rest_centres
        return State(
            self.rest.copy(),
            np.zeros_like(self.rest),
            self.elastic.rest_modes(),
            np.concatenate([centres, np.zeros((free, 3))]),
            np.tile(np.eye(3), (len(centres) + free, 1, 1)),
            joints.copy(),
            centre_velocities=np.zeros((free, 3)),
            spins=np.zeros((free, 3)),
        )

    def drive(self, state: State, joints: FloatArray) -> None:
        """Put what is driven at `joints`, as `State.joints`."""
        self.command(joints)
        slide = joints[self.actuators]
        swing_nodes(self._arms, self._frame_of, *self._swing, slide, joints, state.positions)
        if self._prescribed:
            self._prescribed.place(joints[-1], state.positions)
        state.joints[:] = joints

    def command(self, joints: FloatArray) -> None:
        """Give the terms that are actuators their values of `joints`, as `State.joints`; no node is moved."""
        if self._actuated:
            for term, value in zip(self._actuated, joints[len(self.torques) :], strict=False):
                term.value = float(value)

    @contextmanager
    def taut(self) -> Iterator[None]:
        """Take up the slack of actuators that only pull, for second derivatives: see `forces.actuator`."""
        for term in self._actuated:
            term.holds = True
        try:
            yield
        finally:
            for term in self._actuated:
                term.holds = False

    @property
    def has_other_actuators(self) -> bool:
        """Whether there are actuators that are no servos."""
        return bool(self._actuated)

    @property
    def commands_positions(self) -> bool:
        """Whether a length or a volume is commanded and resists, as of the last `evaluate`."""
        return any(term.effort_slope > 0.0 for term in self._actuated)

    @property
    def spans(self) -> FloatArray:
        """By how much commands change where a servo would turn by a radian, shape (actuators,)."""
        return np.array([1.0] * len(self.torques) + [term.span for term in self._actuated])

    @property
    def gaps(self) -> FloatArray:
        """What it takes to take up slack, as of the last `evaluate` within `taut`, shape (actuators,)."""
        return np.array([0.0] * len(self.torques) + [term.gap for term in self._actuated])

    @property
    def pulls(self) -> NDArray[np.bool_]:
        """Which actuators are commanded by length and only pull, shape (actuators,)."""
        return np.array(
            [False] * len(self.torques) + [term.only_pulls for term in self._actuated], dtype=bool
        )

    @property
    def routes(self) -> "tuple[Embedding | None, ...]":
        """Points of the line of each term that is an actuator, see `ActuatorTerm.route`."""
        return tuple(term.route for term in self._actuated)

    def runaway(self) -> str:
        """Return in words which actuators a failed solve is likely due to, as of the last `evaluate`; empty if none."""
        return "; ".join(words for term in self._actuated if (words := term.runaway()))

    def turns(self, move: FloatArray) -> FloatArray:
        """Return as turns of servos [rad] how far actuators go, shape (actuators,), for `move`, as `State.joints`."""
        turns = np.abs(move[: self.actuators])
        for k, actuator in enumerate(self._actuated, len(self.torques)):
            turns[k] /= actuator.span
        return turns

    def moves_frames(self, before: FloatArray, joints: FloatArray) -> bool:
        """Return whether something is driven elsewhere by `joints` than by those `before`, both as `State.joints`."""
        if not self._actuated:
            return not same(before, joints)
        s, behind = len(self.torques), self.actuators
        return not (same(before[:s], joints[:s]) and same(before[behind:], joints[behind:]))

    def update_levers(self, state: State) -> None:
        """Write `lever` for the positions of `state`."""
        if not self._turns:
            return
        r, slide = self.reduction, state.joints[self.actuators]
        write_levers(
            state.positions, state.centres, self._hubs, self._inward, slide, r.kind, r.number, r.lever
        )

    def evaluate(self, state: State) -> float:
        """Write `gradient`, `residual` and `efforts`; return Phi [J], infinite where there is none to improve.

        Where positions and modes are those of the evaluation before, its elastic forces serve again.
        """
        phi = self._evaluate_elastic(state)
        if not math.isfinite(phi):
            return np.inf
        g = self.gradient
        g[:] = self._forces
        if self.remembers:
            g += self._damper_forces
            phi += self._damper_energy
        for term in self.terms:
            phi += term.add_gradient(state.positions, g)
        self.update_levers(state)
        self.reduction.gradient(g, self.residual, self.torques)
        for k, actuator in enumerate(self._actuated, len(self.torques)):
            self.efforts[k] = actuator.effort
        return phi

    def knows(self, state: State) -> bool:
        """Return whether the elastic forces at hand are those at `state`."""
        if not self._known:
            return False
        positions, modes = self._last
        return same(positions, state.positions) and (
            not self.elastic.has_modes or bool(same(modes, state.modes))
        )

    def _evaluate_elastic(self, state: State) -> float:
        """Write dE/dx to `_forces`, dD/dx to `_damper_forces` and return E [J]."""
        x, modes, elastic, damped = state.positions, state.modes, self.elastic, self._damper_forces
        if self.knows(state):
            if self.remembers and not self._aimed:
                damped[:] = 0.0
                self._damper_energy = 0.0 if self._unmoved else elastic.add_damper_gradient(x, modes, damped)
                self._aimed = True
            return self._elastic_energy
        self._known = self._strained = self._unmoved = False
        self._forces[:] = 0.0
        if self.remembers:
            damped[:] = 0.0
            self._elastic_energy, self._damper_energy = elastic.add_gradients(x, modes, self._forces, damped)
        else:
            self._elastic_energy = elastic.add_gradient(x, modes, self._forces)
        if math.isfinite(self._elastic_energy):
            self._last[0][:] = x
            if elastic.has_modes:
                self._last[1][:] = modes
            self._known = self._aimed = True
        return self._elastic_energy

    def remember(self, state: State, out: FloatArray) -> None:
        """Write what the dampers take the rates of at `state` to `out`, shape (remembers,)."""
        if self.remembers:
            knows = self.knows(state)
            self.elastic.remember(state.positions, state.modes, out, known=self._aimed and knows)
            self._strained = knows
            if knows:
                self._strains[:] = out

    def aim(self, s: float, known: FloatArray) -> None:
        """Prepare a stage of `s` [s]; `known`: what the scheme makes of what was remembered, shape (remembers,)."""
        for term in self._blocks:
            if isinstance(term, StageTerm):
                term.aim(s)
        if self.remembers:
            self.elastic.aim(s, known)
            self._rate, self._aimed = 1.0 / s, False
            at_rest = (
                self._strained and not self.elastic.has_modes
            )  # whose own forces are part of those at hand
            self._unmoved = at_rest and same(self._strains, known)

    def add_rates(self, y: FloatArray, out: FloatArray) -> None:
        """Add C y / s to `out` [N], of shape (n, 3), C the dampers' matrix in a stage of s.

        It is that of the last assembly; with a term that does not last (`ElasticTerm.lasting`) of the last evaluation.
        """
        positions, modes = self._assembled[:2] if self.elastic.lasting else self._last
        self.elastic.add_rates(positions, modes, y, self._rate, out)

    def settle(self, state: State, solution: FloatArray, dx: FloatArray) -> None:
        """Take `state`, a step beyond the last evaluation that solves its linear equations, to be solved.

        No law is evaluated: the elastic forces become those that balance all others after the step, dampers among them,
        and on driven nodes, as the torques, those of the linear response. An evaluation at `state` finds them; one
        elsewhere asks the elements again.

        Args:
            state: The end of the step.
            solution: The step of the unknowns, -H^-1 residual, shape (unknowns,).
            dx: What it moves each node by [m], shape (n, 3).
        """
        change, forces, dampers = self._change, self._forces, self._damper_forces
        if self._blocks:
            change[:] = 0.0
            for term in self._blocks:
                term.add_products(dx, change)
            self.reduction.gradient(change, self._reduced, self._unused)
            self.residual += self._reduced
        change[:] = 0.0
        self.elastic.add_response(self.elastic.matrices, dx, 1.0, change)
        if self.remembers:  # elastic forces and those of dampers are known together, and the latter apart
            forces += dampers
            self._elastic_energy += self._damper_energy
        self._elastic_energy += self.reduction.relieve(self.residual, self._weight(), dx, change, forces)
        self.residual[:] = 0.0
        self.efforts += solution @ self.reduction.drive
        positions, modes = self._last
        positions[:], modes[:] = state.positions, state.modes
        self._strained = self._unmoved = False
        if self.remembers:
            dampers[:] = 0.0
            self._damper_energy = self.elastic.add_damper_gradient(state.positions, state.modes, dampers)
            forces -= dampers
            self._elastic_energy -= self._damper_energy
        self.elastic.balance_modes()

    def forget(self) -> None:
        """Drop what was kept from earlier evaluations and assemblies, so that results depend on the state alone."""
        self.elastic.forget()
        self._known = False

    def known_no_more(self) -> None:
        """Forget what the last evaluation found: condensed gradients are others now."""
        self._known = False

    def unbalanced(self) -> float:
        """Return the norm of the residual and of the modes' gradients [N].

        Torques on bodies count divided by the body's radius of gyration.
        """
        return math.sqrt(scaled_norm_squared(self.residual, self._scale) + self.elastic.mode_residual_squared)

    def rounding(self, state: State) -> float:
        """Return what of the unbalanced force the rounding of positions makes at `state` [N].

        Only systems with springs count it: at very small steps, the inertia of their nodes makes it larger than
        `solver.tolerance`.
        """
        if self.elastic.lasting:
            return 0.0
        pulled = scaled_norm_squared(state.positions.ravel(), np.repeat(self._weight(), 3))
        return ROUNDING * math.sqrt(pulled) + self.elastic.rounding(state.positions)

    def assemble(self, state: State, *, project: bool) -> int:
        """Write the element matrices at `state`; return -1, or an element that is unstable without `project`."""
        if self.elastic.has_modes:
            self._known = False  # the condensed gradient belongs to the last assembly
        positions, modes, centres = self._assembled
        positions[:], centres[:] = state.positions, state.centres[: len(centres)]
        if self.remembers:
            modes[:] = state.modes
            self._aimed = False  # an element that is found inside out has no damper any more
        for term in self._blocks:
            term.stiffness(state.positions, project=project)
        return self.elastic.stiffness(state.positions, state.modes, project=project)

    def factor(self, shift: float = 0.0, *, curved: bool = True) -> bool:
        """Reduce and factor the Hessian of Phi with the assembled matrices; return whether it is positive definite.

        Args:
            shift: Added for each node [N/m]: a matrix that is only semi-definite then has a descent direction.
            curved: Whether the second-order terms of rotations are in it (see `reduction`). Without them it is positive
                semi-definite where the matrices are, however large the forces on rigid bodies.
        """
        self.write_hessian(shift, curved=curved)
        if (places := self.linear.places) is not None:
            positions, _, centres = self._assembled
            places[:] = np.concatenate([positions[self.reduction.free], np.repeat(centres, 2, axis=0)])
        self.factored = self.linear.factor()
        return self.factored and self.linear.is_positive()

    def write_hessian(self, shift: float = 0.0, *, curved: bool = True) -> None:
        """Write the reduced Hessian into `reduction.pattern`, with the assembled matrices; see `factor`."""
        weight = self._weight() + shift if shift else self._weight()
        count = len(self.elastic.terms)
        parts = [(k, own, 1.0) for k, own in enumerate(self.elastic.matrices)]
        parts += [(k, term.matrices, 1.0) for k, term in enumerate(self._blocks, count)]
        self.reduction.hessian(parts, weight, self.gradient if curved else np.zeros_like(self.gradient))
        for k, actuator in enumerate(self._actuated, len(self.torques)):
            self._couple(k, actuator)

    def _couple(self, k: int, actuator: ActuatorTerm) -> None:
        """Write what actuator `k` adds to `reduction.drive` and `drive_drive`."""
        r, s = self.reduction, len(self.torques)
        self._change[:] = 0.0
        actuator.add_coupling(self._assembled[0], self._change)
        r.gradient(self._change, self._reduced, self._unused)
        r.drive[:, k] = self._reduced
        r.drive_drive[:s, k] = r.drive_drive[k, :s] = self._unused
        r.drive_drive[k, k] = actuator.effort_slope

    def _weight(self) -> FloatArray:
        """Return the sum of the terms' weights [N/m], shape (n,)."""
        weights = [t.weight for t in self.terms if t.weight is not None]
        return sum(weights[1:], start=weights[0]) if weights else self._no_weight

    def add_present_products(self, dx: FloatArray, out: FloatArray) -> None:
        """Add to `out` the Hessian times `dx` [m], both of shape (n, 3), without the nodes' own weights.

        Terms that do not last (`ElasticTerm.lasting`) have that of the last evaluation, all others of the last
        assembly.
        """
        self.elastic.add_present_products(*self._last, dx, out)
        for term in self._blocks:
            term.add_products(dx, out)

    @property
    def weight(self) -> FloatArray:
        """Sum of the weights of terms at each node [N/m], shape (n,)."""
        return self._weight()

    def add_driven(self, dx: FloatArray) -> None:
        """Add to `residual` the first-order change K dx of the gradient when driven nodes move by `dx` [m]."""
        self._change[:] = 0.0
        self.elastic.add_response(self.elastic.matrices, dx, 1.0, self._change)
        for term in self._blocks:
            term.add_products(dx, self._change)
        self.reduction.gradient(self._change, self._reduced, self._unused)
        self.residual += self._reduced

    def move(self, start: State, solution: FloatArray, dx: FloatArray, scale: float, out: State) -> None:
        """Write to `out` the state after `scale` times a step.

        Args:
            start: Where the step begins; its driven nodes already stand at the end of the step in `out`.
            solution: Step of the unknowns, shape (unknowns,).
            dx: First-order move of every node for the whole step [m], shape (n, 3), driven nodes included.
            scale: Fraction of the step, 1 when driven nodes move.
            out: The result; may not be `start`.
        """
        self.move_nodes(start, solution, dx, scale, out)
        if self.elastic.has_modes:
            self.elastic.advance_modes(start.modes, dx, scale, out.modes)

    def move_nodes(
        self, start: State, solution: FloatArray, dx: FloatArray, scale: float, out: State
    ) -> None:
        """As `move`, without the modes."""
        r = self.reduction
        if r.bodies:
            first = 3 * r.free_count
            move_bodies(start.centres, start.rotations, scale, solution, first, out.centres, out.rotations)
        move_nodes(
            start.positions, scale, dx, out.centres, out.rotations, self._arm, r.kind, r.number, out.positions
        )
