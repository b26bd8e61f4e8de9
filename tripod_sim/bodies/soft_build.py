"""Model to soft bodies: meshes and nets where they begin, and what they put into a system: mass, terms."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.bodies.assembly import Assembly, AssemblySkin, SoftBody
from tripod_sim.bodies.suited import mass_note, suited, width_note
from tripod_sim.constraints.groups import Groups, Kind
from tripod_sim.elements.element import row_sums
from tripod_sim.errors import SceneError
from tripod_sim.forces.elastic import ElasticTerm
from tripod_sim.mesh.node_sets import NodeSets
from tripod_sim.mesh.solid_mesh import SolidMesh, block_volumes, by_block, names_of, solid_volumes
from tripod_sim.mesh.topology import parts as connected_parts
from tripod_sim.model import Model
from tripod_sim.tables.bodies import HOME, Body, Material, Mesh, Region
from tripod_sim.tables.materials import parameters_of

if TYPE_CHECKING:
    from tripod_sim.forces.element_inertia import ElementMasses
    from tripod_sim.forces.strain_bound import StrainBound
    from tripod_sim.springs.body import SpringBody
    from tripod_sim.springs.skin import ChainSkin


class Masses(NamedTuple):
    """What nodes weigh and what inertia they have [kg], each of shape (n,)."""

    load: FloatArray
    inert: FloatArray


def assembled(model: Model, read: Callable[[Mesh], SolidMesh]) -> tuple[Assembly, tuple[str, ...]]:
    """Return the soft bodies of a model where they are described to begin, and notes on them.

    Args:
        model: Of the scene.
        read: Makes a mesh.

    Raises:
        SceneError: a mesh or net cannot be made, or a tie misses.
    """
    bodies, notes, first = list[SoftBody](), list[str](), 0
    weighs = bool(model.gravity or model.scheme)
    for k, (field, table) in enumerate(model.bodies):
        body, said = _body(SoftBody(table, field, np.zeros(0, dtype=np.int64), k), read, weighs=weighs)
        notes += (
            said if len(model.bodies) == 1 else [type(note)(f"body {table.name!r}: {note}") for note in said]
        )
        count = len(body.mesh.nodes)
        bodies.append(replace(body, nodes=first + np.arange(count)))
        first += count
    assembly = Assembly(bodies)
    if model.ties:
        from tripod_sim.bodies.ties import tied  # noqa: PLC0415 - an effect that is absent

        assembly = tied(assembly, model.ties, sets_of(model, assembly))
    if model.platforms:
        from tripod_sim.bodies.platform import Platforms  # noqa: PLC0415 - an effect that is absent

        assembly = Platforms(model.platforms, sets_of(model, assembly)).joined(assembly)
    return assembly, tuple(notes)


def sets_of(model: Model, assembly: Assembly) -> NodeSets:
    """Return the sets of the scene's nodes."""
    regions = {region.set for body in assembly.bodies for region in body.table.region}
    return NodeSets(model.sets, assembly.nodes, assembly.groups, assembly.named, regions)


def _body(
    body: SoftBody, read: Callable[[Mesh], SolidMesh], *, weighs: bool
) -> tuple[SoftBody, tuple[str, ...]]:
    """Return a body with its mesh where it begins, and notes on it; `weighs`: whether its mass counts."""
    table = body.table
    notes: tuple[str, ...] = ()
    try:
        if table.springs:
            from tripod_sim.springs.net import spring_net  # noqa: PLC0415 - only with springs

            body = replace(body, net=spring_net(table.springs))
        else:
            assert table.mesh
            solid, notes = suited(read(table.mesh), _material(table).poisson)
            body, size = replace(body, solid=solid), width_note(table.mesh.source, solid.nodes)
            if weighs and not size:  # in other units nothing is right
                size = mass_note(_material(table), solid, body.field)
            notes = (*size, *solid.notes, *notes)
    except SceneError as error:
        raise SceneError(f"{body.field}{error}") from None
    if table.position == (0.0, 0.0, 0.0) and table.orientation == HOME:
        return body, notes
    position, turn = table.pose
    return body.placed(body.mesh.nodes @ turn.T + position), notes


def shown(
    assembly: Assembly,
) -> "tuple[SolidMesh | SpringBody | Assembly, ChainSkin | AssemblySkin | None, tuple[int, ...]]":
    """Return what a simulation shows of the bodies: a mesh, a skin where bodies share nodes or a chain has no surface,
    and how many of the nodes shown belong to each body.
    """
    counts = tuple(len(body.nodes) for body in assembly.bodies)
    if len(counts) == 1 and (solid := assembly.bodies[0].solid):
        return solid, None, counts
    if len(counts) == 1 and (net := assembly.bodies[0].net):
        if len(net.triangles):
            return net, None, counts
        from tripod_sim.springs.skin import ChainSkin  # noqa: PLC0415 - only with springs

        chain = ChainSkin(net)
        return net, chain, (len(chain.nodes),)
    if sum(counts) == len(assembly.nodes) and all(len(body.mesh.surface) for body in assembly.bodies):
        return assembly, None, counts
    skin = AssemblySkin(assembly)
    return assembly, skin, skin.counts


def masses(assembly: Assembly, sets: NodeSets, size: int) -> Masses:
    """Return the masses of `size` nodes, of which those of the bodies are the first."""
    load, inert = np.zeros(size), np.zeros(size)
    for body in assembly.bodies:
        if body.net:
            load[body.nodes] += body.net.mass
            inert[body.nodes] += body.net.mass
            continue
        material, mesh = _material(body.table), body.solid
        assert mesh
        volume = solid_volumes(mesh)
        density = _densities(body, assembly, sets, volume)
        total = material.mass
        if material.density or any(region.density for region in body.table.region):
            total = float(density @ volume)
        of_block = by_block(mesh, density / density[0])
        for mass, parts in zip((load, inert), zip(*block_volumes(mesh), strict=True), strict=True):
            own = np.zeros(len(mesh.nodes))
            for (_, elements), part, times in zip(mesh.blocks, parts, of_block, strict=True):
                np.add.at(own, elements, part * times[:, None])
            mass[body.nodes] += own * (total / own.sum())
    return Masses(load, inert)


def _densities(body: SoftBody, assembly: Assembly, sets: NodeSets, volume: FloatArray) -> FloatArray:
    """Return the density of each element of a body, whose `volume` is given [m³], all of shape (m,) [kg/m³]."""
    material = _material(body.table)
    density = np.full(len(volume), material.density or material.mass / volume.sum())
    for region, elements in _regions(body, assembly, sets):
        if region.density:
            density[elements] = region.density
    return density


def element_masses(assembly: Assembly, sets: NodeSets) -> "list[ElementMasses]":
    """Return what the masses of nodes lack of the inertia of quadratic elements, for each kind of such in each body."""
    found = []
    for body in assembly.bodies:
        if not (mesh := body.solid) or all(kind.lumping is row_sums for kind, _ in mesh.blocks):
            continue
        from tripod_sim.forces.element_inertia import lacking  # noqa: PLC0415 - only with quadratic elements

        density = by_block(mesh, _densities(body, assembly, sets, solid_volumes(mesh)))
        for (kind, elements), nodes, own in zip(mesh.blocks, body.blocks, density, strict=True):
            if kind.lumping is not row_sums:
                found.append(lacking(kind, mesh.nodes[elements], nodes, own))
    return found


def elastic_terms(
    assembly: Assembly, sets: NodeSets, rest: FloatArray, groups: Groups, damping: float
) -> list[ElasticTerm]:
    """Return the strain energy of the bodies: a solid for each material and kind of elements of each, springs.

    Args:
        assembly: The bodies.
        sets: Of the scene.
        rest: Undeformed positions of all nodes of the system [m], shape (n, 3).
        groups: What ties nodes: elements that cannot deform are left out.
        damping: b, the viscosity over the stiffness undeformed [s].
    """
    terms = list[ElasticTerm]()
    alone = len(assembly.bodies) == 1
    for body in assembly.bodies:
        name = body.table.name
        if net := body.net:
            from tripod_sim.forces.spring_force import SpringForce  # noqa: PLC0415 - only with springs

            (ends,) = body.blocks
            moving = strained(ends, groups)
            length, stiffness = net.rest_length[moving], net.stiffness[moving]
            dampers = net.damping[moving]
            terms.append(
                SpringForce(
                    ends[moving],
                    length,
                    stiffness,
                    dampers,
                    slack=net.slack,
                    owner=name,
                    viscosity=damping,
                )
            )
            continue
        from tripod_sim.forces.solid import Solid  # noqa: PLC0415 - only with solids

        mesh = body.solid
        assert mesh
        of = np.zeros(mesh.count, dtype=np.int64)
        parts: list[Material | Region] = [_material(body.table)]
        for region, elements in _regions(body, assembly, sets):
            of[elements] = len(parts)
            parts.append(region)
        numbers, of_block = by_block(mesh, np.arange(mesh.count)), by_block(mesh, of)
        deforming = [strained(elements, groups) for elements in body.blocks]
        for k, part in enumerate(parts):
            for i, elements in enumerate(body.blocks):
                chosen = np.flatnonzero(deforming[i] & (of_block[i] == k))
                if len(chosen):
                    owner, own = "" if alone else name, parameters_of(part)
                    solid = Solid(rest, elements[chosen], mesh.blocks[i].kind, part.law, own, owner, damping)
                    solid.numbers = numbers[i][chosen]
                    terms.append(solid)
    return terms


def strain_bound(assembly: Assembly, groups: Groups, mass: FloatArray, stretch: float) -> "StrainBound":
    """Return the bound of the stretch of all springs; `mass`: of nodes [kg], shape (n,)."""
    from tripod_sim.forces.strain_bound import StrainBound  # noqa: PLC0415 - an effect that is absent

    nets = [(b.blocks[0], b.net.rest_length, strained(b.blocks[0], groups)) for b in assembly.bodies if b.net]
    ends = np.concatenate([blocks[moving] for blocks, _, moving in nets])
    return StrainBound(ends, np.concatenate([rest[moving] for _, rest, moving in nets]), stretch, mass)


def spring_sides(assembly: Assembly) -> list[IndexArray]:
    """Return the triangles of nets: a contact joins their corners."""
    return [b.nodes[b.net.triangles] for b in assembly.bodies if b.net and len(b.net.triangles)]


def strained(blocks: IndexArray, groups: Groups) -> "np.ndarray":
    """Return which blocks can deform: not all nodes in one group."""
    kind, number = groups.kinds()
    key = np.where(kind == Kind.FREE, -1 - np.arange(groups.size), 1000 * kind + number)[blocks]
    return ~(key == key[:, :1]).all(axis=1)


def with_held(groups: Groups, assembly: Assembly, *, static: bool) -> tuple[Groups, tuple[str, ...]]:
    """Return the groups with what bodies hold by themselves, and notes on bodies, or parts of them, that nothing holds.

    Nodes of springs may be fixed by number. At rest a further body that nothing holds has no equilibrium, and stays
    where it is.
    """
    from tripod_sim.constraints.held import free_motion  # noqa: PLC0415

    fixed = [b.nodes[b.net.fixed] for b in assembly.bodies if b.net]
    notes = []
    groups = replace(groups, fixed=np.unique(np.concatenate([groups.fixed, *fixed])))
    for k, first in enumerate(assembly.bodies):
        together = [b for b in assembly.bodies if b.tied == k]
        if not (static and k and first.tied == k):
            continue
        nodes = np.unique(np.concatenate([b.nodes for b in together]))
        own = [np.searchsorted(nodes, rows) for b in together for rows in b.blocks]
        rigid = [np.searchsorted(nodes, body) for body in groups.rigid if np.isin(body, nodes).all()]
        if free_motion([*own, *rigid], assembly.nodes[nodes], groups.held()[nodes]):
            groups = replace(groups, fixed=np.union1d(groups.fixed, nodes))
            notes.append(
                f"nothing holds body {first.table.name!r}; a scene without [inertia] leaves it where it is: "
                "add [[fixed]] or [inertia]"
            )
    return groups, (*notes, *_separate_parts(groups, assembly, static=static))


def _separate_parts(groups: Groups, assembly: Assembly, *, static: bool) -> Iterator[str]:
    """Yield notes on bodies with parts that share no node.

    `static`: whether every part has to be held, so that no note is needed on one that is not.
    """
    blocks = [block for body in assembly.bodies for block in body.blocks]
    label = connected_parts([*blocks, *(body[None] for body in groups.rigid)], groups.size)
    held = label[groups.held().any(axis=1)]
    for body in assembly.bodies:
        own = np.unique(label[body.nodes])
        loose = np.setdiff1d(own, held)
        if not static and 0 < len(loose) < len(own):
            some = names_of(np.flatnonzero(label[body.nodes] == loose[0]))
            yield (
                f"body {body.table.name!r} has {len(own)} parts that share no node, and nothing holds the one "
                f"with nodes {some}, which moves by itself: join the parts or hold that one with [[fixed]]"
            )
        elif body.solid and len(own) > 1:
            yield (
                f"body {body.table.name!r} has {len(own)} parts that share no node: if it is one piece, its mesh has a "
                f"gap, beside nodes {names_of(np.flatnonzero(label[body.nodes] == own[-1]))}"
            )


def _material(table: Body) -> Material:
    assert table.material
    return table.material


def _regions(body: SoftBody, assembly: Assembly, sets: NodeSets) -> list[tuple[Region, IndexArray]]:
    """Return the regions of a body of the assembly, each with its elements. Raises SceneError where there are none."""
    found, mesh = list[tuple[Region, IndexArray]](), body.solid
    if not (body.table.region and mesh):
        return found
    loads = [load for load, _ in block_volumes(mesh)]
    shares = [load / load.sum(axis=1, keepdims=True) for load in loads]
    groups = {f"{assembly.before(body)}{name}": cells for name, cells in mesh.cell_groups.items()}
    for i, region in enumerate(body.table.region):
        field = f"{body.field}region.{i}.set"
        elements = sets.elements(region.set, field, body.blocks, shares, groups)
        if not elements.size:
            raise SceneError(
                f"{field} is {region.set!r}: no element of the body is in that set. A place holds the "
                "elements whose centroid is in it, a group of nodes those with all nodes in it: enlarge the "
                "set"
            )
        found.append((region, elements))
    return found
