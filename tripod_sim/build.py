"""Scene to simulation: each effect that a scene names does its part; an absent one is not even imported."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from tripod_host.arrays import IndexArray
from tripod_sim.bodies.assembly import Assembly
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
from tripod_sim.constraints.held import free_motion, held_groups
from tripod_sim.effect import Draft, Effect
from tripod_sim.effects import EFFECTS, has, table_of
from tripod_sim.errors import Doubt, SceneError
from tripod_sim.linear.choice import linear_factory
from tripod_sim.mesh.described import described_mesh
from tripod_sim.mesh.solid_mesh import SolidMesh, check_held, names_of
from tripod_sim.mesh.topology import parts as connected_parts
from tripod_sim.node_sets import NodeSets
from tripod_sim.parts import Parts
from tripod_sim.proportions import out_of_proportion
from tripod_sim.scene import Scene
from tripod_sim.scene_short import only_springs, rigids_of, soft_bodies
from tripod_sim.solved_to import solved_to
from tripod_sim.steppers import stepper_of
from tripod_sim.system import System
from tripod_sim.tables.bodies import Mesh
from tripod_sim.tables.fields import unusual

Progress = Callable[[float], None]
Say = Callable[[str], None]


def build(scene: Scene, progress: Progress | None = None, say: Say | None = None) -> Parts:
    """Return the parts of a simulation of `scene`.

    Args:
        scene: What is described.
        progress: Told how far its bodies are bent to fit together, 0 to 1.
        say: Told what is being done, a line each, and how large what is being built is as far as that is known.

    Raises SceneError.
    """
    for effect, table in _effects(scene):
        if effect.prepare:
            scene = effect.prepare(table, scene)
    parts = _built(scene, progress, say)
    for effect, table in _effects(scene):
        if effect.finish:
            parts = effect.finish(table, scene, parts, _built)
    return parts


def _effects(scene: Scene) -> Iterator[tuple[Effect, Any]]:
    """Yield the effects of a scene, each with its table."""
    for name, effect in EFFECTS.items():
        if has(scene, name):
            yield effect, table_of(scene, name)


def _built(scene: Scene, progress: Progress | None = None, say: Say | None = None) -> Parts:
    """Return the parts of a simulation whose body is solved for in every step."""
    if rigids_of(scene) and not soft_bodies(scene):
        from tripod_sim.contact.rigid_build import build_rigid

        return build_rigid(scene)
    return _of_terms(scene, progress, say or (lambda text: None))


def _of_terms(scene: Scene, progress: Progress | None, say: Say) -> Parts:
    """Return the parts of a simulation of soft bodies, whose potential is a list of terms."""

    def read(description: Mesh) -> SolidMesh:
        say(f"making the mesh {description.source!r}")
        mesh = described_mesh(description)
        say(f"building {mesh.count} elements, {len(mesh.nodes)} nodes")
        return mesh

    assembly, notes = assembled(scene, read)
    draft = Draft(scene, assembly, sets_of(scene, assembly), assembly.nodes)
    used = list(_effects(scene))

    def do(phase: str) -> None:
        for effect, table in used:
            if act := getattr(effect, phase):
                act(table, draft)

    do("place")
    assembly, platforms = draft.assembly, None
    do("hold")
    if scene.platform:
        from tripod_sim.bodies.platform import Platforms

        platforms = Platforms(scene.platform, draft.sets)
        draft.rigid += platforms.nodes
    draft.groups, said = with_held(held_groups(draft), assembly, static=not scene.inertia)
    if platforms or not scene.inertia:
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
    draft.scene = scene = solved_to(
        scene, [draft.load[body.nodes].sum() for body in assembly.bodies], draft.dead
    )
    do("act")

    def made(held: Groups) -> System:
        return System(
            draft.rest, elastic_terms(assembly, draft.sets, draft.rest, held, draft.damping), held,
            [*draft.terms, *([draft.inertia] if draft.inertia else [])], damped=bool(scene.inertia and draft.inertia),
            joined=spring_sides(assembly) if has(scene, "contact") else (),
            linear=linear_factory(scene.solver.linear, scene.solver.linear_tolerance, springs=only_springs(scene)),
        )  # fmt: skip

    elements = sum(body.solid.count for body in assembly.bodies if body.solid)
    say(f"looking for an order of the unknowns: {elements} elements")
    system = made(draft.groups)
    say(f"preparing the first step: {elements} elements, {system.unknowns} unknowns")
    if platforms and not scene.inertia:
        system.assembly = platforms.bending(assembly, made, scene.solver, progress)
    stepping = [(effect.step, table) for effect, table in used if effect.step]
    parts = stepping[0][0](stepping[0][1], draft, system) if stepping else _stepped(draft, system)
    parts = replace(
        parts,
        notes=(*notes, *said, *draft.notes),
        watches=tuple(draft.watches),
        soft=shown(assembly)[2],
        solver=scene.solver,
        plate=draft.plate,
        ball=draft.ball,
    )
    parts = _watched(scene, draft.sets, system, parts)
    if unusual(scene) or any(isinstance(note, Doubt) for note in parts.notes):
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


def _watched(scene: Scene, sets: NodeSets, system: System, parts: Parts) -> Parts:
    """Return parts with the velocities of nodes at the start, and the nodes of each marker."""
    velocities = None
    for effect, table in _effects(scene):
        if effect.start:
            velocities = effect.start(table, sets, system.rest, system.groups.held())
    watched: tuple[IndexArray, ...] = tuple(
        sets.nodes(table.set, f"marker.{i}.set") for i, table in enumerate(scene.marker)
    )
    return replace(parts, velocities=velocities, watched=watched)
