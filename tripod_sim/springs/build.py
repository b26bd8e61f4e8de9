"""Scene to simulation for a body of springs."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tripod_sim.build import Parts, Stepper
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import names_of
from tripod_sim.mesh.topology import parts as connected_parts
from tripod_sim.node_sets import NodeSets
from tripod_sim.scene import Scene
from tripod_sim.scene_checks import halves
from tripod_sim.springs.body import SpringBody
from tripod_sim.springs.net import spring_net
from tripod_sim.springs.skin import ChainSkin
from tripod_sim.springs.system import SpringSystem
from tripod_sim.tables.bodies import Springs
from tripod_sim.tables.method import TimeError
from tripod_sim.tables.motion import Inertia

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.springs.automatic import AutomaticSprings
    from tripod_sim.springs.estimated import EstimatedSprings
    from tripod_sim.springs.implicit_kernels import Options

LARGE = 60_000
"""Unknowns above which `auto` iterates."""


def build_springs(scene: Scene, description: Springs) -> Parts:
    """Return the parts of a simulation of `scene`, whose body `description` describes. Raises SceneError."""
    body = spring_body(scene, description)
    if scene.contact:
        from tripod_sim.contact.build import placed, spring_parts  # noqa: PLC0415 - an effect that is absent

        body = placed(body, scene, scene.contact)
        system = SpringSystem(body, scene.gravity.acceleration if scene.gravity else None)
        return spring_parts(system, scene, scene.contact, None if len(body.triangles) else ChainSkin(body))
    system = SpringSystem(body, scene.gravity.acceleration if scene.gravity else None)
    skin = None if len(body.triangles) else ChainSkin(body)
    if (wanted := scene.time_error) and not halves(scene):
        estimated = _estimated(scene, system, wanted)
        return Parts(body, system.mass, system, estimated, skin=skin, errors=estimated)
    stepper = _stepper(scene, system)
    if scene.strain_limit:
        from tripod_sim.forces.strain_bound import StrainBound  # noqa: PLC0415 - an effect that is absent
        from tripod_sim.integrators.strain_limit import StrainLimited  # noqa: PLC0415

        bound = StrainBound(body.ends, body.rest_length, scene.strain_limit.stretch, system.mass)
        stepper = StrainLimited(stepper, system, bound, system.mass, [], scene.solver.max_iterations)
    return Parts(body, system.mass, system, stepper, skin=skin)


def spring_body(scene: Scene, description: Springs) -> SpringBody:
    """Return the body that `description` and the fixed regions of `scene` describe. Raises SceneError."""
    body = spring_net(description)
    sets = NodeSets(scene.set, body.nodes, {})
    held = [sets.held(table, f"fixed.{i}") for i, table in enumerate(scene.fixed)]
    if held:
        fixed = np.unique(np.concatenate([body.fixed, *held]))
        if len(fixed) == len(body.nodes):
            raise SceneError("springs: every node is fixed; nothing is free to move")
        body = replace(body, fixed=fixed)
    if not scene.inertia:
        label = connected_parts([body.ends], len(body.nodes))
        loose = np.setdiff1d(label, label[body.fixed])
        if loose.size:
            raise SceneError(
                f"springs: nothing holds the part with nodes {names_of(np.flatnonzero(label == loose[0]))}, so its "
                "translation is free and it has no static equilibrium; add [inertia] or hold it"
            )
    return body


def _stepper(scene: Scene, system: SpringSystem) -> Stepper:
    drag = scene.damping.mass if scene.damping else 0.0
    rayleigh = scene.damping.stiffness if scene.damping else 0.0
    if not scene.inertia:
        from tripod_sim.springs.implicit import StaticSprings  # noqa: PLC0415

        return StaticSprings(system, _options(scene, system))
    from tripod_sim.springs.explicit import SCHEMES, ExplicitSprings  # noqa: PLC0415

    if scene.inertia.scheme in SCHEMES:
        divide = scene.inertia.substeps == "auto"
        return ExplicitSprings(system, scene.inertia.scheme, drag=drag, rayleigh=rayleigh, divide=divide)
    from tripod_sim.springs.implicit import ImplicitSprings  # noqa: PLC0415

    return ImplicitSprings(
        system,
        _implicit(scene.inertia),
        _options(scene, system),
        drag=drag,
        rayleigh=rayleigh,
        max_halvings=scene.solver.max_halvings,
    )


def _implicit(inertia: Inertia) -> str:
    """Return the scheme of implicit steps of a fixed dt."""
    return "implicit_euler" if inertia.scheme == "auto" else inertia.scheme


def _estimated(
    scene: Scene, system: SpringSystem, wanted: TimeError
) -> "EstimatedSprings | AutomaticSprings":
    """Return what carries the error of the time steps along, or takes steps as long as what they add allows."""
    assert scene.inertia
    damping = scene.damping
    drag, rayleigh = (damping.mass, damping.stiffness) if damping else (0.0, 0.0)
    if scene.inertia.scheme == "auto" and wanted.steps == "auto":
        from tripod_sim.springs.automatic import AutomaticSprings  # noqa: PLC0415 - an effect that is absent

        return AutomaticSprings(system, wanted.tolerance, wanted.shortest, drag=drag, rayleigh=rayleigh)
    from tripod_sim.springs.estimated import EstimatedSprings  # noqa: PLC0415 - an effect that is absent

    return EstimatedSprings(
        system, _implicit(scene.inertia), _options(scene, system), wanted, drag=drag, rayleigh=rayleigh,
        max_halvings=scene.solver.max_halvings,
    )  # fmt: skip


def _options(scene: Scene, system: SpringSystem) -> "Options":
    from tripod_sim.springs.implicit_kernels import Options  # noqa: PLC0415

    solver = scene.solver
    if solver.linear == "cholmod":
        raise SceneError("solver.linear is 'cholmod'; of springs allowed: auto, ldl, cg")
    direct = solver.linear == "ldl" or (solver.linear == "auto" and system.unknowns <= LARGE)
    one_solve = solver.mode == "one_solve"
    return Options(direct, one_solve, solver.tolerance, solver.linear_tolerance, solver.max_iterations)
