"""Scene to simulation: each effect that a scene names does its part; an absent one is not even imported."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tripod_host.arrays import IndexArray
from tripod_sim.bodies.assembly import Assembly
from tripod_sim.bodies.proportions import out_of_proportion
from tripod_sim.bodies.soft_build import (
    assembled,
    elastic_terms,
    masses,
    sets_of,
    shown,
    spring_sides,
    with_held,
)
from tripod_sim.constraints.groups import Groups
from tripod_sim.constraints.held import Holding, free_motion, held_groups
from tripod_sim.effect import Draft
from tripod_sim.errors import Doubt, SceneError
from tripod_sim.linear.choice import linear_factory
from tripod_sim.mesh.described import described_mesh
from tripod_sim.mesh.node_sets import NodeSets
from tripod_sim.mesh.solid_mesh import SolidMesh, check_held, names_of
from tripod_sim.mesh.topology import parts as connected_parts
from tripod_sim.model import Model
from tripod_sim.scene.lowering import lowered
from tripod_sim.scene.scene import Scene
from tripod_sim.steps.parts import Parts
from tripod_sim.steps.steppers import stepper_of
from tripod_sim.steps.tolerance import with_tolerance
from tripod_sim.system import System
from tripod_sim.tables.bodies import Mesh

Progress = Callable[[float], None]
Say = Callable[[str], None]


def build(scene: Scene, progress: Progress | None = None, say: Say | None = None) -> Parts:
    """Return the parts of a simulation of `scene`; the rest as for `build_model`."""
    return build_model(lowered(scene), progress, say)


def build_model(model: Model, progress: Progress | None = None, say: Say | None = None) -> Parts:
    """Return the parts of a simulation of `model`.

    Args:
        model: What a scene describes, written out.
        progress: Told how far its bodies are bent to fit together, 0 to 1.
        say: Told what is being done, a line each, and how large what is being built is as far as that is known.

    Raises SceneError.
    """
    parts = _built(model, progress, say)
    for effect, table in model.effects:
        if effect.finish:
            parts = effect.finish(table, model, parts, _built)
    return replace(parts, notes=(*parts.notes, *model.notes))


def _built(model: Model, progress: Progress | None = None, say: Say | None = None) -> Parts:
    """Return the parts of a simulation before effects change them."""
    say = say or (lambda text: None)

    def read(description: Mesh) -> SolidMesh:
        say(f"making the mesh {description.source!r}")
        mesh = described_mesh(description)
        say(f"building {mesh.count} elements, {len(mesh.nodes)} nodes")
        return mesh

    assembly, notes = assembled(model, read)
    draft = Draft(model, assembly, sets_of(model, assembly), assembly.nodes)

    def do(phase: str) -> None:
        for effect, table in model.effects:
            if act := getattr(effect, phase):
                act(table, draft)

    do("hold")
    do("place")
    assembly, platforms = draft.assembly, None
    if model.platforms:
        from tripod_sim.bodies.platform import Platforms

        platforms = Platforms(model.platforms, draft.sets)
        draft.rigid += [Holding(f"platform.{i}", nodes) for i, nodes in enumerate(platforms.nodes)]
    held = held_groups(
        draft.rest.shape, draft.rigid, draft.driven, draft.fixed, draft.moved, draft.prescribed
    )
    actuators = len(model.joints.others) if model.joints else 0
    held = replace(held, free=len(model.rigid), actuators=actuators)
    draft.groups, said = with_held(held, assembly, static=not model.scheme)
    if platforms or not model.scheme:
        while_held = "while a platform is brought to its place" if platforms else "without inertia"
        _check_held(assembly, draft.groups, while_held)
    do("extend")
    fastened = np.zeros(0)
    if platforms:
        draft.rest, draft.groups, fastened = platforms.fasten(draft.rest, draft.groups)
    draft.load, draft.inert = masses(assembly, draft.sets, len(draft.rest))
    last = slice(len(draft.rest) - len(fastened), None)
    draft.load[last], draft.inert[last] = fastened, fastened
    do("weigh")
    draft.model = model = with_tolerance(
        model, [draft.load[body.nodes].sum() for body in assembly.bodies], draft.dead
    )
    do("act")

    def made(held: Groups) -> System:
        return System(
            draft.rest, elastic_terms(assembly, draft.sets, draft.rest, held, draft.damping), held,
            [*draft.terms, *([draft.inertia] if draft.inertia else [])], damped=bool(model.scheme and draft.inertia),
            joined=spring_sides(assembly) if model.contact else (),
            linear=linear_factory(model.solver.linear, model.solver.linear_tolerance, springs=model.only_springs),
        )  # fmt: skip

    elements = sum(body.solid.count for body in assembly.bodies if body.solid)
    if assembly.bodies:
        say(f"looking for an order of the unknowns: {elements} elements")
    system = made(draft.groups)
    say(f"preparing the first step: {elements} elements, {system.step_unknowns} unknowns")
    if platforms and not model.scheme:
        system.assembly = platforms.bending(assembly, made, model.solver, progress)
    stepping = [(effect.step, table) for effect, table in model.effects if effect.step]
    parts = stepping[0][0](stepping[0][1], draft, system) if stepping else _stepped(draft, system)
    parts = replace(
        parts,
        notes=(*notes, *said, *draft.notes),
        watches=tuple(draft.watches),
        assembly=assembly,
        soft=shown(assembly)[2],
        solver=model.solver,
        plate=draft.plate,
        ball=draft.ball,
        observed=draft.observed,
        places=draft.places,
    )
    parts = _watched(model, draft.sets, system, parts)
    if model.doubts or any(isinstance(note, Doubt) for note in parts.notes):
        return parts  # of what follows from an input that is wrong by itself nothing is to say
    return replace(parts, notes=(*parts.notes, *out_of_proportion(draft, parts.velocities)))


def _stepped(draft: Draft, system: System) -> Parts:
    """Return the parts of a simulation of bodies that touch nothing."""
    mesh, skin, _ = shown(draft.assembly)
    stepper = stepper_of(draft, system)
    errors = getattr(stepper, "errors", None)  # of schemes that carry them along
    return Parts(mesh, draft.inert, system, stepper, skin=skin, errors=errors)


def _check_held(assembly: Assembly, groups: Groups, when: str) -> None:
    """Refuse bodies that can move as a whole in a state of rest. Raises SceneError, which says how, and `when`."""
    first, held = assembly.bodies[0], groups.held()
    source = "bodies " + ", ".join(repr(body.table.name) for body in assembly.bodies)
    if first.solid and len(assembly.bodies) == 1:
        source = f"mesh.source {first.table.mesh.source!r}" if first.table.mesh else source
        check_held(first.solid, groups.rigid, np.flatnonzero(held.any(axis=1)), source)
    blocks = [block for body in assembly.bodies for block in body.blocks]
    if all(body.net for body in assembly.bodies):  # weight holds what can turn about what is fixed
        label = connected_parts(blocks, groups.size)
        loose = np.setdiff1d(label, label[held.any(axis=1)])
        if loose.size:
            raise SceneError(
                f"springs: nothing holds the part with nodes {names_of(np.flatnonzero(label == loose[0]))}, "
                "so it can move as a whole and has no static equilibrium; add [inertia], or fix a node of it"
            )
    elif free := free_motion([*blocks, *groups.rigid], assembly.nodes, held):
        raise SceneError(
            f"{source}: {free}; {when} that motion must be held too: add [[fixed]] there, or [inertia]"
        )


def _watched(model: Model, sets: NodeSets, system: System, parts: Parts) -> Parts:
    """Return parts with the velocities of nodes at the start, and the nodes of each marker."""
    velocities = None
    for effect, table in model.effects:
        if effect.start:
            velocities = effect.start(table, sets, system.rest, system.groups.held())
    watched: tuple[IndexArray, ...] = tuple(
        sets.nodes(table.set, f"marker.{i}.set") for i, table in enumerate(model.markers)
    )
    return replace(parts, velocities=velocities, watched=watched)
