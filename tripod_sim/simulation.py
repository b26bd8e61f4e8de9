"""The loop: a scene that lives."""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_host.rotations import quaternion
from tripod_sim.bodies.assembly import Assembly
from tripod_sim.build import build_model
from tripod_sim.compliance import Compliance, compliance
from tripod_sim.constraints.groups import DrivenFrame
from tripod_sim.errors import Doubt, SceneError, StepError, shown
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.stepper import integrator_of
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.scene.lowering import lowered
from tripod_sim.scene.scene import Scene
from tripod_sim.scene.unread import unread
from tripod_sim.state import State
from tripod_sim.steps.parts import Parts
from tripod_sim.system import System
from tripod_sim.tables.fields import unusual
from tripod_sim.tables.method import Solver

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.acting_forces import ActingForces, Forces
    from tripod_sim.applied_forces import AppliedForces
    from tripod_sim.contact.contact_solver import ContactSolver
    from tripod_sim.fields import NodalFields
    from tripod_sim.integrators.report import MeshErrorReport
    from tripod_sim.maze.plate import Plate
    from tripod_sim.maze.play import MazeBall
    from tripod_sim.mesh.embedding import Embedding
    from tripod_sim.mesh_error.estimate import MeshError
    from tripod_sim.rest_state import RestState
    from tripod_sim.robot.servo import ServoMotion, ServoState
    from tripod_sim.stability_margin import SoftestMove


LOST = 0.1
"""How far below all else a ball counts as lost [m]."""

REHEARSED = 0.01
"""Motion of the servos that a rehearsal tries [rad]: more than at rest, so that equations are solved; and the share of
a step's time up to which prescribed motions go when kernels compile: all of it would cost as much as the first step."""

UNSTABLE_START = (
    "the platforms begin in an unstable equilibrium, which the bodies leave at a small load "
    "(they snap or buckle); start from another platform position. If a finer mesh or another "
    "mesh.element does not report this, the mesh is the cause"
)
"""What is to say where the bodies have no stiffness against some move once platforms are let go."""


@dataclass(frozen=True, eq=False)
class Pose:
    """Position [m], shape (3,), and unit quaternion (x, y, z, w), w at least 0, shape (4,), in world."""

    position: FloatArray
    quaternion: FloatArray


@dataclass(frozen=True)
class Energies:
    """Energies [J].

    Attributes:
        kinetic: Of soft and rigid bodies.
        strain: Of soft bodies, with that of compliant clamps.
        gravity: Potential of weights and dead loads; zero in the undeformed shape.
    """

    kinetic: float
    strain: float
    gravity: float


class Skin(Protocol):
    """What a viewer draws: undeformed nodes [m], (n, 3), triangles, (k, 3), and the id of their connectivity."""

    @property
    def nodes(self) -> FloatArray:
        """Undeformed positions [m], shape (n, 3)."""

    @property
    def surface(self) -> NDArray[np.int64]:
        """Triangles of nodes, shape (k, 3)."""

    @property
    def topology_id(self) -> int:
        """CRC-32 of the connectivity."""


class Simulation:
    """A soft body, stepped in time.

    What `copy.deepcopy` and pickle make of it goes on from the same state, as after `restore`, and shares nothing.

    Attributes:
        scene: What is simulated.
        mesh: Undeformed nodes, elements, surface triangles and topology id.
        state: Positions, velocities, joints, time, which each step overwrites; read it, change it only through the
            methods.
        report: What the last step took.
        efforts: dV/dq of each actuator, shape (a,): the torque that a servo exerts on the body, about its axis towards
            growing angle [N m]; of others see `forces.actuator`. Each step makes a new array.
        left_out: Rigid bodies on the body that the last compliance leaves out, since nothing keeps them in place.
        notes: What users should know of the scene.
    """

    _acting: "ActingForces | None" = None
    _applied: "AppliedForces | None" = None
    _ended = False  # whether the state is the end of a step of which what `forces` needs is kept

    def __init__(
        self,
        scene: Scene,
        progress: Callable[[float], None] | None = None,
        *,
        say: Callable[[str], None] | None = None,
        noted: Callable[[str], None] | None = None,
    ) -> None:
        """Build the simulation and put it in its start state. Kernels compile here, never in the first step.

        A body that servos hold, or that is fixed and has other actuators, starts in static equilibrium at their start
        values; any other starts undeformed, or bent as far as platforms ask for.

        Args:
            scene: What to simulate.
            progress: Told the share of that bending which is done.
            say: Told in a line what is being done, and how large what is being built is.
            noted: Told each of the notes as soon as it is known: also of a scene that then cannot begin.

        Raises:
            SceneError: the scene cannot be built.
            StepError: no equilibrium in the start configuration.
        """
        if not isinstance(scene, Scene):
            raise SceneError(f'scene is {shown(scene)}; it must be a Scene: Simulation(load_scene("tripod"))')
        self.scene, self._model = scene, (model := lowered(scene))
        self.notes: tuple[str, ...] = ()
        self._noted = noted
        self.note(*unusual(scene), *unread(scene))
        parts = self._parts = build_model(model, progress, say)
        self.note(*(parts.plate.board.notes if parts.plate else ()), *parts.notes)
        self.joints = model.joints
        self._begins_at_rest = bool(self.joints and (self.joints.arms or scene.fixed or not model.scheme))
        posed = self._begins_at_rest or model.platforms or (scene.fixed and model.effectors)
        self._static = build_model(model.at_rest(), progress) if model.scheme and posed else parts
        self.mesh, self._mass, self._system, self._stepper = (
            parts.mesh,
            parts.mass,
            parts.system,
            parts.stepper,
        )
        self._renew, self._watches = getattr(self._stepper, "renew", None), parts.watches
        count = self._system.actuators
        self._prescribed = self._system.groups.prescribed
        self.state = self._begin(np.zeros(count + 1 + bool(self._prescribed)))
        if parts.rigid:
            for of, begin in zip(self.state.rigid, parts.rigid.start, strict=True):
                of[:] = begin
        self._begin_errors(parts)
        self.efforts = np.zeros(count)
        self._held_by = np.full(
            self.state.positions.shape if scene.marker else (0, 3), np.nan
        )  # see `reactions`
        self.report = StepReport()
        self.left_out: tuple[int, ...] = ()
        self._rest: RestState | None = None
        self._servos: ServoMotion | None = parts.servos
        self._ball = parts.ball
        undeformed = self.state.copy()
        self._softest = self._softest_move()
        if scene.platform and not self._softest:
            self.note(UNSTABLE_START)
        with self._explained():
            self._find_start(parts, say or (lambda text: None))
        if self._servos:
            self._measure_reactions(self._servos, undeformed)
            self._measure_reactions(self._servos, self.state.copy())
            self.state.servos = self._servos.start(self.state.joints[: self._servo_count])
            self._next = self.state.servos.copy()
        if self._ball:
            self.state.ball = self._ball.start(self.state)
            trial = self.state.ball.copy()  # compiles what moves it
            self._ball.load(self.state, trial)
            self._ball.follow(self.state, trial, scene.dt)
        self._begin_motion(parts)
        self._rest = self._state_of_rest()
        self._mesh_error = self._begin_mesh_error(parts)
        self._start, self._start_held_by = self.state.copy(), self._held_by.copy()
        self._start_torques = self.efforts.copy()
        self._prepare()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Let errors name what in the scene is out of proportion, if anything is, in place of the solver's limits."""
        try:
            yield
        except StepError as error:
            if doubts := "; ".join(note for note in self.notes if isinstance(note, Doubt)):
                error.remedy = f"likely cause: {doubts}"
            raise

    def __repr__(self) -> str:
        """Return it in a few words, as a notebook shows it."""
        return f"<Simulation of {self.scene.name!r}: {self.unknowns} unknowns, {self.state!r}>"

    def note(self, *notes: str) -> None:
        """Add to what users should know of the scene, and tell it."""
        self.notes += notes
        if self._noted:
            for text in notes:
                self._noted(text)

    def _softest_move(self) -> "SoftestMove | None":
        """Return what tells how firm the body is; None where that is not known, or there is no stiffness."""
        static = self._static.system
        if not static.groups.rigid or self._model.contact:
            return None
        from tripod_sim.stability_margin import softest_move  # noqa: PLC0415 - only with an effector

        return softest_move(static, self.state)

    def _begin(self, joints: FloatArray) -> State:
        """Return the undeformed state; where bodies do not fit so, that of rest."""
        return (self._static if self.scene.platform else self._parts).system.start_state(joints)

    def _find_start(self, parts: Parts, say: Callable[[str], None]) -> None:
        """Bring the body to rest with the joints where they start, check that, and rehearse a step."""
        if self._begins_at_rest:
            say("finding the pose of rest at the start")
            assert self.joints
            self._pose(self._goal(self.joints.start, 0.0))
        elif self.joints:
            self.state.joints[: self._system.actuators + 1] = self.joints.start
        if parts.check_start:
            parts.check_start(self.state.positions)
        say("rehearsing the first step")
        self._warm_up()

    def _begin_motion(self, parts: Parts) -> None:
        """Give nodes the velocities of the start, where ways and errors begin."""
        if parts.velocities is not None:
            self.state.velocities[:] = parts.velocities
        self._begin_errors(parts)

    def _begin_errors(self, parts: Parts) -> None:
        """Let the state remember what estimates of the error of the time steps ask for, if there are any."""
        if parts.errors:
            self.state.errors = parts.errors.start(self.state.velocities)
        if parts.doubling:
            self.state.twin = parts.doubling.start(self.state)
        if parts.chosen:
            self.state.way = parts.chosen.start(self.state)

    def _begin_mesh_error(self, parts: Parts) -> "MeshError | None":
        """Return what tells the error of the mesh; None where the scene does not ask for it."""
        if not self.scene.mesh_error:
            return None
        from tripod_sim.mesh_error.estimate import MeshError  # noqa: PLC0415 - an effect that is absent

        mesh = getattr(self.mesh, "soft", self.mesh)  # of a body beside rigid ones
        if isinstance(mesh, Assembly):
            mesh = mesh.bodies[0].solid
        assert isinstance(mesh, SolidMesh)
        found = MeshError(self._model, mesh, parts, self.scene.mesh_error.share)
        self.report.mesh_error = found.start(self.state)
        if found.carry_steps():
            self._begin_errors(parts)
        return found

    def _state_of_rest(self) -> "RestState | None":
        """Return what follows the rest of a body in motion; None where nothing moves."""
        if self._static is self._parts:
            return None
        from tripod_sim.rest_state import RestState  # noqa: PLC0415 - only where something moves

        return RestState(self._static.system)

    def _prepare(self) -> None:
        """Make the first step from the start state as fast as the others."""
        self._load_ball()
        prepare = getattr(self._stepper, "prepare", None)
        if self.scene.inertia and prepare:
            prepare(self.state, self.scene.dt)
        else:
            self._stepper.forget()

    def _warm_up(self) -> None:
        """Compile or load every kernel by one step of a copy."""
        keep = self.state.copy()
        try:
            self._stepper.step(self.state, self.state.joints.copy(), self.scene.dt)
            if len(self.efforts) or self._prescribed:
                turned = self._goal(self.command + self._small_turn(), REHEARSED * self.scene.dt)
                self._stepper.step(self.state, turned, self.scene.dt)
        except StepError:
            if not (self.scene.inertia and self.scene.inertia.explicit):
                raise  # an explicit scheme beyond its limit is told of by the step itself
            keep.copy_to(self.state)
        system = self._system
        if self.scene.solver.mode == "one_solve":  # steps that end so may come late
            system.settle(self.state, np.zeros(system.unknowns), np.zeros_like(system.rest))
        if self.effector:
            with suppress(StepError):  # a body that nothing holds may have none: who asks for it is told
                self.compliance()
        keep.copy_to(self.state)
        self._stepper.forget()

    def _measure_reactions(self, motion: "ServoMotion", start: State) -> None:
        """Raise the stiffness and drag of `motion` to those about `start`; the state stays."""
        dt = self.scene.dt
        stiffness = self._reaction(self._static, start, 0.0)
        drag = (self._reaction(self._parts, start, dt) - stiffness) * dt
        np.maximum(motion.stiffness, stiffness, out=motion.stiffness)
        np.maximum(motion.drag, drag, out=motion.drag)

    def _reaction(self, parts: Parts, start: State, dt: float) -> FloatArray:
        """Return the sum of |d torque_i / d angle_j| over i for each j, in a step of `dt` from `start` [N m / rad]."""
        count, turn = self._servo_count, 1e-4
        torques = np.empty((count + 1, count))
        for k in range(count + 1):
            state, goal = start.copy(), start.joints.copy()
            if k:
                goal[k - 1] += turn
            parts.stepper.forget()
            parts.stepper.step(state, goal, dt)
            torques[k] = parts.system.torques
        parts.stepper.forget()
        return np.asarray(np.abs(torques[1:] - torques[0]).sum(axis=1) / turn)

    def _pose(self, joints: FloatArray) -> None:
        """Bring the body to static equilibrium with its driven frames at `joints`."""
        self._held_by.fill(np.nan)
        self._static.stepper.step(self.state, joints, 0.0)
        self._keep_forces(self._static.system)
        self.efforts = self._static.system.efforts.copy()
        self.state.velocities[:] = 0.0
        self.state.time, self.state.step = 0.0, 0

    def step(self, joints: FloatArray | None = None) -> StepReport:
        """Advance by the scene's dt.

        Args:
            joints: Angle of each servo [rad] and the slide [m] at the end of the step, shape (s + 1,); None keeps what
                was asked last. With `servo_dynamics` the angles are commands, which the servos follow as they can.

        Raises:
            SceneError: `joints` has another shape, is not finite or is out of the scene's limits.
            StepError: the step could not be saved; the state is the last good one.
        """
        goal = self.command if joints is None else self._checked(joints)
        self._ended = False
        begin = time.thread_time() if self._mesh_error else 0.0
        self.renew()
        try:
            if self._servos and self.state.servos:
                self._step_servos(self._servos, self.state.servos, goal)
            else:
                until = self.state.time + self.scene.dt
                self.report = self._stepper.step(self.state, self._goal(goal, until), self.scene.dt)
                self._keep_forces(self._system)
                self.efforts = self._system.efforts.copy()
        except StepError:
            with self._explained():
                raise
        if self._ball and self.state.ball and not self._parts.chosen:
            self._ball.follow(self.state, self.state.ball, self.scene.dt)
            self._load_ball()
        if self._mesh_error:
            self.report.mesh_error = (
                self._mesh_error.unknown(self.state)
                if self.pushed
                else self._mesh_error.follow(self.state, begin)
            )
        if self._watches:
            self._watch()
        return self.report

    def _watch(self) -> None:
        """Add the notes of watches; each tells one at most."""
        told = {watch: note for watch in self._watches if (note := watch(self.state.positions))}
        self._watches = tuple(watch for watch in self._watches if watch not in told)
        self.note(*told.values())

    def renew(self) -> None:
        """Do now what the next step would begin with, such as a new factorisation where the old one serves no longer.

        Whoever has time between steps, as who waits for the next period, calls it there: the longest steps are then
        shorter, with the same bits. Else the step itself does it.
        """
        if self._renew:
            self._renew(self.state, self.scene.dt)

    def advance(self, steps: int) -> StepReport:
        """Make `steps` steps with the joints as they are asked last: the same bits as one by one, and for explicit
        schemes of nets of springs much faster.

        Returns:
            What all of them took together; residual, growth and stalls are those of the last.

        Raises:
            SceneError: `steps` is no whole number, or below 1.
            StepError: as `step`; the state is the last good one.
        """
        if not isinstance(steps, int | np.integer) or steps < 1:
            raise SceneError(f"steps is {shown(steps)}; it must be a whole number, at least 1")
        many = getattr(self._stepper, "advance", None)
        if many and not (self._servos or self._ball):
            self._ended = False
            self.report = many(self.state, self.command, self.scene.dt, steps)
            self._keep_forces(self._system)
            return self.report
        total = StepReport()
        for _ in range(steps):
            total = self.step().after(total)
        self.report = total
        return total

    def _keep_forces(self, system: System) -> None:
        """Keep what holds the nodes at the end of a step, for `reactions`: `system` is evaluated elsewhere, too."""
        if self.scene.marker or self._acting:
            self._held_by[:] = system.gradient
            self._ended = True

    def _step_servos(self, motion: "ServoMotion", servos: "ServoState", goal: FloatArray) -> None:
        """Advance with `goal` as the command of the servos; a step that fails leaves them as they were."""
        servos.copy_to(self._next)
        s, dt = self._servo_count, self.scene.dt
        angles, torques = self.state.joints[:s], self.efforts[:s]
        goal[:s] = motion.advance(self._next, angles, goal[:s], torques, dt)
        report = self._stepper.step(self.state, self._goal(goal, self.state.time + dt), dt)
        self._next.copy_to(servos)
        self._keep_forces(self._system)
        self.efforts = self._system.efforts.copy()
        report.stalled = motion.stalled(servos, self.state.joints[:s], self.efforts[:s])
        self.report = report

    def _goal(self, joints: FloatArray, time: float) -> FloatArray:
        """Return `joints`, shape (s + 1,), and where there are prescribed motions how far these are at `time` [s]."""
        return np.append(joints, min(time, self._prescribed.end)) if self._prescribed else joints

    @property
    def _servo_count(self) -> int:
        return len(self._system.groups.driven)

    def _small_turn(self) -> FloatArray:
        """Return a small change of what is commanded, shape (a + 1,)."""
        turn = np.append(np.full(len(self.efforts), 1e-4), 0.0)
        if self.joints:
            others = slice(self._servo_count, -1)
            turn[others] *= (self.joints.high - self.joints.low)[self._servo_count :]
        return turn

    def _shaped(self, joints: FloatArray) -> FloatArray:
        """Return a copy of angles and slide. Raises SceneError: another shape, or not finite."""
        return joint_values(joints, len(self.efforts) + 1)

    def _checked(self, joints: FloatArray) -> FloatArray:
        """Return a copy of angles and slide that the scene allows. Raises SceneError."""
        goal = self._shaped(joints)
        *commands, slide = goal.tolist()
        if s := self.joints:
            for value, a in zip(commands, s.actuators, strict=True):
                slack = 1e-9 * (1.0 if a.unit == "rad" else a.high - a.low)
                if not a.low - slack <= value <= a.high + slack:
                    raise SceneError(
                        f"{a.name}: {a.quantity} {value:g} {a.unit}; allowed: {a.low:g} to {a.high:g} {a.unit}"
                    )
            if not -1e-9 <= slide <= s.slide_max + 1e-9:
                raise SceneError(f"slide {slide:g} m; allowed: 0 to {s.slide_max:g} m")
        return goal

    def reset(self) -> None:
        """Return to the start state, bit for bit."""
        self.apply_forces({})
        self._start.copy_to(self.state)
        self._forget_rest()
        self._prepare()
        self.efforts = self._start_torques.copy()
        self._held_by[:] = self._start_held_by if self.scene.marker else np.nan
        self._ended = False
        self.report = StepReport()
        if self._mesh_error:
            self.report.mesh_error = self._mesh_error.start(self.state)

    def drop_ball(self) -> None:
        """Put the ball back to where it starts, at rest, the body staying as it is.

        Raises SceneError: the scene has no ball, or something is in that place now.
        """
        rigid, number = self._parts.rigid, self._model.rigid_ball
        if rigid and number is not None:
            from tripod_sim.contact.rigid_start import put_back  # noqa: PLC0415 - only with contact
            from tripod_sim.mesh.surfaces import Part  # noqa: PLC0415

            triangles = self.mesh.surface[: len(self.mesh.surface) - len(rigid.triangles)]
            soft = Part(self.positions[: len(self.mesh.nodes) - rigid.count], triangles)
            beside = [("the soft body", soft)] if len(triangles) else []
            if kinematic := self._world.kinematic:
                beside += kinematic.placed()
            put_back(rigid, self.state.rigid, number, beside)
            self._stepper.forget()
            self._ended = False
            return
        if not (self._ball and self.state.ball):
            raise SceneError(f"scene {self.scene.name!r} has no ball; add [maze] and [ball]")
        self._ball.start(self.state).copy_to(self.state.ball)
        self._load_ball()
        self._ended = False
        if self._parts.chosen:
            self._parts.chosen.ball_starts(self.state)

    def apply_forces(self, forces: Mapping[int, FloatArray]) -> None:
        """Apply forces to nodes from the next step on, until others are given; `reset` and {} end them.

        The error of the mesh is not known meanwhile. In motion `compliance` is that of the body without them.

        Args:
            forces: Force [N], shape (3,), by the number of a node of `mesh`. Vertices of rigid bodies, the last nodes,
                are points of these.

        Raises SceneError: there is no such node, or a force is not finite.
        """
        if self._applied is None:
            if not forces:
                return
            from tripod_sim.applied_forces import AppliedForces  # noqa: PLC0415 - only where somebody pushes

            self._applied = AppliedForces(self._parts, len(self.mesh.nodes))
            if self._acting:
                self._acting = None
                self.keep_forces()
        self.renew()  # with the forces that acted so far, whether somebody had time for it before or not
        self._applied.set(forces)

    @property
    def pushed(self) -> bool:
        """Whether forces are applied by `apply_forces`."""
        return bool(self._applied and self._applied.acts)

    def rehearse(self) -> None:
        """Take every way once that steps take, so that nothing is left to compile, and return to the start state."""
        try:
            self.step()
            if self.joints:
                start = self.command
                way = np.minimum(REHEARSED, np.maximum(start[:-1] - self.joints.low, 0.0))
                for share in (0.25, 0.5, 0.75, 1.0):
                    self.step(start - share * np.append(way, 0.0))
            self.energies()
            if self._model.effectors:
                self.compliance()
        except StepError:
            pass  # it comes again where it can be told
        self.reset()

    def save(self) -> tuple[State, FloatArray]:
        """Return a copy of state and efforts, for `restore`."""
        return self.state.copy(), self.efforts.copy()

    def restore(self, saved: tuple[State, FloatArray]) -> None:
        """Return to what `save` gave, without moving there: the next step depends on that state alone.

        Raises SceneError: it is the state of another scene.
        """
        state, efforts = saved
        self._check_fits(state)
        if np.shape(efforts) != self.efforts.shape:
            raise SceneError(
                f"the state is of another scene: it has efforts of shape {np.shape(efforts)}, here "
                f"{self.efforts.shape}; take a state of this scene"
            )
        state.copy_to(self.state)
        self.efforts = np.array(efforts, dtype=float)
        self._held_by.fill(np.nan)
        self._ended = False
        self._load_ball()
        self._forget_rest()
        self._stepper.forget()
        if self._mesh_error:
            self.report.mesh_error = self._mesh_error.start(self.state)

    def _check_fits(self, state: State) -> None:
        """Raise SceneError if a state is of another scene."""
        for name in ("positions", "modes", "centres", "joints"):
            theirs, own = getattr(state, name).shape, getattr(self.state, name).shape
            if theirs != own:
                raise SceneError(
                    f"the state is of another scene: {name} has shape {theirs}, here {own}; take a state of this "
                    "scene"
                )

    def __reduce__(self) -> "tuple[Callable[..., Simulation], tuple[Scene, tuple[State, FloatArray]]]":
        """Copy by what it is made of: parts hold views of each other's arrays, which copied one by one would part."""
        return _restored, (self.scene, self.save())

    def _load_ball(self) -> None:
        """Let the ball weigh on the plate as it does now: what the next step begins with, and `renew` before it."""
        if self._ball and self.state.ball:
            self._ball.load(self.state, self.state.ball)

    def _forget_rest(self) -> None:
        if self._rest:
            self._rest.forget()

    @property
    def command(self) -> FloatArray:
        """What was asked last: angles [rad] and slide [m], shape (s + 1,), a copy; the joints if servos are ideal."""
        joints = self.state.joints[: len(self.efforts) + 1].copy()
        if self.state.servos:
            joints[: self._servo_count] = self.state.servos.command
        return joints

    def joint_work(
        self, joints: FloatArray | None = None, efforts: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return `State.joints` with the positions of actuators (see `Joints.moved`), and their efforts, shape (a,).

        `joints`, `efforts`: of another time, as `State.joints` and `efforts`; None: the present ones.
        """
        joints = (self.state.joints if joints is None else joints).copy()
        efforts = self.efforts if efforts is None else efforts
        if self.joints and self.joints.others:
            a = len(efforts)
            joints[:a], efforts = self.joints.moved(joints[:a], efforts)
        return joints, efforts

    @property
    def driven_frames(self) -> tuple[DrivenFrame, ...]:
        """The servo arms."""
        return self._system.groups.driven

    @property
    def fixed(self) -> NDArray[np.int64]:
        """Nodes that are fixed, or prescribed, along all axes."""
        return self._system.groups.fixed

    @property
    def positions(self) -> FloatArray:
        """Positions of the mesh's nodes [m], shape (n, 3): a view that the next step overwrites.

        With rigid bodies their vertices come last, and it is a new array.
        """
        if rigid := self._parts.rigid:
            soft = self.state.positions[: len(self.mesh.nodes) - rigid.count]
            return np.concatenate([soft, rigid.vertices(self.state.rigid)])
        return self.state.positions[: len(self.mesh.nodes)]

    @property
    def rigid(self) -> tuple[Pose, ...]:
        """Pose of each rigid body: centre of mass and rotation of its frame; empty in a scene without any."""
        pairs = zip(*self.state.rigid[:2], strict=True)
        return tuple(Pose(centre.copy(), quaternion(R)) for centre, R in pairs)

    @property
    def rigid_counts(self) -> tuple[int, ...]:
        """How many vertices show each rigid body: the last nodes of mesh and skin, in order."""
        rigid = self._parts.rigid
        return tuple(len(shape.vertices) for shape in rigid.shapes) if rigid else ()

    @property
    def skin(self) -> Skin:
        """What shows the body: undeformed nodes, surface triangles and topology id."""
        return self._parts.skin or self.mesh

    @property
    def bodies(self) -> tuple[int, ...]:
        """How many nodes of `skin` belong to each soft body, 0 where there is none, and to each rigid one."""
        rigid = self.rigid_counts
        return (*(self._parts.soft or (len(self.skin.nodes) - sum(rigid),)), *rigid)

    def shown(self, positions: FloatArray) -> FloatArray:
        """Return where the nodes of `skin` are [m], shape (k, 3), for `positions` of the mesh's nodes [m], (n, 3)."""
        skin = self._parts.skin
        return skin.vertices(positions) if skin else positions

    def fields(self) -> "NodalFields":
        """Return what computes fields on the nodes of `skin` from positions of the mesh's nodes (see `fields`)."""
        from tripod_sim.fields import NodalFields  # noqa: PLC0415 - only on request

        return NodalFields(self._system.elastic.terms, self.mesh.nodes, self.owners)

    @property
    def field_names(self) -> tuple[str, ...]:
        """Names of the fields that `fields` computes, and with `[mesh_error]` that of `mesh_error_field`."""
        from tripod_sim.fields import MESH_ERROR, names_of  # noqa: PLC0415 - only on request

        return (*names_of(self._system.elastic.terms), *((MESH_ERROR,) if self._mesh_error else ()))

    @cached_property
    def owners(self) -> NDArray[np.int64]:
        """The node of `mesh` with which each node of `skin` moves, shape (k,)."""
        numbers = np.repeat(np.arange(float(len(self.mesh.nodes)))[:, None], 3, axis=1)
        apart = self.shown(numbers) - self.shown(np.zeros_like(numbers))  # they keep their distance
        return np.rint(apart[:, 0]).astype(np.int64)

    @property
    def masses(self) -> FloatArray:
        """Lumped masses of the nodes of soft bodies [kg], shape (n,), without those of rigid ones."""
        return self._mass

    @property
    def total_mass(self) -> float:
        """Of all bodies [kg]."""
        rigid = self._parts.rigid
        return float(self._mass.sum()) + (float(rigid.mass.sum()) if rigid else 0.0)

    def rigid_softness(self, node: int) -> float | None:
        """Return the largest acceleration of a vertex of a rigid body by 1 N there [1/kg]; None of other nodes."""
        rigid = self._parts.rigid
        if not rigid or (own := node - (len(self.mesh.nodes) - rigid.count)) < 0:
            return None
        body = int(np.searchsorted(np.cumsum(self.rigid_counts), own, side="right"))
        arm = np.concatenate([shape.vertices for shape in rigid.shapes])[own]
        return float(1.0 / rigid.mass[body] + arm @ arm / np.linalg.eigvalsh(rigid.inertia[body])[0])

    @property
    def solver(self) -> Solver:
        """How its steps are solved, with the tolerance that the scene leaves open."""
        return self._parts.solver

    @property
    def unknowns(self) -> int:
        """Number of unknowns of a step, after elimination of constraints and incompatible modes."""
        return self._system.step_unknowns

    @property
    def system(self) -> System:
        """What the steps solve."""
        return self._system

    @property
    def effector(self) -> Pose | None:
        """Pose of the effector, with no rotation where that is a point or a set; None in a scene without one."""
        if observed := self._parts.observed:
            return Pose(observed.position(self.state.positions), np.array([0.0, 0.0, 0.0, 1.0]))
        if not self._system.groups.rigid:
            return None
        return Pose(self.state.centres[0].copy(), quaternion(self.state.rotations[0]))

    @property
    def watched(self) -> dict[str, NDArray[np.int64]]:
        """Nodes of each marker of the scene, by the name of its set."""
        return {t.set: nodes for t, nodes in zip(self.scene.marker, self._parts.watched, strict=True)}

    @property
    def routes(self) -> "dict[str, Embedding]":
        """Points through which each cable runs, by its name."""
        if not (self.joints and self.joints.others):
            return {}
        routes = zip(self.joints.others, self._system.routes, strict=True)
        return {actuator.name: route for actuator, route in routes if route is not None}

    def cables(self, positions: FloatArray) -> dict[str, FloatArray]:
        """Return the points of each cable [m], shape (k, 3), by its name, with nodes at `positions`, shape (n, 3)."""
        return {name: route.places(positions) for name, route in self.routes.items()}

    @property
    def markers(self) -> tuple[FloatArray, ...]:
        """Mean position of the nodes of each marker of the scene [m], shape (3,)."""
        return tuple(self.state.positions[nodes].mean(axis=0) for nodes in self._parts.watched)

    def undeformed(self, marker: int) -> FloatArray:
        """Return the mean position of the nodes of a marker in the undeformed body [m], shape (3,).

        Raises SceneError: the scene has no such marker.
        """
        return np.asarray(self.mesh.nodes[self._marked(marker)].mean(axis=0))

    def _marked(self, marker: int) -> NDArray[np.int64]:
        """Return the nodes of a marker. Raises SceneError."""
        count = len(self._parts.watched)
        if marker not in range(count):
            known = f"allowed: 0 to {count - 1}" if count else "the scene has none; add [[marker]]"
            raise SceneError(f"there is no marker {shown(marker)}: {known}")
        return self._parts.watched[marker]

    def reactions(self, marker: int) -> tuple[FloatArray, FloatArray]:
        """Return the force [N] on the nodes of a marker from what holds or moves them, and its moment about the origin.

        That is the gradient of the last step's potential there, in implicit schemes with the inertia of the nodes
        themselves, so that it is about zero where nodes are free; in explicit ones where nodes are held alone. It is
        NaN where the state is neither the end of a step nor a pose of rest: before the first step, after `restore`.

        Raises SceneError where the scene has no such marker.
        """
        nodes = self._marked(marker)
        forces = self._held_by[nodes]
        if self.scene.inertia and self.scene.inertia.explicit:
            forces = forces * self._system.groups.held()[nodes]
        return forces.sum(axis=0), np.cross(self.state.positions[nodes], forces).sum(axis=0)

    def keep_forces(self) -> None:
        """Keep what `forces` needs, from the next step on. Results stay the same."""
        if self._acting:
            return
        from tripod_sim.acting_forces import ActingForces  # noqa: PLC0415 - only on request

        self._acting = ActingForces(self._parts, contact=bool(self._model.contact))
        if not len(self._held_by):
            self._held_by = np.full_like(self.state.positions, np.nan)
        integrator = integrator_of(self._stepper)
        if hasattr(integrator, "writes_forces"):
            integrator.writes_forces = True

    @property
    def force_groups(self) -> tuple[str, ...]:
        """Names of the groups of `forces`; empty before `keep_forces`."""
        return self._acting.groups if self._acting else ()

    def forces(self) -> "tuple[Forces, ...]":
        """Return what acts on the bodies at the end of the last step, in groups; see `acting_forces`.

        They are computed here and cost a step nothing. Where the state is not the end of a step, such as at the start
        and after `reset` or `restore`, forces are not known: there are no groups then.

        Raises SceneError without `keep_forces` before.
        """
        if not self._acting:
            raise SceneError("forces of steps are not kept; call keep_forces() before the first step")
        return self._acting.at(self.state, self._held_by, self.efforts) if self._ended else ()

    @property
    def ball(self) -> Pose | None:
        """Pose of the ball; None in a scene without one."""
        if (number := self._model.rigid_ball) is not None:
            return self.rigid[number]
        b = self.state.ball
        return Pose(b.position.copy(), math.copysign(1.0, b.quaternion[3]) * b.quaternion) if b else None

    @property
    def ball_game(self) -> "MazeBall | None":
        """How the ball moves in the maze; None without one. Its state is `state.ball`."""
        return self._ball

    @property
    def plate(self) -> "Plate | None":
        """The maze on the effector; None in a scene without one."""
        return self._parts.plate

    @property
    def ball_event(self) -> str:
        """What has become of the ball, in words; empty while nothing has, and without a ball."""
        if self.state.ball:
            return self.state.ball.event
        rigid, number = self._parts.rigid, self._model.rigid_ball
        if not rigid or number is None:
            return ""
        others = np.concatenate([self.state.positions, self._world.obstacles])
        lost = rigid.below(self.state.rigid, number, others) > LOST
        return f"ball lost: it fell more than {LOST:g} m below everything else" if lost else ""

    @property
    def _world(self) -> "ContactSolver":
        """The bodies in contact, of a scene that has it."""
        found: ContactSolver = integrator_of(self._stepper).world
        return found

    def energies(self) -> Energies:
        """Return the energies of the present state."""
        s = self.state
        kinetic = 0.5 * float(self._mass @ (s.velocities**2).sum(axis=1))
        unused = np.zeros_like(s.velocities)
        kinetic += sum(term.add_inertia(s.velocities, unused) for term in self._system.terms)
        strain, gravity = self._system.potentials(s)
        if rigid := self._parts.rigid:
            moving, fallen = rigid.energies(s.rigid)
            kinetic, gravity = kinetic + float(moving.sum()), gravity + float(fallen.sum())
        return Energies(kinetic, strain, gravity)

    def compliance(self) -> Compliance:
        """Return the linearised static response about where the body would rest, the ball lying where it is.

        Of a body in motion that state of rest goes along from one compliance to the next, see `rest_state`; with a ball
        or contact it is the present state that is linearised.

        Obstacles, the body itself and rigid bodies that lie still on it hold it where they pressed it at the end of the
        last step; see `left_out` for those that do not.

        Raises:
            SceneError: the scene has no effector.
            StepError: the static tangent is singular.
        """
        system = self._static.system
        held = None
        if self._model.contact:
            from tripod_sim.contact.rest import rest_of  # noqa: PLC0415 - only with contact

            held, self.left_out = rest_of(self._stepper, system, self.state, self._parts.rigid)
        elif not self._ball:
            return compliance(
                system, self.state, rest=self._rest, softest=self._softest, observed=self._parts.observed,
                places=self._parts.places,
            )  # fmt: skip
        from tripod_sim.forces.loads import NodalLoads  # noqa: PLC0415 - only where something presses

        loads = system.term(NodalLoads)
        if loads is None:
            loads = NodalLoads(system.rest)
            system.take(loads)
        before = loads.force.copy()
        loads.force[:] = 0.0
        if self._ball and self.state.ball:
            self._ball.rest_load(self.state, self.state.ball, loads.force)
        if held:
            loads.force[:] += held.force
        try:
            return compliance(system, self.state, held, softest=self._softest, observed=self._parts.observed)
        finally:
            loads.force[:] = before

    def mesh_error(self) -> "MeshErrorReport | None":
        """Return the estimated error of the mesh at the effector now; None where the scene does not ask for it.

        The report of a step has the last estimate, which may be some steps old.
        """
        if self._mesh_error and self.pushed:
            return self._mesh_error.unknown(self.state)
        return self._mesh_error.estimate(self.state) if self._mesh_error else None

    def mesh_error_field(self) -> FloatArray | None:
        """Return the error of the mesh at each node of `skin` by the last estimate [m], shape (k,); None without any.

        It is how far the node is from where the richer mesh at rest under the same forces has it; NaN where that is not
        known, as on other bodies than the first. Nothing is solved for it. The estimate may be some steps old.
        """
        if not self._mesh_error:
            return None
        found, first = np.full(len(self.mesh.nodes), np.nan), self._mesh_error.field()
        found[: len(first)] = first
        return found[self.owners]


def joint_values(joints: FloatArray, count: int) -> FloatArray:
    """Return a copy of angles and slide, shape (count,). Raises SceneError: another shape, or not finite numbers."""
    try:
        values = np.array(joints, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise SceneError(f"joints are {shown(joints)}; the scene needs {count} numbers") from None
    if values.shape != (count,):
        raise SceneError(f"joints have shape {values.shape}; the scene needs {(count,)}")
    if not all(map(math.isfinite, values.tolist())):
        raise SceneError(f"joints {values.tolist()} are not finite")
    return values


def _restored(scene: Scene, saved: tuple[State, FloatArray]) -> Simulation:
    """Return a simulation of `scene` in a state that another one saved."""
    simulation = Simulation(scene)
    simulation.restore(saved)
    return simulation
