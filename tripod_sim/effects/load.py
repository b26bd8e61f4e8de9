"""Effect: dead loads on sets of nodes."""

import numpy as np

from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.errors import SceneError
from tripod_sim.tables.sets import Load


def check(tables: tuple[Load, ...], scene: Described) -> None:
    """Raise SceneError if a load is described wrongly."""
    for i, load in enumerate(tables):
        given = [name for name in ("force", "pressure", "mass") if getattr(load, name) is not None]
        if len(given) != 1:
            raise SceneError(
                f"load.{i} has {' and '.join(given) or 'none'} of force, pressure, mass; give exactly "
                "one of them"
            )
        if load.mass is not None and not (scene.gravity or scene.inertia):
            raise SceneError(
                f"load.{i}.mass needs gravity or inertia: without them a mass has no effect; add [gravity] or "
                "[inertia]"
            )


def weigh(tables: tuple[Load, ...], draft: Draft) -> None:
    """Add dead masses, and find the dead forces; note loads that something fixed bears alone, and dead pressures."""
    from tripod_sim.forces.dead_pressure import pressure_notes
    from tripod_sim.forces.set_loads import set_load

    solids = [body.among(draft.assembly.nodes) for body in draft.assembly.bodies if body.solid]
    draft.dead, free = np.zeros(draft.rest.shape), ~draft.groups.still()
    for i, table in enumerate(tables):
        force, weighing, lumped = set_load(table, f"load.{i}", draft.sets, solids, len(draft.rest))
        draft.dead, draft.load, draft.inert = draft.dead + force, draft.load + weighing, draft.inert + lumped
        acts = (force != 0) | (weighing > 0)[:, None]
        if acts.any() and not (acts & free).any():
            draft.notes.append(
                f"load.{i} acts only on nodes of set {table.set!r} that are fixed or prescribed, so it has no "
                "effect; name another set"
            )
        if table.pressure:
            nodes = draft.sets.nodes(table.set, f"load.{i}.set")
            loaded = [solid.faces_within(nodes) for solid in solids]
            notes, watches = pressure_notes(f"load.{i}", table.set, loaded, draft.rest)
            draft.notes += notes
            draft.watches += watches


def act(tables: tuple[Load, ...], draft: Draft) -> None:
    """Add the forces where there is no weight that has them."""
    if draft.model.gravity is None:
        from tripod_sim.forces.gravity import GravityForce

        draft.terms.append(GravityForce(draft.load, (0.0, 0.0, 0.0), draft.rest, draft.dead))


EFFECT = Effect(
    Load,
    rank=60,
    several=True,
    check=check,
    modules=("forces.dead_pressure",),
    words=('load=[{set="all", force=[0.01, 0.0, 0.0], share="even"}]',),
    weigh=weigh,
    act=act,
)
