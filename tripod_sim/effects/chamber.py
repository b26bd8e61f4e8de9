"""Effect: chambers under a commanded pressure or of a commanded volume."""

import math
from functools import partial

from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.errors import SceneError
from tripod_sim.tables.actuators import VACUUM, Chamber, check_actuators


def check(tables: tuple[Chamber, ...], scene: Described) -> None:
    """Raise SceneError if a chamber is described wrongly."""
    check_actuators(scene)
    for i, table in enumerate(tables):
        if table.command == "pressure" and table.range[0] < VACUUM:
            raise SceneError(
                f"chamber.{i}.range begins at {table.range[0]:g} Pa, but vacuum is {VACUUM:g} Pa above the pressure "
                "outside; give a larger smallest pressure"
            )
        if table.cap and not table.set:
            raise SceneError(f"chamber.{i}.cap closes the openings of a set; name one with chamber.{i}.set")
        if table.set and table.cavity:
            raise SceneError(f"chamber.{i}.set and chamber.{i}.cavity exclude each other; leave one out")


def act(tables: tuple[Chamber, ...], draft: Draft) -> None:
    """Add the pressures. Raises SceneError where a chamber is not closed."""
    from tripod_sim.forces.actuator import EffortWatch
    from tripod_sim.forces.chamber import Chamber as ChamberTerm
    from tripod_sim.mesh.cavity import cavity_faces, faces_of_set

    for i, table in enumerate(tables):
        field = f"chamber.{i}"
        body = draft.assembly.body_named(table.body, f"{field}.body")
        if not body.solid:
            raise SceneError(f"{field}.body is a net of springs; only a solid has a chamber: name a solid")
        mesh = body.among(draft.rest)
        if table.set:
            nodes = draft.sets.nodes(table.set, f"{field}.set")
            surface = faces_of_set(mesh, nodes, f"{field}.set", table.set, cap=table.cap)
        else:
            surface = cavity_faces(mesh, table.cavity, f"{field}.cavity")
        bulk = table.bulk if table.command == "volume" else None
        term = ChamberTerm(surface, draft.rest, table.name, bulk=bulk)
        if bulk and table.range[0] <= -term.undeformed:
            raise SceneError(
                f"{field}.range begins at {table.range[0]:.3g} m³, but the chamber has {term.undeformed:.3g} m³; give "
                "a smallest change of volume that leaves some"
            )
        draft.add_actuator(term, table.actuator)
        if bulk:
            draft.watches.append(EffortWatch(
                partial(getattr, term, "pressure"), VACUUM, math.inf,
                f"{field}: the pressure in {table.name} is {{:.3g}} Pa, below vacuum, {VACUUM:g} Pa, where a liquid "
                "boils: pump less out",
            ))  # fmt: skip


EFFECT = Effect(
    Chamber,
    rank=66,
    several=True,
    check=check,
    modules=("forces.chamber", "forces.chamber_kernels", "mesh.cavity", "mesh.closed_surface"),
    words=('chamber=[{name="air", range=[0.0, 1e4]}]',),
    act=act,
)
