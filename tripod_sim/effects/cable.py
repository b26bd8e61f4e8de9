"""Effect: cables that are pulled."""

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.errors import SceneError
from tripod_sim.tables.actuators import WORLD, Cable, Via, check_actuators

if TYPE_CHECKING:
    from tripod_sim.forces.cable import Cable as CableTerm
    from tripod_sim.mesh.embedding import Embedding


def check(tables: tuple[Cable, ...], scene: Described) -> None:
    """Raise SceneError if a cable is described wrongly."""
    check_actuators(scene)
    for i, table in enumerate(tables):
        if table.command == "length" and scene.inertia and not scene.inertia.integrator.takes_jumps:
            raise SceneError(
                f"cable.{i}.command is 'length', but inertia.scheme is {scene.inertia.scheme!r}, which gains energy "
                "where a cable goes slack and taut; choose 'tr_bdf2', or command the tension"
            )
        if table.command == "tension" and table.range[0] < 0:
            raise SceneError(
                f"cable.{i}.range begins at {table.range[0]:g} N; a cable cannot push: give a smallest tension of 0 N"
            )
        for k, via in enumerate(table.via):
            if bool(via.points) == bool(via.source):
                raise SceneError(f"cable.{i}.via.{k} needs either points or source; give one of the two")
        if not any((via.points or via.source) and via.body != WORLD for via in table.via):
            raise SceneError(
                f"cable.{i}.via has no point of a body; give one: via = [{{points = [[x, y, z]]}}]"
            )


def hold(tables: tuple[Cable, ...], draft: Draft) -> None:
    """Find the points in the bodies where these are undeformed, before something moves them to their places."""
    from tripod_sim.mesh.embedding import joined

    draft.prepared["cable"] = [
        joined([_points(f"cable.{i}.via.{k}", via, draft) for k, via in enumerate(table.via)])
        for i, table in enumerate(tables)
    ]


def _points(field: str, via: Via, draft: Draft) -> "Embedding":
    """Return the points of one body. Raises SceneError."""
    from tripod_sim.mesh.embedding import in_world
    from tripod_sim.mesh.lines import read_points

    name = f"{field}.{'source' if via.source else 'points'}"
    listed = read_points(Path(via.source), name) if via.source else via.points
    points = np.reshape(listed, (-1, 3)).astype(float)
    if via.body == WORLD:
        return in_world(points)
    body = draft.assembly.body_named(via.body, f"{field}.body", f"points that never move: {WORLD}")
    found: Embedding = body.embedded(points, draft.rest, name)
    return found


def act(tables: tuple[Cable, ...], draft: Draft) -> None:
    """Add the cables, and what warns of their tensions."""
    from tripod_sim.forces.actuator import EffortWatch
    from tripod_sim.forces.cable import Cable as CableTerm

    for i, (table, points) in enumerate(zip(tables, draft.prepared["cable"], strict=True)):
        by_tension, field = table.command == "tension", f"cable.{i}"
        term = CableTerm(points, draft.rest, by_tension=by_tension, stiffness=table.stiffness, owner=field)
        term.rest_length += table.slack
        _check_rigid(field, term, draft)
        draft.add_actuator(term, table.actuator)
        if table.tension_max:
            draft.watches.append(EffortWatch(
                partial(getattr, term, "tension"), -math.inf, table.tension_max,
                f"{field}: the tension of {table.name} is {{:.3g}} N, above tension_max, {table.tension_max:g} N: pull "
                "less, or allow more",
            ))  # fmt: skip


def _check_rigid(field: str, term: "CableTerm", draft: Draft) -> None:
    """Raise SceneError where a cable passes points of two rigid bodies."""
    rigid = [b for b, nodes in enumerate(draft.groups.rigid) if np.isin(term.elements, nodes).any()]
    if len(rigid) > 1:
        raise SceneError(
            f"{field}.via has points in {len(rigid)} rigid bodies (discs, platforms); a cable can pass one: move the "
            "points of the others off their nodes"
        )


EFFECT = Effect(
    Cable,
    rank=65,
    several=True,
    check=check,
    modules=("forces.cable", "forces.cable_kernels"),
    words=(
        'cable=[{name="tendon", via=[{points=[[0.01, 0.0, 0.0], [0.03, 0.0, 0.0]]}], range=[-1.0, 1.0]}]',
    ),
    hold=hold,
    act=act,
)
