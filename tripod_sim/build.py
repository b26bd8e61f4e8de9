"""Scene to simulation: each named effect becomes one term or stage; an absent one is not even imported."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from tripod_sim.constraints.groups import DrivenFrame, Groups, Kind
from tripod_sim.constraints.held import free_motion, held_groups
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.elements.element import node_volumes
from tripod_sim.errors import SceneError
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.substeps import StepReport, Substeps
from tripod_sim.linear.choice import linear_factory
from tripod_sim.materials.lame import lame_constants
from tripod_sim.mesh.solid_mesh import SolidMesh, check_held, check_mesh
from tripod_sim.mesh.suited import suited, width_note
from tripod_sim.node_sets import NodeSets
from tripod_sim.scene import Scene
from tripod_sim.state import State
from tripod_sim.system import System
from tripod_sim.tables.bodies import Mesh
from tripod_sim.tables.motion import EXPLICIT
from tripod_sim.tables.robot import Servos

if TYPE_CHECKING:
    from tripod_sim.ball.body_ball import BodyBall
    from tripod_sim.contact.rigid_set import JoinedMesh, JoinedSkin, RigidSet
    from tripod_sim.contact.rigid_system import RigidSystem
    from tripod_sim.forces.anchor import Anchor
    from tripod_sim.forces.loads import NodalLoads
    from tripod_sim.integrators.time_error import ErrorTransport
    from tripod_sim.maze.plate import Plate
    from tripod_sim.maze.play import MazeBall
    from tripod_sim.robot.servo import ServoMotion
    from tripod_sim.springs.automatic import AutomaticSprings
    from tripod_sim.springs.body import SpringBody
    from tripod_sim.springs.estimated import EstimatedSprings
    from tripod_sim.springs.skin import ChainSkin
    from tripod_sim.springs.system import SpringSystem

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


class Stepper(Protocol):
    """Advances a state by one step."""

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance in place, or raise StepError and leave `state` as it was."""

    def forget(self) -> None:
        """Drop what was kept from earlier steps, so that the next depends on its state alone."""


@dataclass(frozen=True, eq=False)
class Parts:
    """What `build` made of a scene.

    Attributes:
        mesh: The solid's mesh, or the body of springs.
        mass: Of nodes [kg], shape (n,); zero for ghosts of a compliant clamp, which follow the mesh's nodes.
        system: The potential.
        stepper: The time integrator or the static solver.
        servos: How the servos turn; None where their angles are ideal.
        skin: What shows a body that has no surface of its own.
        plate: The maze on the disc; None without one.
        ball: How the ball moves; None without one.
        errors: Carries the error of the time steps along; None where the scene does not ask for it.
        rigid: The rigid bodies, which `mesh` shows behind the soft one; None without any.
        check_start: Raises SceneError if positions of nodes at the start [m] pass through something; None: they do not.
        notes: What users should know of them, one sentence each.
        velocities: Of nodes at the start [m/s], shape (n, 3); None: at rest.
        watched: Nodes of each marker.
    """

    mesh: "SolidMesh | SpringBody | JoinedMesh"
    mass: FloatArray
    system: "System | SpringSystem | RigidSystem"
    stepper: Stepper
    servos: "ServoMotion | None" = None
    skin: "ChainSkin | JoinedSkin | None" = None
    plate: "Plate | None" = None
    ball: "MazeBall | BodyBall | None" = None
    errors: "ErrorTransport | EstimatedSprings | AutomaticSprings | None" = None
    rigid: "RigidSet | None" = None
    check_start: Callable[[FloatArray], None] | None = None
    notes: tuple[str, ...] = ()
    velocities: FloatArray | None = None
    watched: tuple[IndexArray, ...] = ()


def build(scene: Scene) -> Parts:
    """Return the parts of a simulation of `scene`. Raises SceneError."""
    parts = _built(scene)
    if not scene.sleep:
        return parts
    from tripod_sim.integrators.sleep import Sleeping

    speed, time = scene.sleep.speed, scene.sleep.time
    stepper = Sleeping(parts.stepper, parts.system, parts.mass, speed=speed, time=time, rigid=parts.rigid)
    return replace(parts, stepper=stepper)


def _built(scene: Scene) -> Parts:
    """Return the parts of a simulation whose body is solved for in every step."""
    if scene.springs:
        from tripod_sim.springs.build import build_springs

        parts = build_springs(scene, scene.springs)
        nodes, held = parts.mesh.nodes[: parts.system.groups.size], parts.system.groups.held()
        sets = NodeSets(scene.set, nodes, {})
        return replace(parts, velocities=_velocities(scene, sets, nodes, held), watched=_watched(scene, sets))
    if scene.rigid and not scene.mesh:
        from tripod_sim.contact.rigid_build import build_rigid

        return build_rigid(scene)
    from tripod_sim.forces.solid import Solid

    assert scene.mesh
    assert scene.material
    mesh, notes = suited(body_mesh(scene.mesh))
    notes = (*width_note(scene.mesh.source, mesh.nodes), *notes)
    sets = NodeSets(scene.set, mesh.nodes, mesh.groups)
    if scene.contact:
        from tripod_sim.contact.solid_build import placed_solid

        mesh = placed_solid(mesh, scene, scene.contact)
    groups = _groups(scene, mesh.nodes, sets)
    if not scene.inertia:
        _check_held(scene.mesh.source, mesh, groups)
    rest, foundation = mesh.nodes, None
    if scene.clamp:
        from tripod_sim.robot.clamp import bed_clamps

        rest, frames, foundation = bed_clamps(mesh, groups.driven, scene.clamp.stiffness)
        groups = replace(groups, size=len(rest), driven=frames)
    rest, groups, plate = _fastened(scene, rest, groups)
    load, inert = _node_masses(mesh, scene.material.mass, len(rest))
    if plate:
        load[plate.nodes], inert[plate.nodes] = plate.mass, plate.mass
    dead = _dead_loads(scene, sets, mesh, load, inert)
    lam, mu = lame_constants(scene.material.young, scene.material.poisson)
    solid = Solid(rest, _strained(mesh.elements, groups), mesh.kind, scene.material.law, lam, mu)
    gravity = inertia = None
    if scene.gravity or dead is not None:
        from tripod_sim.forces.gravity import GravityForce

        gravity = GravityForce(load, scene.gravity.acceleration if scene.gravity else (0, 0, 0), rest, dead)
    velocities, watched = _velocities(scene, sets, rest, groups.held()), _watched(scene, sets)
    loads, ball = _ball(scene, rest, groups, mesh.surface, plate)
    explicit = scene.inertia is not None and scene.inertia.scheme in EXPLICIT
    if (scene.inertia and not explicit) or scene.contact:
        from tripod_sim.forces.anchor import Anchor

        inertia = Anchor(len(rest))
    damping = scene.damping.stiffness if scene.damping and not explicit else 0.0
    system = System(
        rest, [solid], groups, gravity=gravity, inertia=inertia, damping=damping, foundation=foundation,
        loads=loads,
        linear=linear_factory(scene.solver.linear, scene.solver.linear_tolerance),
    )  # fmt: skip
    if scene.contact and inertia:
        from tripod_sim.contact.solid_build import solid_parts

        parts = solid_parts(mesh, system, inertia, inert, scene, scene.contact, plate)
        return replace(
            parts, servos=_servos(scene, groups), notes=notes, velocities=velocities, watched=watched
        )
    stepper = _stepper(scene, system, inertia, inert)
    servos = _servos(scene, groups)
    errors = stepper.errors if isinstance(stepper, Substeps) else None
    return Parts(
        mesh, inert, system, stepper, servos, plate=plate, ball=ball, errors=errors, notes=notes,
        velocities=velocities, watched=watched,
    )  # fmt: skip


def _dead_loads(
    scene: Scene, sets: NodeSets, mesh: SolidMesh, weighing: FloatArray, inert: FloatArray
) -> FloatArray | None:
    """Return the dead loads on nodes [N], shape (n, 3); add their masses to what nodes weigh and resist with [kg]."""
    if not scene.load:
        return None
    from tripod_sim.forces.set_loads import set_loads

    loads = set_loads(scene.load, sets, mesh, len(weighing))
    weighing += loads.weighing
    inert += loads.inert
    return loads.force


def _servos(scene: Scene, groups: Groups) -> "ServoMotion | None":
    """Return how the servos turn; None where their angles are ideal."""
    if not scene.servo_dynamics:
        return None
    from tripod_sim.robot.servo import ServoMotion

    return ServoMotion(scene.servo_dynamics, len(groups.driven))


def _stepper(scene: Scene, system: System, inertia: "Anchor | None", mass: FloatArray) -> Stepper:
    """Return the time integrator or the static solver; `inertia` is None where that needs no such term."""
    solver = scene.solver
    one_solve = scene.inertia and solver.mode == "one_solve"  # statics goes to the tolerance
    if one_solve and not scene.servos:  # where nothing holds a body errors of the momentum would add up
        groups = system.groups
        one_solve = not free_motion([*system.reduction.blocks, *groups.rigid], system.rest, groups.held())
    if one_solve:
        from tripod_sim.integrators.one_solve import OneSolve

        newton: Newton = OneSolve(system, solver.tolerance, solver.max_iterations, solver.position_tolerance)
    else:
        newton = Newton(system, solver.tolerance, solver.max_iterations)
    if not scene.inertia:
        from tripod_sim.integrators.quasi_static import QuasiStatic

        return QuasiStatic(newton, scene.solver.max_halvings, scene.solver.max_turn, reach_of(scene.servos))
    drag = scene.damping.mass if scene.damping else 0.0
    if inertia:
        from tripod_sim.integrators.schemes import make_scheme

        most = scene.solver.max_halvings
        mixed = (
            scene.inertia.scheme == "auto"
            and scene.time_error is not None
            and scene.time_error.steps == "auto"
        )
        name = "tr_bdf2" if mixed else scene.inertia.scheme
        scheme = make_scheme(name, newton, inertia, mass, drag, most)
        if wanted := scene.time_error:
            from tripod_sim.integrators.time_error import ErrorTransport

            scheme.errors = ErrorTransport(
                system, inertia, mass, local=wanted.steps == "auto", carried=wanted.carries
            )
            if wanted.steps == "auto":
                from tripod_sim.integrators.auto_steps import AutoSteps

                return AutoSteps(scheme, newton, most, wanted.tolerance, wanted.shortest, mixed=mixed)
        return scheme
    from tripod_sim.integrators.explicit import ExplicitSolid

    rayleigh = scene.damping.stiffness if scene.damping else 0.0
    divide = scene.inertia.substeps == "auto"
    return ExplicitSolid(system, mass, scene.inertia.scheme, drag=drag, rayleigh=rayleigh, divide=divide)


def reach_of(servos: "Servos | None") -> float:
    """Return the length of the arms by which a slide counts as a turn [m]."""
    return max(servos.axis_depth, 0.005) if servos else 0.03


def _fastened(scene: Scene, rest: FloatArray, groups: Groups) -> "tuple[FloatArray, Groups, Plate | None]":
    """Return nodes and groups with what the scene fastens to the disc, and that."""
    if not scene.maze:
        return rest, groups, None
    from tripod_sim.maze.plate import fasten

    return fasten(rest, groups, scene.maze, scene.ball.radius if scene.ball else 0.0)


def _ball(
    scene: Scene, rest: FloatArray, groups: Groups, surface: IndexArray, plate: "Plate | None"
) -> "tuple[NodalLoads | None, MazeBall | BodyBall | None]":
    """Return the loads of the ball on the nodes, and how it moves."""
    if not (scene.ball and scene.gravity and scene.material):
        return None, None
    from tripod_sim.forces.loads import NodalLoads

    loads, gravity, static = NodalLoads(rest), np.array(scene.gravity.acceleration), not scene.inertia
    if plate:
        from tripod_sim.maze.play import MazeBall

        return loads, MazeBall(scene.ball, plate, gravity, loads, quasi_static=static)
    from tripod_sim.ball.body_ball import BodyBall

    mass, disc = scene.material.mass, groups.rigid[0] if groups.rigid else None
    return loads, BodyBall(
        scene.ball, surface, groups.driven, mass, gravity, loads, quasi_static=static, disc=disc
    )


def _node_masses(mesh: SolidMesh, total: float, size: int) -> tuple[FloatArray, FloatArray]:
    """Return what nodes weigh and what inertia they have [kg], each of shape (size,) and of sum `total` [kg]."""
    found = []
    for volumes in node_volumes(mesh.kind, mesh.nodes[mesh.elements]):
        mass = np.zeros(size)
        np.add.at(mass, mesh.elements, volumes)
        found.append(mass * (total / mass.sum()))
    return found[0], found[1]


def body_mesh(description: Mesh) -> SolidMesh:
    """Return the mesh that a scene describes. Raises SceneError."""
    if description.source == "y_piece":
        from tripod_sim.mesh.y_piece import LEVELS, YShape, divided, y_piece

        kind, level = ELEMENTS[description.element], LEVELS[description.level]
        shape = YShape(legs=description.legs)
        if description.refine:
            level = divided(level, 2**description.refine)
        if kind.corners == 8:
            mesh = y_piece(level, shape, kind)
        else:
            from tripod_sim.mesh.convert import convert_hexahedra

            mesh = convert_hexahedra(y_piece(level, shape), kind.name)
    elif description.source == "block":
        from tripod_sim.mesh.block import block

        mesh = block(description.corners, description.cells)
        if description.element != mesh.kind.name:
            from tripod_sim.mesh.convert import convert_hexahedra

            mesh = convert_hexahedra(mesh, description.element)
        mesh = _refined(mesh, description.refine)
    elif "." in description.source:
        from tripod_sim.mesh.read import read_solid

        mesh = read_solid(Path(description.source), description.scale, description.element)
        mesh = _refined(mesh, description.refine)
    else:
        raise SceneError(
            f"mesh.source is {description.source!r}; allowed: y_piece, block, or the path of a mesh file"
        )
    check_mesh(mesh, f"mesh.source {description.source!r}")
    return mesh


def _refined(mesh: SolidMesh, times: int) -> SolidMesh:
    for _ in range(times):
        from tripod_sim.mesh.refine import refine

        mesh = refine(mesh)
    return mesh


def _groups(scene: Scene, nodes: FloatArray, sets: NodeSets) -> Groups:
    rigid: tuple[IndexArray, ...] = ()
    driven: tuple[DrivenFrame, ...] = ()
    if scene.effector:
        from tripod_sim.robot.disc import effector_disc

        rigid = (effector_disc(nodes, scene.effector),)
    if scene.servos:
        from tripod_sim.robot.arms import placed_arms, servo_arms

        driven = placed_arms(scene.servo, sets) if scene.servo else servo_arms(nodes, scene.servos)
    return held_groups(scene, sets, nodes, rigid, driven)


def _check_held(source: str, mesh: SolidMesh, groups: Groups) -> None:
    """Refuse a body that can move as a whole in a scene without inertia. Raises SceneError, which says how."""
    held = groups.held()
    check_held(mesh, groups.rigid, np.flatnonzero(held.any(axis=1)), f"mesh.source {source!r}")
    if free := free_motion([mesh.elements, *groups.rigid], mesh.nodes, held):
        raise SceneError(f"mesh.source {source!r}: {free}; without inertia it must be held against that, too")


def _velocities(scene: Scene, sets: NodeSets, rest: FloatArray, held: NDArray[np.bool_]) -> FloatArray | None:
    """Return the velocities of nodes at the start [m/s]; None: at rest."""
    if not scene.initial_velocity:
        return None
    from tripod_sim.start_velocities import start_velocities

    return start_velocities(scene.initial_velocity, sets, rest, held)


def _watched(scene: Scene, sets: NodeSets) -> tuple[IndexArray, ...]:
    """Return the nodes of each marker."""
    return tuple(sets.nodes(table.set, f"marker.{i}.set") for i, table in enumerate(scene.marker))


def _strained(elements: IndexArray, groups: Groups) -> IndexArray:
    """Return the elements that can deform: not all nodes in one group."""
    kind, number = groups.kinds()
    key = np.where(kind == Kind.FREE, -1 - np.arange(groups.size), 1000 * kind + number)[elements]
    return np.ascontiguousarray(elements[~(key == key[:, :1]).all(axis=1)])
