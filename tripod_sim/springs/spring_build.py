"""Scene to a body of springs alone, free or in contact."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tripod_sim.effects.contact import Contact, contact_of
from tripod_sim.effects.time_error import carried
from tripod_sim.errors import SceneError
from tripod_sim.integrators.scheme import ExplicitScheme
from tripod_sim.mesh.solid_mesh import names_of
from tripod_sim.mesh.topology import parts as connected_parts
from tripod_sim.node_sets import NodeSets
from tripod_sim.parts import Parts, Stepper
from tripod_sim.scene import Scene
from tripod_sim.scene_short import FIRST
from tripod_sim.solved_to import solved_to
from tripod_sim.springs.body import SpringBody
from tripod_sim.springs.net import spring_net
from tripod_sim.springs.skin import ChainSkin
from tripod_sim.springs.spring_system import SpringSystem
from tripod_sim.steppers import implicit_steps
from tripod_sim.tables.bodies import Springs

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.forces.strain_bound import StrainBound
    from tripod_sim.integrators.time_error import ErrorTransport
    from tripod_sim.mesh.surfaces import Part
    from tripod_sim.springs.automatic import AutomaticSprings
    from tripod_sim.springs.implicit_kernels import Options

LARGE = 60_000
"""Unknowns above which `auto` iterates."""


def build_springs(scene: Scene, description: Springs) -> Parts:
    """Return the parts of a simulation of `scene`, whose body `description` describes. Raises SceneError."""
    body = spring_body(scene, description)
    if contact := contact_of(scene):
        body = _placed(body, scene, contact)
    damping = scene.damping.stiffness if scene.damping else 0.0
    system = SpringSystem(body, scene.gravity.acceleration if scene.gravity else None, damping)
    scene = solved_to(scene, [float(body.mass.sum())])
    skin, bound = None if len(body.triangles) else ChainSkin(body), None
    if scene.strain_limit:
        from tripod_sim.forces.strain_bound import StrainBound  # noqa: PLC0415 - an effect that is absent

        bound = StrainBound(body.ends, body.rest_length, scene.strain_limit.stretch, system.mass)
    if contact:
        return _touching(system, scene, contact, skin, bound)
    stepper, errors = _stepper(scene, system)
    if bound:
        from tripod_sim.integrators.strain_limit import StrainLimited  # noqa: PLC0415 - an effect that is absent

        stepper = StrainLimited(stepper, system, bound, system.mass, [], scene.solver.max_iterations)
    return Parts(body, system.mass, system, stepper, skin=skin, errors=errors, solver=scene.solver)


def _touching(
    system: SpringSystem, scene: Scene, contact: Contact, skin: ChainSkin | None, bound: "StrainBound | None"
) -> Parts:
    """Return the parts of a simulation of a spring body, and rigid ones if there are any, among obstacles."""
    from tripod_sim.contact.contact_build import touching  # noqa: PLC0415 - an effect that is absent
    from tripod_sim.contact.spring_nodes import SpringNodes  # noqa: PLC0415
    from tripod_sim.contact.start import near_itself  # noqa: PLC0415

    drag, part = scene.damping.mass if scene.damping else 0.0, surface_part(system.body, contact)
    notes = near_itself(part, contact.contact_distance)
    soft = SpringNodes(system, drag=drag, bound=bound), [part]
    mesh, skin, rigid, stepper = touching(scene, contact, soft, [("the soft body", part)], system.body, skin)
    return Parts(mesh, system.mass, system, stepper, skin=skin, rigid=rigid, notes=notes, solver=scene.solver)


def surface_part(body: SpringBody, contact: Contact) -> "Part":
    """Return the surface of a spring body; a chain touches with its springs."""
    from tripod_sim.mesh.surfaces import Part  # noqa: PLC0415 - an effect that is absent

    segments = np.zeros((0, 2), dtype=np.int64) if len(body.triangles) else body.ends
    return Part(body.nodes, body.triangles, segments, self_contact=contact.self_contact)


def _placed(body: SpringBody, scene: Scene, contact: Contact) -> SpringBody:
    """Return the body where it can start: as it is, or lifted. Raises SceneError if it passes through an obstacle."""
    from tripod_sim.contact.contact_build import obstacle_parts, upward  # noqa: PLC0415 - an effect that is absent
    from tripod_sim.contact.start import check_itself, check_start, lift  # noqa: PLC0415

    part, obstacles = surface_part(body, contact), obstacle_parts(scene)
    check_itself(part, contact.contact_distance)
    if contact.start == "refuse" or not obstacles:
        check_start(part, obstacles)
        return body
    move = lift(part, obstacles, upward(scene), contact.contact_distance)
    return replace(body, nodes=body.nodes + move) if move.any() else body


def spring_body(scene: Scene, description: Springs) -> SpringBody:
    """Return the body that `description` and the fixed regions of `scene` describe. Raises SceneError."""
    body = spring_net(description)
    sets = NodeSets(scene.set, body.nodes, {}, {FIRST: np.arange(len(body.nodes))})
    held = [sets.held(table.set, table.low, table.high, f"fixed.{i}") for i, table in enumerate(scene.fixed)]
    if held:
        fixed = np.unique(np.concatenate([body.fixed, *held]))
        if len(fixed) == len(body.nodes):
            raise SceneError("springs: every node is fixed, so nothing can move; fix fewer nodes")
        body = replace(body, fixed=fixed)
    if not scene.inertia:
        label = connected_parts([body.ends], len(body.nodes))
        loose = np.setdiff1d(label, label[body.fixed])
        if loose.size:
            raise SceneError(
                f"springs: nothing holds the part with nodes {names_of(np.flatnonzero(label == loose[0]))}, "
                "so it can move as a whole and has no static equilibrium; add [inertia], or fix a node of it"
            )
    return body


def _stepper(
    scene: Scene, system: SpringSystem
) -> "tuple[Stepper, ErrorTransport | AutomaticSprings | None]":
    """Return the time integrator or the static solver, and what carries the error of the time steps along."""
    drag = scene.damping.mass if scene.damping else 0.0
    if not scene.inertia:
        from tripod_sim.springs.implicit import StaticSprings  # noqa: PLC0415

        return StaticSprings(system, _options(scene, system)), None
    scheme, wanted = scene.inertia.integrator, carried(scene)
    if wanted and scheme.is_automatic and wanted.steps == "auto":
        from tripod_sim.springs.automatic import AutomaticSprings  # noqa: PLC0415 - an effect that is absent

        chosen = AutomaticSprings(system, wanted.tolerance, wanted.shortest, drag=drag)
        return chosen, chosen
    if isinstance(scheme, ExplicitScheme):
        from tripod_sim.springs.explicit import ExplicitSprings  # noqa: PLC0415

        divide = scene.inertia.substeps == "auto"
        return ExplicitSprings(system, scheme, drag=drag, divide=divide), None
    from tripod_sim.forces.anchor import Anchor  # noqa: PLC0415
    from tripod_sim.springs.implicit import SpringSolver  # noqa: PLC0415
    from tripod_sim.springs.stage import SpringNewton, SpringStage, StageEnd  # noqa: PLC0415

    solver = SpringSolver(system, _options(scene, system), drag=drag, moving=True)
    auto = wanted is not None and wanted.steps == "auto"
    end = StageEnd(system, solver, keep=auto) if wanted else None
    inertia = Anchor(len(system.mass))
    newton = SpringNewton(system, solver, predict=auto, end=end)
    stage = SpringStage(newton, inertia, system.mass, drag)
    steps = implicit_steps(scene, stage, end, inertia, system.mass)
    return steps, steps.errors


def _options(scene: Scene, system: SpringSystem) -> "Options":
    from tripod_sim.springs.implicit_kernels import Options  # noqa: PLC0415

    solver = scene.solver
    if solver.linear == "cholmod":
        raise SceneError("solver.linear is 'cholmod'; allowed with springs: auto, ldl, cg")
    direct = solver.linear == "ldl" or (solver.linear == "auto" and system.unknowns <= LARGE)
    one_solve = solver.mode == "one_solve"
    return Options(direct, one_solve, solver.tolerance, solver.linear_tolerance, solver.max_iterations)
