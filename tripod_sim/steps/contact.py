"""Model to soft bodies in contact, finite-element solids and springs."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.bodies.assembly import Assembly
from tripod_sim.bodies.soft_build import shown
from tripod_sim.contact.contact_build import obstacle_parts, touching, upward
from tripod_sim.contact.solid_nodes import SolidNodes
from tripod_sim.contact.start import check_apart, check_itself, check_start, lift, near_itself, passing
from tripod_sim.effect import Draft
from tripod_sim.errors import SceneError
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.stepper import integrator_of
from tripod_sim.mesh.solid_mesh import check_boundary
from tripod_sim.mesh.surfaces import Part
from tripod_sim.model import Model
from tripod_sim.steps.parts import Parts
from tripod_sim.system import System
from tripod_sim.tables.contact import Contact

MODES = 1e-3
"""Unbalanced force that incompatible modes may keep, as a share of the solver's tolerance."""


class Surface(NamedTuple):
    """The surface of bodies that are tied, or of one.

    Attributes:
        name: For messages.
        part: What touches.
        nodes: Its vertices among the nodes of all bodies, ascending, shape (k,).
        first: Number of its first body.
    """

    name: str
    part: Part
    nodes: IndexArray
    first: int


def surfaces(assembly: Assembly, contact: Contact) -> list[Surface]:
    """Return what touches: bodies that are tied are one part, which does not touch itself unless all do.

    Raises SceneError where the boundary of a solid is no surface.
    """
    found = []
    for k, body in enumerate(assembly.bodies):
        if body.tied != k:
            continue
        together = [b for b in assembly.bodies if b.tied == k]
        for b in together:
            if b.solid and b.table.mesh:
                check_boundary(b.solid, f"{b.field}mesh.source {b.table.mesh.source!r}")
        faces = np.concatenate([b.nodes[b.mesh.surface] for b in together])
        chains = [rows for b in together if b.net and not len(b.net.triangles) for rows in b.blocks]
        edges = np.concatenate([np.zeros((0, 2), dtype=np.int64), *chains])
        nodes = np.unique(np.concatenate([faces.ravel(), edges.ravel()]))
        part = Part(
            assembly.nodes[nodes],
            np.searchsorted(nodes, faces),
            np.searchsorted(nodes, edges),
            filled=np.repeat(
                [b.solid is not None for b in together], [len(b.mesh.surface) for b in together]
            ),
            self_contact=contact.self_contact,
            name=" and ".join(b.table.name for b in together),
        )
        names = " and ".join(repr(b.table.name) for b in together)
        name = "the body" if len(assembly.bodies) == 1 else f"body {names}"
        found.append(Surface(name, part, nodes, k))
    return found


def placed_bodies(assembly: Assembly, held: IndexArray, model: Model, contact: Contact) -> Assembly:
    """Return the bodies where they can start: as they are, or lifted one after the other.

    Args:
        assembly: The bodies where they are described to begin.
        held: Nodes that are fixed, or move along timelines.
        model: Of the scene.
        contact: Of the model.

    Raises:
        SceneError: one passes through an obstacle or another body, and may or can not be lifted.
    """
    obstacles, moves = obstacle_parts(model.obstacles), dict[int, FloatArray]()
    placed = list[tuple[str, Part]]()
    for name, part, _, first in surfaces(assembly, contact):
        here = part
        check_itself(part, contact.contact_distance)
        if model.posed and first == 0:  # it begins where the servos bring it
            continue
        others = [*obstacles, *(other for _, other in placed)]
        if contact.start == "refuse" or not others:
            check_start(part, obstacles, name)
            check_apart(name, part, placed)
        elif _hold(held, assembly, first):
            if passing(part, others).size:
                raise SceneError(
                    f"contact.start is 'lift', but {name} is held inside something that it passes through; move "
                    "that"
                )
        else:
            move = lift(part, others, upward(model.gravity), contact.contact_distance, name)
            here, moves[first] = replace(part, vertices=part.vertices + move), move
        placed.append((name, here))
    if not any(move.any() for move in moves.values()):
        return assembly
    return assembly.moved(lambda body: moves.get(body.tied, np.zeros(3)))


def _hold(held: IndexArray, assembly: Assembly, first: int) -> bool:
    """Return whether one of the nodes `held` belongs to a body, or to one that is tied to it."""
    return any(np.isin(body.nodes, held).any() for body in assembly.bodies if body.tied == first)


def solid_parts(draft: Draft, system: System, contact: Contact) -> Parts:
    """Return the parts of a simulation of soft bodies, and rigid ones if there are any, among obstacles.

    Raises SceneError: a body passes through something at the start.
    """
    model, assembly, mass, inertia = draft.model, draft.assembly, draft.inert, draft.inertia
    assert inertia
    found = surfaces(assembly, contact)
    for s in found:
        draft.notes += near_itself(s.part, contact.contact_distance, s.name)
    soft, mesh, skin = None, None, None
    if found:
        vertices = np.concatenate([s.nodes for s in found])
        newton = Newton(system, model.solver.tolerance, model.solver.max_iterations)
        stage = ImplicitStage(newton, inertia, mass, model.drag)
        near = contact.tolerance * contact.contact_distance
        nodes = SolidNodes(stage, mass, vertices, MODES * model.solver.tolerance, near, draft.bound)
        soft = nodes, [s.part for s in found]
        mesh, skin, _ = shown(assembly)
    there = [s for s in found if not (model.posed and s.first == 0)]
    alone = len(assembly.bodies) == 1
    placed = [("the soft body" if alone else s.name, s.part) for s in there]
    mesh, skin, rigid, stepper = touching(model, contact, soft, placed, mesh, skin)

    if bodies := integrator_of(stepper).world.rigid:
        bodies.terms = system.terms

    def check_start_of(positions: FloatArray) -> None:
        """Name what passes through what where the servos have brought the first body."""
        name, part, own, _ = found[0]
        body = replace(part, vertices=positions[own])
        check_start(body, obstacle_parts(model.obstacles), name)
        check_apart(name, body, [(s.name, s.part) for s in found[1:]])
        if rigid:
            from tripod_sim.contact.rigid_start import check_beside

            check_beside(rigid, body)

    check = check_start_of if model.posed else None
    return Parts(mesh, mass, system, stepper, skin=skin, rigid=rigid, check_start=check)
