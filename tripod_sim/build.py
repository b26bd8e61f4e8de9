"""Scene to simulation: each named effect becomes one term or stage; an absent one is not even imported."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.bodies.assembly import Assembly, SoftBody
from tripod_sim.bodies.soft_build import (
    assembled,
    elastic_terms,
    masses,
    sets_of,
    shown,
    spring_dampers,
    spring_sides,
    strain_bound,
    with_held,
)
from tripod_sim.constraints.groups import DrivenFrame, Groups
from tripod_sim.constraints.held import free_motion, held_groups
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.errors import SceneError
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.linear.choice import linear_factory
from tripod_sim.mesh.solid_mesh import SolidMesh, check_held, check_mesh
from tripod_sim.node_sets import NodeSets
from tripod_sim.scene import Scene
from tripod_sim.scene_checks import by_way, carried, halves
from tripod_sim.scene_short import (
    ball_is_rigid,
    discs_of,
    joints_of,
    pose_of,
    rigids_of,
    servo_tables,
    soft_bodies,
    springs_alone,
)
from tripod_sim.state import State
from tripod_sim.system import System
from tripod_sim.tables.bodies import Mesh
from tripod_sim.tables.motion import EXPLICIT, ORDER

if TYPE_CHECKING:
    from tripod_sim.ball.body_ball import BodyBall
    from tripod_sim.bodies.assembly import AssemblySkin
    from tripod_sim.bodies.platform import Platforms
    from tripod_sim.contact.rigid_set import JoinedMesh, JoinedSkin, RigidSet, RigidSystem
    from tripod_sim.forces.anchor import Anchor
    from tripod_sim.forces.gravity import GravityForce
    from tripod_sim.forces.loads import NodalLoads
    from tripod_sim.forces.spring_force import SpringDampers
    from tripod_sim.forces.strain_bound import StrainBound
    from tripod_sim.integrators.doubling import Doubling
    from tripod_sim.integrators.stage import ImplicitStage
    from tripod_sim.integrators.time_error import ErrorTransport
    from tripod_sim.integrators.way_steps import WaySteps
    from tripod_sim.maze.plate import Plate
    from tripod_sim.maze.play import MazeBall
    from tripod_sim.robot.servo import ServoMotion
    from tripod_sim.springs.automatic import AutomaticSprings
    from tripod_sim.springs.body import SpringBody
    from tripod_sim.springs.skin import ChainSkin
    from tripod_sim.springs.spring_system import SpringSystem


RIGID_BALL = (
    "beside contact the ball is a rigid body: it touches with contact.friction, restitution and rest_speed; its own, "
    "rolling and substep are of no account"
)
"""What users should know of it."""


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
        mesh: The solid's mesh, the body of springs, or several bodies.
        mass: Of nodes [kg], shape (n,); zero for ghosts of a compliant clamp, which follow the mesh's nodes.
        system: The potential.
        stepper: The time integrator or the static solver.
        servos: How the servos turn; None where their angles are ideal.
        skin: What shows a body that has no surface of its own.
        plate: The maze on the disc; None without one.
        ball: How the ball moves; None without one.
        errors: Carries the error of the time steps along; None where the scene does not ask for it.
        doubling: Finds that error by steps of half the length; None where nobody asks, or `errors` does.
        chosen: Chooses the steps by what they err over their way, those of the ball among them; None: nothing does.
        rigid: The rigid bodies, which `mesh` shows behind the soft one; None without any.
        check_start: Raises SceneError if positions of nodes at the start [m] pass through something; None: they do not.
        notes: What users should know of them, one sentence each.
        soft: How many of the nodes that show the simulation belong to each soft body; empty: all that are not rigid.
        velocities: Of nodes at the start [m/s], shape (n, 3); None: at rest.
        watched: Nodes of each marker.
    """

    mesh: "SolidMesh | SpringBody | Assembly | JoinedMesh"
    mass: FloatArray
    system: "System | SpringSystem | RigidSystem"
    stepper: Stepper
    servos: "ServoMotion | None" = None
    skin: "ChainSkin | AssemblySkin | JoinedSkin | None" = None
    plate: "Plate | None" = None
    ball: "MazeBall | BodyBall | None" = None
    errors: "ErrorTransport | AutomaticSprings | None" = None
    doubling: "Doubling | None" = None
    chosen: "WaySteps | None" = None
    rigid: "RigidSet | None" = None
    check_start: Callable[[FloatArray], None] | None = None
    notes: tuple[str, ...] = ()
    soft: tuple[int, ...] = ()
    velocities: FloatArray | None = None
    watched: tuple[IndexArray, ...] = ()


def build(scene: Scene, progress: Callable[[float], None] | None = None) -> Parts:
    """Return the parts of a simulation of `scene`; `progress` is told how far its bodies are bent to fit together.

    Raises SceneError.
    """
    follows_way = by_way(scene)
    if follows_way and scene.inertia and scene.inertia.scheme == "auto":
        scheme = "bdf2" if halves(scene) else "tr_bdf2"  # hits make both restart; the former is cheaper there
        scene = replace(scene, inertia=replace(scene.inertia, scheme=scheme))
    parts = _built(scene, progress)
    if ball_is_rigid(scene):
        parts = replace(parts, notes=(*parts.notes, RIGID_BALL))
    if follows_way and scene.time_error and scene.inertia:
        from tripod_sim.integrators.way_steps import WaySteps

        distance = scene.contact.contact_distance if scene.contact else 0.0
        in_maze = cast("MazeBall", parts.ball) if scene.maze and parts.ball else None
        solid = any(body.springs is None for body in soft_bodies(scene))
        by_way_steps = WaySteps(parts, scene.time_error, scene.inertia.scheme, distance, in_maze, solid=solid)
        parts = replace(parts, stepper=by_way_steps, chosen=by_way_steps)
    elif scene.time_error and scene.inertia and not parts.errors:
        from tripod_sim.integrators.doubling import Doubling

        twin = _built(replace(scene, dt=0.5 * scene.dt, time_error=None))
        jumps = scene.contact or scene.strain_limit
        order = 1 if jumps else ORDER[scene.inertia.scheme]
        doubling = Doubling(parts, twin, order, scene.time_error)
        parts = replace(parts, stepper=doubling, doubling=doubling)
    if not scene.sleep:
        return parts
    from tripod_sim.integrators.sleep import Sleeping

    speed, time = scene.sleep.speed, scene.sleep.time
    stepper = Sleeping(parts.stepper, parts.system, parts.mass, speed=speed, time=time, rigid=parts.rigid)
    return replace(parts, stepper=stepper)


def _built(scene: Scene, progress: Callable[[float], None] | None = None) -> Parts:
    """Return the parts of a simulation whose body is solved for in every step."""
    if scene.springs and springs_alone(scene):  # a loop of its own, faster than that of any terms
        from tripod_sim.springs.spring_build import build_springs

        parts = build_springs(scene, scene.springs)
        nodes, held = parts.mesh.nodes[: parts.system.groups.size], parts.system.groups.held()
        sets = NodeSets(scene.set, nodes, {})
        return replace(parts, velocities=_velocities(scene, sets, nodes, held), watched=_watched(scene, sets))
    if rigids_of(scene) and not soft_bodies(scene):
        from tripod_sim.contact.rigid_build import build_rigid

        return build_rigid(scene)
    static = not scene.inertia
    assembly, notes = assembled(scene, body_mesh)
    sets = sets_of(scene, assembly)
    if scene.contact:
        from tripod_sim.contact.solid_build import placed_bodies

        assembly = placed_bodies(assembly, sets, scene, scene.contact)
    first, rest = assembly.bodies[0], assembly.nodes
    platforms = _platforms(scene, sets)
    groups = _groups(scene, assembly, sets, platforms.nodes if platforms else [])
    groups, said = with_held(groups, assembly, static=static)
    if static or platforms:
        _check_held(assembly, groups)
    foundation = None
    if scene.clamp:
        from tripod_sim.robot.clamp import bed_clamps

        rest, frames, foundation = bed_clamps(_in_all(first, rest), groups.driven, scene.clamp.stiffness)
        groups = replace(groups, size=len(rest), driven=frames)
    rest, groups, plate, fastened = _fastened(scene, rest, groups, platforms)
    inert, gravity = _weights(scene, assembly, sets, rest, plate, fastened)
    inertia = None
    velocities, watched = _velocities(scene, sets, rest, groups.held()), _watched(scene, sets)
    loads, ball = (None, None) if ball_is_rigid(scene) else _ball(scene, rest, groups, first, plate)
    explicit = scene.inertia is not None and scene.inertia.scheme in EXPLICIT
    if (scene.inertia and not explicit) or scene.contact:
        from tripod_sim.forces.anchor import Anchor

        inertia = Anchor(len(rest))
    damping = scene.damping.stiffness if scene.damping and not explicit else 0.0
    bound = strain_bound(assembly, groups, inert, scene.strain_limit.stretch) if scene.strain_limit else None
    dampers = spring_dampers(assembly) if scene.inertia else None
    terms = [t for t in (foundation, dampers, None if explicit else bound, gravity, loads, inertia) if t]

    def made(held: Groups) -> System:
        return System(
            rest, elastic_terms(assembly, sets, rest, held), held, terms, damping=damping,
            joined=spring_sides(assembly) if scene.contact else (),
            linear=linear_factory(scene.solver.linear, scene.solver.linear_tolerance),
        )  # fmt: skip

    system = made(groups)
    if platforms and static:
        system.assembly = platforms.bending(assembly, made, scene.solver, progress)
    mesh, skin, counts = shown(assembly)
    if scene.contact and inertia:
        from tripod_sim.contact.solid_build import solid_parts

        parts = solid_parts(
            assembly, mesh, skin, system, inertia, inert, scene, scene.contact, plate, ball, bound
        )
    else:
        stepper = _stepper(scene, system, inertia, inert, bound, dampers)
        parts = Parts(
            mesh, inert, system, stepper, skin=skin, plate=plate, ball=ball, errors=errors_of(stepper)
        )
    return replace(
        parts, servos=_servos(scene, groups), notes=(*notes, *said), soft=counts, velocities=velocities, watched=watched
    )  # fmt: skip


def errors_of(stepper: Stepper) -> "ErrorTransport | None":
    """Return what carries the error of the time steps along in a stepper; None where nothing does."""
    return stepper.errors if isinstance(stepper, Substeps) else None


def _platforms(scene: Scene, sets: NodeSets) -> "Platforms | None":
    """Return what joins sets of several bodies; None where nothing does."""
    if not scene.platform:
        return None
    from tripod_sim.bodies.platform import Platforms

    return Platforms(scene.platform, sets)


def _weights(
    scene: Scene,
    assembly: Assembly,
    sets: NodeSets,
    rest: FloatArray,
    plate: "Plate | None",
    fastened: FloatArray,
) -> "tuple[FloatArray, GravityForce | None]":
    """Return the inertia of nodes [kg], and weight and dead loads, None where there are none.

    `fastened`: masses of the last nodes [kg], those of platforms.
    """
    load, inert = masses(assembly, sets, len(rest))
    if plate:
        load[plate.nodes], inert[plate.nodes] = plate.mass, plate.mass
    if len(fastened):
        load[-len(fastened) :], inert[-len(fastened) :] = fastened, fastened
    dead = None
    if scene.load:
        from tripod_sim.forces.set_loads import set_loads

        solids = [_in_all(body, assembly.nodes) for body in assembly.bodies if body.solid]
        dead, weighing, lumped = set_loads(scene.load, sets, solids, len(rest))
        load, inert = load + weighing, inert + lumped
    if not scene.gravity and dead is None:
        return inert, None
    from tripod_sim.forces.gravity import GravityForce

    acceleration = scene.gravity.acceleration if scene.gravity else (0.0, 0.0, 0.0)
    return inert, GravityForce(load, acceleration, rest, dead)


def _in_all(body: SoftBody, nodes: FloatArray) -> SolidMesh:
    """Return a solid in the numbering of all bodies, whose nodes are `nodes` [m]."""
    assert body.solid
    return replace(body.solid, nodes=nodes, elements=body.blocks, groups={})


def _servos(scene: Scene, groups: Groups) -> "ServoMotion | None":
    """Return how the servos turn; None where their angles are ideal."""
    if not scene.servo_dynamics:
        return None
    from tripod_sim.robot.servo import ServoMotion

    return ServoMotion(scene.servo_dynamics, len(groups.driven))


def _stepper(
    scene: Scene, system: System, inertia: "Anchor | None", mass: FloatArray, bound: "StrainBound | None",
    dampers: "SpringDampers | None",
) -> Stepper:  # fmt: skip
    """Return the time integrator or the static solver; `inertia` is None where that needs no such term."""
    solver = scene.solver
    one_solve = scene.inertia and solver.mode == "one_solve"  # statics goes to the tolerance
    one_solve = one_solve and not bound  # nor does one solve find which springs are at it
    if one_solve and not servo_tables(
        scene
    ):  # where nothing holds a body errors of the momentum would add up
        groups = system.groups
        one_solve = not free_motion([*system.reduction.blocks, *groups.rigid], system.rest, groups.held())
    if one_solve:
        from tripod_sim.integrators.one_solve import OneSolve

        newton: Newton = OneSolve(system, solver.tolerance, solver.max_iterations, solver.position_tolerance)
    elif bound and inertia:
        from tripod_sim.integrators.strain_limit import BoundedNewton

        newton = BoundedNewton(system, bound, solver.tolerance, solver.max_iterations)
    else:
        newton = Newton(system, solver.tolerance, solver.max_iterations)
    if not scene.inertia:
        from tripod_sim.integrators.quasi_static import QuasiStatic

        watch = not any(
            body.springs for body in soft_bodies(scene)
        )  # slack ones have no stiffness to be watched
        return QuasiStatic(
            newton, scene.solver.max_halvings, scene.solver.max_turn, reach_of(scene), watch=watch
        )
    drag = scene.damping.mass if scene.damping else 0.0
    if inertia:
        from tripod_sim.integrators.stage import ImplicitStage

        rates = dampers.add_products if dampers else None
        return implicit_steps(scene, ImplicitStage(newton, inertia, mass, drag), system, inertia, mass, rates)
    from tripod_sim.integrators.explicit import ExplicitSteps

    rayleigh = scene.damping.stiffness if scene.damping else 0.0
    divide = scene.inertia.substeps == "auto"
    stepper = ExplicitSteps(system, mass, scene.inertia.scheme, drag=drag, rayleigh=rayleigh, divide=divide)
    if not bound:
        return stepper
    from tripod_sim.integrators.strain_limit import StrainLimited

    blocks = [term.elements for term in system.elastic.terms]
    return StrainLimited(stepper, system, bound, mass, blocks, solver.max_iterations)


def implicit_steps(
    scene: Scene,
    stage: "ImplicitStage",
    system: Any,
    inertia: "Anchor",
    mass: FloatArray,
    rates: Callable[[FloatArray, FloatArray], None] | None,
) -> "Substeps":
    """Return the implicit time integrator of a scene; all but the scene and the stage are as for `ErrorTransport`."""
    from tripod_sim.integrators.schemes import ImplicitScheme

    assert scene.inertia
    most, wanted = scene.solver.max_halvings, carried(scene)
    mixed = scene.inertia.scheme == "auto" and wanted is not None and wanted.steps == "auto"
    scheme = ImplicitScheme("tr_bdf2" if mixed else scene.inertia.scheme, stage, most)
    if by_way(scene):
        stage.newton.keep_several()
    if not wanted:
        return scheme
    from tripod_sim.integrators.time_error import ErrorTransport

    auto = wanted.steps == "auto"
    scheme.errors = ErrorTransport(system, inertia, mass, local=auto, carried=wanted.carries, rates=rates)
    if not auto:
        return scheme
    from tripod_sim.integrators.auto_steps import AutoSteps

    return AutoSteps(scheme, stage.newton, most, wanted.tolerance, wanted.shortest, mixed=mixed)


def reach_of(scene: Scene) -> float:
    """Return the length of the arms by which a slide counts as a turn [m]."""
    joints = joints_of(scene)
    return joints.reach if joints else 0.03


def _fastened(
    scene: Scene, rest: FloatArray, groups: Groups, platforms: "Platforms | None"
) -> "tuple[FloatArray, Groups, Plate | None, FloatArray]":
    """Return nodes and groups with what the scene fastens to the disc, and that, and with the nodes of platforms, and
    the masses of these [kg].
    """
    plate, mass = None, np.zeros(0)
    if scene.maze:
        from tripod_sim.maze.plate import fasten

        rest, groups, plate = fasten(rest, groups, scene.maze, scene.ball.radius if scene.ball else 0.0)
    if platforms:
        rest, groups, mass = platforms.fasten(rest, groups)
    return rest, groups, plate, mass


def _ball(
    scene: Scene, rest: FloatArray, groups: Groups, body: SoftBody, plate: "Plate | None"
) -> "tuple[NodalLoads | None, MazeBall | BodyBall | None]":
    """Return the loads of the ball on the nodes, and how it moves."""
    material = body.table.material
    if not (scene.ball and scene.gravity and material and body.solid):
        return None, None
    from tripod_sim.forces.loads import NodalLoads

    loads, gravity, static = NodalLoads(rest), np.array(scene.gravity.acceleration), not scene.inertia
    if plate:
        from tripod_sim.maze.play import MazeBall

        return loads, MazeBall(scene.ball, plate, gravity, loads, quasi_static=static)
    from tripod_sim.ball.body_ball import BodyBall

    mass, disc = material.mass, groups.rigid[0] if groups.rigid else None
    return loads, BodyBall(
        scene.ball, body.solid.surface, groups.driven, mass, gravity, loads, quasi_static=static, disc=disc
    )


def body_mesh(description: Mesh) -> SolidMesh:
    """Return the mesh that a scene describes. Raises SceneError."""
    kind = ELEMENTS[description.element]
    if description.source == "y_piece":
        from tripod_sim.mesh.y_piece import LEVELS, YShape, divided, y_piece

        level = divided(LEVELS[description.level], 2**description.refine)
        shape = YShape(legs=description.legs)
        mesh = y_piece(level, shape, kind) if kind.corners == 8 else y_piece(level, shape)
    elif description.source == "block":
        from tripod_sim.mesh.block import block

        mesh = block(description.corners, description.cells)
    elif "." in description.source:
        from tripod_sim.mesh.read import read_solid

        mesh = read_solid(Path(description.source), description.scale, kind.name)
    else:
        raise SceneError(
            f"mesh.source is {description.source!r}; allowed: y_piece, block, or the path of a mesh file"
        )
    if mesh.kind is not kind:
        from tripod_sim.mesh.convert import convert

        mesh = convert(mesh, kind.name)
    for _ in range(0 if description.source == "y_piece" else description.refine):
        from tripod_sim.mesh.refine import refine

        mesh = refine(mesh)
    check_mesh(mesh, f"mesh.source {description.source!r}")
    return mesh


def _groups(scene: Scene, assembly: Assembly, sets: NodeSets, joined: Sequence[IndexArray]) -> Groups:
    """Return what holds and moves nodes: discs, platforms that hold the nodes `joined`, servo arms, what is fixed or
    prescribed.
    """
    rigid = list[IndexArray]()
    driven: tuple[DrivenFrame, ...] = ()
    own = {body.table.name: body.nodes for body in assembly.bodies}
    for field, table, body in discs_of(scene):
        from tripod_sim.robot.disc import effector_disc

        position, turn = pose_of(body)
        rigid.append(
            own[body.name][effector_disc((assembly.nodes[own[body.name]] - position) @ turn, table, field)]
        )
    rigid += joined
    if joints := joints_of(scene):
        from tripod_sim.robot.arms import servo_arms

        driven = servo_arms(joints, sets)
    return held_groups(scene, sets, assembly.nodes, tuple(rigid), driven)


def _check_held(assembly: Assembly, groups: Groups) -> None:
    """Refuse bodies that can move as a whole in a scene without inertia. Raises SceneError, which says how."""
    first, held = assembly.bodies[0], groups.held()
    source = f"mesh.source {first.table.mesh.source!r}" if first.table.mesh else f"body {first.table.name!r}"
    if first.solid and len(assembly.bodies) == 1:
        check_held(first.solid, groups.rigid, np.flatnonzero(held.any(axis=1)), source)
    blocks = [body.blocks for body in assembly.bodies]
    if free := free_motion([*blocks, *groups.rigid], assembly.nodes, held):
        raise SceneError(f"{source}: {free}; without inertia it must be held against that, too")


def _velocities(scene: Scene, sets: NodeSets, rest: FloatArray, held: NDArray[np.bool_]) -> FloatArray | None:
    """Return the velocities of nodes at the start [m/s]; None: at rest."""
    if not scene.initial_velocity:
        return None
    from tripod_sim.start_velocities import start_velocities

    return start_velocities(scene.initial_velocity, sets, rest, held)


def _watched(scene: Scene, sets: NodeSets) -> tuple[IndexArray, ...]:
    """Return the nodes of each marker."""
    return tuple(sets.nodes(table.set, f"marker.{i}.set") for i, table in enumerate(scene.marker))
